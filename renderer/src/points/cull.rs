//! Rejecting points that are seen through gaps in a nearer surface.

use super::PixelSamples;

/// How far behind the mean depth of its 3x3 neighbours a point may lie, as a share of that depth, before it is suspected.
pub const TOLERANCE: f32 = 0.03;

/// Calls `keep` for the point of every pixel that lies well behind its neighbours' mean depth (Render Cache 2002, "Depth
/// cull") and takes away those for which it says no; gives how many were taken. A point at a silhouette is legitimately
/// behind its neighbours, so `keep` can ask the scene; the Render Cache itself always says no.
pub fn cull(
    pixels: &mut PixelSamples,
    suspects: &mut Vec<(u16, u16)>,
    mut keep: impl FnMut(u32) -> bool,
) -> usize {
    let grid = pixels.grid;
    suspects.clear();
    for y in 0..grid.height {
        for word in 0..grid.words {
            let mut left = pixels.has[y * grid.words + word];
            while left != 0 {
                let x = word * 64 + left.trailing_zeros() as usize;
                left &= left - 1;
                if is_behind(pixels, x, y) {
                    suspects.push((x as u16, y as u16));
                }
            }
        }
    }
    let mut removed = 0;
    for &(x, y) in suspects.iter() {
        let (x, y) = (usize::from(x), usize::from(y));
        if !keep(pixels.point[grid.at(x, y)]) {
            pixels.remove(x, y);
            removed += 1;
        }
    }
    removed
}

fn is_behind(pixels: &PixelSamples, x: usize, y: usize) -> bool {
    let grid = pixels.grid;
    let here = pixels.depth[grid.at(x, y)];
    // Inverse depth is linear over a plane in the image, so that a slanted plane is no suspect.
    let (mut sum, mut count) = (0.0f32, 0.0f32);
    for ny in y.saturating_sub(1)..(y + 2).min(grid.height) {
        for nx in x.saturating_sub(1)..(x + 2).min(grid.width) {
            let depth = pixels.depth[grid.at(nx, ny)];
            if depth.is_finite() && (nx, ny) != (x, y) {
                sum += 1.0 / depth;
                count += 1.0;
            }
        }
    }
    here * sum > count * (1.0 + TOLERANCE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::epi::grid::Grid;

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
        let removed = cull(&mut pixels, &mut Vec::new(), |p| {
            asked.push(p);
            false
        });
        assert_eq!((removed, asked), (1, vec![2 * 80 + 70]));
        assert!(!pixels.has_sample(70, 2) && pixels.has_sample(69, 2));
    }
}
