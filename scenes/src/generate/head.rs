//! A head with an irregular surface, as a scanner would give one: a field of blended ellipsoids, seen from outside along
//! the directions of a cube's lattice, roughened by noise.

use std::collections::HashMap;

use glam::DVec3;
use rayon::prelude::*;
use serde::Deserialize;

use super::builder::{Builder, Corner};
use super::limits::{counts, positive};

/// How far from the middle the search for the surface starts, head heights.
const OUTSIDE: f64 = 1.2;
/// How far a vertex strays from its place in the lattice, cells.
const STRAY: f64 = 0.22;

/// A head's shape; it faces +z and its neck ends below.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct HeadSpec {
    /// From crown to chin, metres; the neck goes on for a sixth of it.
    pub(crate) height: f32,
    /// Cells along each edge of the cube; 12 · cells² triangles.
    #[serde(default = "cells")]
    pub(crate) cells: u32,
    /// Height of the finest roughness, thousandths of the height.
    #[serde(default = "roughness")]
    pub(crate) roughness: f32,
    #[serde(default)]
    pub(crate) seed: u32,
}

fn cells() -> u32 {
    48
}

fn roughness() -> f32 {
    1.0
}

/// An ellipsoid that is added to the head, or taken away from it, with a soft seam. In heads: the skull is 1 high.
struct Lump {
    centre: [f64; 3],
    radii: [f64; 3],
    /// Width of the seam.
    seam: f64,
    hollow: bool,
}

const fn lump(centre: [f64; 3], radii: [f64; 3], seam: f64) -> Lump {
    Lump {
        centre,
        radii,
        seam,
        hollow: false,
    }
}

const fn hollow(centre: [f64; 3], radii: [f64; 3], seam: f64) -> Lump {
    Lump {
        hollow: true,
        ..lump(centre, radii, seam)
    }
}

/// In the order in which they are blended; what has x > 0 has a mirror image. Proportions after the usual canon: eyes at
/// half the height, five eyes to the width, the nose's base and the mouth at a third and two thirds below.
const LUMPS: [Lump; 21] = [
    // Skull: cap and back.
    lump([0.0, 0.16, -0.06], [0.335, 0.345, 0.41], 0.0),
    lump([0.0, 0.02, 0.1], [0.275, 0.34, 0.29], 0.12),
    // Jaw, chin, cheeks.
    lump([0.0, -0.25, 0.14], [0.2, 0.2, 0.22], 0.1),
    lump([0.0, -0.4, 0.26], [0.085, 0.06, 0.07], 0.07),
    lump([0.19, -0.08, 0.2], [0.085, 0.08, 0.1], 0.08),
    lump([0.19, -0.28, 0.04], [0.05, 0.13, 0.1], 0.08),
    // Neck, wider below.
    lump([0.0, -0.45, -0.06], [0.185, 0.34, 0.2], 0.07),
    lump([0.05, -0.66, -0.06], [0.2, 0.1, 0.17], 0.08),
    // Brow, sockets, lids.
    lump([0.1, 0.105, 0.33], [0.1, 0.026, 0.05], 0.05),
    hollow([0.125, 0.03, 0.42], [0.085, 0.05, 0.07], 0.04),
    lump([0.125, 0.03, 0.3], [0.062, 0.05, 0.06], 0.012),
    // Nose: bridge, tip, wings, nostrils.
    lump([0.0, 0.0, 0.385], [0.032, 0.12, 0.055], 0.04),
    lump([0.0, -0.105, 0.435], [0.042, 0.04, 0.05], 0.03),
    lump([0.045, -0.12, 0.395], [0.03, 0.028, 0.036], 0.015),
    hollow([0.025, -0.145, 0.415], [0.012, 0.014, 0.018], 0.01),
    // Mouth: the part between the lips is taken away last.
    lump([0.0, -0.225, 0.35], [0.095, 0.024, 0.04], 0.02),
    lump([0.0, -0.27, 0.345], [0.075, 0.026, 0.042], 0.02),
    hollow([0.0, -0.246, 0.4], [0.09, 0.007, 0.04], 0.012),
    // Ears, with a bowl.
    lump([0.345, 0.0, -0.05], [0.03, 0.115, 0.07], 0.02),
    hollow([0.385, 0.015, -0.035], [0.03, 0.06, 0.035], 0.02),
    // Larynx.
    lump([0.0, -0.53, 0.12], [0.035, 0.05, 0.04], 0.06),
];

/// Makes the head, closed, its middle in the origin.
///
/// # Errors
/// What is wrong with which parameter.
pub(super) fn head(b: &mut Builder, spec: &HeadSpec) -> Result<(), String> {
    positive("height", spec.height)?;
    counts(&[
        ("cells", spec.cells, 2),
        ("cells", spec.cells, 2),
        ("sides", 6, 1),
    ])?;
    if !(0.0..=20.0).contains(&spec.roughness) {
        return Err(format!(
            "roughness = {} must be from 0 to 20",
            spec.roughness
        ));
    }
    let n = spec.cells;
    let mut ids: HashMap<[u32; 3], u32> = HashMap::new();
    let mut lattice = Vec::new();
    let mut quads = Vec::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for side in [0, n] {
            for i in 0..n {
                for j in 0..n {
                    let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(di, dj)| {
                        let mut at = [0; 3];
                        at[axis] = side;
                        at[u] = i + di;
                        at[v] = j + dj;
                        *ids.entry(at).or_insert_with(|| {
                            lattice.push(at);
                            lattice.len() as u32 - 1
                        })
                    });
                    let [a, c, d, e] = corners;
                    quads.push(if side == n { corners } else { [a, e, d, c] });
                }
            }
        }
    }
    let points: Vec<DVec3> = lattice
        .par_iter()
        .map(|&at| surface(direction(at, n, spec.seed), spec))
        .collect();
    let up = b.normal([0.0, 1.0, 0.0]);
    let uv = b.uv([0.0; 2]);
    let corners: Vec<Corner> = points
        .iter()
        .map(|p| Corner {
            position: b.position(p.as_vec3().to_array()),
            normal: up,
            uv,
        })
        .collect();
    for [a, c, d, e] in quads {
        let at = |i: u32| points[i as usize];
        let at_corner = |i: u32| corners[i as usize];
        // The shorter diagonal, as a scanner's triangulation would have it.
        if at(a).distance_squared(at(d)) <= at(c).distance_squared(at(e)) {
            b.quad([a, c, d, e].map(at_corner));
        } else {
            b.quad([c, d, e, a].map(at_corner));
        }
    }
    b.smooth(180.0);
    Ok(())
}

