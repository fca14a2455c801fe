//! Flat-faced shapes.

use std::collections::HashMap;

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

/// A slab with rectangular openings, in one closed piece.
pub(super) fn wall(b: &mut Builder, size: [f32; 3], openings: &[[f32; 4]], cell: f32) {
    let lines = |end: f32, ends: &mut dyn Iterator<Item = f32>| {
        let mut lines: Vec<f32> = [0.0, end].into_iter().chain(ends).collect();
        lines.sort_by(f32::total_cmp);
        lines.dedup();
        cut(&lines, cell)
    };
    let xs = lines(size[0], &mut openings.iter().flat_map(|o| [o[0], o[2]]));
    let ys = lines(size[1], &mut openings.iter().flat_map(|o| [o[1], o[3]]));
    let filled = |i: usize, j: usize| {
        let (x, y) = (0.5 * (xs[i] + xs[i + 1]), 0.5 * (ys[j] + ys[j + 1]));
        !openings
            .iter()
            .any(|o| o[0] < x && x < o[2] && o[1] < y && y < o[3])
    };
    slab(b, &xs, &ys, size[2] / 2.0, filled, |x, y, z| [x, y, z]);
}

/// A lattice in y = 0.
pub(super) fn bars(b: &mut Builder, size: [f32; 2], bars: [u32; 2], width: f32, thickness: f32) {
    let lines = |size: f32, n: u32| {
        let step = (size - width) / (n - 1) as f32;
        let starts = (0..n).map(move |i| i as f32 * step - size / 2.0);
        starts.flat_map(|s| [s, s + width]).collect::<Vec<f32>>()
    };
    let xs = lines(size[0], bars[0]);
    let zs = lines(size[1], bars[1]);
    let filled = |i: usize, j: usize| i.is_multiple_of(2) || j.is_multiple_of(2);
    // (x, y, z) to (x, z, -y) keeps the orientation.
    slab(b, &xs, &zs, thickness / 2.0, filled, |x, y, z| [x, z, -y]);
}

/// Gap between the two layers of crossed bars, of their thickness.
const HAIR: f32 = 0.02;

/// Bars along z about y = 0, and bars along x that lie on them.
pub(super) fn crossed_bars(
    b: &mut Builder,
    size: [f32; 2],
    bars: [u32; 2],
    [width, thickness]: [f32; 2],
    cells: u32,
) {
    let half = thickness / 2.0;
    for (axis, count) in bars.into_iter().enumerate() {
        let step = (size[axis] - width) / (count - 1) as f32;
        let length = size[1 - axis];
        let along: Vec<f32> = (0..=cells)
            .map(|i| (i as f32 / cells as f32 - 0.5) * length)
            .collect();
        let height = axis as f32 * thickness * (1.0 + HAIR);
        for bar in 0..count {
            let start = bar as f32 * step - size[axis] / 2.0;
            let across = [start, start + width];
            let first = b.positions();
            let (xs, ys) = if axis == 0 {
                (&across[..], &along[..])
            } else {
                (&along[..], &across[..])
            };
            slab(b, xs, ys, half, |_, _| true, |x, y, z| [x, z, -y]);
            b.lift(first, height);
        }
    }
}

/// The lines and as many between them as keep each gap within `cell`.
fn cut(lines: &[f32], cell: f32) -> Vec<f32> {
    let mut out = vec![lines[0]];
    for w in lines.windows(2) {
        let n = ((w[1] - w[0]) / cell).ceil().max(1.0) as u32;
        out.extend((1..n).map(|i| w[0] + (w[1] - w[0]) * i as f32 / n as f32));
        out.push(w[1]);
    }
    out
}

/// The filled cells of a grid in x and y, from z = -half to half, turned by `place`; texture coordinates in metres.
fn slab(
    b: &mut Builder,
    xs: &[f32],
    ys: &[f32],
    half: f32,
    filled: impl Fn(usize, usize) -> bool,
    place: impl Fn(f32, f32, f32) -> [f32; 3],
) {
    let (nx, ny) = (xs.len() - 1, ys.len() - 1);
    let inside = |i: Option<usize>, j: Option<usize>| match (i, j) {
        (Some(i), Some(j)) => i < nx && j < ny && filled(i, j),
        _ => false,
    };
    let mut made: HashMap<[usize; 3], u32> = HashMap::new();
    let directions = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let normals = directions.map(|d| {
        let n = place(d[0], d[1], d[2]);
        [b.normal(n.map(|x| -x)), b.normal(n)]
    });
    let mut face = |axis: usize, side: usize, grid: [[usize; 3]; 4]| {
        let corners = grid.map(|[i, j, k]| {
            let (x, y, z) = (xs[i], ys[j], if k == 0 { -half } else { half });
            let position = *made
                .entry([i, j, k])
                .or_insert_with(|| b.position(place(x, y, z)));
            let uv = match axis {
                0 => [z, y],
                1 => [x, z],
                _ => [x, y],
            };
            Corner {
                position,
                normal: normals[axis][side],
                uv: b.uv(uv),
            }
        });
        b.quad(corners);
    };
    for i in 0..nx {
        for j in 0..ny {
            if !filled(i, j) {
                continue;
            }
            let (i1, j1) = (i + 1, j + 1);
            face(2, 1, [[i, j, 1], [i1, j, 1], [i1, j1, 1], [i, j1, 1]]);
            face(2, 0, [[i, j, 0], [i, j1, 0], [i1, j1, 0], [i1, j, 0]]);
            if !inside(Some(i1), Some(j)) {
                face(0, 1, [[i1, j, 0], [i1, j1, 0], [i1, j1, 1], [i1, j, 1]]);
            }
            if !inside(i.checked_sub(1), Some(j)) {
                face(0, 0, [[i, j, 0], [i, j, 1], [i, j1, 1], [i, j1, 0]]);
            }
            if !inside(Some(i), Some(j1)) {
                face(1, 1, [[i, j1, 0], [i, j1, 1], [i1, j1, 1], [i1, j1, 0]]);
            }
            if !inside(Some(i), j.checked_sub(1)) {
                face(1, 0, [[i, j, 0], [i1, j, 0], [i1, j, 1], [i, j, 1]]);
            }
        }
    }
}
