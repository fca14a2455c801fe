//! Round bodies along a curve: tails, necks, limbs and horns, smooth or with scales and a crest.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use serde::Deserialize;

use super::builder::{Builder, Corner};
use super::limits::{counts, positive};
use super::params::around;
use super::round::turn;
use crate::path::catmull_rom;

/// How strongly the back turns upwards from ring to ring; 0 would only carry it along.
const UPWARDS: f64 = 0.05;
/// Half the width of the crest, radians about the tube.
const CREST_WIDTH: f64 = 0.16;
/// Edges whose faces' normals differ by more than this many degrees stay sharp in the shading.
const SHARP: f32 = 50.0;

/// A tube's shape. It follows a Catmull-Rom spline through `keys` and ends in a blunt tip, half a radius beyond them.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TubeSpec {
    /// Points of the centre line and the radius there, metres.
    pub(crate) keys: Vec<[f32; 4]>,
    #[serde(default = "around")]
    pub(crate) around: u32,
    /// Rings of facets, equally many between any two keys.
    #[serde(default = "along")]
    pub(crate) along: u32,
    /// Scales that fit about the tube; none at 0.
    #[serde(default)]
    pub(crate) scales: u32,
    /// Height of scales, radii.
    #[serde(default = "relief")]
    pub(crate) relief: f32,
    /// Height of the spikes along its back, radii.
    #[serde(default)]
    pub(crate) crest: f32,
}

fn along() -> u32 {
    96
}

fn relief() -> f32 {
    0.06
}

/// A cross-section.
struct Ring {
    centre: DVec3,
    /// Unit tangent.
    along: DVec3,
    /// Unit direction of the back, perpendicular to the tangent.
    back: DVec3,
    radius: f64,
    /// From start to end, 0 to 1.
    t: f64,
    /// Length so far, in units of the circumference on the way.
    length: f64,
}

/// Makes a tube.
///
/// # Errors
/// What is wrong with which parameter.
pub(super) fn tube(b: &mut Builder, spec: &TubeSpec) -> Result<(), String> {
    check(spec)?;
    let rings = rings(spec)?;
    let around = spec.around;
    let normal = b.normal([0.0, 1.0, 0.0]);
    let mut circles: Vec<Vec<u32>> = Vec::with_capacity(rings.len());
    for ring in &rings {
        let place = |i| b.position(point(spec, ring, i).as_vec3().to_array());
        circles.push((0..around).map(place).collect());
    }
    let mut uvs = Vec::new();
    for ring in &rings {
        uvs.extend((0..=around).map(|i| b.uv([i as f32 / around as f32, ring.length as f32])));
    }
    let corner = |i: u32, j: usize| Corner {
        position: circles[j][(i % around) as usize],
        normal,
        uv: uvs[j * (around as usize + 1) + i as usize],
    };
    for j in 0..rings.len() - 1 {
        for i in 0..around {
            b.quad([
                corner(i, j),
                corner(i + 1, j),
                corner(i + 1, j + 1),
                corner(i, j + 1),
            ]);
        }
    }
    for (j, outwards) in [(0, -0.5), (rings.len() - 1, 0.5)] {
        let ring = &rings[j];
        let tip = ring.centre + ring.along * (outwards * ring.radius);
        let position = b.position(tip.as_vec3().to_array());
        let uv = b.uv([0.5, ring.length as f32]);
        let tip = Corner {
            position,
            normal,
            uv,
        };
        for i in 0..around {
            let (this, next) = (corner(i, j), corner(i + 1, j));
            b.triangle(if outwards < 0.0 {
                [tip, next, this]
            } else {
                [tip, this, next]
            });
        }
    }
    b.smooth(SHARP);
    Ok(())
}

