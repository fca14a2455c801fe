//! Shadow rays: stratified, adaptive, weighted by what each part of the light contributes.

use glam::DVec3;
use rays::Ray;

use crate::{
    lights::{Emitter, Receiver, Shape, segment, segment_weight},
    random::Stream,
    stage::Stage,
};

use super::{Shadows, Visibility, area};

/// Shadow rays stop short of the light by this share of their length, so that what touches the light does not block it.
const STOP_SHORT: f32 = 1e-5;

/// Visibility by shadow rays.
///
/// Light and dark are told apart by a first set of rays; only where they disagree is the light divided further, around
/// the places where they do. The estimate is the ratio of what is seen to what was asked for, both weighted by the
/// integrand, so that full light and full shadow have no noise.
#[derive(Clone, Copy, Debug)]
pub struct ShadowRays {
    /// Most rays a light and sample; at least 20 are used for an area light.
    pub max_rays: u32,
}

impl Default for ShadowRays {
    fn default() -> Self {
        Self { max_rays: 256 }
    }
}

impl Visibility for ShadowRays {
    fn fraction(
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
            Shape::Polygon(shape) => {
                area::fraction(stage, receiver, shape, self.max_rays, stream, shadows)
            }
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
    let blocker = stage
        .world()
        .occluder_where(&ray, 1. - STOP_SHORT, |instance, face| {
            Some(instance) != light && (instance, face) != own
        });
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
    let at = |s: f64| receiver.position + from.lerp(to, s);
    let probe = |s: f64, shadows: &mut Shadows| {
        let weight = segment_weight(receiver, at(s));
        (weight, sees(stage, receiver, at(s), None, shadows))
    };
    // Pieces as (start, length, weight, seen), and the ends as neighbours of the first and the last.
    let inset = 1. / 256.;
    let ends_seen = [probe(inset, shadows).1, probe(1. - inset, shadows).1];
    let mut pieces = Vec::with_capacity(4 * PIECES);
    for i in 0..PIECES {
        let (start, length) = (i as f64 / PIECES as f64, 1. / PIECES as f64);
        let (weight, seen) = probe(start + length * f64::from(stream.unit()), shadows);
        pieces.push((start, length, weight, seen));
    }
    let mut halves = Vec::with_capacity(4 * PIECES);
    for _ in 0..HALVINGS {
        halves.clear();
        for (i, &(start, length, weight, seen)) in pieces.iter().enumerate() {
            let before = if i == 0 {
                ends_seen[0]
            } else {
                pieces[i - 1].3
            };
            let after = pieces.get(i + 1).map_or(ends_seen[1], |piece| piece.3);
            if seen == before && seen == after {
                halves.push((start, length, weight, seen));
                continue;
            }
            for start in [start, start + 0.5 * length] {
                let length = 0.5 * length;
                let (weight, seen) = probe(start + length * f64::from(stream.unit()), shadows);
                halves.push((start, length, weight, seen));
            }
        }
        if halves.len() == pieces.len() {
            break;
        }
        std::mem::swap(&mut pieces, &mut halves);
    }
    let (mut lit, mut all) = (0., 0.);
    for &(_, length, weight, seen) in &pieces {
        all += length * weight;
        lit += if seen { length * weight } else { 0. };
    }
    if all > 0. { (lit / all) as f32 } else { 0. }
}
