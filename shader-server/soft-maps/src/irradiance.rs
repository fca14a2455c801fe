//! What a part of a linear light gives a receiver if nothing is in between.

use glam::{DVec3, Vec3};

use crate::Receiver;

/// Irradiance at `receiver` from the segment `from`-`to`, for 1 W/sr a metre; W/m² per W/(m sr).
///
/// With `facing` the segment is an edge of a polygon and shines by the cosine to that normal; the integral is then
/// Simpson's, since only the shares of such parts are used.
pub(crate) fn irradiance(receiver: &Receiver, ends: [Vec3; 2], facing: Option<Vec3>) -> f64 {
    let normal = receiver.normal.as_dvec3();
    let position = receiver.position.as_dvec3();
    let [from, to] = ends.map(|end| end.as_dvec3() - position);
    let Some([from, to]) = above_horizon(from, to, normal) else {
        return 0.;
    };
    let length = (to - from).length();
    if length == 0. {
        return 0.;
    }
    match facing {
        None => isotropic(from, to, length, normal),
        Some(facing) => {
            let facing = facing.as_dvec3();
            let at = |s: f64| {
                let q = from.lerp(to, s);
                let square = q.length_squared();
                let value = q.dot(normal).max(0.) * (-q.dot(facing)).max(0.) / (square * square);
                if value.is_finite() { value } else { 0. }
            };
            length * (at(0.) + 4. * at(0.5) + at(1.)) / 6.
        }
    }
}

/// The integral of n·q/|q|³ along a segment above the horizon, in closed form.
fn isotropic(from: DVec3, to: DVec3, length: f64, normal: DVec3) -> f64 {
    let along = (to - from) / length;
    let (start, end) = (from.dot(along), to.dot(along));
    let foot = from - along * start;
    let (near, far) = (from.length(), to.length());
    if near == 0. || far == 0. {
        return 0.;
    }
    // ∫ dτ/(τ²+h²)^{3/2} in two forms: the first divides by nothing that vanishes when the line passes close by.
    let across = if start * end > 0. {
        (end * end - start * start) / (near * far * (end * near + start * far))
    } else {
        let square = foot.length_squared();
        if square > 0. {
            (end / far - start / near) / square
        } else {
            0.
        }
    };
    (foot.dot(normal) * across + along.dot(normal) * (1. / near - 1. / far)).max(0.)
}

/// The part of a segment with q·normal ≥ 0.
fn above_horizon(from: DVec3, to: DVec3, normal: DVec3) -> Option<[DVec3; 2]> {
    let (a, b) = (from.dot(normal), to.dot(normal));
    match (a >= 0., b >= 0.) {
        (true, true) => Some([from, to]),
        (false, false) => None,
        (true, false) => Some([from, from.lerp(to, a / (a - b))]),
        (false, true) => Some([from.lerp(to, a / (a - b)), to]),
    }
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
