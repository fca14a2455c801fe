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

/// One over `q` to within 3·10⁻⁴ of itself, for positive `q`, the same at every level: a division would cost as much as the
/// rest of a tap. Negating a float's exponent (254 is twice its bias) is right to an eighth; each step squares the error.
#[inline(always)]
pub(super) fn reciprocal<S: Simd>(simd: S, q: S::f32s) -> S::f32s {
    let two = S::f32s::splat(simd, 2.0);
    let mirrored = S::u32s::splat(simd, 254 << 23) - q.bitcast::<S::u32s>();
    let r: S::f32s = mirrored.bitcast();
    let r = r * (two - q * r);
    r * (two - q * r)
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
            let r = reciprocal(simd, q);
            let w = used.select(load(&samples.count) * (r * r * r), zero);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::place::hash_unit;

    /// Neighbours reach each other at random, alike in both directions.
    struct Random(Grid, u64);

    impl Random {
        fn open(&self, from: (i64, i64), to: (i64, i64)) -> bool {
            let (w, h) = (self.0.width as i64, self.0.height as i64);
            let inside = |p: (i64, i64)| p.0 >= 0 && p.1 >= 0 && p.0 < w && p.1 < h;
            let key = |p: (i64, i64)| (p.1 * w + p.0) as u64;
            inside(from) && inside(to) && {
                let (a, b) = (key(from).min(key(to)), key(from).max(key(to)));
                hash_unit(self.1, a * 1_000_003 + b) < 0.6
            }
        }
    }

    impl Reach for Random {
        fn reachable(&self, (dx, dy): (i32, i32), word: usize, y: usize) -> u64 {
            (0..64).fold(0, |bits, k| {
                let from = ((word * 64 + k) as i64, y as i64);
                let to = (from.0 + i64::from(dx), from.1 + i64::from(dy));
                bits | u64::from(self.open(from, to)) << k
            })
        }
    }

    fn samples(grid: Grid, seed: u64, share: f32) -> PixelSamples {
        let mut samples = PixelSamples::new(grid);
        for y in 0..grid.height {
            for x in 0..grid.width {
                let key = (y * grid.width + x) as u64;
                if hash_unit(seed, key) >= share {
                    continue;
                }
                let at = grid.at(x, y);
                samples.x[at] = hash_unit(seed ^ 1, key);
                samples.y[at] = hash_unit(seed ^ 2, key);
                samples.count[at] = 1.0 + (3.0 * hash_unit(seed ^ 3, key)).floor();
                for (k, plane) in samples.rgb.iter_mut().enumerate() {
                    plane[at] = hash_unit(seed ^ (4 + k as u64), key);
                }
                samples.has[grid.bit(x, y).0] |= 1 << grid.bit(x, y).1;
            }
        }
        samples
    }

    /// One pixel's colour by its definition, in double precision; nothing if it reaches no sample.
    fn by_definition(s: &PixelSamples, reach: &Random, (x, y): (usize, usize)) -> Option<[f64; 3]> {
        let mut near = Vec::new();
        for (k, &(dx, dy)) in OFFSETS.iter().enumerate() {
            if k == super::super::taps::INNER && near.len() >= super::super::taps::ENOUGH as usize {
                break;
            }
            let to = (x as i64 + i64::from(dx), y as i64 + i64::from(dy));
            let here = (x as i64, y as i64);
            let inside =
                to.0 >= 0 && to.1 >= 0 && to.0 < s.grid.width as i64 && to.1 < s.grid.height as i64;
            if inside
                && s.has_sample(to.0 as usize, to.1 as usize)
                && (k == 0 || reach.open(here, to))
            {
                let at = s.grid.at(to.0 as usize, to.1 as usize);
                let place = [
                    f64::from(dx) + f64::from(s.x[at]) - 0.5,
                    f64::from(dy) + f64::from(s.y[at]) - 0.5,
                ];
                near.push((place, at));
            }
        }
        let weights: Vec<f64> = near
            .iter()
            .map(|([x, y], at)| f64::from(s.count[*at]) / (0.25 + x * x + y * y).powi(3))
            .collect();
        let total: f64 = weights.iter().sum();
        (!near.is_empty()).then(|| {
            let mean = |f: &dyn Fn(usize) -> f64| {
                (0..near.len()).map(|i| weights[i] * f(i)).sum::<f64>() / total
            };
            let (mx, my) = (mean(&|i| near[i].0[0]), mean(&|i| near[i].0[1]));
            let ridge = f64::from(SLOPE_RIDGE);
            let xx = mean(&|i| near[i].0[0].powi(2)) - mx * mx + ridge;
            let yy = mean(&|i| near[i].0[1].powi(2)) - my * my + ridge;
            let xy = mean(&|i| near[i].0[0] * near[i].0[1]) - mx * my;
            [0, 1, 2].map(|k| {
                let colour = |i: usize| f64::from(s.rgb[k][near[i].1]);
                let mc = mean(&colour);
                let cx = mean(&|i| near[i].0[0] * colour(i)) - mx * mc;
                let cy = mean(&|i| near[i].0[1] * colour(i)) - my * mc;
                let det = xx * yy - xy * xy;
                let value = mc - mx * (yy * cx - xy * cy) / det - my * (xx * cy - xy * cx) / det;
                let range = (0..near.len()).map(colour);
                let low = range.clone().fold(f64::INFINITY, f64::min);
                value.clamp(low, range.fold(f64::NEG_INFINITY, f64::max))
            })
        })
    }

    #[test]
    fn every_level_and_thread_count_gives_the_fit_s_definition() {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(3)
            .build()
            .unwrap();
        for (seed, (width, height), share) in [
            (1, (70, 9), 0.02),
            (2, (64, 5), 0.3),
            (3, (130, 7), 1.0),
            (4, (1, 9), 0.5),
            (5, (3, 1), 0.0),
        ] {
            let grid = Grid::new(width, height);
            let (samples, reach) = (samples(grid, seed, share), Random(grid, seed));
            let middle = vec![0.5; grid.elements()];
            let complex = vec![0; grid.plane_words()];
            let inputs = Inputs {
                samples: &samples,
                has: &samples.has,
                reach: &reach,
                complex: &complex,
                centre_x: &middle,
                centre_y: &middle,
            };
            let run = |level, pool, method| {
                let mut out = Interpolated::new(grid);
                interpolate(level, pool, method, &inputs, &mut out);
                out
            };
            let out = run(Level::new(), None, Method::LinearFit);
            for y in 0..height {
                for x in 0..width {
                    let exact = by_definition(&samples, &reach, (x, y));
                    let (word, bit) = grid.bit(x, y);
                    assert_eq!(
                        out.bare[word] >> bit & 1 == 1,
                        exact.is_none(),
                        "{seed} {x} {y}"
                    );
                    for (plane, exact) in out.rgb.iter().zip(exact.unwrap_or_default()) {
                        let got = f64::from(plane[grid.at(x, y)]);
                        assert!(
                            (got - exact).abs() < 2e-3,
                            "{seed} {x} {y}: {got} for {exact}"
                        );
                    }
                }
            }
            for method in [Method::LinearFit, Method::FixedWeights] {
                let out = run(Level::new(), None, method);
                for other in [
                    run(Level::baseline(), None, method),
                    run(Level::new(), Some(&pool), method),
                ] {
                    assert_eq!((out.rgb.clone(), &out.starved), (other.rgb, &other.starved));
                }
            }
        }
    }
}
