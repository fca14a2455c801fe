//! From view space to image space: clipping before projecting, and snapping to a fixed-point grid.

use crate::camera::View;

/// Fixed-point units a pixel.
pub const SUBPIXELS: i64 = 1 << 10;
/// How far outside of the picture segments are kept whole, pixels.
const GUARD_PX: f64 = 1024.0;
/// Nearest depth, m: only there to keep numbers finite, since the guard band bounds the rest.
const NEAR: f64 = 1e-6;

/// What is seen of a segment in the picture and near it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageSegment {
    /// Ends, image space in units of 1/[`SUBPIXELS`] px.
    pub ends: [[i64; 2]; 2],
    /// 1/depth at the ends, 1/m; linear in image space.
    pub inverse_depth: [f64; 2],
    /// Where on the segment the ends lie, 0..1 along view space.
    pub along: [f64; 2],
}

impl ImageSegment {
    /// The ends of a part of it, 0..1 in image space, in the units of its own.
    #[inline]
    pub fn part(&self, range: [f64; 2]) -> [[i64; 2]; 2] {
        let [a, b] = self.ends;
        range.map(|share| [0, 1].map(|k| a[k] + round((b[k] - a[k]) as f64 * share)))
    }
}

/// Turns segments in view space into segments in image space.
#[derive(Clone, Copy, Debug)]
pub struct Projector {
    focal: f64,
    half: [f64; 2],
    guard: [f64; 2],
}

impl Projector {
    /// For a view.
    pub fn new(view: &View) -> Self {
        let half = [f64::from(view.width) * 0.5, f64::from(view.height) * 0.5];
        Self {
            focal: f64::from(view.focal_px),
            half,
            guard: half.map(|h| h + GUARD_PX),
        }
    }

    /// Clips at the near plane and far outside of the picture, projects and snaps. An end that is not clipped goes to
    /// the same grid point in every segment that has it. Nothing if none of the segment can be seen, or if a
    /// coordinate is not finite.
    #[inline]
    pub fn project(&self, from: [f32; 3], to: [f32; 3]) -> Option<ImageSegment> {
        let (a, b) = (from.map(f64::from), to.map(f64::from));
        // Nearly every segment passes; the others pay for more divisions.
        if a[2] >= NEAR && b[2] >= NEAR {
            let inverse_depth = [1.0 / a[2], 1.0 / b[2]];
            let [p, q] = [
                self.place(a, inverse_depth[0]),
                self.place(b, inverse_depth[1]),
            ];
            // What is not a number is not within.
            let within = |axis: usize| {
                let (middle, guard) = (self.half[axis], self.guard[axis]);
                (p[axis] - middle).abs() <= guard && (q[axis] - middle).abs() <= guard
            };
            if within(0) && within(1) {
                return Some(ImageSegment {
                    ends: [p, q].map(|place| place.map(|px| round(px * SUBPIXELS as f64))),
                    inverse_depth,
                    along: [0.0, 1.0],
                });
            }
        }
        self.project_part(a, b)
    }

    #[cold]
    fn project_part(&self, a: [f64; 3], b: [f64; 3]) -> Option<ImageSegment> {
        let along = self.clip(a, b)?;
        let at = |t: f64| -> [f64; 3] {
            match t {
                0.0 => a,
                1.0 => b,
                _ => std::array::from_fn(|k| a[k] + (b[k] - a[k]) * t),
            }
        };
        let p = along.map(at);
        let inverse_depth = p.map(|p| 1.0 / p[2].max(NEAR));
        let snap = |k: usize| {
            let [x, y] = self.place(p[k], inverse_depth[k]);
            [fixed(x, self.guard[0]), fixed(y, self.guard[1])]
        };
        Some(ImageSegment {
            ends: [snap(0), snap(1)],
            inverse_depth,
            along,
        })
    }

    /// Signed distances to the five planes, positive inside.
    fn distances(&self, p: [f64; 3]) -> [f64; 5] {
        let (x, y) = (p[0] * self.focal, p[1] * self.focal);
        let (gx, gy) = (self.guard[0] * p[2], self.guard[1] * p[2]);
        [p[2] - NEAR, gx - x, gx + x, gy - y, gy + y]
    }

    fn clip(&self, a: [f64; 3], b: [f64; 3]) -> Option<[f64; 2]> {
        let (da, db) = (self.distances(a), self.distances(b));
        let (mut t0, mut t1) = (0.0_f64, 1.0_f64);
        for (da, db) in da.into_iter().zip(db) {
            if !(da.is_finite() && db.is_finite()) || (da < 0.0 && db < 0.0) {
                return None;
            }
            if da < 0.0 {
                t0 = t0.max(da / (da - db));
            } else if db < 0.0 {
                t1 = t1.min(da / (da - db));
            }
        }
        (t0 < t1).then_some([t0, t1])
    }

    /// Image place, px.
    #[inline]
    fn place(&self, p: [f64; 3], inverse_depth: f64) -> [f64; 2] {
        let s = self.focal * inverse_depth;
        [self.half[0] + p[0] * s, self.half[1] - p[1] * s]
    }
}

/// Rounds pixels to the grid. What rounding errors left outside of the guard band goes to its rim.
fn fixed(px: f64, guard: f64) -> i64 {
    round(px.clamp(-2.0 * guard, 2.0 * guard) * SUBPIXELS as f64)
}

/// To the nearest integer, for sizes up to 2⁴⁰.
#[inline]
fn round(x: f64) -> i64 {
    // Moved to where truncation rounds down: `f64::round` is a call on plain x86-64.
    const SHIFT: i64 = 1 << 40;
    (x + (SHIFT as f64 + 0.5)) as i64 - SHIFT
}
