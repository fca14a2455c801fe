//! Reconstruction block by block: sixteen pixels share the samples around them that no edge separates from them.
//!
//! A block of 4x4 pixels sees a window of 8x8. Where no edge crosses it, all of its samples serve all of the block's pixels.
//! Elsewhere the window falls into parts that edges separate, and each part's samples serve the block's pixels in it. A
//! part with too few samples grows beyond the window ([`super::grow`]).

use fearless_simd::{f32x4, mask32x4, prelude::*};
use fearless_simd_macros::simd;

use super::fit::{self, BLOCK, Fitted, MIDDLES, PIXELS, Places, Wanted, Weights};
use super::grow::grow;
use super::interpolate::{Inputs, Method, Rows};
use super::lattice::Lattice;
use super::moments::{SOFTENING, SOFTENING_SHARE};
use super::records::{MOST, Records, Starts};
use super::window::{BLOCKS, MARGIN, SIDE, Strip, flood, row_counts};
use crate::epi::grid::Grid;

/// The block's own pixels in its window.
const OWN: u64 = 0x0000_3c3c_3c3c_0000;

/// The block and one pixel around it: all of the window but its border.
const CLOSE: u64 = 0x007e_7e7e_7e7e_7e00;

/// The columns of a window that the next block's window does not show.
const PASSED: u64 = 0x0f0f_0f0f_0f0f_0f0f;

/// Samples so close at which the rest of the window is not read.
const ENOUGH: u32 = 8;

/// Samples in the window below which a part grows.
const FEWEST: u32 = 5;

/// What one thread works with, kept from frame to frame.
#[derive(Clone, Debug)]
pub(super) struct Worker {
    records: Records,
    /// Places among the records of the samples that serve a part; only the first `len` count.
    chosen: [u32; MOST],
    len: usize,
    found: Vec<(u16, u16)>,
    centres: Centres,
    lattice: Lattice,
    /// Those of the block with edges that is in work.
    places: Places,
    weights: Box<Weights>,
    fitted: Fitted,
}

/// Where in their pixels the colours of a word's blocks are wanted, x and y, row by row. Copied, since blocks would miss
/// the nearest memory again and again.
#[derive(Clone, Debug)]
struct Centres([[[f32; 64]; BLOCK]; 2]);

impl Centres {
    /// Copies those of the blocks whose first row is `y`.
    #[inline(always)]
    fn load(&mut self, inputs: &Inputs<'_>, word: usize, y: usize) {
        let grid = inputs.samples.grid;
        let height = BLOCK.min(grid.height - y);
        let planes = [inputs.centre_x, inputs.centre_y];
        for (rows, plane) in self.0.iter_mut().zip(planes) {
            for (k, row) in rows[..height].iter_mut().enumerate() {
                let first = grid.at(word * 64, y + k);
                row.copy_from_slice(&plane[first..first + 64]);
            }
        }
    }

    /// Those of the block whose first column is `x`.
    #[inline(always)]
    fn find<S: Simd>(&self, simd: S, x: usize, places: &mut Places) {
        let column = x % 64;
        for (rows, places) in self.0.iter().zip(places) {
            for (row, to) in rows.iter().zip(places.chunks_exact_mut(BLOCK)) {
                f32x4::from_slice(simd, &row[column..column + BLOCK]).store_slice(to);
            }
        }
    }
}

/// Some of a block's pixels and what serves them, as bits of its window.
#[derive(Clone, Copy)]
struct Part {
    /// The block's first pixel.
    corner: (usize, usize),
    /// Pixels of the block.
    pixels: u64,
    /// What they reach.
    reached: u64,
    /// All samples, reached or not.
    samples: u64,
    /// Might reach more outside the window.
    grows: bool,
    /// Some pixels' colours are wanted elsewhere than in the middle.
    edged: bool,
}

impl Worker {
    /// Room for images of this layout.
    pub(super) fn new(grid: Grid) -> Self {
        Self {
            records: Records::new(grid),
            chosen: [0; MOST],
            len: 0,
            found: Vec::with_capacity(MOST),
            lattice: Lattice::default(),
            centres: Centres([[[0.5; 64]; BLOCK]; 2]),
            places: MIDDLES,
            weights: Box::new([[0.0; PIXELS]; MOST]),
            fitted: Fitted {
                rgb: [[0.0; PIXELS]; 3],
                weight: [0.0; PIXELS],
            },
        }
    }

    /// Chooses samples of the window: their places among the records, of which `starts` says where each row's begin.
    #[inline(always)]
    fn choose(&mut self, starts: &Starts, samples: u64, chosen: u64) {
        self.len = 0;
        let mut left = chosen;
        while left != 0 {
            let bit = left.trailing_zeros() as usize;
            left &= left - 1;
            let row = bit / SIDE;
            let before = samples & ((1 << bit) - 1) & (0xff << (SIDE * row));
            self.chosen[self.len] = starts[row] + before.count_ones();
            self.len += 1;
        }
    }

