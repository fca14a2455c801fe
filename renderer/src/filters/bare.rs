//! Colours for pixels that reach no sample at all.

use super::interpolate::Interpolated;
use crate::points::PixelSamples;

/// Colours of bare pixels: the mean of the samples in the smallest block of 2, 4, 8 ... pixels squared around each that
/// has any.
pub(super) fn fill_bare(samples: &PixelSamples, out: &mut Interpolated) {
    let grid = samples.grid;
    if samples.has.iter().all(|&w| w == 0) {
        return;
    }
    let levels = grid
        .width
        .max(grid.height)
        .next_power_of_two()
        .trailing_zeros();
    for y in 0..grid.height {
        for word in 0..grid.words {
            let mut left = out.bare[y * grid.words + word];
            while left != 0 {
                let x = word * 64 + left.trailing_zeros() as usize;
                left &= left - 1;
                let mean = (1..=levels).find_map(|level| block_mean(samples, (x, y), level));
                for (plane, value) in out.rgb.iter_mut().zip(mean.unwrap_or_default()) {
                    plane[grid.at(x, y)] = value;
                }
            }
        }
    }
}

/// Mean of the samples in the aligned block of 2^level pixels squared around a pixel, if there are any.
fn block_mean(samples: &PixelSamples, (x, y): (usize, usize), level: u32) -> Option<[f32; 3]> {
    let grid = samples.grid;
    let side = 1usize << level;
    let (x0, y0) = (x & !(side - 1), y & !(side - 1));
    let (mut sum, mut count) = ([0.0; 3], 0.0);
    for row in y0..(y0 + side).min(grid.height) {
        for word in x0 / 64..(x0 + side).div_ceil(64).min(grid.words) {
            let mut bits = samples.has[row * grid.words + word];
            if side < 64 {
                bits &= ((1u64 << side) - 1) << (x0 % 64);
            }
            while bits != 0 {
                let at = grid.at(word * 64 + bits.trailing_zeros() as usize, row);
                bits &= bits - 1;
                for (sum, plane) in sum.iter_mut().zip(&samples.rgb) {
                    *sum += plane[at];
                }
                count += 1.0;
            }
        }
    }
    (count > 0.0).then(|| sum.map(|s: f32| s / count))
}
