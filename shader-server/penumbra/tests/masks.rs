//! Casting leaf by leaf against brute force, and both against the truth.

mod scenes;

use std::sync::Arc;

use glam::{Affine3A, DVec3, Quat, Vec3, dvec3, vec3};
use penumbra::{
    Alpha, AlphaMap, BlockerMesh, Caster, Costs, Instance, Light, Receivers, Route, Sampling, Seen,
    Shape, Wanted, brute, share_of_samples,
};
use rays::{Ray, TriangleMesh, World};
use scenes::{Random, cuboid, scene};

const ALL: Wanted = Wanted {
    masks: true,
    pairs: true,
};

fn sampling(samples: u32, sets: u32) -> Sampling {
    Sampling {
        samples,
        sets,
        seed: 7,
    }
}

#[test]
fn masks_are_those_of_brute_force_to_the_bit() {
    let (mut blocked, mut open) = (0u64, 0u64);
    for seed in 0..64 {
        let samples = [32, 64, 96, 256, 1024][seed as usize % 5];
        let (caster, receivers) = scene(seed, sampling(samples, 1 + seed as u32 % 8), 60, 150);
        let expected = brute::masks(&caster, &receivers);
        let mut seen = Seen::default();
        caster.cast(&receivers, Route::Cast, ALL, &mut seen);
        assert!(seen.masks == expected, "seed {seed}");
        caster
            .clone()
            .with_baseline_simd()
            .cast(&receivers, Route::Cast, ALL, &mut seen);
        assert!(seen.masks == expected, "seed {seed}, plain instructions");
        let ones: u64 = expected
            .iter()
            .map(|word| u64::from(word.count_ones()))
            .sum();
        blocked += ones;
        open += 32 * expected.len() as u64 - ones;
    }
    assert!(blocked > 100_000 && open > 100_000, "{blocked} {open}");
}

#[test]
fn the_order_of_blockers_and_receivers_and_the_threads_do_not_matter() {
    for seed in 100..116 {
        let mut random = Random(seed);
        let (positions, mut faces) = scenes::soup(&mut random, 200);
        let light = scenes::light(&mut random, seed, sampling(128, 3));
        let mut receivers = scenes::receivers(&mut random, 300, 0);
        receivers.own.fill((u32::MAX, 0));
        let cast = |faces: &[[u32; 3]], threads: usize| {
            let mesh = Arc::new(BlockerMesh::unmerged(&positions, faces));
            let to_world = Affine3A::IDENTITY;
            let caster = Caster::new(vec![Instance { mesh, to_world }], light.clone(), None);
            let mut seen = Seen::default();
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("threads")
                .install(|| caster.cast(&receivers, Route::Cast, ALL, &mut seen));
            seen
        };
        let first = cast(&faces, 1);
        let more = cast(&faces, 3);
        assert!(first.masks == more.masks && first.shares == more.shares);
        assert_eq!(first.pairs, more.pairs);
        for i in (1..faces.len()).rev() {
            faces.swap(i, random.below(i as u64 + 1) as usize);
        }
        assert!(first.masks == cast(&faces, 2).masks, "seed {seed}");
    }
}

/// Whether the segment from `r` to `l` meets the triangle, in double precision; nothing if it is close.
fn meets(r: DVec3, l: DVec3, [a, b, c]: [DVec3; 3]) -> Option<bool> {
    let volume = |p: DVec3, q: DVec3| (p - r).cross(q - r).dot(l - r) / (l - r).length();
    let sides = [volume(a, b), volume(b, c), volume(c, a)];
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let heights = [normal.dot(r - a), normal.dot(l - a)];
    let both =
        |low: f64, high: f64| sides.iter().any(|s| *s < low) && sides.iter().any(|s| *s > high);
    let same_side = heights.iter().all(|h| *h > 1e-5) || heights.iter().all(|h| *h < -1e-5);
    if normal == DVec3::ZERO || same_side || both(-1e-5, 1e-5) {
        return Some(false);
    }
    let clear = sides.iter().chain(&heights).all(|x| x.abs() > 1e-5);
    clear.then(|| heights[0] * heights[1] < 0.)
}

