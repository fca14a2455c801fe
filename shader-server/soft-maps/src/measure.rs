//! Maps and shadow rays on the same receivers: what each costs, and how wrong each is.

use std::time::Instant;

use glam::Vec3;
use rayon::prelude::*;
use rays::{Ray, Recent, World};

use crate::{BuildError, Light, Options, Receiver, SoftMaps, Transition, light::Linear};

/// One way to find visibility, measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row {
    /// Samples on the light: of maps, those there are in the end on all linear lights; rays a receiver.
    pub samples: u32,
    /// Texels of all samples; 0 of rays.
    pub texels: usize,
    /// Seconds to build, on all threads of the pool.
    pub build_s: f64,
    /// Seconds for all receivers, on all threads of the pool.
    pub look_s: f64,
    /// Root mean square of the error of the shares.
    pub rms: f32,
    /// Largest error.
    pub worst: f32,
    /// Share of receivers that are flagged as undersampled.
    pub flagged: f32,
    /// Bytes held.
    pub bytes: usize,
}

impl Row {
    /// Seconds in all.
    #[must_use]
    pub fn total_s(&self) -> f64 {
        self.build_s + self.look_s
    }
}

/// Shares of `light` that reach `receivers`, by `count` stratified shadow rays each: no fewer in full light or full shadow. Strata of a polygon are a grid, so that the next lower square number of rays is taken; `seed` jitters.
#[must_use]
pub fn by_rays(
    world: &World,
    light: &Light,
    receivers: &[Receiver],
    count: u32,
    seed: u64,
) -> Vec<f32> {
    let Ok(source) = Source::new(light) else {
        return vec![0.; receivers.len()];
    };
    let share = |(index, receiver): (usize, &Receiver)| {
        source.share(world, receiver, count, seed ^ (index as u64) << 32)
    };
    let receivers = receivers.par_iter().with_min_len(256);
    receivers.enumerate().map(share).collect()
}

/// Measures shadow rays against `truth`.
#[must_use]
pub fn rays(
    world: &World,
    light: &Light,
    (receivers, truth): (&[Receiver], &[f32]),
    count: u32,
) -> Row {
    let start = Instant::now();
    let shares = by_rays(world, light, receivers, count, 1);
    let look_s = start.elapsed().as_secs_f64();
    let (rms, worst) = error(&shares, truth);
    Row {
        samples: count,
        look_s,
        rms,
        worst,
        ..Row::default()
    }
}

/// Measures maps against `truth`, and gives what they said.
///
/// # Errors
/// The light makes no sense.
pub fn maps(
    world: &World,
    light: &Light,
    (receivers, truth): (&[Receiver], &[f32]),
    options: &Options,
) -> Result<(Row, Vec<f32>), BuildError> {
    let start = Instant::now();
    let maps = SoftMaps::build(world, light, options)?;
    let build_s = start.elapsed().as_secs_f64();
    let mut seen = Vec::new();
    let start = Instant::now();
    maps.fractions(receivers, &mut seen);
    let look_s = start.elapsed().as_secs_f64();
    let shares: Vec<f32> = seen.iter().map(|s| s.share).collect();
    let (rms, worst) = error(&shares, truth);
    let stats = maps.stats();
    let flagged = seen.iter().filter(|s| s.flagged).count();
    let row = Row {
        samples: stats.samples as u32,
        texels: stats.texels,
        build_s,
        look_s,
        rms,
        worst,
        flagged: flagged as f32 / receivers.len().max(1) as f32,
        bytes: stats.bytes,
    };
    Ok((row, shares))
}

/// A measured way, by name, and the shares it gave.
#[derive(Clone, Debug, Default)]
pub struct Measured {
    /// For tables.
    pub name: String,
    /// What it cost and how wrong it was.
    pub row: Row,
    /// Of each receiver.
    pub shares: Vec<f32>,
}

/// Measures shadow rays by numbers of them, then maps with texels of each of `texel_angles`: as the paper has them with two and
/// three samples, with this crate's refinements, and with samples put where they are needed.
///
/// # Errors
/// The light makes no sense.
pub fn compare(
    world: &World,
    light: &Light,
    (receivers, truth): (&[Receiver], &[f32]),
    texel_angles: &[f32],
) -> Result<Vec<Measured>, BuildError> {
    let mut all = Vec::new();
    for count in [4, 9, 16, 36, 64, 144, 256] {
        all.push(Measured {
            name: format!("rays, {count}"),
            row: rays(world, light, (receivers, truth), count),
            shares: Vec::new(),
        });
    }
    for &texel_angle in texel_angles {
        for (name, transition, refinements, samples, max_samples) in [
            ("paper, 2", Transition::Linear, 0, 2, 2),
            ("paper, 3", Transition::Linear, 0, 3, 3),
            ("refined, 2", Transition::Rational, 5, 2, 2),
            ("refined, 3", Transition::Rational, 5, 3, 3),
            ("refined, 2 to 9", Transition::Rational, 5, 2, 9),
        ] {
            let options = Options {
                transition,
                refinements,
                samples,
                max_samples,
                texel_angle,
                max_texels: 1 << 23,
                ..Options::default()
            };
            let (row, shares) = maps(world, light, (receivers, truth), &options)?;
            all.push(Measured {
                name: format!("{name}, {texel_angle}"),
                row,
                shares,
            });
        }
    }
    Ok(all)
}

