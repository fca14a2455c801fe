//! What each sample gives.

use glam::Vec3;

use crate::{
    lanes::{GROUP, LANES},
    light::Light,
};

/// Share of a light's unoccluded irradiance that reaches a receiver whose blocked samples are `mask`, in [0, 1].
///
/// Samples weigh as a diffuse light gives: cosine at the receiver, times cosine at a planar light, over squared distance. A
/// receiver without a normal has no cosine. `at` and `normal` in light space. Nothing reaches a receiver that no sample can.
pub(crate) fn share(light: &Light, at: [f32; 3], normal: [f32; 3], set: u32, mask: &[u32]) -> f32 {
    if mask.iter().all(|word| *word == u32::MAX) {
        return 0.;
    }
    let (mut lit, mut all) = ([0f32; LANES], [0f32; LANES]);
    let planar = light.is_planar();
    let has_horizon = normal != [0.; 3];
    for (group, word) in mask.iter().enumerate() {
        for (half, row) in light.group(set, group).iter().enumerate() {
            let seen = !(word >> (half * LANES));
            for lane in 0..LANES {
                let d = [0, 1, 2].map(|axis| row.0[axis][lane] - at[axis]);
                let squared = (d[0] * d[0] + d[1] * d[1]) + d[2] * d[2];
                let cosine = (d[0] * normal[0] + d[1] * normal[1]) + d[2] * normal[2];
                // Both cosines have the distance in them.
                let here = if has_horizon { cosine.max(0.) } else { 1. };
                let there = if planar { -d[2] } else { 1. };
                let weight = here * there / (squared * squared).max(f32::MIN_POSITIVE);
                all[lane] += weight;
                lit[lane] += if seen >> lane & 1 == 1 { weight } else { 0. };
            }
        }
    }
    let sum = |values: [f32; LANES]| values.iter().sum::<f32>();
    let (lit, all) = (sum(lit), sum(all));
    if all > 0. {
        (lit / all).clamp(0., 1.)
    } else {
        0.
    }
}

/// [`share`] for a caller with masks: the receiver's place and unit normal in world space, its set and its mask.
#[must_use]
pub fn share_of_irradiance(
    light: &Light,
    origin: Vec3,
    normal: Vec3,
    set: u32,
    mask: &[u32],
) -> f32 {
    let groups = light.groups();
    if mask.len() < groups {
        return 0.;
    }
    let at = light.to_light(origin.as_dvec3());
    let set = set % light.sampling().sets;
    share(light, at, light.rotate(normal), set, &mask[..groups])
}

/// Share of samples that are not blocked, each counting the same.
#[must_use]
pub fn share_of_samples(mask: &[u32]) -> f32 {
    let blocked: u32 = mask.iter().map(|word| word.count_ones()).sum();
    1. - blocked as f32 / (mask.len() * GROUP).max(1) as f32
}