#[test]
fn masks_are_true() {
    let mut compared = 0;
    for seed in 200..240 {
        let mut random = Random(seed);
        let (positions, faces) = scenes::soup(&mut random, 40);
        let light = scenes::light(&mut random, seed, sampling(64, 2));
        let mut receivers = scenes::receivers(&mut random, 60, 0);
        receivers.normals.fill(Vec3::ZERO);
        receivers.own.fill((u32::MAX, 0));
        let mesh = Arc::new(BlockerMesh::new(&positions, &faces));
        let to_world = Affine3A::IDENTITY;
        let caster = Caster::new(vec![Instance { mesh, to_world }], light, None);
        let mut seen = Seen::default();
        caster.cast(&receivers, Route::Cast, ALL, &mut seen);
        let light = caster.light();
        for (i, origin) in receivers.origins.iter().enumerate() {
            let r = origin.as_dvec3();
            if light.is_planar() && light_height(light, r) < 1e-5 {
                continue;
            }
            for sample in 0..64 {
                let l = light.sample(u32::from(receivers.sets[i]) % 2, sample);
                let truth = faces.iter().try_fold(false, |any, face| {
                    let corners = face.map(|i| positions[i as usize].as_dvec3());
                    Some(any | meets(r, l, corners)?)
                });
                if let Some(truth) = truth {
                    let word = seen.masks[2 * i + sample as usize / 32];
                    assert_eq!(word >> (sample % 32) & 1 == 1, truth, "seed {seed}");
                    compared += 1;
                }
            }
        }
    }
    assert!(compared > 40_000, "{compared}");
}

fn light_height(light: &Light, place: DVec3) -> f64 {
    let Shape::Polygon(corners) = light.shape() else {
        return f64::INFINITY;
    };
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    normal.normalize_or_zero().dot(place - corners[0])
}

fn square_light(height: f64, half: f64, samples: u32) -> Light {
    let corners = [[-1., -1.], [1., -1.], [1., 1.], [-1., 1.]];
    let corners = corners.map(|[x, z]| dvec3(x * half, height, z * half));
    Light::new(Shape::Polygon(corners.to_vec()), sampling(samples, 4)).expect("a square")
}

fn caster_of(meshes: Vec<BlockerMesh>, light: Light) -> Caster {
    let place = |mesh| Instance {
        mesh: Arc::new(mesh),
        to_world: Affine3A::IDENTITY,
    };
    Caster::new(meshes.into_iter().map(place).collect(), light, None)
}

fn floor_receivers(count: usize, half: f32) -> Receivers {
    let mut random = Random(5);
    let mut receivers = Receivers::default();
    for _ in 0..count {
        let origin = vec3(random.between(-half, half), 0., random.between(-half, half));
        receivers.push(origin, Vec3::Y, (u32::MAX, 0), random.below(4) as u8);
    }
    receivers
}

#[test]
fn one_side_of_closed_shells_is_enough_wherever_the_light_is() {
    // Above a box, in it, and through its wall; then the box turned inside out; then a room around everything.
    let mut differing = 0;
    for (height, low, high) in [
        (3., 1., 1.5),
        (1.3, 1., 1.5),
        (1.5, 1., 1.5),
        (1.2, -1., 4.),
        (5., -1., 4.),
    ] {
        for inside_out in [false, true] {
            let (positions, mut faces) = cuboid(vec3(-0.4, low, -0.4), vec3(0.5, high, 0.7), 3);
            if inside_out {
                faces.iter_mut().for_each(|face| face.swap(1, 2));
            }
            let mesh = BlockerMesh::new(&positions, &faces);
            let caster = caster_of(vec![mesh], square_light(height, 0.25, 128));
            let both = caster.clone().with_both_sides();
            differing += usize::from(caster.blockers() < both.blockers());
            let receivers = floor_receivers(400, 1.5);
            let (mut one, mut two) = (Seen::default(), Seen::default());
            caster.cast(&receivers, Route::Cast, ALL, &mut one);
            both.cast(&receivers, Route::Cast, ALL, &mut two);
            let wrong = one
                .masks
                .iter()
                .zip(&two.masks)
                .map(|(a, b)| (a ^ b).count_ones());
            assert_eq!(wrong.sum::<u32>(), 0, "{height} {low} {inside_out}");
        }
    }
    assert!(differing == 4, "{differing}");
}

