//! Irradiance from a uniform polygon, in closed form.

use glam::DVec3;

/// Irradiance at the origin, on a surface of unit normal `normal`, from a polygon of radiance 1 with its `vertices` in order.
///
/// Lambert's formula after clipping to the horizon: half the sum over edges of the angle an edge subtends, times the
/// cosine of its plane's normal. Angles come from `atan2`, which keeps its accuracy for thin and for wide angles.
/// Never negative, never NaN for finite input, whichever way the vertices run. Units: W/m² per W/(m² sr), at most π.
#[must_use]
pub fn irradiance(vertices: impl Iterator<Item = DVec3> + Clone, normal: DVec3) -> f64 {
    let mut sum = 0.;
    let mut first: Option<DVec3> = None;
    let mut last: Option<DVec3> = None;
    let mut add = |v: DVec3| {
        if let Some(previous) = last {
            sum += edge(previous, v, normal);
        }
        first.get_or_insert(v);
        last = Some(v);
    };

    let mut previous: Option<(DVec3, f64)> = None;
    let start = vertices.clone().next();
    let closed = vertices.chain(start);
    for vertex in closed {
        let height = vertex.dot(normal);
        if let Some((from, below)) = previous
            && (below < 0.) != (height < 0.)
        {
            add(from.lerp(vertex, below / (below - height)));
        }
        if height >= 0. {
            add(vertex);
        }
        previous = Some((vertex, height));
    }
    // The closing vertex was added twice if it is above the horizon: that edge has no length and counts nothing.
    if let (Some(first), Some(last)) = (first, last) {
        sum += edge(last, first, normal);
    }
    (0.5 * sum).abs()
}

fn edge(from: DVec3, to: DVec3, normal: DVec3) -> f64 {
    let cross = from.cross(to);
    let sine = cross.length();
    if sine > 0. {
        sine.atan2(from.dot(to)) * cross.dot(normal) / sine
    } else {
        0.
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use glam::dvec3;

    use super::*;

    fn factor(vertices: &[DVec3], normal: DVec3) -> f64 {
        irradiance(vertices.iter().copied(), normal) / PI
    }

    fn rectangle(a: f64, b: f64, h: f64) -> [DVec3; 4] {
        [
            dvec3(0., 0., h),
            dvec3(a, 0., h),
            dvec3(a, b, h),
            dvec3(0., b, h),
        ]
    }

    #[test]
    fn rectangles_agree_with_the_catalogue() {
        let corner = factor(&rectangle(1., 2., 1.5), DVec3::Z);
        assert!((corner - 0.122_359_661_642).abs() < 1e-12, "{corner}");
        let centred = rectangle(2., 2., 1.).map(|v| v - dvec3(1., 1., 0.));
        let factor = factor(&centred, DVec3::Z);
        assert!((factor - 0.554_126_423_980).abs() < 1e-12, "{factor}");
    }

    #[test]
    fn scale_and_orientation_change_nothing() {
        let expected = factor(&rectangle(1., 2., 1.5), DVec3::Z);
        for scale in [1e-6, 1e6] {
            let mut scaled = rectangle(1., 2., 1.5).map(|v| v * scale);
            assert!((factor(&scaled, DVec3::Z) - expected).abs() < 1e-12 * expected.max(1.));
            scaled.reverse();
            assert!((factor(&scaled, DVec3::Z) - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn a_fine_polygon_is_a_disc() {
        let n = 4096;
        let disc: Vec<DVec3> = (0..n)
            .map(|i| {
                let angle = 2. * PI * f64::from(i) / f64::from(n);
                dvec3(angle.cos(), angle.sin(), 2.)
            })
            .collect();
        assert!((factor(&disc, DVec3::Z) - 0.199_999_94).abs() < 1e-8);
    }

    #[test]
    fn the_horizon_cuts() {
        // A wall from far below to far above the horizon gives what its upper half gives.
        let wall = |low: f64| {
            [
                dvec3(1., -1., low),
                dvec3(1., 1., low),
                dvec3(1., 1., 3.),
                dvec3(1., -1., 3.),
            ]
        };
        let whole = factor(&wall(-5.), DVec3::Z);
        let upper = factor(&wall(0.), DVec3::Z);
        assert!((whole - upper).abs() < 1e-14 && whole > 0.1);
        assert_eq!(
            factor(&wall(-5.).map(|v| v - dvec3(0., 0., 4.)), DVec3::Z),
            0.
        );
        // A closed box around the point: the upper hemisphere is all light.
        let mut total = 0.;
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            for side in [axis, -axis] {
                let (u, v) = side.any_orthonormal_pair();
                let face = [side + u + v, side + u - v, side - u - v, side - u + v];
                total += factor(&face, dvec3(0.3, -0.5, 0.8).normalize());
            }
        }
        assert!((total - 1.).abs() < 1e-12, "{total}");
    }

    #[test]
    fn degenerate_positions_are_finite() {
        let polygon = rectangle(1., 1., 0.);
        for shift in [
            dvec3(0.5, 0.5, 0.),
            dvec3(0., 0., 0.),
            dvec3(0.5, 0., 0.),
            dvec3(3., 0., 0.),
        ] {
            for normal in [DVec3::Z, DVec3::NEG_Z, DVec3::X, dvec3(0., 0.6, 0.8)] {
                let value = factor(&polygon.map(|v| v - shift), normal);
                assert!(
                    value.is_finite() && (0. ..=1.).contains(&value),
                    "{shift} {normal}: {value}"
                );
            }
        }
        assert_eq!(factor(&[], DVec3::Z), 0.);
        assert_eq!(factor(&[DVec3::Z; 3], DVec3::Z), 0.);
        let sliver = [dvec3(0., 0., 1.), dvec3(1., 0., 1.), dvec3(1., 1e-12, 1.)];
        let value = factor(&sliver, DVec3::Z);
        assert!((0. ..1e-11).contains(&value));
    }
}
