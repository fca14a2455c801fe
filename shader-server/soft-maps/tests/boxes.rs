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

/// Angle between texels; two of them are at most 4 cm wide on the ground.
const TEXEL: f32 = 0.004;
const TWO_TEXELS: f32 = 0.04;

/// Receivers on the ground and on the tops of boxes.
fn receivers(world: &World, random: &mut Random, count: usize) -> Vec<Receiver> {
    let mut receivers = Vec::new();
    while receivers.len() < count {
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
    receivers
}

/// How far `share` is from all that is true within two texels of the receiver.
fn excess(world: &World, light: &Light, receiver: &Receiver, share: f32) -> f32 {
    let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
    for (dx, dz) in (-2..=2).flat_map(|x| (-2..=2).map(move |z| (x as f32, z as f32))) {
        let moved = Receiver {
            position: receiver.position + vec3(dx, 0., dz) * (0.5 * TWO_TEXELS),
            ..*receiver
        };
        let truth = by_rays(world, &moved, segment(light), 100);
        (low, high) = (low.min(truth), high.max(truth));
    }
    (low - share).max(share - high).max(0.)
}

/// Of what receivers without a flag are told: the root mean square of all errors, that of errors which a displacement by two
/// texels does not explain; and the share of receivers with a flag.
fn errors(world: &World, light: &Light, maps: &SoftMaps, random: &mut Random) -> [f32; 3] {
    let receivers = receivers(world, random, 1500);
    let mut seen = Vec::new();
    maps.fractions(&receivers, &mut seen);
    let (mut all, mut unexplained, mut flagged) = (0., 0., 0);
    for (receiver, seen) in receivers.iter().zip(&seen) {
        if seen.flagged {
            flagged += 1;
            continue;
        }
        let error = (seen.share - by_rays(world, receiver, segment(light), 300)).abs();
        all += error * error;
        if error > 0.01 {
            unexplained += excess(world, light, receiver, seen.share).powi(2);
        }
    }
    let count = receivers.len() as f32;
    [
        (all / count).sqrt(),
        (unexplained / count).sqrt(),
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
        let options = Options { texel_angle: TEXEL, ..Options::default() };
        let maps = SoftMaps::build(&world, &light, &options).unwrap();
        let [all, unexplained, flagged] = errors(&world, &light, &maps, &mut random);
        println!("{count} boxes, half {half:.2}: rms {all:.4}, {unexplained:.4} beyond two texels, {flagged:.4} flagged, {} samples", maps.stats().samples);
        prop_assert!(all < 0.04, "{all}");
        prop_assert!(unexplained < 0.01, "{unexplained}");
        prop_assert!(flagged < 0.05, "{flagged}");
    }
}