#[test]
fn neighbours_in_one_plane_are_cast_as_one() {
    let (positions, faces) = cuboid(vec3(-0.5, 1., -0.5), vec3(0.5, 1.25, 0.5), 8);
    let mesh = BlockerMesh::new(&positions, &faces);
    assert_eq!(mesh.polygons(), 6);
    let whole = caster_of(vec![mesh], square_light(3., 0.5, 256));
    let cells = caster_of(
        vec![BlockerMesh::unmerged(&positions, &faces)],
        square_light(3., 0.5, 256),
    );
    let receivers = floor_receivers(2000, 1.);
    let (mut one, mut two) = (Seen::default(), Seen::default());
    whole.cast(&receivers, Route::Cast, ALL, &mut one);
    cells.cast(&receivers, Route::Cast, ALL, &mut two);
    let wrong = one
        .masks
        .iter()
        .zip(&two.masks)
        .map(|(a, b)| (a ^ b).count_ones());
    assert_eq!(wrong.sum::<u32>(), 0);
    assert!(two.counts.pairs > 20 * one.counts.pairs);
}

#[test]
fn light_does_not_leak_between_neighbours() {
    // A wavy sheet whose corners, receivers and samples are all on a coarse grid: most sides are met exactly.
    let n = 12u32;
    let mut positions = Vec::new();
    for j in 0..=n {
        for i in 0..=n {
            let y = 1. + 0.25 * ((i + j) % 2) as f32;
            positions.push(vec3(i as f32 * 0.5 - 3., y, j as f32 * 0.5 - 3.));
        }
    }
    let mut faces = Vec::new();
    for j in 0..n {
        for i in 0..n {
            let a = j * (n + 1) + i;
            faces.extend([[a, a + n + 1, a + n + 2], [a, a + n + 2, a + 1]]);
        }
    }
    let light =
        Light::new(Shape::Polygon(vec![dvec3(0., 3., 0.); 3]), sampling(32, 1)).expect("a point");
    let caster = caster_of(vec![BlockerMesh::new(&positions, &faces)], light);
    let mut receivers = Receivers::default();
    for j in -8..=8 {
        for i in -8..=8 {
            let origin = vec3(i as f32 * 0.25, 0., j as f32 * 0.25);
            receivers.push(origin, Vec3::Y, (u32::MAX, 0), 0);
        }
    }
    let mut seen = Seen::default();
    caster.cast(&receivers, Route::Cast, ALL, &mut seen);
    assert!(seen.masks.iter().all(|word| *word == u32::MAX));
    assert!(seen.shares.iter().all(|share| *share == 0.));
}

#[test]
fn a_small_light_is_a_point_and_one_in_the_receivers_plane_gives_nothing() {
    let (positions, faces) = cuboid(vec3(-0.5, 1., -0.5), vec3(0.5, 1.25, 0.5), 1);
    let mesh = || BlockerMesh::new(&positions, &faces);
    let point = Light::new(Shape::Polygon(vec![dvec3(0.1, 3., 0.); 4]), sampling(32, 1));
    let caster = caster_of(vec![mesh()], point.expect("a point"));
    let receivers = floor_receivers(500, 2.);
    let mut seen = Seen::default();
    caster.cast(&receivers, Route::Cast, ALL, &mut seen);
    assert!(seen.shares.iter().all(|share| *share == 0. || *share == 1.));
    assert!(seen.shares.contains(&0.) && seen.shares.contains(&1.));

    let coplanar = caster_of(vec![mesh()], square_light(0., 0.5, 32));
    coplanar.cast(&receivers, Route::Cast, ALL, &mut seen);
    assert!(seen.shares.iter().all(|share| *share == 0.));
}

