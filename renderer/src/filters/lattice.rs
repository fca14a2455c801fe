//! Reconstruction from a pixel's own sample and those of the eight pixels around it: where there are enough, a block of
//! pixels does without farther ones, and sixteen pixels of a row are reconstructed together.

use fearless_simd::prelude::*;

use super::fit::BLOCK;
use super::interpolate::{Inputs, Method, Neighbours, Rows};
use super::moments::{
    MOST_COUNTED, Moments, ONE, SOFTENING, SOFTENING_SHARE, Weighing, sharp_weight,
};
use super::taps::{INNER, OFFSETS, shifted};
use super::window::BLOCKS;
use crate::epi::grid::Grid;

/// Blocks side by side whose pixels are reconstructed together.
const TOGETHER: usize = 4;

/// Of those, how many must have enough samples to make it worth while.
const WORTH: u32 = 2;

/// What a row of 64 pixels reaches.
#[derive(Clone, Copy, Debug, Default)]
struct Reach {
    /// Samples, by [`OFFSETS`].
    samples: [u64; INNER],
    /// Their number, bit by bit.
    count: [u64; 4],
    /// The number of pixels reached, bit by bit.
    area: [u64; 4],
}

/// What the rows of a word's blocks reach.
#[derive(Clone, Debug, Default)]
pub(super) struct Lattice {
    rows: [Reach; BLOCK],
}

impl Lattice {
    /// Reconstructs blocks of a word whose first row is `y`, where `edged` says that there may be edges; a bit a block says
    /// which. More pixels may be written, but none that lies outside of the word.
    #[inline(always)]
    pub(super) fn reconstruct<S: Simd>(
        &mut self,
        simd: S,
        inputs: &Inputs<'_>,
        (word, y): (usize, usize),
        edged: bool,
        out: &mut Rows<'_>,
    ) -> u32 {
        let grid = inputs.samples.grid;
        let height = BLOCK.min(grid.height - y);
        let mut enough = !0;
        for (k, row) in self.rows[..height].iter_mut().enumerate() {
            *row = Reach::new(grid, inputs.near, (word, y + k), edged);
            // Three samples or more within the reach of each pixel.
            enough &= row.count[2] | row.count[3] | row.count[0] & row.count[1];
            enough |= !grid.valid(word);
        }
        // The first of a block's bits tells whether all are set.
        let pairs = enough & enough >> 1;
        let first = pairs & pairs >> 2;
        let blocks = (grid.width - word * 64).div_ceil(BLOCK).min(BLOCKS);
        let done = (0..blocks).fold(0, |done, block| {
            done | ((first >> (BLOCK * block) & 1) as u32) << block
        });
        let mut worth = 0;
        for first in (0..BLOCKS).step_by(TOGETHER) {
            let mask = ((1 << TOGETHER) - 1) << first;
            if (done & mask).count_ones() >= WORTH {
                worth |= mask;
            }
        }
        if worth == 0 {
            return 0;
        }
        let lanes = S::f32s::LEN;
        for (k, row) in self.rows[..height].iter().enumerate() {
            for column in (0..64).step_by(lanes) {
                if worth >> (column / BLOCK) & 1 == 0 {
                    continue;
                }
                let pixels = Pixels {
                    at: grid.at(word * 64 + column, y + k),
                    to: (y + k - out.top) * grid.stride + word * 64 + column,
                    column,
                    edged,
                };
                match inputs.method {
                    Method::LinearFit => row.fit(simd, inputs, pixels, out),
                    Method::FixedWeights => row.mean(simd, inputs, pixels, out),
                }
            }
        }
        done & worth
    }
}

/// As many pixels side by side as a vector has lanes.
#[derive(Clone, Copy)]
struct Pixels {
    /// Element of the first.
    at: usize,
    /// The same in the rows that are written.
    to: usize,
    /// Its column in the word.
    column: usize,
    /// Their colours may be wanted elsewhere than in the middle.
    edged: bool,
}

