//! The samples of the rows around a strip of blocks, packed row by row, so that a block reads few cache lines.

use super::fit::Record;
use super::interpolate::Inputs;
use super::window::{MARGIN, SIDE, Strip};
use crate::epi::grid::Grid;

/// Most samples that a block is reconstructed from.
pub(super) const MOST: usize = 128;

/// Where the samples of each row of a block's window begin among the records.
pub(super) type Starts = [u32; SIDE];

/// Records of the rows that a strip of blocks sees, then room for those of one block that looks further.
#[derive(Clone, Debug)]
pub(super) struct Records {
    list: Vec<Record>,
    /// Where each word's samples begin, by row modulo [`SIDE`].
    starts: Vec<Starts>,
    /// The first row that is not in yet.
    next: usize,
}

impl Records {
    /// Room for the rows of images of this layout.
    pub(super) fn new(grid: Grid) -> Self {
        Self {
            list: vec![Record::default(); SIDE * grid.stride + MOST],
            starts: vec![[0; SIDE]; grid.words],
            next: 0,
        }
    }

    /// Forgets all rows: the first strip of blocks will be the one from row `y` on.
    pub(super) fn restart(&mut self, y: usize) {
        self.next = y.saturating_sub(MARGIN);
    }

    /// Packs the rows that the strip of blocks from row `y` on sees and that are not in yet.
    #[inline(always)]
    pub(super) fn advance(&mut self, inputs: &Inputs<'_>, y: usize) {
        let end = (y + SIDE - MARGIN).min(inputs.samples.grid.height);
        while self.next < end {
            self.pack(inputs, self.next);
            self.next += 1;
        }
    }

    #[inline(always)]
    fn pack(&mut self, inputs: &Inputs<'_>, y: usize) {
        let (samples, grid) = (inputs.samples, inputs.samples.grid);
        let row = grid.at(0, y)..grid.at(0, y) + grid.stride;
        let [xs, ys, counts] =
            [&samples.x, &samples.y, &samples.count].map(|plane| &plane[row.clone()]);
        let rgb = samples.rgb.each_ref().map(|plane| &plane[row.clone()]);
        let slot = y % SIDE;
        let mut to = slot * grid.stride;
        for word in 0..grid.words {
            self.starts[word][slot] = to as u32;
            let mut bits = inputs.near.has[y * grid.words + word];
            while bits != 0 {
                let x = word * 64 + bits.trailing_zeros() as usize;
                bits &= bits - 1;
                let rgb = rgb.map(|plane| plane[x]);
                self.list[to] = record((x, y), [xs[x], ys[x]], counts[x], rgb);
                to += 1;
            }
        }
    }

    /// Where the samples of the window of a word's first block begin; blocks' first row is `y`.
    #[inline(always)]
    pub(super) fn starts(&self, word: usize, y: usize, has: &Strip) -> Starts {
        std::array::from_fn(|row| {
            let before = has.row(row, 0) & ((1 << MARGIN) - 1);
            let slot = (y + SIDE - MARGIN + row) % SIDE;
            self.starts[word][slot].wrapping_sub(before.count_ones())
        })
    }

    /// All records.
    #[inline(always)]
    pub(super) fn list(&self) -> &[Record] {
        &self.list
    }

    /// Replaces the records of the block that looked further last, at most [`MOST`]; says where they begin.
    #[inline(always)]
    pub(super) fn replace_extra(&mut self, inputs: &Inputs<'_>, pixels: &[(u16, u16)]) -> u32 {
        let first = self.list.len() - MOST;
        let samples = inputs.samples;
        for (to, &(x, y)) in self.list[first..].iter_mut().zip(pixels) {
            let pixel = (usize::from(x), usize::from(y));
            let at = samples.grid.at(pixel.0, pixel.1);
            let rgb = samples.rgb.each_ref().map(|plane| plane[at]);
            let place = [samples.x[at], samples.y[at]];
            *to = record(pixel, place, samples.count[at], rgb);
        }
        first as u32
    }
}

/// A pixel's sample; `place` is in the pixel.
#[inline(always)]
fn record((x, y): (usize, usize), [px, py]: [f32; 2], count: f32, rgb: [f32; 3]) -> Record {
    Record::new([x as f32 + px, y as f32 + py], count, rgb)
}
