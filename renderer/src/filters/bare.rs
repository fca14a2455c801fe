//! Colours for pixels that found no sample near enough.

use super::interpolate::{Interpolated, Neighbours};
use crate::epi::grid::Grid;
use crate::points::PixelSamples;

/// Colours of bare pixels: that of the nearest pixel that has one and can be reached; where none can be, the mean of the
/// samples in the smallest block of 2, 4, 8 ... pixels squared around each that has any.
///
/// `left` and `queue` are scratch: a bit plane and a list of pixels.
pub(super) fn fill_bare(
    samples: &PixelSamples,
    near: Neighbours<'_>,
    left: &mut [u64],
    queue: &mut Vec<u32>,
    out: &mut Interpolated,
) {
    let grid = samples.grid;
    if samples.has.iter().all(|&w| w == 0) {
        return;
    }
    for (left, (bare, complex)) in left.iter_mut().zip(out.bare.iter().zip(near.complex)) {
        *left = bare & !complex;
    }
    lend(grid, near, left, queue, out);
    for (left, (bare, complex)) in left.iter_mut().zip(out.bare.iter().zip(near.complex)) {
        *left |= bare & complex;
    }
    let levels = grid
        .width
        .max(grid.height)
        .next_power_of_two()
        .trailing_zeros();
    grid.for_each_set(left, |x, y| {
        let mean = (1..=levels).find_map(|level| block_mean(samples, (x, y), level));
        for (plane, value) in out.rgb.iter_mut().zip(mean.unwrap_or_default()) {
            plane[grid.at(x, y)] = value;
        }
    });
}

/// Gives pixels whose bit is in `left` the colour of the nearest pixel whose bit is not, step by step and never across an
/// edge, and clears their bits.
fn lend(
    grid: Grid,
    near: Neighbours<'_>,
    left: &mut [u64],
    queue: &mut Vec<u32>,
    out: &mut Interpolated,
) {
    queue.clear();
    let is_left = |left: &[u64], (x, y): (usize, usize)| {
        let (word, bit) = grid.bit(x, y);
        left[word] >> bit & 1 == 1
    };
    let mut copy = |from: (usize, usize), to: (usize, usize)| {
        for plane in &mut out.rgb {
            plane[grid.at(to.0, to.1)] = plane[grid.at(from.0, from.1)];
        }
    };
    grid.for_each_set(left, |x, y| {
        let lender = joined(grid, near, (x, y)).find(|&there| !is_left(left, there));
        if let Some(there) = lender {
            copy(there, (x, y));
            queue.push((y * grid.width + x) as u32);
        }
    });
    let clear = |left: &mut [u64], x: usize, y: usize| {
        let (word, bit) = grid.bit(x, y);
        left[word] &= !(1 << bit);
    };
    for &pixel in queue.iter() {
        clear(
            left,
            pixel as usize % grid.width,
            pixel as usize / grid.width,
        );
    }
    let mut next = 0;
    while let Some(&pixel) = queue.get(next) {
        next += 1;
        let here = (pixel as usize % grid.width, pixel as usize / grid.width);
        for there in joined(grid, near, here) {
            if is_left(left, there) {
                copy(here, there);
                clear(left, there.0, there.1);
                queue.push((there.1 * grid.width + there.0) as u32);
            }
        }
    }
}

/// The direct neighbours that no edge separates from a pixel.
fn joined(
    grid: Grid,
    near: Neighbours<'_>,
    (x, y): (usize, usize),
) -> impl Iterator<Item = (usize, usize)> {
    let bit = |plane: &[u64], x: usize, y: usize| {
        let (word, bit) = grid.bit(x, y);
        plane[word] >> bit & 1 == 1
    };
    let to = |open: bool, x: usize, y: usize| open.then_some((x, y));
    [
        to(x > 0 && bit(near.right, x - 1, y), x.wrapping_sub(1), y),
        to(y > 0 && bit(near.down, x, y - 1), x, y.wrapping_sub(1)),
        to(x + 1 < grid.width && bit(near.right, x, y), x + 1, y),
        to(y + 1 < grid.height && bit(near.down, x, y), x, y + 1),
    ]
    .into_iter()
    .flatten()
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
