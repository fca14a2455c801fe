//! Bits of the image around a block of 4x4 pixels, and what can be reached in them.

use super::fit::BLOCK;
use crate::epi::grid::Grid;

/// Pixels on every side of a block that its window shows.
pub(super) const MARGIN: usize = 2;

/// Columns and rows of a window.
pub(super) const SIDE: usize = BLOCK + 2 * MARGIN;

/// Blocks in a word.
pub(super) const BLOCKS: usize = 64 / BLOCK;

/// All columns of a window but the last.
const NOT_LAST: u64 = 0x7f7f_7f7f_7f7f_7f7f;

/// Bits of one plane around the sixteen blocks of a word: rows from two above the blocks on, from two columns left of the
/// word on; 0 outside the image.
pub(super) struct Strip {
    low: [u64; SIDE],
    high: [u64; SIDE],
}

impl Strip {
    /// Nothing set.
    pub(super) const EMPTY: Self = Self {
        low: [0; SIDE],
        high: [0; SIDE],
    };

    /// The strip around blocks whose first row is `y`; `at` gives a word of the plane.
    #[inline(always)]
    pub(super) fn new(grid: Grid, word: usize, y: usize, at: impl Fn(usize) -> u64) -> Self {
        let mut strip = Self::EMPTY;
        for (k, (low, high)) in strip.low.iter_mut().zip(&mut strip.high).enumerate() {
            let Some(row) = (y + k).checked_sub(MARGIN).filter(|&r| r < grid.height) else {
                continue;
            };
            let i = row * grid.words + word;
            let before = if word > 0 { at(i - 1) } else { 0 };
            let after = if word + 1 < grid.words { at(i + 1) } else { 0 };
            *low = at(i) << MARGIN | before >> (64 - MARGIN);
            *high = at(i) >> (64 - MARGIN) | after << MARGIN;
        }
        strip
    }

    /// The eight pixels of a row that a block's window shows.
    #[inline(always)]
    pub(super) fn row(&self, row: usize, block: usize) -> u64 {
        part(self.low[row], self.high[row], block)
    }

    /// The 8x8 pixels of a block's window, row by row.
    #[inline(always)]
    pub(super) fn window(&self, block: usize) -> u64 {
        (0..SIDE).fold(0, |window, row| {
            window | self.row(row, block) << (SIDE * row)
        })
    }

    /// Whether any bit of each block's window is set, a bit a block.
    #[inline(always)]
    pub(super) fn any(&self) -> u32 {
        let low = self.low.iter().fold(0, |any, &row| any | row);
        let high = self.high.iter().fold(0, |any, &row| any | row);
        (0..BLOCKS).fold(0, |any, block| {
            any | u32::from(part(low, high, block) != 0) << block
        })
    }
}

/// The bits of a row that a block's window shows.
#[inline(always)]
fn part(low: u64, high: u64, block: usize) -> u64 {
    let shift = BLOCK * block;
    (low >> shift | (high << 1) << (63 - shift)) & 0xff
}

/// What can be reached in a window from the pixels of `seed`, step by step to the right and left and down and up, where
/// pixels are joined to the one at their right and below.
#[inline(always)]
pub(super) fn flood(seed: u64, right: u64, down: u64) -> u64 {
    let right = right & NOT_LAST;
    let mut reached = seed;
    loop {
        let sides = (reached & right) << 1 | reached >> 1 & right;
        let next = reached | sides | (reached & down) << SIDE | reached >> SIDE & down;
        if next == reached {
            return reached;
        }
        reached = next;
    }
}
