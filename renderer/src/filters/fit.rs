//! A block of 4x4 pixels reconstructed from a few samples at once, each pixel with weights of its own.

use fearless_simd::{f32x4, prelude::*};

/// Columns and rows of a block, pixels.
pub(super) const BLOCK: usize = 4;

/// Pixels of a block, row by row.
pub(super) const PIXELS: usize = BLOCK * BLOCK;

/// Share of 1 pixel² and the mean squared distance that is added to the fit's variances: keeps few, collinear or far
/// samples from tilting it.
pub(super) const SLOPE_RIDGE: f32 = 0.001;

/// Added to squared distances where weights need not fit the samples' spacing, pixels².
pub(super) const SOFTENING: f32 = 0.25;

/// Raw samples more than which count no more.
const MOST_COUNTED: f32 = 4096.0;

/// A fit whose scale is below this is replaced by the weighted mean.
const LEAST_SCALE: f32 = 1e-30;

/// Bits of 1.0.
const ONE: u32 = 127 << 23;

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
}

/// Where a block's colours are wanted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Places {
    /// The block's first pixel.
    pub(super) corner: [f32; 2],
    /// Place in its pixel, x and y.
    pub(super) offset: [[f32; PIXELS]; 2],
}

impl Places {
    /// In the image, pixels.
    #[inline(always)]
    fn of<S: Simd>(&self, simd: S, here: std::ops::Range<usize>) -> [S::f32s; 2] {
        let at = |axis: usize, steps: &[f32; PIXELS]| {
            let pixel = S::f32s::from_slice(simd, &steps[here.clone()])
                + S::f32s::splat(simd, self.corner[axis]);
            pixel + S::f32s::from_slice(simd, &self.offset[axis][here.clone()])
        };
        [at(0, &COLUMNS), at(1, &ROWS)]
    }
}

/// A block's colours, and how well they are founded: the sum of [`super::interpolate::weight`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Fitted {
    pub(super) rgb: [[f32; PIXELS]; 3],
    pub(super) weight: [f32; PIXELS],
}

/// About (1/4 + d²)⁻³ times a sample's count, of `q` = 1/4 + d². A float's bits are about its logarithm: within a fifth,
/// falling everywhere, and the same at every level.
#[inline(always)]
fn sharp_weight<S: Simd>(simd: S, q: S::f32s, count: S::u32s) -> S::f32s {
    let bits: S::u32s = q.bitcast();
    (count + S::u32s::splat(simd, ONE.wrapping_mul(4)) - (bits + bits + bits)).bitcast()
}

/// What makes a softened distance's bits, times five, the bits of a weight (s / q)⁵.
#[inline(always)]
fn broad_scale(softening: f32) -> u32 {
    softening.to_bits().wrapping_mul(5).wrapping_add(ONE)
}

/// How well a fit is founded: the nearest sample's sharp weight, times the sum of weights in units of the nearest's.
#[inline(always)]
fn founded<S: Simd>(simd: S, nearest: S::f32s, softening: f32, sum: S::f32s) -> S::f32s {
    let none = S::u32s::splat(simd, 0);
    let sharp = sharp_weight(simd, nearest + S::f32s::splat(simd, SOFTENING), none);
    let bits: S::u32s = (nearest + S::f32s::splat(simd, softening)).bitcast();
    // One over the nearest's weight: the exponent negated.
    let scale = S::u32s::splat(
        simd,
        ONE.wrapping_mul(2).wrapping_sub(broad_scale(softening)),
    );
    let inverse: S::f32s = (scale + (bits + (bits << 2))).bitcast();
    sharp * (sum * inverse)
}

/// Weighted linear fit at each pixel's place to some of the records, at least one: kept to their range. Weights are about
/// (s / (s + d²))⁵ times a sample's count, s being `softening`.
#[inline(always)]
pub(super) fn fit<S: Simd>(
    simd: S,
    (records, chosen): (&[Record], &[u32]),
    wanted: &Places,
    softening: f32,
    out: &mut Fitted,
) {
    let lanes = S::f32s::LEN;
    let splat = |v: f32| S::f32s::splat(simd, v);
    let zero = splat(0.0);
    let soft = splat(softening);
    let scale = S::u32s::splat(simd, broad_scale(softening));
    for group in (0..PIXELS).step_by(lanes) {
        let here = group..group + lanes;
        let [px, py] = wanted.of(simd, here.clone());
        let mut nearest = splat(f32::INFINITY);
        let [mut w0, mut wx, mut wy] = [zero; 3];
        let [mut wxx, mut wxy, mut wyy] = [zero; 3];
        let [mut c0, mut cx, mut cy] = [[zero; 3]; 3];
        let mut low = f32x4::splat(simd, f32::INFINITY);
        let mut high = f32x4::splat(simd, f32::NEG_INFINITY);
        for &i in chosen {
            let s = &records[i as usize];
            let count = S::u32s::splat(simd, s.count);
            let (x, y) = (splat(s.place[0]) - px, splat(s.place[1]) - py);
            let d2 = x * x + y * y;
            nearest = nearest.min(d2);
            let bits: S::u32s = (d2 + soft).bitcast();
            let w: S::f32s = (count + scale - (bits + (bits << 2))).bitcast();
            let (ux, uy) = (w * x, w * y);
            w0 += w;
            wx += ux;
            wy += uy;
            wxx += ux * x;
            wxy += ux * y;
            wyy += uy * y;
            for k in 0..3 {
                let c = splat(s.rgb[k]);
                c0[k] += w * c;
                cx[k] += ux * c;
                cy[k] += uy * c;
            }
            let rgb = f32x4::from_slice(simd, &s.rgb);
            (low, high) = (low.min(rgb), high.max(rgb));
        }
        // Slopes by the covariances around the weighted middle, then the value at the pixel's place; all times powers of
        // the weight sum and the determinant, which one division takes out again.
        let ridge = splat(SLOPE_RIDGE) * w0 * (w0 + (wxx + wyy));
        let (xx, yy) = (w0 * wxx - wx * wx + ridge, w0 * wyy - wy * wy + ridge);
        let xy = w0 * wxy - wx * wy;
        let (gx, gy) = (xy * wy - yy * wx, xy * wx - xx * wy);
        let level = (xx * yy - xy * xy) - (gx * wx + gy * wy);
        let (gx, gy) = (gx * w0, gy * w0);
        let total = level * w0 + (gx * wx + gy * wy);
        let sure = total.simd_gt(splat(LEAST_SCALE));
        let inverse = splat(1.0) / sure.select(total, w0);
        founded(simd, nearest, softening, w0).store_slice(&mut out.weight[here.clone()]);
        for (k, to) in out.rgb.iter_mut().enumerate() {
            let value = level * c0[k] + (gx * cx[k] + gy * cy[k]);
            let value = sure.select(value, c0[k]) * inverse;
            let value = value
                .max(splat(low.as_slice()[k]))
                .min(splat(high.as_slice()[k]));
            value.store_slice(&mut to[here.clone()]);
        }
    }
}

/// Weighted mean of some of the records, at least one, by [`super::interpolate::weight`] of the distance between pixels.
#[inline(always)]
pub(super) fn mean<S: Simd>(
    simd: S,
    (records, chosen): (&[Record], &[u32]),
    wanted: &Places,
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