fn check(spec: &TubeSpec) -> Result<(), String> {
    counts(&[("around", spec.around, 3), ("along", spec.along, 1)])?;
    if !(2..=4096).contains(&spec.keys.len()) {
        return Err("keys must be 2 to 4096 points with a radius".into());
    }
    if !spec.keys.iter().flatten().all(|x| x.is_finite()) {
        return Err("keys must be finite".into());
    }
    spec.keys
        .iter()
        .try_for_each(|k| positive("a key's radius", k[3]))?;
    let fits = |v: f32| (0.0..=10.0).contains(&v);
    if spec.scales > 4096 || !fits(spec.relief) || !fits(spec.crest) {
        return Err("scales must be at most 4096, relief and crest 0 to 10".into());
    }
    Ok(())
}

/// Position and radius on the spline, `at` from 0 to the number of keys less one.
fn on_spline(keys: &[[f32; 4]], at: f64) -> (DVec3, f64) {
    let last = keys.len() - 1;
    let piece = (at as usize).min(last - 1);
    let u = (at - piece as f64) as f32;
    let key = |step: usize| keys[(piece + step).saturating_sub(1).min(last)];
    let four = [key(0), key(1), key(2), key(3)];
    let [x, y, z, r]: [f32; 4] = std::array::from_fn(|k| catmull_rom(four.map(|q| q[k]), u));
    // A spline that overshoots could turn the tube inside out.
    let [least, most] = [
        keys[piece][3].min(keys[piece + 1][3]),
        keys[piece][3].max(keys[piece + 1][3]),
    ];
    (
        DVec3::new(x.into(), y.into(), z.into()),
        r.clamp(least, most).into(),
    )
}

fn rings(spec: &TubeSpec) -> Result<Vec<Ring>, String> {
    let keys = (spec.keys.len() - 1) as f64;
    let step = keys / f64::from(spec.along);
    let mut rings: Vec<Ring> = Vec::with_capacity(spec.along as usize + 1);
    for j in 0..=spec.along {
        let at = (f64::from(j) * step).min(keys);
        let (centre, radius) = on_spline(&spec.keys, at);
        let (before, _) = on_spline(&spec.keys, (at - step * 0.25).max(0.0));
        let (after, _) = on_spline(&spec.keys, (at + step * 0.25).min(keys));
        let along = (after - before)
            .try_normalize()
            .ok_or("neighbouring keys must be different points")?;
        let last = rings.last();
        let before = last.map_or(DVec3::Y, |r| r.back + DVec3::Y * UPWARDS);
        let back =
            (before - along * before.dot(along)).normalize_or(along.any_orthonormal_vector());
        let length = last.map_or(0.0, |r| {
            r.length + centre.distance(r.centre) / (PI * (radius + r.radius))
        });
        rings.push(Ring {
            centre,
            along,
            back,
            radius,
            t: at / keys,
            length,
        });
    }
    Ok(rings)
}

/// Where corner `i` of a ring is.
fn point(spec: &TubeSpec, ring: &Ring, i: u32) -> DVec3 {
    let (sin, cos) = turn(i, spec.around);
    let share = f64::from(i) / f64::from(spec.around);
    let mut height = 1.0;
    if spec.scales > 0 {
        let scales = f64::from(spec.scales);
        height += f64::from(spec.relief) * scale(share * scales, ring.length * scales);
    }
    if spec.crest > 0.0 {
        let off = TAU * share.min(1.0 - share) / CREST_WIDTH;
        let spike = 1.0 - (ring.length * 6.0).fract();
        let ends = (PI * ring.t).sin().max(0.0).sqrt();
        height += f64::from(spec.crest) * (1.0 - off).max(0.0) * (0.2 + 0.8 * spike) * ends;
    }
    let side = ring.along.cross(ring.back);
    ring.centre + (ring.back * cos + side * sin) * (ring.radius * height)
}

/// Height, 0 to 1, of round scales in rows half a scale apart, every other row shifted by half a scale.
fn scale(u: f64, v: f64) -> f64 {
    let row = (2.0 * v).floor();
    let height = |row: f64| {
        let shift = 0.5 * (row.rem_euclid(2.0));
        let (x, y) = ((u - shift) - (u - shift).round(), v - 0.5 * row);
        1.0 - (x * x + y * y) / 0.25
    };
    height(row).max(height(row + 1.0)).max(0.0)
}