impl Reach {
    #[inline(always)]
    fn new(grid: Grid, near: Neighbours<'_>, (word, y): (usize, usize), edged: bool) -> Self {
        let at = |plane: &[u64], offset| shifted(plane, grid.words, word, y, offset);
        let mut reach = Self::default();
        let mut reached = [!0; INNER];
        if edged {
            let [right, down] = [near.right, near.down];
            // Steps are stored at the pixel on their left or upper end.
            let sides = [at(right, (0, 0)), at(right, (-1, 0))];
            let ends = [at(down, (0, 0)), at(down, (0, -1))];
            let round = |side: usize, end: usize, on: u64, beside: u64| {
                sides[side] & on | ends[end] & beside
            };
            reached = [
                !0,
                sides[0],
                sides[1],
                ends[0],
                ends[1],
                round(0, 0, at(down, (1, 0)), at(right, (0, 1))),
                round(1, 0, at(down, (-1, 0)), at(right, (-1, 1))),
                round(0, 1, at(down, (1, -1)), at(right, (0, -1))),
                round(1, 1, at(down, (-1, -1)), at(right, (-1, -1))),
            ];
        }
        let complex = near.complex[y * grid.words + word];
        for (tap, (samples, reached)) in reach.samples.iter_mut().zip(reached).enumerate() {
            // Complex pixels may use every sample around them (paper section 5.4).
            let reached = (reached | complex) & inside(grid, (word, y), OFFSETS[tap]);
            *samples = at(near.has, OFFSETS[tap]) & reached;
            count(&mut reach.count, *samples);
            count(&mut reach.area, reached);
        }
        reach
    }

    /// Whether some pixels reach the sample at an offset.
    #[inline(always)]
    fn mask<S: Simd>(&self, simd: S, tap: usize, column: usize) -> S::mask32s {
        let lanes = S::f32s::LEN;
        let bits = self.samples[tap] >> column & (!0 >> (64 - lanes));
        S::mask32s::from_bitmask(simd, bits)
    }

    /// The weighted linear fit at each pixel's place, kept to the range of its samples.
    #[inline(always)]
    fn fit<S: Simd>(&self, simd: S, inputs: &Inputs<'_>, pixels: Pixels, out: &mut Rows<'_>) {
        let lanes = S::f32s::LEN;
        let splat = |v: f32| S::f32s::splat(simd, v);
        let (samples, stride) = (inputs.samples, inputs.samples.grid.stride);
        let load = |plane: &[f32], at: usize| S::f32s::from_slice(simd, &plane[at..at + lanes]);
        let (mut cx, mut cy) = (splat(0.5), splat(0.5));
        if pixels.edged {
            cx = load(inputs.centre_x, pixels.at);
            cy = load(inputs.centre_y, pixels.at);
        }
        let area = number(simd, &self.area, pixels.column);
        // One at least, where there are none and the result is not used.
        let many = number(simd, &self.count, pixels.column).max(splat(1.0));
        let softening = (splat(SOFTENING_SHARE) * area / many).max(splat(SOFTENING));
        let weighing = Weighing::new(simd, softening);
        let none = S::u32s::splat(simd, ONE);
        let mut nearest = splat(f32::INFINITY);
        let mut moments = Moments::new(simd);
        let mut weights = [splat(0.0); INNER];
        let mut steps = [[splat(0.0); 2]; INNER];
        for (tap, &(dx, dy)) in OFFSETS[..INNER].iter().enumerate() {
            let from = place(pixels.at, stride, (dx, dy));
            let reached = self.mask(simd, tap, pixels.column);
            let x = load(&samples.x, from) + (splat(dx as f32) - cx);
            let y = load(&samples.y, from) + (splat(dy as f32) - cy);
            let many: S::u32s = load(&samples.count, from)
                .min(splat(MOST_COUNTED))
                .bitcast();
            let [q, w] = weighing.weight([x, y], many - none);
            let w = reached.select(w, splat(0.0));
            nearest = reached.select(nearest.min(q), nearest);
            moments.add(w, [x, y]);
            (weights[tap], steps[tap]) = (w, [x, y]);
        }
        let shares = moments.shares(simd);
        let mut sums = [splat(0.0); 3];
        let (mut low, mut high) = ([splat(f32::INFINITY); 3], [splat(f32::NEG_INFINITY); 3]);
        for (tap, &offset) in OFFSETS[..INNER].iter().enumerate() {
            let from = place(pixels.at, stride, offset);
            let reached = self.mask(simd, tap, pixels.column);
            let share = shares.of(weights[tap], steps[tap]);
            for k in 0..3 {
                let c = load(&samples.rgb[k], from);
                sums[k] += share * c;
                low[k] = reached.select(low[k].min(c), low[k]);
                high[k] = reached.select(high[k].max(c), high[k]);
            }
        }
        // Those that reach none are not done, but must not hold anything either.
        let zero = splat(0.0);
        let any = moments.weight().simd_gt(zero);
        let weight = any.select(weighing.founded(simd, nearest, moments.weight()), zero);
        weight.store_slice(&mut out.weight[pixels.to..pixels.to + lanes]);
        for k in 0..3 {
            let value = (sums[k] * shares.inverse).max(low[k]).min(high[k]);
            let value = any.select(value, zero);
            value.store_slice(&mut out.rgb[k][pixels.to..pixels.to + lanes]);
        }
    }

