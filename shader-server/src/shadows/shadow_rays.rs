//! Shadow rays: stratified, adaptive, weighted by what each part of the light contributes.

use glam::DVec3;
use rays::{Ray, Recent};

use crate::{
    lights::{Emitter, Receiver, Shape, segment},
    random::Stream,
    stage::Stage,
};

use super::{Asked, Shadows, Visibility, area};

/// Shadow rays stop short of the light by this share of their length, so that what touches the light does not block it.
pub(super) const STOP_SHORT: f32 = 1e-5;

/// Visibility by shadow rays.
///
/// Light and dark are told apart by a first set of rays; only where they disagree is the light divided further, around
/// the places where they do. The estimate is the ratio of what is seen to what was asked for, both weighted by the
/// integrand, so that full light and full shadow have no noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShadowRays {
    /// Most rays a light and sample, but for the first ones.
    pub max_rays: u32,
    /// Strata a side that an area light is divided into at first, at most 32; each gets a ray, and so do the corners.
    pub strata: u32,
    /// Most faces between a receiver and an area light that are drawn onto the light instead of being met by rays.
    pub drawn_faces: u32,
}

impl Default for ShadowRays {
    fn default() -> Self {
        Self {
            max_rays: 256,
            strata: 5,
            drawn_faces: 192,
        }
    }
}

impl Visibility for ShadowRays {
    fn batch(&self) -> usize {
        1
    }

    fn ask(&self, stage: &Stage, light: usize, asked: &mut [Asked], shadows: &mut Shadows) {
        let emitter = &stage.emitters()[light];
        for asked in asked {
            // Which blocker is found must not depend on what was asked before.
            shadows.recent = Recent::default();
            let stream = &mut asked.stream;
            asked.seen = self.fraction(stage, emitter, &asked.receiver, stream, shadows);
            shadows.met_from(asked.receiver.instance);
        }
    }
}

impl ShadowRays {
    /// The share of `light`'s unoccluded irradiance that reaches `receiver`, in [0, 1]. Adds to `shadows` what blocks.
    pub fn fraction(
        &self,
        stage: &Stage,
        light: &Emitter,
        receiver: &Receiver,
        stream: &mut Stream,
        shadows: &mut Shadows,
    ) -> f32 {
        match &light.shape {
            Shape::Point(position) => {
                f32::from(u8::from(sees(stage, receiver, *position, None, shadows)))
            }
            Shape::Segment(from, to) => {
                segment_fraction(stage, receiver, [*from, *to], stream, shadows)
            }
            Shape::Polygon(shape) => area::fraction(stage, receiver, shape, self, stream, shadows),
        }
    }
}

/// Whether nothing but instance `light` is between `receiver` and `target`.
pub(super) fn sees(
    stage: &Stage,
    receiver: &Receiver,
    target: DVec3,
    light: Option<u32>,
    shadows: &mut Shadows,
) -> bool {
    let towards = (target - receiver.position).as_vec3();
    let side = if towards.dot(receiver.face_normal) < 0. {
        -1.
    } else {
        1.
    };
    let lift = receiver.face_normal * (side * receiver.clearance);
    let origin = receiver.position.as_vec3() + lift;
    let ray = Ray {
        origin,
        direction: target.as_vec3() - origin,
    };
    shadows.rays += 1;
    let own = (receiver.instance, receiver.face);
    let accept = |instance, face| Some(instance) != light && (instance, face) != own;
    let recent = &mut shadows.recent;
    let blocker = stage
        .world()
        .occluder_again(&ray, 1. - STOP_SHORT, recent, accept);
    if let Some(blocker) = blocker {
        shadows.block(blocker.instance);
    }
    blocker.is_none()
}

/// Pieces that a segment is divided into at first, and how often pieces at a change are halved.
const PIECES: usize = 8;
const HALVINGS: u32 = 5;

fn segment_fraction(
    stage: &Stage,
    receiver: &Receiver,
    ends: [DVec3; 2],
    stream: &mut Stream,
    shadows: &mut Shadows,
) -> f32 {
    let normal = receiver.normal;
    let [from, to] = ends.map(|end| end - receiver.position);
    let Some((from, to)) = segment::above_horizon(from, to, normal) else {
        return 0.;
    };
    let from_receiver = |s: f64| from.lerp(to, s);
    let probe = |s: f64, shadows: &mut Shadows| {
        sees(
            stage,
            receiver,
            receiver.position + from_receiver(s),
            None,
            shadows,
        )
    };
    // Pieces as (start, length, seen); the ends are neighbours of the first and the last.
    let inset = 1. / 256.;
    let ends = [probe(inset, shadows), probe(1. - inset, shadows)];
    let ask = |start: f64, length: f64, stream: &mut Stream, shadows: &mut Shadows| {
        (
            start,
            length,
            probe(start + length * f64::from(stream.unit()), shadows),
        )
    };
    let length = 1. / PIECES as f64;
    let mut pieces: Vec<(f64, f64, bool)> = (0..PIECES)
        .map(|i| ask(i as f64 * length, length, stream, shadows))
        .collect();
    for _ in 0..HALVINGS {
        let mut halves = Vec::with_capacity(pieces.len() + 4);
        for (i, &(start, length, seen)) in pieces.iter().enumerate() {
            let before = if i == 0 { ends[0] } else { pieces[i - 1].2 };
            let after = pieces.get(i + 1).map_or(ends[1], |piece| piece.2);
            if seen == before && seen == after {
                halves.push((start, length, seen));
            } else {
                let half = 0.5 * length;
                halves.push(ask(start, half, stream, shadows));
                halves.push(ask(start + half, half, stream, shadows));
            }
        }
        let done = halves.len() == pieces.len();
        pieces = halves;
        if done {
            break;
        }
    }
    if pieces.iter().all(|piece| piece.2 == pieces[0].2) {
        return f32::from(u8::from(pieces[0].2));
    }
    // Every piece weighs what it gives, in closed form: no noise but visibility's.
    let (mut lit, mut all) = (0., 0.);
    for (start, length, seen) in pieces {
        let [a, b] = [from_receiver(start), from_receiver(start + length)];
        let weight = segment::irradiance(a, b, normal);
        all += weight;
        lit += if seen { weight } else { 0. };
    }
    if all > 0. { (lit / all) as f32 } else { 0. }
}
