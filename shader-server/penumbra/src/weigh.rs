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
                let distance = squared.sqrt();
                let here = if has_horizon {
                    cosine.max(0.)
                } else {
                    distance
                };
                let there = if planar { -d[2] } else { distance };
                // Each cosine has the distance in it.
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

/// Share of a light's unoccluded irradiance that reaches a receiver, in [0, 1], for a caller with masks: by the receiver's place and unit
/// normal in world space, its set and its mask. Samples weigh as a diffuse light gives.
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

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;
    use crate::light::{Sampling, Shape};

    /// From a line at height h over a receiver the part between u₀ and u₁ gives ∫ h / (h² + u²)^1.5 du, which is
    /// [u / √(h² + u²)] / h.
    #[test]
    fn parts_of_a_line_weigh_as_they_shine() {
        let (height, from, to, at) = (2f64, -1., 3., 0.7);
        let ends = vec![dvec3(from, height, 0.), dvec3(to, height, 0.)];
        let sampling = Sampling {
            samples: 1024,
            ..Sampling::default()
        };
        let light = Light::new(Shape::Polygon(ends), sampling).expect("a line");
        let origin = Vec3::new(at as f32, 0., 0.);
        let middle = light.to_light(dvec3(0., height, 0.));
        // Samples at x < 0 are blocked.
        let mask: Vec<u32> = (0..light.groups())
            .map(|group| {
                let rows = light.group(0, group).iter().enumerate();
                rows.fold(0, |word, (half, row)| {
                    let beyond = |lane: &usize| row.0[0][*lane] < middle[0];
                    let lanes = (0..LANES).filter(beyond);
                    lanes.fold(word, |word, lane| word | 1 << (half * LANES + lane))
                })
            })
            .collect();
        let gives = |a: f64, b: f64| {
            let rise = |x: f64| (x - at) / (height * height + (x - at) * (x - at)).sqrt();
            rise(b) - rise(a)
        };
        let expected = (gives(0., to) / gives(from, to)) as f32;
        let share = share_of_irradiance(&light, origin, Vec3::Y, 0, &mask);
        assert!((share - expected).abs() < 1e-3, "{share} for {expected}");
    }
}
