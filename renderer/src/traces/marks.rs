//! What the display does, as traces tell it.

use protocol::messages::{Camera, Digest};
use protocol::trace::Step;

use crate::config::Choices;
use crate::epi::grid::Grid;

/// A display is made, or made anew with its points kept or not, for pictures of this size (width, height; pixels).
pub fn shaped(choices: &Choices, (width, height): (u32, u32), keep_points: bool) -> Step {
    Step::Shaped {
        // Choices are names and finite numbers: there is nothing that JSON cannot hold.
        choices: serde_json::to_string(choices).unwrap_or_default(),
        width,
        height,
        keep_points,
    }
}

/// A display chooses at most `budget` samples to ask for, before the `first` picture or after one.
pub fn planned(budget: usize, first: bool, next: Option<Camera>) -> Step {
    Step::Planned {
        budget: u32::try_from(budget).unwrap_or(u32::MAX),
        first,
        next,
    }
}

/// BLAKE3 of a picture's linear radiance (planes by `grid`): red, green and blue one after another, each row by row,
/// little-endian `f32`.
pub fn picture_digest(grid: Grid, rgb: &[Vec<f32>; 3]) -> Digest {
    let mut hasher = blake3::Hasher::new();
    for plane in rgb {
        for y in 0..grid.height {
            let row = &plane[grid.at(0, y)..grid.at(0, y) + grid.width];
            if cfg!(target_endian = "little") {
                hasher.update(bytemuck::cast_slice(row));
            } else {
                row.iter().for_each(|v| {
                    hasher.update(&v.to_le_bytes());
                });
            }
        }
    }
    hasher.finalize().into()
}
