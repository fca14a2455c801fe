//! Flat-faced shapes.

use super::builder::{Builder, Corner};

/// An axis-parallel box from `low` to `high`, texture coordinates in metres.
pub(super) fn cuboid(b: &mut Builder, low: [f32; 3], high: [f32; 3]) {
    let mut positions = [0; 8];
    for (i, slot) in positions.iter_mut().enumerate() {
        *slot = b.position(std::array::from_fn(|k| {
            if i >> k & 1 == 1 { high[k] } else { low[k] }
        }));
    }
    let size: [f32; 3] = std::array::from_fn(|k| high[k] - low[k]);
    for axis in 0..3 {
        // Right-handed: (u, v, axis).
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for side in [0, 1] {
            let mut n = [0.0; 3];
            n[axis] = if side == 1 { 1.0 } else { -1.0 };
            let normal = b.normal(n);
            let mut corner = |i: usize, j: usize| Corner {
                position: positions[side << axis | i << u | j << v],
                normal,
                uv: b.uv(face_uv(axis, [i as f32 * size[u], j as f32 * size[v]])),
            };
            let corners = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
            let [a, c, d, e] = corners;
            b.quad(if side == 1 { corners } else { [a, e, d, c] });
        }
    }
}

/// Keeps v upright on the faces that stand.
fn face_uv(axis: usize, [u, v]: [f32; 2]) -> [f32; 2] {
    if axis == 0 { [v, u] } else { [u, v] }
}

/// A rectangle in y = 0 that faces up; u along x, v along -z.
pub(super) fn plane(b: &mut Builder, size: [f32; 2], cells: [u32; 2], repeat: [f32; 2]) {
    let normal = b.normal([0.0, 1.0, 0.0]);
    let mut corners = Vec::new();
    for j in 0..=cells[1] {
        for i in 0..=cells[0] {
            let (u, w) = (i as f32 / cells[0] as f32, j as f32 / cells[1] as f32);
            corners.push(Corner {
                position: b.position([(u - 0.5) * size[0], 0.0, (w - 0.5) * size[1]]),
                normal,
                uv: b.uv([u * repeat[0], (1.0 - w) * repeat[1]]),
            });
        }
    }
    let row = cells[0] + 1;
    for j in 0..cells[1] {
        for i in 0..cells[0] {
            let at = |di: u32, dj: u32| corners[((j + dj) * row + i + di) as usize];
            b.quad([at(0, 0), at(0, 1), at(1, 1), at(1, 0)]);
        }
    }
}
