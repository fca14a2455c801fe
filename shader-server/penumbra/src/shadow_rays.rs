//! The same samples by shadow rays.

use rays::{Ray, Recent, World};

use crate::{
    cast::Scratch,
    caster::Caster,
    lanes::bits,
    mesh::NONE,
    predicate::Pair,
    receivers::{Leaf, Receivers},
};

/// Rays stop short of the light by this share of their length: what touches the light does not block it.
const STOP_SHORT: f32 = 1e-5;

/// Fills in the masks of a leaf that have been begun, by any-hit rays: those of casting, but for rounding. The instances of
/// `world` are those of the caster.
pub(crate) fn trace(
    caster: &Caster,
    world: &World,
    (receivers, leaf): (&Receivers, &Leaf),
    packets: bool,
    scratch: &mut Scratch,
) {
    let groups = caster.light().groups();
    for lane in 0..leaf.len {
        let origin = receivers.origins[leaf.index[lane] as usize];
        let places = caster.light().places(leaf.set[lane]);
        scratch.rays.clear();
        scratch.samples.clear();
        for (group, word) in scratch.masks[lane][..groups].iter().enumerate() {
            for bit in bits(!word) {
                let sample = 32 * group + bit;
                scratch.samples.push(sample as u32);
                scratch.rays.push(Ray {
                    origin,
                    direction: places[sample] - origin,
                });
            }
        }
        scratch.counts.rays += scratch.rays.len() as u64;
        let accept = |ray: usize, instance: u32, face: u32| {
            caster.ignored() != Some(instance)
                && (leaf.own[lane] == NONE || caster.key((instance, face)) != leaf.own[lane])
                && is_opaque(caster, leaf, (lane, scratch.samples[ray]), (instance, face))
        };
        let far = 1. - STOP_SHORT;
        scratch.found.clear();
        if packets {
            world.occluder_each(&scratch.rays, far, accept, &mut scratch.found);
        } else {
            let mut recent = Recent::default();
            for (i, ray) in scratch.rays.iter().enumerate() {
                let blocker = world.occluder_again(ray, far, &mut recent, |instance, face| {
                    accept(i, instance, face)
                });
                scratch.found.push(blocker);
            }
        }
        for (sample, blocker) in scratch.samples.iter().zip(&scratch.found) {
            if let Some(blocker) = blocker {
                scratch.masks[lane][(sample / 32) as usize] |= 1 << (sample % 32);
                let by = (lane as u32, blocker.instance);
                if scratch.blocked.last() != Some(&by) {
                    scratch.blocked.push(by);
                }
            }
        }
    }
}

/// Whether a face is opaque where the ray to a sample meets it.
fn is_opaque(
    caster: &Caster,
    leaf: &Leaf,
    (lane, sample): (usize, u32),
    (instance, face): (u32, u32),
) -> bool {
    let Some(part) = caster.instances().get(instance as usize) else {
        return true;
    };
    let has_map = part
        .mesh
        .alpha
        .as_ref()
        .is_some_and(|a| a.has(face as usize));
    if !has_map {
        return true;
    }
    let polygon = part.mesh.polygon_of_face.get(face as usize).copied();
    let Some(blocker) = polygon.and_then(|polygon| caster.blocker(instance as usize, polygon))
    else {
        return false;
    };
    let place = caster.light().local_sample(leaf.set[lane], sample);
    Pair::new(caster.light(), leaf.point(lane), &blocker)
        .is_some_and(|pair| pair.is_opaque(&part.mesh, blocker.key, &blocker, place))
}
