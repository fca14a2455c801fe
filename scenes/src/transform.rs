//! From an object's `translate`, `rotate` and `scale` to a matrix.

use protocol::scene::Affine;

/// `p' = translate + Rz·Ry·Rx·(scale·p)`: turned about x first, then y, then z; angles in degrees, anticlockwise seen
/// from the axis' positive end. Quarter turns are exact.
pub(crate) fn affine(translate: [f32; 3], rotate: [f32; 3], scale: [f32; 3]) -> Affine {
    let [(sx, cx), (sy, cy), (sz, cz)] = rotate.map(sin_cos);
    let r = [
        [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
        [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
        [-sy, cy * sx, cy * cx],
    ];
    std::array::from_fn(|row| {
        std::array::from_fn(|column| match column {
            3 => translate[row],
            // Adding zero turns -0 into 0, so that equal scenes have equal bytes.
            _ => (r[row][column] * f64::from(scale[column])) as f32 + 0.0,
        })
    })
}

/// The map that leaves everything where it is.
pub(crate) const IDENTITY: Affine = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
];

/// `outer` after `inner`; exact where `inner` is [`IDENTITY`].
pub(crate) fn product(outer: &Affine, inner: &Affine) -> Affine {
    std::array::from_fn(|row| {
        std::array::from_fn(|column| {
            let sum: f64 = (0..3)
                .map(|k| f64::from(outer[row][k]) * f64::from(inner[k][column]))
                .sum();
            let moved = if column == 3 {
                f64::from(outer[row][3])
            } else {
                0.0
            };
            (sum + moved) as f32 + 0.0
        })
    })
}

fn sin_cos(degrees: f32) -> (f64, f64) {
    match degrees.rem_euclid(360.0) {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        _ => f64::from(degrees).to_radians().sin_cos(),
    }
}

/// The map applied to a point.
#[cfg(test)]
pub(crate) fn apply(m: &Affine, p: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|i| m[i][0] * p[0] + m[i][1] * p[1] + m[i][2] * p[2] + m[i][3])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_about_x_then_y_then_z() {
        let m = affine([10.0, 0.0, 0.0], [90.0, 90.0, 0.0], [2.0, 1.0, 1.0]);
        // y goes to z about x, then z goes to x about y.
        assert_eq!(apply(&m, [0.0, 1.0, 0.0]), [11.0, 0.0, 0.0]);
        // x is scaled, unmoved about x, then goes to -z about y.
        assert_eq!(apply(&m, [1.0, 0.0, 0.0]), [10.0, 0.0, -2.0]);
        let z = affine([0.0; 3], [0.0, 90.0, 90.0], [1.0; 3]);
        // z goes to x about y, then x goes to y about z.
        assert_eq!(apply(&z, [0.0, 0.0, 1.0]), [0.0, 1.0, 0.0]);
    }

    #[test]
    fn any_rotation_keeps_lengths_and_handedness() {
        let m = affine([0.0; 3], [17.0, -63.0, 231.0], [1.0; 3]);
        let column =
            |c: usize| glam::DVec3::from_array([0, 1, 2].map(|r: usize| f64::from(m[r][c])));
        let (x, y, z) = (column(0), column(1), column(2));
        assert!((x.cross(y) - z).length() < 1e-6);
        assert!((x.length() - 1.0).abs() < 1e-6);
        // The same product, one plain turn after another.
        let one = |axis: usize, d: f32| {
            let mut r = [0.0; 3];
            r[axis] = d;
            affine([0.0; 3], r, [1.0; 3])
        };
        let p = [0.3, -1.2, 0.7];
        let step = apply(
            &one(2, 231.0),
            apply(&one(1, -63.0), apply(&one(0, 17.0), p)),
        );
        for (a, b) in step.into_iter().zip(apply(&m, p)) {
            assert!((a - b).abs() < 1e-6);
        }
        let joined = product(&one(2, 231.0), &product(&one(1, -63.0), &one(0, 17.0)));
        for (a, b) in joined.iter().flatten().zip(m.iter().flatten()) {
            assert!((a - b).abs() < 1e-6);
        }
        assert_eq!(product(&m, &IDENTITY), m);
    }
}
