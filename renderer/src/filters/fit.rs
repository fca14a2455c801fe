//! A block of 4x4 pixels reconstructed from a few samples at once, each pixel with weights of its own.

use std::ops::Range;

use fearless_simd::{f32x4, prelude::*};

use super::moments::{MOST_COUNTED, Moments, ONE, SOFTENING, Shares, Weighing, sharp_weight};
use super::records::MOST;

/// Columns and rows of a block, pixels.
pub(super) const BLOCK: usize = 4;

/// Pixels of a block, row by row.
pub(super) const PIXELS: usize = BLOCK * BLOCK;

/// First columns and rows of a block's pixels.
const COLUMNS: [f32; PIXELS] = pixel_steps(false);
const ROWS: [f32; PIXELS] = pixel_steps(true);

const fn pixel_steps(rows: bool) -> [f32; PIXELS] {
    let mut steps = [0.0; PIXELS];
    let mut k = 0;
    while k < PIXELS {
        steps[k] = if rows { k / BLOCK } else { k % BLOCK } as f32;
        k += 1;
    }
    steps
}

/// A sample as blocks read it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Record {
    /// Place in the image, pixels.
    place: [f32; 2],
    /// Bits of the number of raw samples it is the mean of, less those of 1.
    count: u32,
    /// Linear radiance; the last is nothing.
    rgb: [f32; 4],
}

impl Record {
    /// A sample that is the mean of `count` raw ones.
    #[inline(always)]
    pub(super) fn new(place: [f32; 2], count: f32, [red, green, blue]: [f32; 3]) -> Self {
        Self {
            place,
            count: count.min(MOST_COUNTED).to_bits().wrapping_sub(ONE),
            rgb: [red, green, blue, 0.0],
        }
    }

    /// Its place from those of some pixels.
    #[inline(always)]
    fn from<S: Simd>(&self, simd: S, [x, y]: [S::f32s; 2]) -> [S::f32s; 2] {
        [
            S::f32s::splat(simd, self.place[0]) - x,
            S::f32s::splat(simd, self.place[1]) - y,
        ]
    }
}

/// Where in their pixels a block's colours are wanted, x and y.
pub(super) type Places = [[f32; PIXELS]; 2];

/// In the middle of every pixel.
pub(super) const MIDDLES: Places = [[0.5; PIXELS]; 2];

/// Where a block's colours are wanted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wanted<'a> {
    /// The block's first pixel.
    pub(super) corner: [f32; 2],
    pub(super) places: &'a Places,
}

impl Wanted<'_> {
    /// In the image, pixels.
    #[inline(always)]
    fn of<S: Simd>(&self, simd: S, here: Range<usize>) -> [S::f32s; 2] {
        let load = |from: &[f32; PIXELS]| S::f32s::from_slice(simd, &from[here.clone()]);
        let corner = |axis: usize| S::f32s::splat(simd, self.corner[axis]);
        [
            load(&COLUMNS) + corner(0) + load(&self.places[0]),
            load(&ROWS) + corner(1) + load(&self.places[1]),
        ]
    }
}

/// Weights of a block's pixels for each of the samples that serve them.
pub(super) type Weights = [[f32; PIXELS]; MOST];

/// A block's colours, and how well they are founded: the sum of [`super::interpolate::weight`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Fitted {
    pub(super) rgb: [[f32; PIXELS]; 3],
    pub(super) weight: [f32; PIXELS],
}

/// Weighted linear fit at each pixel's place to some of the records, at least one: kept to their range. Weights are about
/// (s / (s + d²))⁵ times a sample's count, s being `softening`.
///
/// A first pass over the samples finds the weights and the moments of the places; they give each sample's share in the
/// value, by which a second pass sums up the colours. Samples that all have one colour need no second pass.
#[inline(always)]
pub(super) fn fit<S: Simd>(
    simd: S,
    (records, chosen): (&[Record], &[u32]),
    wanted: &Wanted<'_>,
    softening: f32,
    weights: &mut Weights,
    out: &mut Fitted,
) {
    let lanes = S::f32s::LEN;
    let [low, high] = range(simd, (records, chosen));
    let weighing = Weighing::new(simd, S::f32s::splat(simd, softening));
    for group in (0..PIXELS).step_by(lanes) {
        let here = group..group + lanes;
        let at = wanted.of(simd, here.clone());
        if low == high {
            let (nearest, sum) = weigh(simd, (records, chosen), at, &weighing);
            let weight = weighing.founded(simd, nearest, sum);
            weight.store_slice(&mut out.weight[here.clone()]);
            for (to, value) in out.rgb.iter_mut().zip(low) {
                S::f32s::splat(simd, value).store_slice(&mut to[here.clone()]);
            }
            continue;
        }
        let (nearest, moments) = moments(simd, (records, chosen), at, &weighing, weights);
        let weight = weighing.founded(simd, nearest, moments.weight());
        weight.store_slice(&mut out.weight[here.clone()]);
        let shares = moments.shares(simd);
        let sums = sum_up(simd, (records, chosen), at, weights, &shares);
        for (k, (to, sum)) in out.rgb.iter_mut().zip(sums).enumerate() {
            let value = sum * shares.inverse;
            let value = value.max(S::f32s::splat(simd, low[k]));
            let value = value.min(S::f32s::splat(simd, high[k]));
            value.store_slice(&mut to[here.clone()]);
        }
    }
}

