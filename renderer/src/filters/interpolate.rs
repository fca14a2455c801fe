//! Constrained interpolation: each pixel's primary region from the reachable samples of its 5x5 neighbourhood
//! (paper section 5.3).
//!
//! Two methods. [`Method::FixedWeights`] is the paper's: a weight an offset, renormalised over what is reachable (the
//! paper's own weights are in a lost figure; any sharply peaked set does). [`Method::LinearFit`] knows where in its
//! pixel each sample lies and fits a plane to them.

use fearless_simd::{Level, dispatch, prelude::*};
use fearless_simd_macros::simd;
use rayon::ThreadPool;
use rayon::prelude::*;

use super::taps::{OFFSETS, Reach, Taps, taps};
use crate::epi::grid::Grid;
use crate::points::PixelSamples;

/// How samples become a colour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// The paper's: weights by pixel distance alone.
    FixedWeights,
    /// Weighted least-squares plane through the samples at their true places, clamped to their range.
    #[default]
    LinearFit,
}

/// Weight of a sample at squared distance `d2` pixels²: (1/4 + d²)⁻³, sharply peaked.
#[inline]
pub fn weight(d2: f32) -> f32 {
    let q = 0.25 + d2;
    1.0 / (q * q * q)
}

/// Share of the weight sum added to the fit's slope terms, pixels²: keeps few or collinear samples from tilting it.
pub const SLOPE_RIDGE: f32 = 0.01;

/// What interpolation reads.
pub struct Inputs<'a, R> {
    /// Samples a pixel.
    pub samples: &'a PixelSamples,
    /// Plane of pixels whose sample may be used: it surely lies in the primary region.
    pub has: &'a [u64],
    /// Which primary regions reach which.
    pub reach: &'a R,
    /// Plane of complex pixels.
    pub complex: &'a [u64],
    /// Where in its pixel each primary region's middle lies, x, by [`Grid`]: where the colour is wanted.
    pub centre_x: &'a [f32],
    /// The same, y.
    pub centre_y: &'a [f32],
}

/// Colours and how well they are founded, by [`Grid`].
#[derive(Clone, Debug)]
pub struct Interpolated {
    /// Linear radiance of primary regions.
    pub rgb: [Vec<f32>; 3],
    /// Sum of weights before renormalising.
    pub weight: Vec<f32>,
    /// Plane: fewer than three samples were reachable, so that no plane is determined by them.
    pub starved: Vec<u64>,
    /// Plane: no sample was reachable; the colour is 0.
    pub bare: Vec<u64>,
}

impl Interpolated {
    /// Room for an image of this layout.
    pub fn new(grid: Grid) -> Self {
        let plane = || vec![0.0; grid.elements()];
        Self {
            rgb: [plane(), plane(), plane()],
            weight: plane(),
            starved: vec![0; grid.plane_words()],
            bare: vec![0; grid.plane_words()],
        }
    }
}

/// A row of [`Interpolated`].
struct Row<'a> {
    rgb: [&'a mut [f32]; 3],
    weight: &'a mut [f32],
    starved: &'a mut [u64],
    bare: &'a mut [u64],
}

/// Reconstructs every pixel's primary region, rows shared among the threads of a pool where one is given. Results do not
/// depend on `level` or threads.
pub fn interpolate<R: Reach + Sync>(
    level: Level,
    pool: Option<&ThreadPool>,
    method: Method,
    inputs: &Inputs<'_, R>,
    out: &mut Interpolated,
) {
    let grid = inputs.samples.grid;
    let elements = grid.origin..grid.origin + grid.height * grid.stride;
    let (stride, words) = (grid.stride, grid.words);
    let Interpolated {
        rgb: [red, green, blue],
        weight,
        starved,
        bare,
    } = out;
    let planes = [red, green, blue, weight].map(|plane| &mut plane[elements.clone()]);
    let [red, green, blue, weight] = planes;
    let fill = |(y, (((((r, g), b), weight), starved), bare))| {
        interpolate_row(
            level,
            method,
            inputs,
            y,
            Row {
                rgb: [r, g, b],
                weight,
                starved,
                bare,
            },
        );
    };
    match pool {
        None => {
            let colours = red
                .chunks_mut(stride)
                .zip(green.chunks_mut(stride))
                .zip(blue.chunks_mut(stride));
            let planes = starved.chunks_mut(words).zip(bare.chunks_mut(words));
            let rows = colours.zip(weight.chunks_mut(stride)).zip(planes);
            rows.map(|(colours, (starved, bare))| ((colours, starved), bare))
                .enumerate()
                .for_each(fill);
        }
        Some(pool) => pool.install(|| {
            let colours = red
                .par_chunks_mut(stride)
                .zip(green.par_chunks_mut(stride))
                .zip(blue.par_chunks_mut(stride));
            let rows = colours
                .zip(weight.par_chunks_mut(stride))
                .zip(starved.par_chunks_mut(words))
                .zip(bare.par_chunks_mut(words));
            rows.enumerate().for_each(fill);
        }),
    }
}

fn interpolate_row<R: Reach>(
    level: Level,
    method: Method,
    inputs: &Inputs<'_, R>,
    y: usize,
    mut out: Row<'_>,
) {
    let grid = inputs.samples.grid;
    // The outer ring adds little where the inner nine are enough, and weights of the paper's kind want it all.
    let stop_early = method == Method::LinearFit;
    for word in 0..grid.words {
        let taps = taps(
            inputs.reach,
            inputs.has,
            inputs.complex,
            grid.words,
            (word, y),
            stop_early,
        );
        out.starved[word] = taps.few & grid.valid(word);
        out.bare[word] = taps.none & grid.valid(word);
        let first = (grid.at(word * 64, y), word * 64);
        match method {
            Method::LinearFit => {
                dispatch!(level, simd => fit_word(simd, inputs, &taps, first, &mut out));
            }
            Method::FixedWeights => {
                dispatch!(level, simd => fixed_word(simd, inputs.samples, &taps, first, &mut out));
            }
        }
    }
}

