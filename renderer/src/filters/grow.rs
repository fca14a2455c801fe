//! The nearest samples that can be reached from a block step by step, never across an edge: a part of the image, 64 columns
//! in a word, in which the set of reached pixels grows.

use super::interpolate::Neighbours;
use super::window::{MARGIN, SIDE};
use crate::epi::grid::Grid;

/// Samples at which growing stops.
const NEAREST: u32 = 6;

/// Most steps that growing takes beyond the block's window, pixels.
const RADIUS: usize = 12;

/// Rows that growing sees: the radius on both sides of a window, and one more to look at.
const ROWS: usize = 2 * RADIUS + SIDE + 2;

/// Row that the window begins in.
const TOP: usize = RADIUS + 1;

/// Bit of a row that the window's first column is in; there is room for the radius on both sides.
const LEFT: usize = 28;

/// Columns of a plane as rows of 64 bits.
#[derive(Clone, Copy)]
struct Columns {
    grid: Grid,
    /// Word that bit 0 is in, one too many so that it is never negative.
    word: usize,
    shift: usize,
}

impl Columns {
    /// Column `x` in bit [`LEFT`] + [`MARGIN`].
    #[inline(always)]
    fn around(grid: Grid, x: usize) -> Self {
        let first = x + 64 - LEFT - MARGIN;
        Self {
            grid,
            word: first / 64,
            shift: first % 64,
        }
    }

    /// Bits of a row of a plane; 0 outside the image.
    #[inline(always)]
    fn row(&self, plane: &[u64], y: isize) -> u64 {
        if y < 0 || y >= self.grid.height as isize {
            return 0;
        }
        let row = &plane[y as usize * self.grid.words..][..self.grid.words];
        let at = |w: usize| row.get(w.wrapping_sub(1)).copied().unwrap_or(0);
        at(self.word) >> self.shift | (at(self.word + 1) << 1) << (63 - self.shift)
    }
}

/// Finds the nearest samples that can be reached from the pixels `reached` of the window of the block at `corner`: all
/// within the number of steps that makes them [`NEAREST`] or more, up to the list's capacity. Says how many pixels were
/// looked at.
#[inline(always)]
pub(super) fn grow(
    grid: Grid,
    near: Neighbours<'_>,
    (x, y): (usize, usize),
    window: u64,
    found: &mut Vec<(u16, u16)>,
) -> u32 {
    found.clear();
    let columns = Columns::around(grid, x);
    let top = y as isize - (MARGIN + TOP) as isize;
    let [mut right, mut down, mut has, mut reached] = [[0u64; ROWS]; 4];
    let (mut first, mut last) = (TOP, TOP + SIDE - 1);
    for row in first - 1..=last {
        right[row] = columns.row(near.right, top + row as isize);
        down[row] = columns.row(near.down, top + row as isize);
        has[row] = columns.row(near.has, top + row as isize);
        if row >= first {
            reached[row] = (window >> (SIDE * (row - first)) & 0xff) << LEFT;
        }
    }
    for _ in 0..RADIUS {
        (first, last) = (first - 1, last + 1);
        for row in [first - 1, last] {
            right[row] = columns.row(near.right, top + row as isize);
            down[row] = columns.row(near.down, top + row as isize);
            has[row] = columns.row(near.has, top + row as isize);
        }
        let (mut above, mut grew, mut count) = (0, 0, 0);
        for row in first..=last {
            let here = reached[row];
            let sides = (here & right[row]) << 1 | here >> 1 & right[row];
            let next = here | sides | above | reached[row + 1] & down[row];
            above = here & down[row];
            reached[row] = next;
            grew |= next ^ here;
            count += (next & has[row]).count_ones();
        }
        if count >= NEAREST || grew == 0 {
            break;
        }
    }
    let mut area = 0;
    for row in first..=last {
        area += reached[row].count_ones();
        let mut bits = reached[row] & has[row];
        while bits != 0 {
            let column = x + bits.trailing_zeros() as usize - LEFT - MARGIN;
            bits &= bits - 1;
            if found.len() == found.capacity() {
                break;
            }
            found.push((column as u16, (top + row as isize) as u16));
        }
    }
    area
}
