//! Vectors in double precision, and what makes a polygon a light.

use super::Problem;
use crate::limits::{MAX_LIGHT_VERTICES, POLYGON_TOLERANCE};

pub(super) type V = [f64; 3];

pub(super) fn wide(v: [f32; 3]) -> V {
    v.map(f64::from)
}

pub(super) fn sub(a: V, b: V) -> V {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: V, b: V) -> V {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

pub(super) fn length(v: V) -> f64 {
    dot(v, v).sqrt()
}

/// Checks that a polygon is planar and convex and goes round once. Its vertices must be finite.
pub(super) fn convex_polygon(vertices: &[[f32; 3]]) -> Result<(), Problem> {
    super::count(vertices.len(), 3, MAX_LIGHT_VERTICES)?;
    let first = wide(vertices[0]);
    let points: Vec<V> = vertices.iter().map(|&v| sub(wide(v), first)).collect();
    let extent = points.iter().copied().map(length).fold(0.0, f64::max);
    let next = |i: usize| points[(i + 1) % points.len()];
    // Newell's sum is twice the area along the normal, and exact enough for any vertex order.
    let newell = (0..points.len()).fold([0.0; 3], |sum: V, i| {
        let c = cross(points[i], next(i));
        [sum[0] + c[0], sum[1] + c[1], sum[2] + c[2]]
    });
    let twice_area = length(newell);
    // Written so that a zero or undefined extent is refused too.
    let area_there = twice_area > POLYGON_TOLERANCE * POLYGON_TOLERANCE * extent * extent;
    if extent <= 0.0 || !area_there {
        return Err(Problem::Other("the polygon has no area"));
    }
    let normal = newell.map(|c| c / twice_area);
    let slack = POLYGON_TOLERANCE * extent;
    if points.iter().any(|&p| dot(p, normal).abs() > slack) {
        return Err(Problem::Other("the polygon is not planar"));
    }
    let mut turned = 0.0;
    for (i, &point) in points.iter().enumerate() {
        let along = sub(next(i), point);
        let after = sub(next(i + 1), next(i));
        if length(along) <= 0.0 {
            return Err(Problem::Other("the polygon has an edge without length"));
        }
        let turn = dot(cross(along, after), normal);
        // How far the vertex is dented: the distance from the line through its neighbours.
        let across = length(sub(next(i + 1), point));
        if turn < -slack * across {
            return Err(Problem::Other("the polygon is not convex"));
        }
        turned += turn.atan2(dot(along, after));
    }
    if (turned - std::f64::consts::TAU).abs() > 0.1 {
        return Err(Problem::Other("the polygon winds round more than once"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring(n: usize, step: usize) -> Vec<[f32; 3]> {
        (0..n)
            .map(|i| {
                let angle = (i * step) as f32 / n as f32 * std::f32::consts::TAU;
                [3.0 + angle.cos(), 2.0, -1.0 + angle.sin()]
            })
            .collect()
    }

    #[test]
    fn convex_polygons_pass_either_way_round() {
        for n in [3, 4, 5, 100] {
            let mut polygon = ring(n, 1);
            convex_polygon(&polygon).unwrap();
            polygon.reverse();
            convex_polygon(&polygon).unwrap();
        }
        let with_straight_corner = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [2.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
        ];
        convex_polygon(&with_straight_corner).unwrap();
    }

    #[test]
    fn other_polygons_are_refused() {
        let bad: [&[[f32; 3]]; 7] = [
            &[],
            &[[0.0; 3], [1.0, 0.0, 0.0]],
            &[[0.0; 3]; 4],
            &[[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]],
            &[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 0.1, 1.0], [0.0, 0.0, 1.0]],
            &[[0.0; 3], [2.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.0, 2.0, 0.0]],
            &[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]],
        ];
        for polygon in bad {
            assert!(convex_polygon(polygon).is_err(), "{polygon:?}");
        }
        assert_eq!(
            convex_polygon(&ring(5, 2)),
            Err(Problem::Other("the polygon winds round more than once"))
        );
    }
}
