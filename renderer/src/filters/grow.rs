//! The nearest samples that can be reached from a place step by step, never across an edge: a window of the image, 64
//! columns in a word, in which the set of reached pixels grows.

use super::diffuse::Neighbours;
use crate::epi::grid::Grid;

/// Samples at which growing stops.
const NEAREST: u32 = 4;

/// Most steps that growing takes, pixels.
const RADIUS: usize = 12;

/// Rows of the window that growing sees: the radius on both sides of a block of two.
const ROWS: usize = 2 * RADIUS + 2;

/// Bit of a window's row that the first seed is in; there is room for the radius on both sides.
const SEED: usize = 31;

/// Most samples that growing can find: all pixels of its window.
pub(super) const MOST: usize = ROWS * 64;

/// Bits of a row of a plane, column `x` in bit [`SEED`]; 0 outside the image.
#[inline]
fn window_row(grid: Grid, plane: &[u64], x: usize, y: isize) -> u64 {
    if y < 0 || y >= grid.height as isize {
        return 0;
    }
    let row = &plane[y as usize * grid.words..][..grid.words];
    // The first column of the window, one word further on so that it is never negative.
    let first = x + 64 - SEED;
    let (word, shift) = (first / 64, first % 64);
    let at = |w: usize| {
        w.checked_sub(1)
            .and_then(|w| row.get(w))
            .copied()
            .unwrap_or(0)
    };
    if shift == 0 {
        at(word)
    } else {
        at(word) >> shift | at(word + 1) << (64 - shift)
    }
}

/// Elements of the nearest samples that can be reached from the pixels whose bits are set in the two rows of `seeds`, the
/// first of which is at (x, y): all within the number of steps that makes them [`NEAREST`] or more.
pub(super) fn grow(
    grid: Grid,
    near: Neighbours<'_>,
    (x, y): (usize, usize),
    seeds: [u64; 2],
    found: &mut Vec<u32>,
) {
    found.clear();
    let top = y as isize - RADIUS as isize;
    let [mut right, mut down, mut has] = [[0u64; ROWS]; 3];
    let mut reached = [0u64; ROWS];
    reached[RADIUS] = seeds[0] << SEED;
    reached[RADIUS + 1] = seeds[1] << SEED;
    let (mut first, mut last) = (RADIUS, RADIUS + 1);
    for row in first - 1..=last {
        right[row] = window_row(grid, near.right, x, top + row as isize);
        down[row] = window_row(grid, near.down, x, top + row as isize);
        has[row] = window_row(grid, near.has, x, top + row as isize);
    }
    let count = |reached: &[u64; ROWS], has: &[u64; ROWS], (first, last): (usize, usize)| {
        (first..=last)
            .map(|r| (reached[r] & has[r]).count_ones())
            .sum::<u32>()
    };
    for _ in 0..RADIUS {
        if count(&reached, &has, (first, last)) >= NEAREST {
            break;
        }
        (first, last) = (first.saturating_sub(1), (last + 1).min(ROWS - 1));
        for row in [first.saturating_sub(1), first, last] {
            right[row] = window_row(grid, near.right, x, top + row as isize);
            down[row] = window_row(grid, near.down, x, top + row as isize);
            has[row] = window_row(grid, near.has, x, top + row as isize);
        }
        let before = reached;
        let mut grew = 0;
        for row in first..=last {
            let here = before[row];
            let above = if row > 0 {
                before[row - 1] & down[row - 1]
            } else {
                0
            };
            let below = if row + 1 < ROWS {
                before[row + 1] & down[row]
            } else {
                0
            };
            let sides = (here & right[row]) << 1 | here >> 1 & right[row];
            reached[row] = here | sides | above | below;
            grew |= reached[row] ^ here;
        }
        if grew == 0 {
            break;
        }
    }
    for row in first..=last {
        let mut bits = reached[row] & has[row];
        while bits != 0 {
            let column = x + bits.trailing_zeros() as usize - SEED;
            bits &= bits - 1;
            found.push(grid.at(column, (top + row as isize) as usize) as u32);
        }
    }
}
