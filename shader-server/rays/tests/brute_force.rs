//! Trees against trying every face: the same hit to the bit, ties included.

mod common;

use std::sync::Arc;

use common::{Random, Soup, brute_closest, icosphere, soup};
use glam::{Affine3A, Quat, Vec3, vec3};
use proptest::{
    prelude::*,
    test_runner::{RngAlgorithm, RngSeed},
};
use rays::{Ray, Recent, TriangleMesh, World};

fn config() -> ProptestConfig {
    ProptestConfig {
        cases: 48,
        rng_algorithm: RngAlgorithm::ChaCha,
        rng_seed: RngSeed::Fixed(11),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

fn random_transform(random: &mut Random) -> Affine3A {
    let turn = Quat::from_euler(
        glam::EulerRot::XYZ,
        random.unit() * 6.,
        random.unit() * 6.,
        random.unit() * 6.,
    );
    let signed = |r: &mut Random| (0.2 + 2. * r.unit()) * if r.pick(2) == 0 { -1. } else { 1. };
    let scale = vec3(signed(random), signed(random), signed(random));
    match random.pick(4) {
        0 => Affine3A::IDENTITY,
        1 => Affine3A::from_translation(random.cube() * 3.),
        _ => Affine3A::from_scale_rotation_translation(scale, turn, random.cube() * 3.),
    }
}

/// A ray through the scene, often aimed at a vertex, often along axes.
fn random_ray(random: &mut Random, soup: &Soup) -> Ray {
    let origin = random.cube() * 4.;
    let mut direction = match random.pick(3) {
        0 => random.cube(),
        1 => soup.positions[random.pick(soup.positions.len())] - origin,
        _ => vec3(0., if random.pick(2) == 0 { 0. } else { -0. }, 1.),
    };
    let turns = random.pick(3);
    for _ in 0..turns {
        direction = vec3(direction.y, direction.z, -direction.x);
    }
    let origin = if random.pick(3) == 0 {
        (origin * 4.).round() / 4.
    } else {
        origin
    };
    Ray { origin, direction }
}

fn check(instances: &[(&Soup, Affine3A)], world: &World, ray: &Ray, t_max: f32) {
    let expected = brute_closest(instances, ray, t_max);
    let found = world.closest(ray, t_max);
    assert_eq!(found, expected, "{ray:?} up to {t_max}");
    assert_eq!(world.clone().without_simd().closest(ray, t_max), expected);
    let baseline = world.clone().with_baseline_simd();
    assert_eq!(baseline.closest(ray, t_max), expected);
    assert_eq!(
        world.occluder(ray, t_max).is_some(),
        expected.is_some(),
        "{ray:?}"
    );
    if let Some(hit) = expected {
        let skipped = |i: u32, f: u32| (i, f) != (hit.instance, hit.face);
        let other = world.occluder_where(ray, hit.t, skipped);
        assert_ne!(
            other.map(|o| (o.instance, o.face)),
            Some((hit.instance, hit.face))
        );
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn random_worlds_agree(seed in any::<u64>(), meshes in 1usize..4, count in 1usize..120) {
        let mut random = Random(seed);
        let soups: Vec<Soup> = (0..meshes).map(|_| soup(&mut random, count, 0.4)).collect();
        let built: Vec<Arc<TriangleMesh>> =
            soups.iter().map(|s| Arc::new(TriangleMesh::build(&s.positions, &s.faces))).collect();
        let places: Vec<(usize, Affine3A)> =
            (0..1 + random.pick(12)).map(|_| (random.pick(meshes), random_transform(&mut random))).collect();
        let instances: Vec<(&Soup, Affine3A)> = places.iter().map(|&(m, at)| (&soups[m], at)).collect();
        let world = World::new(places.iter().map(|&(m, at)| (Arc::clone(&built[m]), at)).collect());
        let mut recent = Recent::default();
        for _ in 0..60 {
            let ray = random_ray(&mut random, &soups[0]);
            let again = world.occluder_again(&ray, 5., &mut recent, |_, _| true);
            prop_assert_eq!(again.is_some(), world.occluder(&ray, 5.).is_some());
            let t_max = if random.pick(2) == 0 { f32::INFINITY } else { 6. * random.unit() };
            check(&instances, &world, &ray, t_max);
        }
    }

    #[test]
    fn moved_instances_agree(seed in any::<u64>()) {
        let mut random = Random(seed);
        let soup = soup(&mut random, 40, 0.5);
        let mesh = Arc::new(TriangleMesh::build(&soup.positions, &soup.faces));
        let mut instances: Vec<(&Soup, Affine3A)> = vec![(&soup, Affine3A::IDENTITY); 9];
        let mut world = World::new(vec![(mesh, Affine3A::IDENTITY); 9]);
        for _ in 0..4 {
            for (i, slot) in instances.iter_mut().enumerate() {
                slot.1 = random_transform(&mut random);
                prop_assert!(world.set_transform(i as u32, slot.1));
            }
            world.refit();
            for _ in 0..20 {
                check(&instances, &world, &random_ray(&mut random, &soup), f32::INFINITY);
            }
        }
    }
}

/// Rays that run alike: from about one place through about another, often through a vertex, some of them broken.
fn alike(random: &mut Random, soup: &Soup, count: usize) -> Vec<Ray> {
    let origin = random.cube() * 4.;
    let target = soup.positions[random.pick(soup.positions.len())];
    let spread = [0., 1e-3, 0.05, 0.5][random.pick(4)];
    let mut rays: Vec<Ray> = (0..count)
        .map(|i| {
            let origin = origin + random.cube() * spread;
            let target = target + random.cube() * spread * (i % 4) as f32;
            let direction = target - origin;
            Ray { origin, direction }
        })
        .collect();
    if random.pick(4) == 0 {
        rays[0].origin.x = f32::NAN;
    }
    rays
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn packets_hit_what_single_rays_hit(seed in any::<u64>(), count in 1usize..200) {
        let mut random = Random(seed);
        let soups: Vec<Soup> = (0..2).map(|_| soup(&mut random, count, 0.3)).collect();
        let places: Vec<(usize, Affine3A)> =
            (0..1 + random.pick(9)).map(|_| (random.pick(2), random_transform(&mut random))).collect();
        let built: Vec<Arc<TriangleMesh>> =
            soups.iter().map(|s| Arc::new(TriangleMesh::build(&s.positions, &s.faces))).collect();
        let instances: Vec<(&Soup, Affine3A)> = places.iter().map(|&(m, at)| (&soups[m], at)).collect();
        let world = World::new(places.iter().map(|&(m, at)| (Arc::clone(&built[m]), at)).collect());
        let levels = [world.clone(), world.clone().with_baseline_simd(), world.clone().without_simd()];
        let (mut hits, mut found) = (Vec::new(), Vec::new());
        for round in 0..40 {
            let rays = alike(&mut random, &soups[0], 1 + round % 19);
            let t_max = if random.pick(2) == 0 { f32::INFINITY } else { 2. * random.unit() };
            let expected: Vec<_> = rays.iter().map(|ray| {
                ray.is_valid().then(|| brute_closest(&instances, ray, t_max)).flatten()
            }).collect();
            for world in &levels {
                world.closest_each(&rays, t_max, &mut hits);
                prop_assert_eq!(&hits, &expected);
                world.occluder_each(&rays, t_max, |_, _, _| true, &mut found);
                let blocked: Vec<bool> = found.iter().map(Option::is_some).collect();
                let expected: Vec<bool> = expected.iter().map(Option::is_some).collect();
                prop_assert_eq!(blocked, expected);
                // What is accepted may depend on the ray.
                let odd = |ray: usize, _: u32, face: u32| (ray + face as usize) % 2 == 1;
                world.occluder_each(&rays, t_max, odd, &mut found);
                for (i, ray) in rays.iter().enumerate() {
                    let alone = world.occluder_where(ray, t_max, |instance, face| odd(i, instance, face));
                    prop_assert_eq!(found[i].is_some(), alone.is_some());
                    prop_assert!(found[i].is_none_or(|o| odd(i, o.instance, o.face)));
                }
            }
        }
    }
}

#[test]
fn ties_go_to_the_smallest_instance_and_face() {
    let sphere = icosphere(1);
    let doubled = Soup {
        faces: sphere
            .faces
            .iter()
            .rev()
            .chain(&sphere.faces)
            .copied()
            .collect(),
        positions: sphere.positions,
    };
    let mesh = Arc::new(TriangleMesh::build(&doubled.positions, &doubled.faces));
    let instances = [(&doubled, Affine3A::IDENTITY); 3];
    let world = World::new(vec![(mesh, Affine3A::IDENTITY); 3]);
    let mut random = Random(3);
    for _ in 0..2000 {
        check(
            &instances,
            &world,
            &random_ray(&mut random, &doubled),
            f32::INFINITY,
        );
    }
}

#[test]
fn faces_that_cannot_be_hit_keep_their_numbers() {
    let positions = [
        Vec3::ZERO,
        Vec3::X,
        Vec3::Y,
        vec3(f32::NAN, 0., 0.),
        Vec3::splat(1e20),
    ];
    let faces = [
        [0, 0, 1],
        [0, 1, 3],
        [0, 1, 9],
        [0, 1, 2],
        [0, 1, 4],
        [0, 1, 1],
    ];
    let mesh = TriangleMesh::build(&positions, &faces);
    assert_eq!(mesh.dropped(), 5);
    let world = World::new(vec![(Arc::new(mesh), Affine3A::IDENTITY)]);
    let ray = Ray {
        origin: vec3(0.2, 0.2, 1.),
        direction: Vec3::NEG_Z,
    };
    assert_eq!(world.closest(&ray, 2.).map(|h| h.face), Some(3));
    assert_eq!(world.closest(&ray, 0.5), None);
    assert_eq!(world.closest(&ray, 1.).map(|h| h.t), Some(1.));
}

#[test]
fn empty_worlds_and_flat_transforms_are_never_hit() {
    let sphere = icosphere(1);
    let mesh = Arc::new(TriangleMesh::build(&sphere.positions, &sphere.faces));
    let nothing = Arc::new(TriangleMesh::build(&[], &[]));
    let ray = Ray {
        origin: vec3(0., 0., 3.),
        direction: Vec3::NEG_Z,
    };
    assert_eq!(World::new(vec![]).closest(&ray, f32::INFINITY), None);
    let mut hits = vec![None];
    World::new(vec![]).closest_each(&[ray; 3], f32::INFINITY, &mut hits);
    assert_eq!(hits, [None; 3]);
    assert_eq!(
        World::new(vec![(nothing.clone(), Affine3A::IDENTITY)]).occluder(&ray, 9.),
        None
    );
    let flat = Affine3A::from_scale(vec3(1., 1., 0.));
    let world = World::new(vec![(mesh.clone(), flat), (nothing, Affine3A::IDENTITY)]);
    assert_eq!(world.closest(&ray, f32::INFINITY), None);
    let mut world = World::new(vec![(mesh.clone(), flat), (mesh, flat)]);
    world.set_transform(1, Affine3A::IDENTITY);
    world.refit();
    assert_eq!(
        world.closest(&ray, f32::INFINITY).map(|h| h.instance),
        Some(1)
    );
    assert!(!world.set_transform(2, Affine3A::IDENTITY));
}