/// Sums of a weighted linear fit c ≈ a + b·x + c·y.
struct Sums<V> {
    w: V,
    x: V,
    y: V,
    xx: V,
    xy: V,
    yy: V,
    c: [V; 3],
    cx: [V; 3],
    cy: [V; 3],
    low: [V; 3],
    high: [V; 3],
}

#[simd]
fn fit_word<S: Simd, R: Reach>(
    simd: S,
    inputs: &Inputs<'_, R>,
    taps: &Taps,
    (first, column): (usize, usize),
    out: &mut Row<'_>,
) {
    let lanes = S::f32s::LEN;
    let samples = inputs.samples;
    let stride = samples.grid.stride;
    let splat = |v: f32| S::f32s::splat(simd, v);
    let zero = splat(0.0);
    for group in (0..64).step_by(lanes) {
        let at = first + group;
        let lane_bits = if lanes == 64 { !0 } else { (1u64 << lanes) - 1 };
        let centre_x = S::f32s::from_slice(simd, &inputs.centre_x[at..at + lanes]);
        let centre_y = S::f32s::from_slice(simd, &inputs.centre_y[at..at + lanes]);
        let mut s = Sums {
            w: zero,
            x: zero,
            y: zero,
            xx: zero,
            xy: zero,
            yy: zero,
            c: [zero; 3],
            cx: [zero; 3],
            cy: [zero; 3],
            low: [splat(f32::INFINITY); 3],
            high: [splat(f32::NEG_INFINITY); 3],
        };
        for (mask, &(dx, dy)) in taps.masks.iter().zip(&OFFSETS) {
            let bits = mask >> group & lane_bits;
            if bits == 0 {
                continue;
            }
            let from = (at as isize + dy as isize * stride as isize + dx as isize) as usize;
            let load = |plane: &[f32]| S::f32s::from_slice(simd, &plane[from..from + lanes]);
            let used = S::mask32s::from_bitmask(simd, bits);
            let x = load(&samples.x) + splat(dx as f32) - centre_x;
            let y = load(&samples.y) + splat(dy as f32) - centre_y;
            let q = splat(0.25) + x * x + y * y;
            let w = used.select(load(&samples.count) / (q * q * q), zero);
            let (wx, wy) = (w * x, w * y);
            s.w += w;
            s.x += wx;
            s.y += wy;
            s.xx += wx * x;
            s.xy += wx * y;
            s.yy += wy * y;
            for k in 0..3 {
                let c = load(&samples.rgb[k]);
                s.c[k] += w * c;
                s.cx[k] += wx * c;
                s.cy[k] += wy * c;
                s.low[k] = used.select(s.low[k].min(c), s.low[k]);
                s.high[k] = used.select(s.high[k].max(c), s.high[k]);
            }
        }
        let to = column + group..column + group + lanes;
        s.w.store_slice(&mut out.weight[to.clone()]);
        let some = s.w.simd_gt(zero);
        let inv = splat(1.0) / some.select(s.w, splat(1.0));
        // Normal equations scaled to a weight sum of 1, solved for the value at the origin by cofactors.
        let (x, y, xy) = (s.x * inv, s.y * inv, s.xy * inv);
        let xx = s.xx * inv + splat(SLOPE_RIDGE);
        let yy = s.yy * inv + splat(SLOPE_RIDGE);
        let k0 = xx * yy - xy * xy;
        let kx = y * xy - x * yy;
        let ky = x * xy - y * xx;
        let scale = inv / (k0 + x * kx + y * ky);
        for k in 0..3 {
            let value = (k0 * s.c[k] + kx * s.cx[k] + ky * s.cy[k]) * scale;
            let value = value.max(s.low[k]).min(s.high[k]);
            some.select(value, zero)
                .store_slice(&mut out.rgb[k][to.clone()]);
        }
    }
}

#[simd]
fn fixed_word<S: Simd>(
    simd: S,
    samples: &PixelSamples,
    taps: &Taps,
    (first, column): (usize, usize),
    out: &mut Row<'_>,
) {
    let lanes = S::f32s::LEN;
    let stride = samples.grid.stride;
    let zero = S::f32s::splat(simd, 0.0);
    for group in (0..64).step_by(lanes) {
        let at = first + group;
        let lane_bits = if lanes == 64 { !0 } else { (1u64 << lanes) - 1 };
        let mut sum = zero;
        let mut c = [zero; 3];
        for (mask, &(dx, dy)) in taps.masks.iter().zip(&OFFSETS) {
            let bits = mask >> group & lane_bits;
            if bits == 0 {
                continue;
            }
            let from = (at as isize + dy as isize * stride as isize + dx as isize) as usize;
            let used = S::mask32s::from_bitmask(simd, bits);
            let w = used.select(
                S::f32s::splat(simd, weight((dx * dx + dy * dy) as f32)),
                zero,
            );
            sum += w;
            for (c, plane) in c.iter_mut().zip(&samples.rgb) {
                *c += w * S::f32s::from_slice(simd, &plane[from..from + lanes]);
            }
        }
        let to = column + group..column + group + lanes;
        sum.store_slice(&mut out.weight[to.clone()]);
        let some = sum.simd_gt(zero);
        let inv = S::f32s::splat(simd, 1.0) / some.select(sum, S::f32s::splat(simd, 1.0));
        for (c, plane) in c.into_iter().zip(&mut out.rgb) {
            some.select(c * inv, zero)
                .store_slice(&mut plane[to.clone()]);
        }
    }
}