#[test]
fn shares_weigh_samples_and_pairs_name_blockers() {
    // A half of the light is hidden by a wide sheet.
    let sheet = [
        vec3(0., 1., -9.),
        vec3(9., 1., -9.),
        vec3(9., 1., 9.),
        vec3(0., 1., 9.),
    ];
    let far = sheet.map(|p| p + vec3(20., 0., 0.));
    let faces = [[0, 2, 1], [0, 3, 2]];
    let meshes = vec![
        BlockerMesh::new(&far, &faces),
        BlockerMesh::new(&sheet, &faces),
    ];
    let caster = caster_of(meshes, square_light(2., 1., 1024));
    let mut receivers = Receivers::default();
    receivers.push(Vec3::ZERO, Vec3::Y, (7, 0), 0);
    receivers.push(Vec3::ZERO, vec3(-1., 1., 0.).normalize(), (8, 0), 1);
    let mut seen = Seen::default();
    caster.cast(&receivers, Route::Cast, ALL, &mut seen);
    assert!((share_of_samples(&seen.masks[..32]) - 0.5).abs() < 0.01);
    assert!((seen.shares[0] - 0.5).abs() < 0.01);
    // Turned to the open half, more of what arrives comes from there.
    let tilted = caster.light();
    let (mut lit, mut all) = (0., 0.);
    for i in 0..500 {
        for j in 0..500 {
            let place = dvec3(
                (f64::from(i) + 0.5) / 250. - 1.,
                2.,
                (f64::from(j) + 0.5) / 250. - 1.,
            );
            let cosine = (place.y - place.x).max(0.);
            let weight = cosine * place.y / place.length_squared().powi(2);
            all += weight;
            lit += if place.x < 0. { weight } else { 0. };
        }
    }
    assert!(
        (f64::from(seen.shares[1]) - lit / all).abs() < 0.005,
        "{}",
        seen.shares[1]
    );
    assert!(tilted.is_planar());
    assert_eq!(seen.pairs, [(7, 1), (8, 1)]);
}

#[test]
fn moved_instances_and_lights_cast_from_where_they_are() {
    let (mut caster, receivers) = scene(11, sampling(64, 2), 50, 200);
    let (other, _) = scene(12, sampling(64, 2), 50, 1);
    let to_world = Affine3A::from_translation(vec3(0.4, 0.2, -0.3));
    caster.move_instances(&[(2, to_world), (900, to_world)]);
    let mut instances = caster.instances().to_vec();
    instances[2].to_world = to_world;
    let fresh = Caster::new(instances.clone(), caster.light().clone(), None);
    let (mut moved, mut expected) = (Seen::default(), Seen::default());
    caster.cast(&receivers, Route::Cast, ALL, &mut moved);
    fresh.cast(&receivers, Route::Cast, ALL, &mut expected);
    assert!(moved.masks == expected.masks && moved.pairs == expected.pairs);
    caster.set_light(other.light().clone());
    caster.cast(&receivers, Route::Cast, ALL, &mut moved);
    Caster::new(instances, other.light().clone(), None).cast(
        &receivers,
        Route::Cast,
        ALL,
        &mut expected,
    );
    assert!(moved.masks == expected.masks);
}

