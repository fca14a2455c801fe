//! A face's map as it lies in the image.

use ::textures::Footprint;
use glam::{DVec3, Vec2};

use crate::camera::View;

/// Three functions of the image point, each linear in it, whose ratios are the texture coordinates that the ray through the
/// point meets in the plane of a face: `u = U/W`, `v = V/W`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Projected {
    /// U, V and W: at image point (0, 0), and how much they grow a pixel to the right and down.
    rows: [[f32; 3]; 3],
}

impl Projected {
    /// `corners` are world positions. The ray in direction d from the eye, with the corners a, b, c relative to it, meets the
    /// plane at barycentric coordinates in the ratio d·(b×c) : d·(c×a) : d·(a×b).
    pub(super) fn new(view: &View, corners: [DVec3; 3], uvs: &[[f32; 2]; 3]) -> Self {
        let eye = view.eye.as_dvec3();
        let [a, b, c] = corners.map(|p| p - eye);
        let areas = [b.cross(c), c.cross(a), a.cross(b)];
        let along = |axis: usize| {
            let pairs = areas.iter().zip(uvs);
            pairs
                .map(|(area, uv)| *area * f64::from(uv[axis]))
                .sum::<DVec3>()
        };
        let whole: DVec3 = areas.iter().sum();
        // Rays are forward + right·(x − w/2)/f + up·(h/2 − y)/f.
        let (right, up) = (view.right.as_dvec3(), view.up.as_dvec3());
        let slope = 1.0 / f64::from(view.focal_px);
        let (dx, dy) = (right * slope, up * -slope);
        let half = [view.width, view.height].map(|side| 0.5 * f64::from(side));
        let first = view.forward.as_dvec3() - dx * half[0] - dy * half[1];
        // Only ratios matter: their size is that of the plane's, so that single precision holds them.
        let scale = 1.0 / whole.length();
        Self {
            rows: [along(0), along(1), whole]
                .map(|v| [first, dx, dy].map(|d| (v.dot(d) * scale) as f32)),
        }
    }

    /// Texture coordinates at an image point, pixels, and how a pixel lies around them. Nothing where they are not
    /// finite; whether the plane is met in front of the eye is [`Projected::side`]'s to say.
    #[inline]
    pub(super) fn at(&self, x: f32, y: f32) -> Option<(Vec2, Footprint)> {
        let [u, v, w] = self.rows.map(|r| r[0] + x * r[1] + y * r[2]);
        let inverse = 1.0 / w;
        let uv = Vec2::new(u, v) * inverse;
        let [ru, rv, rw] = &self.rows;
        let step = |k: usize| (Vec2::new(ru[k], rv[k]) - uv * rw[k]) * inverse;
        let footprint = Footprint {
            across: step(1),
            along: step(2),
        };
        let fine = uv.is_finite() && footprint.across.is_finite() && footprint.along.is_finite();
        fine.then_some((uv, footprint))
    }

    /// The sign of W at an image point: it changes where the plane of the face passes the horizon.
    #[inline]
    pub(super) fn side(&self, x: f32, y: f32) -> bool {
        let [_, _, w] = &self.rows;
        w[0] + x * w[1] + y * w[2] > 0.0
    }
}
