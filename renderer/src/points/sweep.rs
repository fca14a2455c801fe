//! What neighbours say of all points of a frame at once: a sweep over its rows.

use fearless_simd::prelude::*;
use fearless_simd_macros::simd;

use super::PixelSamples;
use super::around::{AGREES_PX, BEFORE_PX, BEHIND_ONE_PX, BEHIND_PX, HIDDEN, WITHIN_PX};
use super::between::Between;
use crate::epi::grid::Grid;

/// How far behind the mean depth of its 3x3 neighbours a point may lie, as a share of that depth, before it is suspected.
const TOLERANCE: f32 = 0.03;

/// Rows kept.
const KEPT: usize = 4;

/// Room on both sides of a row.
const MARGIN: usize = 64;

/// The last four rows of what the rows after them need, with a margin of [`MARGIN`] on both sides.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    pitch: usize,
    /// One over depth.
    inverse: Vec<f32>,
    /// Sum of three in the row, and how many of them there are.
    sum: Vec<f32>,
    count: Vec<f32>,
    /// Greatest and least of three in the row that are sure.
    most: Vec<f32>,
    least: Vec<f32>,
    /// The same over 3x3, of free pixels; one row.
    step_most: Vec<f32>,
    step_least: Vec<f32>,
    /// Greatest and least of three of these in the row.
    far_most: Vec<f32>,
    far_least: Vec<f32>,
}

impl Rows {
    pub(super) fn start(&mut self, stride: usize) {
        self.pitch = stride + 2 * MARGIN;
        let n = KEPT * self.pitch;
        for (rows, n, empty) in [
            (&mut self.inverse, n, 0.0),
            (&mut self.sum, n, 0.0),
            (&mut self.count, n, 0.0),
            (&mut self.most, n, 0.0),
            (&mut self.least, n, f32::INFINITY),
            (&mut self.step_most, self.pitch, 0.0),
            (&mut self.step_least, self.pitch, f32::INFINITY),
            (&mut self.far_most, n, 0.0),
            (&mut self.far_least, n, f32::INFINITY),
        ] {
            rows.clear();
            rows.resize(n, empty);
        }
    }

    /// Index of column 0 of a row.
    #[inline(always)]
    fn at(&self, row: usize) -> usize {
        row % KEPT * self.pitch + MARGIN
    }

    /// Columns 0 of a row and of those before and after it.
    #[inline(always)]
    fn three(&self, row: usize) -> [usize; 3] {
        [self.at(row + KEPT - 1), self.at(row), self.at(row + 1)]
    }
}

/// The pixels of a word: one check of bounds for all of them.
#[inline(always)]
fn word_at(all: &[f32], at: usize) -> &[f32; 64] {
    all[at..].first_chunk().expect("rows have a margin")
}

#[inline(always)]
fn word_at_mut(all: &mut [f32], at: usize) -> &mut [f32; 64] {
    all[at..].first_chunk_mut().expect("rows have a margin")
}

/// A pixel's own and those of the ones before and after it, each 64 of them.
#[inline(always)]
fn beside(all: &[f32], at: usize) -> [&[f32; 64]; 3] {
    [word_at(all, at - 1), word_at(all, at), word_at(all, at + 1)]
}

/// The same column in three rows, 64 of them.
#[inline(always)]
fn above_and_below(all: &[f32], [a, b, c]: [usize; 3], x: usize) -> [&[f32; 64]; 3] {
    [
        word_at(all, a + x),
        word_at(all, b + x),
        word_at(all, c + x),
    ]
}

// Without `map`: closures over arrays are not always taken into the code of a wider level.
#[inline(always)]
fn lanes_of<S: Simd>(simd: S, three: [&[f32; 64]; 3], group: usize) -> [S::f32s; 3] {
    let end = group + S::f32s::LEN;
    let [a, b, c] = three;
    [
        S::f32s::from_slice(simd, &a[group..end]),
        S::f32s::from_slice(simd, &b[group..end]),
        S::f32s::from_slice(simd, &c[group..end]),
    ]
}

#[inline(always)]
fn sum<S: Simd>(simd: S, three: [&[f32; 64]; 3], group: usize) -> S::f32s {
    let [a, b, c] = lanes_of(simd, three, group);
    a + b + c
}

#[inline(always)]
fn greatest<S: Simd>(simd: S, three: [&[f32; 64]; 3], group: usize) -> S::f32s {
    let [a, b, c] = lanes_of(simd, three, group);
    a.max(b).max(c)
}

#[inline(always)]
fn least_of<S: Simd>(simd: S, three: [&[f32; 64]; 3], group: usize) -> S::f32s {
    let [a, b, c] = lanes_of(simd, three, group);
    a.min(b).min(c)
}

/// The bits of a word that stand for a group of lanes.
#[inline(always)]
fn bits_of(word: u64, group: usize, lanes: usize) -> u64 {
    word >> group & ((1u64 << lanes) - 1)
}

