//! Round solids. Positions are shared across texture seams, so that every edge has its two faces.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::builder::{Builder, Corner};
use crate::geometry::edge_key;

/// Sine and cosine of `i / n` of a turn; quarter turns are exact.
pub(super) fn turn(i: u32, n: u32) -> (f64, f64) {
    let quarters = 4 * u64::from(i % n);
    if quarters.is_multiple_of(n.into()) {
        return [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)]
            [(quarters / u64::from(n)) as usize];
    }
    (f64::from(i % n) / f64::from(n) * TAU).sin_cos()
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

/// `around` meridians and `across` bands from pole to pole about the y axis; a `height` above 0 parts the halves at
/// the equator, where there must then be a circle of latitude.
pub(super) fn sphere(b: &mut Builder, radius: f32, height: f32, around: u32, across: u32) {
    let mut rings = Vec::new();
    for j in 0..=across {
        // From the south pole up; turn() gives half circles exactly.
        let (out, down) = turn(j, across * 2);
        let normal = [if j == 0 || j == across { 0.0 } else { out }, -down];
        let point = |lift: f32| {
            let y = normal[1] * f64::from(radius) + f64::from(lift);
            [(normal[0] * f64::from(radius)) as f32, y as f32]
        };
        let equator = 2 * j == across;
        let lift = if 2 * j < across || equator {
            -height / 2.0
        } else {
            height / 2.0
        };
        rings.push((point(lift), Some(normal)));
        if equator && height > 0.0 {
            rings.push((point(height / 2.0), Some(normal)));
        }
    }
    revolve(b, &rings, false, around);
}

/// A profile turned about the y axis, with normals computed from its facets and split where it bends by more than 40
/// degrees.
pub(super) fn lathe(b: &mut Builder, profile: &[[f32; 2]], ring: bool, around: u32) {
    let rings: Vec<_> = profile.iter().map(|p| (*p, None)).collect();
    revolve(b, &rings, ring, around);
    b.smooth(40.0);
}

/// A point (radius, y) of a profile with its outward normal, if known.
type ProfilePoint = ([f32; 2], Option<[f64; 2]>);

/// Turns a profile, given from the bottom up along the outside, about the y axis.
fn revolve(b: &mut Builder, profile: &[ProfilePoint], ring: bool, around: u32) {
    let up = b.normal([0.0, 1.0, 0.0]);
    let mut circles = Vec::new();
    for ([radius, y], normal) in profile {
        let mut circle = Vec::new();
        for i in 0..if *radius == 0.0 { 1 } else { around } {
            let (sin, cos) = turn(i, around);
            let r = f64::from(*radius);
            let position = b.position([(r * cos) as f32, *y, (r * sin) as f32]);
            let normal = normal
                .map(|[out, up]| b.normal([(out * cos) as f32, up as f32, (out * sin) as f32]));
            circle.push((position, normal.unwrap_or(up)));
        }
        circles.push(circle);
    }
    let bands = if ring {
        profile.len()
    } else {
        profile.len() - 1
    };
    let mut uvs = Vec::new();
    for j in 0..=bands {
        for i in 0..=around {
            uvs.push(b.uv([1.0 - i as f32 / around as f32, j as f32 / bands as f32]));
        }
    }
    let corner = |i: u32, j: usize| {
        let circle = &circles[j % circles.len()];
        let (position, normal) = circle[i as usize % circle.len()];
        Corner {
            position,
            normal,
            uv: uvs[j * (around as usize + 1) + i as usize],
        }
    };
    for j in 0..bands {
        for i in 0..around {
            let (low, low_next) = (corner(i, j), corner(i + 1, j));
            let (high, high_next) = (corner(i, j + 1), corner(i + 1, j + 1));
            if high.position != high_next.position {
                b.triangle([low, high, high_next]);
            }
            if low.position != low_next.position {
                b.triangle([low, high_next, low_next]);
            }
        }
    }
}

/// An icosahedron cut `steps` times; neighbours share their middle points, so it is closed.
pub(super) fn icosphere(b: &mut Builder, radius: f32, steps: u32) {
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let mut points = Vec::new();
    for (x, y) in [
        (-1.0, golden),
        (1.0, golden),
        (-1.0, -golden),
        (1.0, -golden),
    ] {
        points.extend([
            DVec3::new(x, y, 0.0),
            DVec3::new(0.0, x, y),
            DVec3::new(y, 0.0, x),
        ]);
    }
    let mut points: Vec<DVec3> = points.into_iter().map(DVec3::normalize).collect();
    let mut faces = icosahedron_faces(&points);
    for _ in 0..steps {
        let mut middles: HashMap<u64, u32> = HashMap::new();
        let mut middle = |a: u32, c: u32| {
            *middles.entry(edge_key(a, c)).or_insert_with(|| {
                points.push((points[a as usize] + points[c as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        let mut finer = Vec::with_capacity(faces.len() * 4);
        for [a, c, d] in faces {
            let (ac, cd, da) = (middle(a, c), middle(c, d), middle(d, a));
            finer.extend([[a, ac, da], [ac, c, cd], [da, cd, d], [ac, cd, da]]);
        }
        faces = finer;
    }
    let corners: Vec<Corner> = points
        .iter()
        .map(|p| {
            let around = p.z.atan2(p.x) / TAU;
            Corner {
                position: b.position((*p * f64::from(radius)).as_vec3().to_array()),
                normal: b.normal(p.as_vec3().to_array()),
                uv: b.uv([(0.5 - around) as f32, (0.5 + p.y.asin() / PI) as f32]),
            }
        })
        .collect();
    for face in faces {
        b.triangle(face.map(|v| corners[v as usize]));
    }
}

/// Every three corners at the least distance from each other, turned outwards.
fn icosahedron_faces(points: &[DVec3]) -> Vec<[u32; 3]> {
    let near = |a: usize, c: usize| (points[a] - points[c]).length() < 1.2;
    let mut faces = Vec::new();
    for a in 0..12 {
        for c in a + 1..12 {
            for d in c + 1..12 {
                if near(a, c) && near(c, d) && near(d, a) {
                    let out = (points[c] - points[a])
                        .cross(points[d] - points[a])
                        .dot(points[a]);
                    let face = if out > 0.0 { [a, c, d] } else { [a, d, c] };
                    faces.push(face.map(|v| v as u32));
                }
            }
        }
    }
    faces
}
