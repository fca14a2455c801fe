//! Rejecting points that are seen through gaps in a nearer surface.

use fearless_simd::{Level, dispatch, prelude::*};
use fearless_simd_macros::simd;

use super::PixelSamples;
use crate::epi::grid::Grid;

/// How far behind the mean depth of its 3x3 neighbours a point may lie, as a share of that depth, before it is suspected.
pub const TOLERANCE: f32 = 0.03;

/// Scratch of [`cull`].
#[derive(Clone, Debug)]
pub struct CullScratch {
    /// One over depth, 0 where no point is.
    inverse: Vec<f32>,
    suspects: Vec<u64>,
}

/// A point that [`cull`] asks about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Suspect {
    /// Its slot in the cache.
    pub point: u32,
    /// Where it is in the image, pixels.
    pub image_px: [f32; 2],
    /// Depth along the line of sight, metres.
    pub depth: f32,
}

impl CullScratch {
    /// Room for an image of this layout.
    pub fn new(grid: Grid) -> Self {
        Self {
            inverse: vec![0.0; grid.elements()],
            suspects: vec![0; grid.plane_words()],
        }
    }
}

/// Which points [`cull`] asks about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ask {
    /// Those well behind the mean depth of their neighbours (Render Cache 2002, "Depth cull").
    Behind,
    /// Those, and all that are [doubtful](PixelSamples::doubtful): where points are sparse a hidden one may have no nearer
    /// neighbour to give it away.
    BehindOrDoubtful,
}

/// Calls `keep` for the points that may be hidden and takes away those for which it says no. A point at a silhouette is
/// legitimately behind its neighbours, so `keep` can ask the scene; the Render Cache itself always says no.
pub fn cull(
    level: Level,
    ask: Ask,
    pixels: &mut PixelSamples,
    scratch: &mut CullScratch,
    mut keep: impl FnMut(Suspect) -> bool,
) {
    let grid = pixels.grid;
    dispatch!(level, simd => find_suspects(simd, pixels, scratch));
    for y in 0..grid.height {
        for word in 0..grid.words {
            let i = y * grid.words + word;
            let mut left = scratch.suspects[i];
            if ask == Ask::BehindOrDoubtful {
                left |= pixels.doubtful[i];
            }
            while left != 0 {
                let x = word * 64 + left.trailing_zeros() as usize;
                left &= left - 1;
                let at = grid.at(x, y);
                let suspect = Suspect {
                    point: pixels.point[at],
                    image_px: [x as f32 + pixels.x[at], y as f32 + pixels.y[at]],
                    depth: pixels.depth[at],
                };
                if !keep(suspect) {
                    pixels.remove(x, y);
                }
            }
        }
    }
}

/// Marks points well behind the mean of the up to 8 around them. Inverse depth is linear over a plane in the image, so that
/// a slanted plane is no suspect.
#[simd]
fn find_suspects<S: Simd>(simd: S, pixels: &PixelSamples, scratch: &mut CullScratch) {
    let (grid, lanes) = (pixels.grid, S::f32s::LEN);
    let splat = |v: f32| S::f32s::splat(simd, v);
    let (zero, one) = (splat(0.0), splat(1.0));
    for (inverse, depth) in scratch.inverse.iter_mut().zip(&pixels.depth) {
        *inverse = 1.0 / depth;
    }
    for y in 0..grid.height {
        for word in 0..grid.words {
            let has = pixels.has[y * grid.words + word];
            let mut found = 0;
            for group in (0..64).step_by(lanes) {
                let mine = has >> group & ((1u64 << lanes) - 1);
                if mine == 0 {
                    continue;
                }
                let at = grid.at(word * 64 + group, y);
                let load = |i: usize| S::f32s::from_slice(simd, &scratch.inverse[i..i + lanes]);
                let (mut sum, mut count) = (zero, zero);
                for row in [at - grid.stride, at, at + grid.stride] {
                    for column in [row - 1, row, row + 1] {
                        if column != at {
                            let inverse = load(column);
                            sum += inverse;
                            count += inverse.simd_gt(zero).select(one, zero);
                        }
                    }
                }
                let behind = sum.simd_gt(count * splat(1.0 + TOLERANCE) * load(at));
                found |= (behind.to_bitmask() & mine) << group;
            }
            scratch.suspects[y * grid.words + word] = found;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn only_points_behind_their_neighbours_are_asked_about() {
        let grid = Grid::new(80, 5);
        let mut pixels = PixelSamples::new(grid);
        for y in 0..5 {
            for x in 0..80 {
                let at = grid.at(x, y);
                pixels.depth[at] = 1.0 / (0.5 - 0.004 * x as f32);
                pixels.point[at] = (y * 80 + x) as u32;
                pixels.has[grid.bit(x, y).0] |= 1 << grid.bit(x, y).1;
            }
        }
        let hole = grid.at(70, 2);
        pixels.depth[hole] *= 3.0;
        let mut asked = Vec::new();
        let mut scratch = CullScratch::new(grid);
        cull(Level::new(), Ask::Behind, &mut pixels, &mut scratch, |p| {
            asked.push((p.point, p.image_px, p.depth));
            false
        });
        assert_eq!(asked, [(2 * 80 + 70, [70.5, 2.5], pixels.depth[hole])]);
        assert!(!pixels.has_sample(70, 2) && pixels.has_sample(69, 2));
    }
}