impl Between {
    /// Row after row, each step as soon as the rows that it needs are there, so that all stays in the nearest memory. `px` is
    /// one over the focal length, pixels.
    #[simd]
    pub(super) fn sweep<S: Simd>(&mut self, simd: S, pixels: &PixelSamples, px: f32) {
        for row in 0..pixels.grid.height + 3 {
            self.rows.add_up(simd, pixels, row);
            if row >= 1 {
                self.find_sure(simd, pixels, row - 1);
            }
            if row >= 2 {
                self.rows.step(simd, pixels.grid, &self.free, row - 2);
            }
            if row >= 3 {
                self.decide(simd, pixels, row - 3, px);
            }
        }
    }

    /// Finds what is unsure in a row, and the extremes of what is not over three in the row. Inverse depth is linear over a
    /// plane in the image, so that a slanted plane is no suspect.
    #[simd]
    fn find_sure<S: Simd>(&mut self, simd: S, pixels: &PixelSamples, y: usize) {
        let (grid, lanes) = (pixels.grid, S::f32s::LEN);
        let (zero, one) = (S::f32s::splat(simd, 0.0), S::f32s::splat(simd, 1.0));
        let most_behind = S::f32s::splat(simd, 1.0 + TOLERANCE);
        let infinite = S::f32s::splat(simd, f32::INFINITY);
        let rows = &mut self.rows;
        let to = rows.at(y);
        if y >= grid.height {
            rows.most[to..to + grid.stride].fill(0.0);
            rows.least[to..to + grid.stride].fill(f32::INFINITY);
            return;
        }
        let three = rows.three(y);
        for word in 0..grid.words {
            let (i, x) = (y * grid.words + word, word * 64);
            let inverse = word_at(&rows.inverse, to + x);
            let sums = above_and_below(&rows.sum, three, x);
            let counts = above_and_below(&rows.count, three, x);
            let mut suspects = 0;
            for group in (0..64).step_by(lanes) {
                let own = S::f32s::from_slice(simd, &inverse[group..group + lanes]);
                let others = sum(simd, counts, group) - one;
                let behind = (sum(simd, sums, group) - own).simd_gt(others * most_behind * own);
                suspects |= behind.to_bitmask() << group;
            }
            self.suspects[i] = pixels.has[i] & suspects;
            self.unsure[i] = pixels.has[i] & (suspects | pixels.doubtful[i]);
            let sure = pixels.has[i] & self.free[i] & !self.unsure[i];
            let out = word_at_mut(&mut self.sure, grid.at(x, y));
            for group in (0..64).step_by(lanes) {
                let mask = S::mask32s::from_bitmask(simd, bits_of(sure, group, lanes));
                let own = S::f32s::from_slice(simd, &inverse[group..group + lanes]);
                mask.select(own, zero)
                    .store_slice(&mut out[group..group + lanes]);
            }
        }
        // Rows touch in memory; the rim between is never sure.
        for x in (0..grid.stride).step_by(64) {
            let three = beside(&self.sure, grid.at(x, y));
            let most = word_at_mut(&mut rows.most, to + x);
            let least = word_at_mut(&mut rows.least, to + x);
            for group in (0..64).step_by(lanes) {
                let [a, b, c] = lanes_of(simd, three, group);
                let most_here = a.max(b).max(c);
                let [a, b, c] = [
                    a.simd_gt(zero).select(a, infinite),
                    b.simd_gt(zero).select(b, infinite),
                    c.simd_gt(zero).select(c, infinite),
                ];
                most_here.store_slice(&mut most[group..group + lanes]);
                a.min(b)
                    .min(c)
                    .store_slice(&mut least[group..group + lanes]);
            }
        }
    }

    /// What the pixels within two of each say of the points of a row.
    #[simd]
    fn decide<S: Simd>(&mut self, simd: S, pixels: &PixelSamples, y: usize, px: f32) {
        let (grid, lanes) = (pixels.grid, S::f32s::LEN);
        let zero = S::f32s::splat(simd, 0.0);
        let hidden_below = S::f32s::splat(simd, HIDDEN);
        let (behind, behind_one) = (
            S::f32s::splat(simd, BEHIND_PX * px),
            S::f32s::splat(simd, BEHIND_ONE_PX * px),
        );
        let lowest = S::f32s::splat(simd, 1.0 - AGREES_PX * px);
        let highest = S::f32s::splat(simd, 1.0 + BEFORE_PX * px);
        let widest = S::f32s::splat(simd, WITHIN_PX * px);
        let rows = &self.rows;
        let (own_row, three) = (rows.at(y), rows.three(y));
        for word in 0..grid.words {
            let (i, x) = (y * grid.words + word, word * 64);
            let candidates = pixels.has[i] & self.free[i];
            let inverse = word_at(&rows.inverse, own_row + x);
            let mosts = above_and_below(&rows.far_most, three, x);
            let leasts = above_and_below(&rows.far_least, three, x);
            let (mut hidden, mut far_behind, mut agrees) = (0, 0, 0);
            for group in (0..64).step_by(lanes) {
                if bits_of(candidates, group, lanes) == 0 {
                    continue;
                }
                let most = greatest(simd, mosts, group);
                let least = least_of(simd, leasts, group);
                let own = S::f32s::from_slice(simd, &inverse[group..group + lanes]);
                let known = most.simd_gt(zero);
                let spread = most - least;
                let room = spread.simd_gt(zero).select(behind, behind_one);
                let is_behind = known & own.simd_lt(least - spread - room * least);
                let near = own.simd_ge(lowest * most) & own.simd_le(highest * most);
                let within = own.simd_ge(least) & own.simd_le(most) & spread.simd_le(widest * most);
                hidden |= own.simd_lt(hidden_below * most).to_bitmask() << group;
                far_behind |= is_behind.to_bitmask() << group;
                agrees |= (known & (near | within)).to_bitmask() << group;
            }
            let unsure = self.unsure[i];
            self.hidden[i] = (hidden | far_behind & unsure) & candidates;
            self.vouched[i] = agrees & unsure & candidates & !self.hidden[i];
        }
    }
}