    /// The mean, weighted by the distance between pixels.
    #[inline(always)]
    fn mean<S: Simd>(&self, simd: S, inputs: &Inputs<'_>, pixels: Pixels, out: &mut Rows<'_>) {
        let lanes = S::f32s::LEN;
        let splat = |v: f32| S::f32s::splat(simd, v);
        let (samples, stride) = (inputs.samples, inputs.samples.grid.stride);
        let mut weight = splat(0.0);
        let mut sums = [splat(0.0); 3];
        for (tap, &(dx, dy)) in OFFSETS[..INNER].iter().enumerate() {
            let from = place(pixels.at, stride, (dx, dy));
            let q = splat(SOFTENING + (dx * dx + dy * dy) as f32);
            let w = sharp_weight(simd, q, S::u32s::splat(simd, 0));
            let w = self.mask(simd, tap, pixels.column).select(w, splat(0.0));
            weight += w;
            for (sum, plane) in sums.iter_mut().zip(&samples.rgb) {
                *sum += w * S::f32s::from_slice(simd, &plane[from..from + lanes]);
            }
        }
        weight.store_slice(&mut out.weight[pixels.to..pixels.to + lanes]);
        let inverse = splat(1.0) / weight.max(splat(f32::MIN_POSITIVE));
        for (to, sum) in out.rgb.iter_mut().zip(sums) {
            (sum * inverse).store_slice(&mut to[pixels.to..pixels.to + lanes]);
        }
    }
}

/// Element that lies this offset from another.
#[inline(always)]
fn place(at: usize, stride: usize, (dx, dy): (i32, i32)) -> usize {
    at.wrapping_add_signed(dy as isize * stride as isize + dx as isize)
}

/// The pixels of a word from which this offset leads to a pixel of the image.
#[inline(always)]
fn inside(grid: Grid, (word, y): (usize, usize), (dx, dy): (i32, i32)) -> u64 {
    if y.checked_add_signed(dy as isize)
        .is_none_or(|row| row >= grid.height)
    {
        return 0;
    }
    match dx {
        1 => grid.valid(word) >> 1 | grid.valid(word + 1) << 63,
        -1 if word == 0 => grid.valid(word) << 1,
        -1 => grid.valid(word) << 1 | 1,
        _ => grid.valid(word),
    }
}

/// Adds one, where a bit is set, to numbers given bit by bit.
#[inline(always)]
fn count(numbers: &mut [u64; 4], mut more: u64) {
    for bit in numbers {
        let carry = *bit & more;
        *bit ^= more;
        more = carry;
    }
}

/// Some of the numbers given bit by bit.
#[inline(always)]
fn number<S: Simd>(simd: S, numbers: &[u64; 4], column: usize) -> S::f32s {
    let splat = |v: f32| S::f32s::splat(simd, v);
    let lanes = S::f32s::LEN;
    let mut sum = splat(0.0);
    for (bits, value) in numbers.iter().zip([1.0, 2.0, 4.0, 8.0]) {
        let set = S::mask32s::from_bitmask(simd, bits >> column & (!0 >> (64 - lanes)));
        sum += set.select(splat(value), splat(0.0));
    }
    sum
}
