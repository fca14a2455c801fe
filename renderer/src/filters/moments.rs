//! Sums over samples, each pixel with weights of its own, and the linear fit that they give.

use fearless_simd::prelude::*;

/// Share of 1 pixel² and the mean squared distance that is added to the fit's variances: keeps few, collinear or far
/// samples from tilting it.
const SLOPE_RIDGE: f32 = 0.001;

/// Added to squared distances where weights need not fit the samples' spacing, pixels².
pub(super) const SOFTENING: f32 = 0.25;

/// Softening of weights, in units of the area for each sample: weights reach as far as the samples' spacing asks. Anything
/// from 0.3 to 0.5 is within 2 % of the best error, with few samples and many.
pub(super) const SOFTENING_SHARE: f32 = 0.45;

/// Raw samples more than which count no more.
pub(super) const MOST_COUNTED: f32 = 4096.0;

/// A fit whose scale is below this is replaced by the weighted mean.
const LEAST_SCALE: f32 = 1e-30;

/// Bits of 1.0.
pub(super) const ONE: u32 = 127 << 23;

/// About (1/4 + d²)⁻³ times a sample's count, of `q` = 1/4 + d² and the bits of the count less those of 1. A float's bits are
/// about its logarithm: within a fifth, falling everywhere, and the same at every level.
#[inline(always)]
pub(super) fn sharp_weight<S: Simd>(simd: S, q: S::f32s, count: S::u32s) -> S::f32s {
    let bits: S::u32s = q.bitcast();
    (count + S::u32s::splat(simd, ONE.wrapping_mul(4)) - (bits + bits + bits)).bitcast()
}

/// How weights fall with distance: about (s / (s + d²))⁵ times a sample's count, s being the softening.
pub(super) struct Weighing<S: Simd> {
    soft: S::f32s,
    /// What makes a softened distance's bits, times five, the bits of a weight.
    scale: S::u32s,
}

impl<S: Simd> Weighing<S> {
    #[inline(always)]
    pub(super) fn new(simd: S, softening: S::f32s) -> Self {
        let bits: S::u32s = softening.bitcast();
        Self {
            soft: softening,
            scale: bits + (bits << 2) + S::u32s::splat(simd, ONE),
        }
    }

    /// Softened squared distance and weight of samples at these steps, given the bits of their counts less those of 1.
    #[inline(always)]
    pub(super) fn weight(&self, [x, y]: [S::f32s; 2], count: S::u32s) -> [S::f32s; 2] {
        let q = x * x + (y * y + self.soft);
        let bits: S::u32s = q.bitcast();
        let w = (self.scale - (bits + (bits << 2))) + count;
        [q, w.bitcast()]
    }

    /// How well a fit is founded: the nearest sample's sharp weight, given its softened squared distance, times the sum of
    /// weights in units of the nearest's.
    #[inline(always)]
    pub(super) fn founded(&self, simd: S, nearest: S::f32s, sum: S::f32s) -> S::f32s {
        let least = S::f32s::splat(simd, SOFTENING);
        let q = (nearest + (least - self.soft)).max(least);
        let sharp = sharp_weight(simd, q, S::u32s::splat(simd, 0));
        let bits: S::u32s = nearest.bitcast();
        // One over the nearest's weight: the exponent negated.
        let scale = S::u32s::splat(simd, ONE.wrapping_mul(2)) - self.scale;
        let inverse: S::f32s = (scale + (bits + (bits << 2))).bitcast();
        sharp * (sum * inverse)
    }
}

/// Sums of weights times powers of samples' places, which are from the pixel's own.
pub(super) struct Moments<S: Simd> {
    w: S::f32s,
    x: S::f32s,
    y: S::f32s,
    xx: S::f32s,
    xy: S::f32s,
    yy: S::f32s,
}

impl<S: Simd> Moments<S> {
    /// Of no samples.
    #[inline(always)]
    pub(super) fn new(simd: S) -> Self {
        let zero = S::f32s::splat(simd, 0.0);
        Self {
            w: zero,
            x: zero,
            y: zero,
            xx: zero,
            xy: zero,
            yy: zero,
        }
    }

    /// Adds samples of weights `w` at these steps.
    #[inline(always)]
    pub(super) fn add(&mut self, w: S::f32s, [x, y]: [S::f32s; 2]) {
        let (ux, uy) = (w * x, w * y);
        self.w += w;
        self.x += ux;
        self.y += uy;
        self.xx += ux * x;
        self.xy += ux * y;
        self.yy += uy * y;
    }

    /// Sum of the weights.
    #[inline(always)]
    pub(super) fn weight(&self) -> S::f32s {
        self.w
    }

    /// What samples' shares in the value at the pixel's place are by the fit.
    #[inline(always)]
    pub(super) fn shares(&self, simd: S) -> Shares<S> {
        // Slopes by the covariances around the weighted middle, then the value at the pixel's place; all times powers of
        // the weight sum and the determinant, which one division takes out again.
        let splat = |v: f32| S::f32s::splat(simd, v);
        let (w, x, y) = (self.w, self.x, self.y);
        let ridge = splat(SLOPE_RIDGE) * w * (w + (self.xx + self.yy));
        let (xx, yy) = (w * self.xx - x * x + ridge, w * self.yy - y * y + ridge);
        let xy = w * self.xy - x * y;
        let (gx, gy) = (xy * y - yy * x, xy * x - xx * y);
        let level = (xx * yy - xy * xy) - (gx * x + gy * y);
        let (gx, gy) = (gx * w, gy * w);
        let total = level * w + (gx * x + gy * y);
        let sure = total.simd_gt(splat(LEAST_SCALE));
        let (zero, one) = (splat(0.0), splat(1.0));
        Shares {
            level: sure.select(level, one),
            x: sure.select(gx, zero),
            y: sure.select(gy, zero),
            inverse: one / sure.select(total, w),
        }
    }
}

/// What makes a sample's weight its share of the value at the pixel's place: a number, and how it changes by the sample's
/// place; all times a number that is one over `inverse`.
pub(super) struct Shares<S: Simd> {
    level: S::f32s,
    x: S::f32s,
    y: S::f32s,
    pub(super) inverse: S::f32s,
}

impl<S: Simd> Shares<S> {
    /// That of samples of weights `w` at these steps.
    #[inline(always)]
    pub(super) fn of(&self, w: S::f32s, [x, y]: [S::f32s; 2]) -> S::f32s {
        w * (self.level + (self.x * x + self.y * y))
    }
}