/// Root mean square and largest of the differences.
fn error(shares: &[f32], truth: &[f32]) -> (f32, f32) {
    let differences = shares.iter().zip(truth).map(|(a, b)| (a - b).abs());
    let (sum, worst) = differences.fold((0f64, 0f32), |(sum, worst), d| {
        (sum + f64::from(d * d), worst.max(d))
    });
    ((sum / shares.len().max(1) as f64).sqrt() as f32, worst)
}

/// A light as rays are aimed at it.
struct Source {
    /// The ends of a segment, or a polygon's corners.
    points: Vec<Vec3>,
    facing: Option<Vec3>,
    ignored: Option<u32>,
    /// For a polygon, the area of the triangles around its first corner up to each.
    areas: Vec<f32>,
}

impl Source {
    fn new(light: &Light) -> Result<Self, BuildError> {
        let edges = light.linear()?;
        let points = match light {
            Light::Segment(ends) => ends.to_vec(),
            Light::Polygon { vertices, .. } => vertices.clone(),
        };
        let first: Option<&Linear> = edges.first();
        let mut areas = vec![];
        for i in 2..points.len() {
            let area = (points[i - 1] - points[0]).cross(points[i] - points[0]);
            areas.push(areas.last().unwrap_or(&0.) + area.length());
        }
        Ok(Self {
            facing: first.and_then(|e| e.facing),
            ignored: first.and_then(|e| e.ignored),
            points,
            areas,
        })
    }

    /// The place at (u, v) in the unit square, which maps evenly onto the light.
    fn place(&self, [u, v]: [f32; 2]) -> Vec3 {
        let Some(all) = self.areas.last() else {
            return self.points[0].lerp(self.points[1], u);
        };
        let at = u * all;
        let triangle = self.areas.iter().take_while(|a| **a < at).count();
        let triangle = triangle.min(self.areas.len() - 1);
        let before = if triangle == 0 {
            0.
        } else {
            self.areas[triangle - 1]
        };
        let along = (at - before) / (self.areas[triangle] - before);
        let out = v.sqrt();
        let [a, b, c] = [0, triangle + 1, triangle + 2].map(|i| self.points[i]);
        a + ((b - a).lerp(c - a, along)) * out
    }

    fn share(&self, world: &World, receiver: &Receiver, count: u32, seed: u64) -> f32 {
        let mut random = seed;
        let mut unit = || {
            // SplitMix64.
            random = random.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let z = (random ^ (random >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
        };
        let side = if self.facing.is_some() {
            count.isqrt().max(1)
        } else {
            1
        };
        let along = count.max(1) / side;
        let (mut seen, mut all) = (0f64, 0f64);
        let mut recent = Recent::default();
        for i in 0..side * along {
            let u = ((i % along) as f32 + unit()) / along as f32;
            let v = ((i / along) as f32 + unit()) / side as f32;
            let place = self.place([u, v]);
            let weight = self.weight(receiver, place);
            all += weight;
            if weight > 0. && self.sees(world, receiver, place, &mut recent) {
                seen += weight;
            }
        }
        if all > 0. { (seen / all) as f32 } else { 0. }
    }

    fn weight(&self, receiver: &Receiver, place: Vec3) -> f64 {
        let q = (place - receiver.position).as_dvec3();
        let square = q.length_squared();
        let cosine = q.dot(receiver.normal.as_dvec3()).max(0.);
        let weight = match self.facing {
            None => cosine / (square * square.sqrt()),
            Some(n) => cosine * (-q.dot(n.as_dvec3())).max(0.) / (square * square),
        };
        if weight.is_finite() { weight } else { 0. }
    }

    fn sees(&self, world: &World, receiver: &Receiver, place: Vec3, recent: &mut Recent) -> bool {
        let towards = place - receiver.position;
        let side = 1f32.copysign(towards.dot(receiver.face_normal));
        let lift = 1e-5 * (receiver.position.abs().max_element() + towards.length());
        let origin = receiver.position + receiver.face_normal * (side * lift);
        let ray = Ray {
            origin,
            direction: place - origin,
        };
        let blocks = |instance, _| Some(instance) != self.ignored;
        world
            .occluder_again(&ray, 1. - 1e-5, recent, blocks)
            .is_none()
    }
}
