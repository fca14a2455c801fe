//! Against dense rays, on random boxes.

mod common;

use common::{Random, by_rays, ground, segment, solid};
use glam::{Vec3, vec3};
use proptest::{prelude::*, test_runner::RngSeed};
use rays::World;
use soft_maps::{Light, Options, Receiver, SoftMaps};

/// Boxes above the ground, below the light.
fn boxes(random: &mut Random, count: usize) -> World {
    let solids = (0..count).map(|_| {
        let middle = vec3(
            random.between(-2., 2.),
            random.between(0.3, 2.),
            random.between(-2., 2.),
        );
        let half = vec3(
            random.between(0.05, 0.5),
            random.between(0.02, 0.25),
            random.between(0.05, 0.5),
        );
        solid(middle - half, middle + half)
    });
    World::new(std::iter::once(ground(3.)).chain(solids).collect())
}

/// Root mean square of errors on the ground and on the boxes' tops, of receivers without a flag and of all, and the share
/// of receivers with a flag.
fn errors(world: &World, light: &Light, maps: &SoftMaps, random: &mut Random) -> [f32; 3] {
    let mut receivers = Vec::new();
    while receivers.len() < 1500 {
        let from = vec3(random.between(-2.8, 2.8), 2.9, random.between(-2.8, 2.8));
        let ray = rays::Ray {
            origin: from,
            direction: Vec3::NEG_Y,
        };
        if let Some(hit) = world.closest(&ray, 10.) {
            receivers.push(Receiver {
                position: ray.at(hit.t),
                normal: Vec3::Y,
                face_normal: Vec3::Y,
            });
        }
    }
    let mut seen = Vec::new();
    maps.fractions(&receivers, &mut seen);
    let (mut all, mut sure, mut flagged) = (0., 0., 0);
    for (receiver, seen) in receivers.iter().zip(&seen) {
        let error = seen.share - by_rays(world, receiver, segment(light), 300);
        all += error * error;
        sure += if seen.flagged { 0. } else { error * error };
        flagged += usize::from(seen.flagged);
    }
    let count = receivers.len() as f32;
    [
        (sure / count).sqrt(),
        (all / count).sqrt(),
        flagged as f32 / count,
    ]
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 24,
        rng_seed: RngSeed::Fixed(5),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn maps_agree_with_dense_rays(seed in any::<u64>(), count in 1usize..12, tilt in -0.5f32..0.5, half in 0.1f32..0.8) {
        let mut random = Random(seed);
        let world = boxes(&mut random, count);
        let light = Light::Segment([vec3(-half, 4. - tilt * half, 0.1), vec3(half, 4. + tilt * half, -0.2)]);
        let options = Options { texel_angle: 0.004, ..Options::default() };
        let maps = SoftMaps::build(&world, &light, &options).unwrap();
        let [sure, all, flagged] = errors(&world, &light, &maps, &mut random);
        println!("{count} boxes, half {half:.2}: {sure:.4} without flags, {all:.4} of all, {flagged:.4} flagged, {} samples", maps.stats().samples);
        prop_assert!(sure < 0.02, "{sure}");
        prop_assert!(all < 0.04, "{all}");
        prop_assert!(flagged < 0.05, "{flagged}");
    }
}