#[test]
fn numbers_that_are_not_finite_harm_nobody() {
    let bad = [f32::NAN, f32::INFINITY, -1e30, 1e13];
    let mut positions = vec![vec3(-1., 1., -1.), vec3(1., 1., -1.), vec3(0., 1., 1.)];
    let mut faces = vec![[0u32, 1, 2], [0, 1, 99]];
    for value in bad {
        positions.push(vec3(0., value, 0.));
        faces.push([0, 1, positions.len() as u32 - 1]);
    }
    let caster = caster_of(
        vec![BlockerMesh::new(&positions, &faces)],
        square_light(3., 0.5, 64),
    );
    assert_eq!(caster.blockers(), 1);
    let mut receivers = floor_receivers(20, 1.);
    let mut expected = Seen::default();
    caster.cast(&receivers, Route::Cast, ALL, &mut expected);
    receivers.push(vec3(f32::NAN, 0., 0.), Vec3::Y, (0, 0), 0);
    receivers.push(Vec3::ZERO, vec3(f32::INFINITY, 0., 0.), (0, 0), 255);
    receivers.push(vec3(0., f32::NEG_INFINITY, 0.), Vec3::Y, (0, 0), 0);
    let mut seen = Seen::default();
    caster.cast(&receivers, Route::Cast, ALL, &mut seen);
    assert_eq!(seen.shares[..20], expected.shares);
    assert!(seen.shares[20..].iter().all(|share| *share == 0.));
}

#[test]
fn lights_out_of_range_are_refused() {
    let square = Shape::Polygon(vec![DVec3::ZERO, DVec3::X, DVec3::Y]);
    for (samples, sets) in [(0, 1), (33, 1), (1056, 1), (64, 0), (64, 9)] {
        assert!(Light::new(square.clone(), sampling(samples, sets)).is_err());
    }
    assert!(Light::new(Shape::Polygon(Vec::new()), sampling(32, 1)).is_err());
    let broken = Shape::Ball {
        centre: DVec3::ZERO,
        radius: f64::NAN,
    };
    assert!(Light::new(broken, sampling(32, 1)).is_err());
}

