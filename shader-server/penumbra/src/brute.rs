//! Every receiver against every polygon and every sample: the measure of the other ways.

use crate::{
    blocker::ALPHA,
    caster::Caster,
    lanes::GROUP,
    predicate::{Pair, horizon},
    receivers::{Point, Receivers},
};

/// A mask a receiver, one bit a sample, set where the sample is blocked: all by the same predicate.
#[must_use]
pub fn masks(caster: &Caster, receivers: &Receivers) -> Vec<u32> {
    let groups = caster.light().groups();
    let mut masks = vec![0; groups * receivers.len()];
    for (index, mask) in masks.chunks_mut(groups).enumerate() {
        let point = Point::new(caster.light(), receivers, index, |own| caster.key(own));
        fill(caster, &point, mask);
    }
    masks
}

fn fill(caster: &Caster, point: &Point, mask: &mut [u32]) {
    let light = caster.light();
    if !point.may_see(light) {
        mask.fill(u32::MAX);
        return;
    }
    let mut block = |sample: usize| mask[sample / GROUP] |= 1 << (sample % GROUP);
    let places: Vec<[f32; 3]> = (0..light.sampling().samples)
        .map(|sample| light.local_sample(point.set, sample))
        .collect();
    if point.normal != [0.; 3] {
        let horizon = horizon(point.at, point.normal);
        for (sample, place) in places.iter().enumerate() {
            if horizon.value(*place) < horizon.least {
                block(sample);
            }
        }
    }
    for (instance, part) in caster.parts.iter().enumerate() {
        let mesh = &caster.instances()[instance].mesh;
        for blocker in part.blockers.iter().filter(|b| b.key != point.own) {
            let Some(pair) = Pair::new(light, point.at, blocker) else {
                continue;
            };
            let polygon = caster.polygon(instance, blocker);
            for (sample, place) in places.iter().enumerate() {
                if pair.blocks(*place)
                    && (blocker.flags & ALPHA == 0
                        || pair.is_opaque(mesh, polygon, blocker, *place))
                {
                    block(sample);
                }
            }
        }
    }
}