/// Least and greatest colour of some of the records.
#[inline(always)]
fn range<S: Simd>(simd: S, (records, chosen): (&[Record], &[u32])) -> [[f32; 4]; 2] {
    let mut low = f32x4::splat(simd, f32::INFINITY);
    let mut high = f32x4::splat(simd, f32::NEG_INFINITY);
    for &i in chosen {
        let rgb = f32x4::from_slice(simd, &records[i as usize].rgb);
        (low, high) = (low.min(rgb), high.max(rgb));
    }
    [*low, *high]
}

/// The softened squared distance of the nearest of some of the records, and the sum of weights.
#[inline(always)]
fn weigh<S: Simd>(
    simd: S,
    (records, chosen): (&[Record], &[u32]),
    at: [S::f32s; 2],
    weighing: &Weighing<S>,
) -> (S::f32s, S::f32s) {
    let mut nearest = S::f32s::splat(simd, f32::INFINITY);
    let mut sum = S::f32s::splat(simd, 0.0);
    for &i in chosen {
        let s = &records[i as usize];
        let [q, w] = weighing.weight(s.from(simd, at), S::u32s::splat(simd, s.count));
        (nearest, sum) = (nearest.min(q), sum + w);
    }
    (nearest, sum)
}

/// The first pass of the fit: the softened squared distance of the nearest, and moments.
#[inline(always)]
fn moments<S: Simd>(
    simd: S,
    (records, chosen): (&[Record], &[u32]),
    at: [S::f32s; 2],
    weighing: &Weighing<S>,
    weights: &mut Weights,
) -> (S::f32s, Moments<S>) {
    let mut nearest = S::f32s::splat(simd, f32::INFINITY);
    let mut moments = Moments::new(simd);
    for (weight, &i) in weights.iter_mut().zip(chosen) {
        let s = &records[i as usize];
        let steps = s.from(simd, at);
        let [q, w] = weighing.weight(steps, S::u32s::splat(simd, s.count));
        nearest = nearest.min(q);
        w.store_slice(&mut weight[..S::f32s::LEN]);
        moments.add(w, steps);
    }
    (nearest, moments)
}

/// The second pass of the fit.
#[inline(always)]
fn sum_up<S: Simd>(
    simd: S,
    (records, chosen): (&[Record], &[u32]),
    at: [S::f32s; 2],
    weights: &Weights,
    shares: &Shares<S>,
) -> [S::f32s; 3] {
    let splat = |v: f32| S::f32s::splat(simd, v);
    let (mut red, mut green, mut blue) = (splat(0.0), splat(0.0), splat(0.0));
    for (weight, &i) in weights.iter().zip(chosen) {
        let s = &records[i as usize];
        let w = S::f32s::from_slice(simd, &weight[..S::f32s::LEN]);
        let share = shares.of(w, s.from(simd, at));
        red += share * splat(s.rgb[0]);
        green += share * splat(s.rgb[1]);
        blue += share * splat(s.rgb[2]);
    }
    [red, green, blue]
}

/// Weighted mean of some of the records, at least one, by [`super::interpolate::weight`] of the distance between pixels.
#[inline(always)]
pub(super) fn mean<S: Simd>(
    simd: S,
    (records, chosen): (&[Record], &[u32]),
    wanted: &Wanted<'_>,
    out: &mut Fitted,
) {
    let lanes = S::f32s::LEN;
    let splat = |v: f32| S::f32s::splat(simd, v);
    let one = S::u32s::splat(simd, 0);
    for group in (0..PIXELS).step_by(lanes) {
        let here = group..group + lanes;
        let column = S::f32s::from_slice(simd, &COLUMNS[here.clone()]) + splat(wanted.corner[0]);
        let row = S::f32s::from_slice(simd, &ROWS[here.clone()]) + splat(wanted.corner[1]);
        let [mut sum, mut red, mut green, mut blue] = [splat(0.0); 4];
        for &i in chosen {
            let s = &records[i as usize];
            let x = splat(s.place[0]).floor() - column;
            let y = splat(s.place[1]).floor() - row;
            let w = sharp_weight(simd, splat(SOFTENING) + (x * x + y * y), one);
            sum += w;
            red += w * splat(s.rgb[0]);
            green += w * splat(s.rgb[1]);
            blue += w * splat(s.rgb[2]);
        }
        let inverse = splat(1.0) / sum;
        sum.store_slice(&mut out.weight[here.clone()]);
        for (to, sum) in out.rgb.iter_mut().zip([red, green, blue]) {
            (sum * inverse).store_slice(&mut to[here.clone()]);
        }
    }
}
