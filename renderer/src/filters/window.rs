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

    /// The 8x8 pixels of the blocks' windows, each row by row.
    #[inline(always)]
    pub(super) fn windows(&self) -> [u64; BLOCKS] {
        // A byte is a row of every second window.
        let even = transpose(self.low);
        let odd = transpose(std::array::from_fn(|row| {
            self.low[row] >> BLOCK | self.high[row] << (64 - BLOCK)
        }));
        std::array::from_fn(|block| {
            let windows = if block % 2 == 0 { &even } else { &odd };
            windows[block / 2]
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

/// Byte `r` of word `k` becomes byte `k` of word `r`.
#[inline(always)]
fn transpose(mut words: [u64; 8]) -> [u64; 8] {
    let swaps = [
        (4, 0x0000_0000_ffff_ffff),
        (2, 0x0000_ffff_0000_ffff),
        (1, 0x00ff_00ff_00ff_00ff),
    ];
    for (apart, low) in swaps {
        for i in (0..8).filter(|i| i & apart == 0) {
            let other = (words[i] >> (8 * apart) ^ words[i + apart]) & low;
            words[i + apart] ^= other;
            words[i] ^= other << (8 * apart);
        }
    }
    words
}

/// Bits set in each row of a window.
#[inline(always)]
pub(super) fn row_counts(window: u64) -> [u8; SIDE] {
    let pairs = window - (window >> 1 & 0x5555_5555_5555_5555);
    let fours = (pairs & 0x3333_3333_3333_3333) + (pairs >> 2 & 0x3333_3333_3333_3333);
    ((fours + (fours >> 4)) & 0x0f0f_0f0f_0f0f_0f0f).to_le_bytes()
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