impl Rows {
    /// One over depth, summed over three in the row; rows past the last are empty.
    #[simd]
    fn add_up<S: Simd>(&mut self, simd: S, pixels: &PixelSamples, y: usize) {
        let (grid, lanes) = (pixels.grid, S::f32s::LEN);
        let (zero, one) = (S::f32s::splat(simd, 0.0), S::f32s::splat(simd, 1.0));
        let to = self.at(y);
        if y >= grid.height {
            for all in [&mut self.inverse, &mut self.sum, &mut self.count] {
                all[to..to + grid.stride].fill(0.0);
            }
            return;
        }
        for x in (0..grid.stride).step_by(64) {
            let depth = word_at(&pixels.depth, grid.at(x, y));
            let inverse = word_at_mut(&mut self.inverse, to + x);
            for group in (0..64).step_by(lanes) {
                let depth = S::f32s::from_slice(simd, &depth[group..group + lanes]);
                (one / depth).store_slice(&mut inverse[group..group + lanes]);
            }
        }
        for x in (0..grid.stride).step_by(64) {
            let three = beside(&self.inverse, to + x);
            let sum = word_at_mut(&mut self.sum, to + x);
            let count = word_at_mut(&mut self.count, to + x);
            for group in (0..64).step_by(lanes) {
                let [a, b, c] = lanes_of(simd, three, group);
                let ones = [
                    a.simd_gt(zero).select(one, zero),
                    b.simd_gt(zero).select(one, zero),
                    c.simd_gt(zero).select(one, zero),
                ];
                (a + b + c).store_slice(&mut sum[group..group + lanes]);
                (ones[0] + ones[1] + ones[2]).store_slice(&mut count[group..group + lanes]);
            }
        }
    }

    /// Extremes over 3x3 of free pixels, and over three of these in the row.
    #[simd]
    fn step<S: Simd>(&mut self, simd: S, grid: Grid, free: &[u64], y: usize) {
        let lanes = S::f32s::LEN;
        let (zero, infinite) = (
            S::f32s::splat(simd, 0.0),
            S::f32s::splat(simd, f32::INFINITY),
        );
        let to = self.at(y);
        if y >= grid.height {
            self.far_most[to..to + grid.stride].fill(0.0);
            self.far_least[to..to + grid.stride].fill(f32::INFINITY);
            return;
        }
        let three = self.three(y);
        for word in 0..grid.words {
            let (free, x) = (free[y * grid.words + word], word * 64);
            let mosts = above_and_below(&self.most, three, x);
            let leasts = above_and_below(&self.least, three, x);
            let step_most = word_at_mut(&mut self.step_most, MARGIN + x);
            let step_least = word_at_mut(&mut self.step_least, MARGIN + x);
            for group in (0..64).step_by(lanes) {
                let mask = S::mask32s::from_bitmask(simd, bits_of(free, group, lanes));
                let most = mask.select(greatest(simd, mosts, group), zero);
                let least = mask.select(least_of(simd, leasts, group), infinite);
                most.store_slice(&mut step_most[group..group + lanes]);
                least.store_slice(&mut step_least[group..group + lanes]);
            }
        }
        for x in (0..grid.stride).step_by(64) {
            let mosts = beside(&self.step_most, MARGIN + x);
            let leasts = beside(&self.step_least, MARGIN + x);
            let far_most = word_at_mut(&mut self.far_most, to + x);
            let far_least = word_at_mut(&mut self.far_least, to + x);
            for group in (0..64).step_by(lanes) {
                greatest(simd, mosts, group).store_slice(&mut far_most[group..group + lanes]);
                least_of(simd, leasts, group).store_slice(&mut far_least[group..group + lanes]);
            }
        }
    }
}
