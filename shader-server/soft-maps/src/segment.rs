//! Irradiance from a linear light, in closed form.

use glam::DVec3;

/// Irradiance at the origin, on a surface of unit normal `normal`, from the segment `from`-`to` of which each metre shines
/// with 1 W/sr in all directions. Never negative; 0 at a point of the segment itself. Units: W/m² per W/(m sr).
///
/// It is the integral of n·q/|q|³ along the part above the horizon, where the integrand's numerator is linear.
#[must_use]
pub fn irradiance(from: DVec3, to: DVec3, normal: DVec3) -> f64 {
    let Some((from, to)) = above_horizon(from, to, normal) else {
        return 0.;
    };
    let length = (to - from).length();
    if length == 0. {
        return 0.;
    }
    let along = (to - from) / length;
    let (start, end) = (from.dot(along), to.dot(along));
    let foot = from - along * start;
    let (across_height, slope) = (foot.dot(normal), along.dot(normal));
    let (near, far) = (from.length(), to.length());
    if near == 0. || far == 0. {
        return 0.;
    }
    // ∫ dτ/(τ²+h²)^{3/2} in two forms: the first divides by nothing that vanishes when the line passes close by.
    let across = if start * end > 0. {
        (end * end - start * start) / (near * far * (end * near + start * far))
    } else {
        let h2 = foot.length_squared();
        if h2 > 0. {
            (end / far - start / near) / h2
        } else {
            0.
        }
    };
    (across_height * across + slope * (1. / near - 1. / far)).max(0.)
}

/// The part of a segment with q·normal ≥ 0.
#[must_use]
pub fn above_horizon(from: DVec3, to: DVec3, normal: DVec3) -> Option<(DVec3, DVec3)> {
    let (a, b) = (from.dot(normal), to.dot(normal));
    match (a >= 0., b >= 0.) {
        (true, true) => Some((from, to)),
        (false, false) => None,
        (true, false) => Some((from, from.lerp(to, a / (a - b)))),
        (false, true) => Some((from.lerp(to, a / (a - b)), to)),
    }
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;

    fn by_quadrature(from: DVec3, to: DVec3, normal: DVec3) -> f64 {
        let n = 200_000;
        let step = (to - from) / f64::from(n);
        (0..n)
            .map(|i| {
                let q = from + step * (f64::from(i) + 0.5);
                q.dot(normal).max(0.) / q.length().powi(3) * step.length()
            })
            .sum()
    }

    #[test]
    fn it_agrees_with_quadrature() {
        let normal = dvec3(0.2, 0.3, 0.9).normalize();
        for (from, to) in [
            (dvec3(-1., 0., 1.), dvec3(1., 0., 1.)),
            (dvec3(0.5, 2., 1.), dvec3(3., 2.5, 0.4)),
            (dvec3(-1., -2., -1.), dvec3(2., 1., 2.)),
            (dvec3(0.1, 0., 0.5), dvec3(0.2, 0., 1.0)),
            (dvec3(0., 0., 1.), dvec3(0., 0., 2.)),
            (dvec3(0., 0., 2.), dvec3(1e-9, 0., 1.)),
        ] {
            let (exact, slow) = (
                irradiance(from, to, normal),
                by_quadrature(from, to, normal),
            );
            assert!(
                (exact - slow).abs() < 2e-6 * slow,
                "{from} {to}: {exact} {slow}"
            );
        }
    }

    #[test]
    fn degenerate_segments_are_finite() {
        for (from, to) in [
            (DVec3::ZERO, DVec3::X),
            (DVec3::Z, DVec3::Z),
            (DVec3::NEG_X, DVec3::X),
            (DVec3::NEG_Z, DVec3::Z),
            (dvec3(1., 0., 0.), dvec3(2., 0., 0.)),
            (dvec3(0., 0., -2.), dvec3(1., 0., -1.)),
        ] {
            let value = irradiance(from, to, DVec3::Z);
            assert!(value.is_finite() && value >= 0., "{from} {to}: {value}");
        }
    }
}