#[test]
fn holes_in_alpha_maps_let_samples_through() {
    // A sheet whose map is a chequerboard of 4 x 4: half of it is open, the same half as that of its cells.
    let quad = [[-1., -1.], [1., -1.], [1., 1.], [-1., 1.]];
    let corners = quad.map(|[x, z]| vec3(x, 1., z));
    let uv = quad.map(|[x, z]| [(x + 1.) * 0.5, (z + 1.) * 0.5]);
    let faces = [[0usize, 2, 1], [0, 3, 2]];
    let map = AlphaMap::new(4, 4, |x, y| (x + y) % 2 == 0).expect("it has texels");
    let alpha = Alpha {
        maps: vec![map],
        map_of_face: vec![0; 2],
        uvs: faces.map(|face| face.map(|i| uv[i])).to_vec(),
    };
    let indices = faces.map(|face| face.map(|i| i as u32));
    let mapped = BlockerMesh::with_alpha(&corners, &indices, alpha);
    let (mut positions, mut cells) = (Vec::new(), Vec::new());
    for j in 0..4 {
        for i in (0..4).filter(|i| (i + j) % 2 == 0) {
            let first = positions.len() as u32;
            let at = |i: i32, j: i32| vec3(i as f32 * 0.5 - 1., 1., j as f32 * 0.5 - 1.);
            positions.extend([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
            cells.extend([[first, first + 2, first + 1], [first, first + 3, first + 2]]);
        }
    }
    for mirror in [1., -1.] {
        let to_world = Affine3A::from_scale(vec3(mirror, 1., 1.));
        let light = square_light(2.3, 0.7, 256);
        let place = |mesh: &BlockerMesh| Instance {
            mesh: Arc::new(mesh.clone()),
            to_world,
        };
        let one = Caster::new(vec![place(&mapped)], light.clone(), None);
        let cut = BlockerMesh::new(&positions, &cells);
        let two = Caster::new(vec![place(&cut)], light, None);
        let receivers = floor_receivers(500, 1.5);
        let (mut a, mut b) = (Seen::default(), Seen::default());
        one.cast(&receivers, Route::Cast, ALL, &mut a);
        two.cast(&receivers, Route::Cast, ALL, &mut b);
        assert!(a.masks == brute::masks(&one, &receivers));
        let wrong = a
            .masks
            .iter()
            .zip(&b.masks)
            .map(|(a, b)| (a ^ b).count_ones());
        let wrong = wrong.sum::<u32>();
        assert!(wrong < 10, "{wrong} of {}", 500 * 256);
        let mean = a.shares.iter().sum::<f32>() / 500.;
        assert!(mean > 0.3 && mean < 0.9, "{mean}");
    }
}

/// Turned boxes above a floor, the world of the same meshes, and receivers on both.
fn boxes_with_rays(samples: u32) -> (Caster, World, Receivers) {
    let mut random = Random(77);
    let (mut instances, mut world) = (Vec::new(), Vec::new());
    for _ in 0..40 {
        let low = random.point(vec3(-2., 0.2, -2.), vec3(1.6, 1.5, 1.6));
        let (positions, faces) = cuboid(
            low,
            low + random.point(Vec3::splat(0.05), Vec3::splat(0.5)),
            3,
        );
        let turn = Quat::from_rotation_y(random.between(0., 3.));
        let to_world = Affine3A::from_rotation_translation(turn, Vec3::ZERO);
        let mesh = Arc::new(BlockerMesh::new(&positions, &faces));
        instances.push(Instance { mesh, to_world });
        world.push((Arc::new(TriangleMesh::build(&positions, &faces)), to_world));
    }
    let caster = Caster::new(instances, square_light(4., 0.5, samples), None);
    let world = World::new(world);
    let mut receivers = floor_receivers(3000, 2.5);
    for _ in 0..3000 {
        let origin = random.point(vec3(-2., 0., -2.), vec3(2., 3., 2.));
        let ray = Ray {
            origin,
            direction: Vec3::NEG_Y,
        };
        if let Some(hit) = world.closest(&ray, f32::INFINITY) {
            let origin = ray.at(hit.t - 1e-4);
            receivers.push(
                origin,
                Vec3::Y,
                (hit.instance, hit.face),
                random.below(4) as u8,
            );
        }
    }
    (caster, world, receivers)
}

#[test]
fn rays_find_the_same_and_so_does_whatever_is_cheaper() {
    let (caster, world, receivers) = boxes_with_rays(128);
    let mut cast = Seen::default();
    caster.cast(&receivers, Route::Cast, ALL, &mut cast);
    let mean = cast.shares.iter().sum::<f32>() / cast.shares.len() as f32;
    assert!(mean > 0.2 && mean < 0.9, "{mean}");
    let cheap = |ray_ns, packets| Costs {
        ray_ns,
        packets,
        ..Costs::TYPICAL
    };
    let measured = Costs::measured(&caster, &world, &receivers);
    assert!(
        measured.ray_ns > 1. && measured.pair_ns > 0.1,
        "{measured:?}"
    );
    let mut mixed = 0;
    for route in [
        Route::Rays(&world, cheap(1., true)),
        Route::Rays(&world, cheap(1., false)),
        Route::Cheaper(&world, cheap(2., true)),
        Route::Cheaper(&world, measured),
    ] {
        let mut seen = Seen::default();
        caster.cast(&receivers, route, ALL, &mut seen);
        let wrong = cast
            .masks
            .iter()
            .zip(&seen.masks)
            .map(|(a, b)| (a ^ b).count_ones());
        let wrong = wrong.sum::<u32>();
        assert!(
            wrong < 40,
            "{wrong} of {} by {:?}",
            128 * receivers.len(),
            seen.counts
        );
        let all = (128 * receivers.len()) as u64;
        mixed += usize::from(seen.counts.rays > all / 20 && seen.counts.pairs > 1000);
        let told = seen
            .pairs
            .iter()
            .filter(|pair| cast.pairs.contains(pair))
            .count();
        assert!(
            told * 10 > 7 * cast.pairs.len(),
            "{told} of {}",
            cast.pairs.len()
        );
    }
    assert!(mixed > 0, "no batch took both ways");
    caster.cast(
        &receivers,
        Route::Cheaper(&world, cheap(1e9, true)),
        ALL,
        &mut cast,
    );
    assert_eq!(cast.counts.rays, 0);
}
