//! What a part of a linear light gives a receiver if nothing is in between.

use glam::Vec3;

use crate::{Receiver, segment};

/// Irradiance at `receiver` from the segment `from`-`to`, for 1 W/sr a metre; W/m² per W/(m sr).
///
/// With `facing` the segment is an edge of a polygon and shines by the cosine to that normal; the integral is then
/// Simpson's, since only the shares of such parts are used.
pub(crate) fn irradiance(receiver: &Receiver, ends: [Vec3; 2], facing: Option<Vec3>) -> f64 {
    let normal = receiver.normal.as_dvec3();
    let position = receiver.position.as_dvec3();
    let [from, to] = ends.map(|end| end.as_dvec3() - position);
    let Some(facing) = facing.map(|facing| facing.as_dvec3()) else {
        return segment::irradiance(from, to, normal);
    };
    let Some((from, to)) = segment::above_horizon(from, to, normal) else {
        return 0.;
    };
    let at = |s: f64| {
        let q = from.lerp(to, s);
        let square = q.length_squared();
        let value = q.dot(normal).max(0.) * (-q.dot(facing)).max(0.) / (square * square);
        if value.is_finite() { value } else { 0. }
    };
    (to - from).length() * (at(0.) + 4. * at(0.5) + at(1.)) / 6.
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_agrees_with_quadrature() {
        let receiver = Receiver {
            position: Vec3::new(0.3, 0.1, -0.2),
            normal: Vec3::new(0.2, 0.9, 0.1).normalize(),
            face_normal: Vec3::Y,
        };
        for ends in [
            [Vec3::new(-1., 2., 0.), Vec3::new(1., 2., 0.5)],
            [Vec3::new(-1., 2., 0.), Vec3::new(3., -1., 0.5)],
            [Vec3::new(2., 0.5, 0.), Vec3::new(5., 0.5, 0.)],
        ] {
            let steps = 20_000;
            let sum: f64 = (0..steps)
                .map(|i| {
                    let at = ends[0].lerp(ends[1], (i as f32 + 0.5) / steps as f32);
                    let q = (at - receiver.position).as_dvec3();
                    q.dot(receiver.normal.as_dvec3()).max(0.) / q.length().powi(3)
                })
                .sum();
            let expected = sum * f64::from(ends[0].distance(ends[1])) / f64::from(steps);
            let found = irradiance(&receiver, ends, None);
            assert!(
                (found - expected).abs() < 1e-4 * expected,
                "{found} {expected}"
            );
        }
    }
}