/// Unit direction of a vertex of the lattice, strayed from its place by less than half a cell.
fn direction(at: [u32; 3], n: u32, seed: u32) -> DVec3 {
    let mut random = 0;
    let along = at.map(|i| {
        random += 1;
        // Vertices on the cube's edges stray along them alone, so that neighbouring sides agree.
        let stray = if i == 0 || i == n {
            0.0
        } else {
            STRAY * (2.0 * hash([at[0], at[1], at[2]].map(i64::from), seed + 71 * random) - 1.0)
        };
        let t = 2.0 * (f64::from(i) + stray) / f64::from(n) - 1.0;
        // Equal angles rather than equal steps: cells of more equal size.
        (t * std::f64::consts::FRAC_PI_4).tan()
    });
    DVec3::from_array(along).normalize()
}

/// Where a line from outside towards the middle meets the head first, metres.
fn surface(direction: DVec3, spec: &HeadSpec) -> DVec3 {
    let mut r = OUTSIDE;
    for _ in 0..200 {
        let d = field(direction * r);
        if d < 1e-5 {
            break;
        }
        // The field overestimates distances to flat ellipsoids.
        r -= 0.6 * d;
    }
    let p = direction * r;
    let rough = f64::from(spec.roughness) / 1000.0;
    // Hair from the hairline back: strands, longer than wide.
    let hair = smooth_step(
        0.18,
        0.3,
        p.y - 0.55 * (p.z - 0.05).max(0.0) + 0.1 * (-p.z).max(0.0),
    );
    let strands = noise(
        DVec3::new(p.x * 42.0, p.y * 15.0, p.z * 15.0),
        spec.seed + 5,
    ) + 0.5
        * noise(
            DVec3::new(p.x * 95.0, p.y * 30.0, p.z * 30.0),
            spec.seed + 6,
        );
    let skin = 2.0 * noise(p * 14.0, spec.seed + 1)
        + noise(p * 45.0, spec.seed + 2)
        + 0.6 * noise(p * 130.0, spec.seed + 3);
    let lift = rough * (skin * (1.0 - hair) + hair * (9.0 * strands + 6.0));
    direction * (r + lift) * f64::from(spec.height)
}

/// Distance to the head, roughly; negative within. Blends after the polynomial smooth minimum.
fn field(p: DVec3) -> f64 {
    let p = DVec3::new(p.x.abs(), p.y, p.z);
    let mut d = f64::INFINITY;
    for l in &LUMPS {
        let to = ellipsoid(p - DVec3::from_array(l.centre), DVec3::from_array(l.radii));
        d = if d == f64::INFINITY {
            to
        } else if l.hollow {
            -smooth_min(-d, to, l.seam)
        } else {
            smooth_min(d, to, l.seam)
        };
    }
    // The neck is cut off flat.
    -smooth_min(-d, p.y + 0.62, 0.02)
}

fn ellipsoid(p: DVec3, radii: DVec3) -> f64 {
    let k0 = (p / radii).length();
    let k1 = (p / (radii * radii)).length();
    if k1 == 0.0 {
        -radii.min_element()
    } else {
        k0 * (k0 - 1.0) / k1
    }
}

fn smooth_min(a: f64, b: f64, width: f64) -> f64 {
    let h = (width - (a - b).abs()).max(0.0);
    a.min(b)
        - if width > 0.0 {
            h * h / (4.0 * width)
        } else {
            0.0
        }
}

fn smooth_step(from: f64, to: f64, x: f64) -> f64 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Smooth noise in -1 to 1: values at whole points, blended.
fn noise(p: DVec3, seed: u32) -> f64 {
    let cell = p.floor();
    let f = p - cell;
    let f = f * f * (DVec3::splat(3.0) - 2.0 * f);
    let at = |dx: i64, dy: i64, dz: i64| {
        hash(
            [cell.x as i64 + dx, cell.y as i64 + dy, cell.z as i64 + dz],
            seed,
        )
    };
    let along = |dy, dz| at(0, dy, dz) * (1.0 - f.x) + at(1, dy, dz) * f.x;
    let across = |dz| along(0, dz) * (1.0 - f.y) + along(1, dz) * f.y;
    2.0 * (across(0) * (1.0 - f.z) + across(1) * f.z) - 1.0
}

/// A number in [0, 1) for a whole point (splitmix64's mixer).
fn hash(at: [i64; 3], seed: u32) -> f64 {
    let mut z = u64::from(seed).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    for i in at {
        z = (z ^ i as u64).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
    }
    (z >> 11) as f64 / (1_u64 << 53) as f64
}