    /// Chooses all samples of the window, or those that lie [`CLOSE`].
    #[inline(always)]
    fn choose_all(&mut self, starts: &Starts, samples: u64, close: bool) {
        self.len = 0;
        let (seen, rows) = if close {
            (CLOSE, 1..SIDE - 1)
        } else {
            (!0, 0..SIDE)
        };
        let counts = row_counts(samples & seen);
        for row in rows {
            // The sample in the first column is not close.
            let skipped = samples >> (SIDE * row) & u64::from(close);
            let first = starts[row].wrapping_add(skipped as u32);
            for (k, to) in (0..).zip(&mut self.chosen[self.len..self.len + SIDE]) {
                *to = first.wrapping_add(k);
            }
            self.len += usize::from(counts[row]);
        }
    }

    /// Chooses the nearest samples that a part can reach at all; says in how many pixels they were found.
    #[inline(always)]
    fn look_further(&mut self, inputs: &Inputs<'_>, part: &Part) -> u32 {
        let grid = inputs.samples.grid;
        let area = grow(
            grid,
            inputs.near,
            part.corner,
            part.reached,
            &mut self.found,
        );
        let first = self.records.replace_extra(inputs, &self.found);
        self.len = self.found.len().min(MOST);
        for (to, from) in self.chosen[..self.len].iter_mut().zip(first..) {
            *to = from;
        }
        area
    }
}

/// Reconstructs these rows of the image, the first of which begins a block. Marks the pixels that reach no sample.
#[simd]
pub(super) fn reconstruct<S: Simd>(
    simd: S,
    inputs: &Inputs<'_>,
    worker: &mut Worker,
    rows: &mut Rows<'_>,
) {
    let words = inputs.samples.grid.words;
    rows.bare.fill(0);
    worker.records.restart(rows.top);
    let bottom = rows.top + rows.bare.len() / words;
    for y in (rows.top..bottom).step_by(BLOCK) {
        worker.records.advance(inputs, y);
        for word in 0..words {
            reconstruct_word(simd, inputs, worker, (word, y), rows);
        }
    }
}

/// Reconstructs the blocks of a word.
#[inline(always)]
fn reconstruct_word<S: Simd>(
    simd: S,
    inputs: &Inputs<'_>,
    worker: &mut Worker,
    (word, y): (usize, usize),
    rows: &mut Rows<'_>,
) {
    let (grid, near) = (inputs.samples.grid, inputs.near);
    let strip = |plane: &[u64]| Strip::new(grid, word, y, |i| plane[i]);
    let has = strip(near.has);
    let edged = Strip::new(grid, word, y, |i| near.simple[i] | near.complex[i]).any();
    let mut starts = worker.records.starts(word, y, &has);
    let samples = has.windows();
    let [mut complex, mut right, mut down] = [[0; BLOCKS]; 3];
    if edged != 0 {
        worker.centres.load(inputs, word, y);
        complex = strip(near.complex).windows();
        right = strip(near.right).windows();
        down = strip(near.down).windows();
    }
    let blocks = (grid.width - word * 64).div_ceil(BLOCK).min(BLOCKS);
    let done = worker
        .lattice
        .reconstruct(simd, inputs, (word, y), edged != 0, rows);
    for block in 0..blocks {
        let mut part = Part {
            corner: (word * 64 + block * BLOCK, y),
            pixels: OWN,
            reached: !0,
            samples: samples[block],
            grows: true,
            edged: edged >> block & 1 == 1,
        };
        if done >> block & 1 == 1 {
            // All samples are beside the pixels.
        } else if part.edged {
            let x = part.corner.0;
            worker.centres.find(simd, x, &mut worker.places);
            let mut left = OWN & inside(grid, part.corner);
            // Complex pixels may use every sample around them (paper section 5.4).
            let complex = left & complex[block];
            if complex != 0 {
                (part.pixels, part.grows) = (complex, false);
                serve(simd, inputs, worker, &starts, &part, rows);
                left &= !complex;
            }
            while left != 0 {
                let seed = left & left.wrapping_neg();
                part.reached = flood(seed, right[block], down[block]);
                part.pixels = left & part.reached;
                part.grows = part.reached & !CLOSE != 0;
                serve(simd, inputs, worker, &starts, &part, rows);
                left &= !part.reached;
            }
        } else {
            serve(simd, inputs, worker, &starts, &part, rows);
        }
        let passed = row_counts(samples[block] & PASSED);
        for (start, passed) in starts.iter_mut().zip(passed) {
            *start = start.wrapping_add(u32::from(passed));
        }
    }
}

