//! Round solids. Positions are shared across texture seams, so that every edge has its two faces.

use std::f64::consts::TAU;

use super::builder::{Builder, Corner};

/// Sine and cosine of `i / n` of a turn; quarter turns are exact.
pub(super) fn turn(i: u32, n: u32) -> (f64, f64) {
    let i = i % n;
    match (4 * u64::from(i)).checked_rem(n.into()) {
        Some(0) => [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)]
            [(4 * u64::from(i) / u64::from(n)) as usize],
        _ => (f64::from(i) / f64::from(n) * TAU).sin_cos(),
    }
}

/// A ring about the y axis: `around` segments of a tube with `across` sides, two triangles each.
pub(super) fn torus(b: &mut Builder, major: f32, minor: f32, around: u32, across: u32) {
    let (major, minor) = (f64::from(major), f64::from(minor));
    let mut vertices = Vec::new();
    for i in 0..around {
        let (sin, cos) = turn(i, around);
        for j in 0..across {
            let (up, out) = turn(j, across);
            let radius = major + minor * out;
            let position = b.position([
                (radius * cos) as f32,
                (minor * up) as f32,
                (radius * sin) as f32,
            ]);
            let normal = b.normal([(out * cos) as f32, up as f32, (out * sin) as f32]);
            vertices.push((position, normal));
        }
    }
    let mut uvs = Vec::new();
    for i in 0..=around {
        for j in 0..=across {
            uvs.push(b.uv([i as f32 / around as f32, j as f32 / across as f32]));
        }
    }
    let corner = |i: u32, j: u32| {
        let (position, normal) = vertices[((i % around) * across + j % across) as usize];
        Corner {
            position,
            normal,
            uv: uvs[(i * (across + 1) + j) as usize],
        }
    };
    for i in 0..around {
        for j in 0..across {
            b.quad([
                corner(i, j),
                corner(i, j + 1),
                corner(i + 1, j + 1),
                corner(i + 1, j),
            ]);
        }
    }
}

/// `around` meridians and `across` bands from pole to pole about the y axis.
pub(super) fn sphere(b: &mut Builder, radius: f32, around: u32, across: u32) {
    let mut rings = Vec::new();
    for j in 0..=across {
        // Half turns: j of 2·across is j/across of pi.
        let (out, down) = turn(j, across * 2);
        let mut ring = Vec::new();
        let pole = j == 0 || j == across;
        for i in 0..if pole { 1 } else { around } {
            let (sin, cos) = turn(i, around);
            let out = if pole { 0.0 } else { out };
            let n = [out * cos, down, out * sin];
            let position = b.position(n.map(|x| (x * f64::from(radius)) as f32));
            ring.push((position, b.normal(n.map(|x| x as f32))));
        }
        rings.push(ring);
    }
    let mut uvs = Vec::new();
    for j in 0..=across {
        for i in 0..=around {
            let v = 1.0 - j as f32 / across as f32;
            uvs.push(b.uv([1.0 - i as f32 / around as f32, v]));
        }
    }
    let corner = |i: u32, j: u32| {
        let ring = &rings[j as usize];
        let (position, normal) = ring[i as usize % ring.len()];
        Corner {
            position,
            normal,
            uv: uvs[(j * (around + 1) + i) as usize],
        }
    };
    for j in 0..across {
        for i in 0..around {
            let (a, c) = (corner(i, j), corner(i + 1, j));
            let (d, e) = (corner(i, j + 1), corner(i + 1, j + 1));
            if j > 0 {
                b.triangle([a, c, e]);
            }
            if j + 1 < across {
                b.triangle([a, e, d]);
            }
        }
    }
}