/// The pixels of a block's window that lie in the image or before it.
#[inline(always)]
fn inside(grid: Grid, (x, y): (usize, usize)) -> u64 {
    let columns = (1u64 << (grid.width - x + MARGIN).min(SIDE)) - 1;
    let rows = !0 >> (64 - SIDE * (grid.height - y + MARGIN).min(SIDE));
    (columns * 0x0101_0101_0101_0101) & rows
}

/// Reconstructs a part of a block.
#[simd]
fn serve<S: Simd>(
    simd: S,
    inputs: &Inputs<'_>,
    worker: &mut Worker,
    starts: &Starts,
    part: &Part,
    rows: &mut Rows<'_>,
) {
    let reached = part.samples & part.reached;
    let close = (reached & CLOSE).count_ones() >= ENOUGH;
    let seen = if close { CLOSE } else { !0 };
    let mut area = (part.reached & seen).count_ones();
    if part.grows && reached.count_ones() < FEWEST {
        area = worker.look_further(inputs, part);
    } else if part.reached == !0 {
        worker.choose_all(starts, part.samples, close);
    } else {
        worker.choose(starts, part.samples, reached & seen);
    }
    if worker.len == 0 {
        leave_bare(inputs.samples.grid, part, rows);
        return;
    }
    let (x, y) = part.corner;
    let places = if part.edged { &worker.places } else { &MIDDLES };
    let corner = [x as f32, y as f32];
    let wanted = Wanted { corner, places };
    let from = (worker.records.list(), &worker.chosen[..worker.len]);
    let fitted = &mut worker.fitted;
    if inputs.method == Method::FixedWeights && worker.len >= ENOUGH as usize {
        fit::mean(simd, from, &wanted, fitted);
    } else {
        let share = area as f32 / worker.len as f32;
        let softening = (SOFTENING_SHARE * share).max(SOFTENING);
        fit::fit(simd, from, &wanted, softening, &mut worker.weights, fitted);
    }
    write(simd, inputs.samples.grid, part, fitted, rows);
}

/// Puts a part's colours into the image.
#[inline(always)]
fn write<S: Simd>(simd: S, grid: Grid, part: &Part, fitted: &Fitted, rows: &mut Rows<'_>) {
    let (x, y) = part.corner;
    let first = (y - rows.top) * grid.stride + x;
    let [red, green, blue] = &mut rows.rgb;
    let mut planes = [&mut **red, &mut **green, &mut **blue, &mut *rows.weight];
    let [red, green, blue] = &fitted.rgb;
    let values = [red, green, blue, &fitted.weight];
    if part.pixels == OWN && y + BLOCK <= grid.height {
        for row in 0..BLOCK {
            let (to, from) = (first + row * grid.stride, row * BLOCK);
            for (plane, values) in planes.iter_mut().zip(values) {
                let row = f32x4::from_slice(simd, &values[from..from + BLOCK]);
                row.store_slice(&mut plane[to..to + BLOCK]);
            }
        }
        return;
    }
    for row in 0..BLOCK.min(grid.height - y) {
        let (to, from) = (first + row * grid.stride, row * BLOCK);
        let pixels = part.pixels >> (SIDE * (row + MARGIN) + MARGIN) & ((1 << BLOCK) - 1);
        let chosen = mask32x4::from_bitmask(simd, pixels);
        for (plane, values) in planes.iter_mut().zip(values) {
            let place = &mut plane[to..to + BLOCK];
            let new = f32x4::from_slice(simd, &values[from..from + BLOCK]);
            let old = f32x4::from_slice(simd, place);
            chosen.select(new, old).store_slice(place);
        }
    }
}

/// Black, for pixels that reach no sample.
fn leave_bare(grid: Grid, part: &Part, rows: &mut Rows<'_>) {
    let (x, y) = (part.corner.0, part.corner.1 - rows.top);
    for_each_pixel(part.pixels & inside(grid, part.corner), |row, column| {
        let to = (y + row) * grid.stride + x + column;
        for plane in &mut rows.rgb {
            plane[to] = 0.0;
        }
        rows.weight[to] = 0.0;
        let (word, bit) = grid.bit(x + column, y + row);
        rows.bare[word] |= 1 << bit;
    });
}

/// Visits a block's pixels whose bits are set in its window: rows and columns of the block.
#[inline(always)]
fn for_each_pixel(pixels: u64, mut visit: impl FnMut(usize, usize)) {
    let mut left = pixels;
    while left != 0 {
        let bit = left.trailing_zeros() as usize;
        left &= left - 1;
        visit(bit / SIDE - MARGIN, bit % SIDE - MARGIN);
    }
}
