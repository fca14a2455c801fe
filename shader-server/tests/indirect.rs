//! Indirect light where the answer is known.
#![allow(clippy::unwrap_used)]

mod common;

use std::{f64::consts::PI, sync::Arc};

use common::{AT_ORIGIN, moved, object, reflected, scene, shade, sphere, square};
use glam::{DVec3, Vec3, dvec3, vec3};
use protocol::{
    messages::ObjectMove,
    scene::{Light, Mesh, Model, Scene},
};
use rays::Ray;
use shader_server::{
    Stage,
    irradiance::{
        Patience,
        hemisphere::{Gathered, Incoming, Strata, frame},
    },
    lights::Receiver,
    random::Stream,
};

fn global(mut scene: Scene) -> Stage {
    scene.shading.model = Model::Global;
    scene.shading.background = [0.; 3];
    Stage::build(Arc::new(scene)).unwrap()
}

/// A box of half-size 1 around the origin, its faces' fronts inwards.
fn closed_box() -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..8 {
        let side = |bit: usize| if i >> bit & 1 == 0 { -1. } else { 1. };
        mesh.positions.push([side(0), side(1), side(2)]);
    }
    for [a, b, c, d] in [
        [0, 1, 3, 2],
        [4, 6, 7, 5],
        [0, 4, 5, 1],
        [2, 3, 7, 6],
        [0, 2, 6, 4],
        [1, 5, 7, 3],
    ] {
        mesh.faces.extend([[a, b, c], [a, c, d]]);
    }
    mesh
}

/// Some points of the inside of a mesh around the origin, as seen from there.
fn inside(stage: &Stage) -> impl Iterator<Item = Receiver> {
    (0..40).filter_map(|i| {
        let mut stream = Stream::new(5, i);
        let direction = (stream.square().extend(stream.unit()) - 0.5).normalize();
        let ray = Ray {
            origin: Vec3::ZERO,
            direction,
        };
        let hit = stage.world().closest(&ray, f32::INFINITY)?;
        let surface = stage.surface(&hit)?;
        Some(surface.seen_along(direction.as_dvec3(), hit.instance, hit.face))
    })
}

/// A sphere of albedo 0.5 around a point light of 2 W/sr: direct irradiance 2 everywhere, so after four reflections 2 (ρ + ρ² + ρ³
/// + ρ⁴) more, and the gradients are nothing.
#[test]
fn furnace_of_a_point_light() {
    let light = Light::Point {
        position: [0.; 3],
        intensity: [2.; 3],
    };
    let stage = global(scene(
        vec![light],
        vec![sphere(48, 96)],
        vec![object("sphere", 0, AT_ORIGIN)],
    ));
    let cache = stage.irradiance().unwrap();
    let expected = 2. * reflected(0.5);
    for at in inside(&stage) {
        let indirect = cache.irradiance(&stage, &at, 0.002);
        assert!(!indirect.is_provisional);
        let found = indirect.irradiance.x;
        assert!(
            (found / expected - 1.).abs() < 0.02,
            "{at:?}: {found} {expected}"
        );
        let strata = Strata {
            rings: 12,
            sectors: 30,
        };
        let gathered = cache.by_rays(&stage, &at, &strata, &Stream::new(1, 1));
        assert!(
            gathered.by_place[0].length() < 0.1 * expected,
            "{gathered:?}"
        );
    }
    let sample = shade(&stage, Vec3::ZERO, vec3(0.4, 0.3, -0.9));
    let radiance = 0.5 / PI as f32 * (2. + expected);
    assert!(
        (sample.radiance[0] / radiance - 1.).abs() < 0.02,
        "{sample:?} {radiance}"
    );
    assert_eq!(cache.tally().alone, 0);
}

/// A linear light along the axis of a sphere: direct irradiance at the sphere's wall in closed form, with the diffuse and the glossy
/// shader alike; what falls on the wall in all is what the light gives, and what is reflected keeps the balance.
#[test]
fn furnace_of_a_linear_light() {
    let (half, intensity) = (0.4, 2.);
    let light = Light::Linear {
        from: [0., -half as f32, 0.],
        to: [0., half as f32, 0.],
        intensity: [intensity as f32; 3],
    };
    let build = |model: Model| {
        let mut scene = scene(
            vec![light.clone()],
            vec![sphere(64, 128)],
            vec![object("sphere", 0, AT_ORIGIN)],
        );
        scene.shading.model = model;
        scene.shading.background = [0.; 3];
        Stage::build(Arc::new(scene)).unwrap()
    };
    // By quadrature over the light: cosine over the square of the distance.
    let direct = |height: f64| -> f64 {
        let n = 2000;
        let step = 2. * half / f64::from(n);
        (0..n)
            .map(|i| {
                let y = -half + (f64::from(i) + 0.5) * step;
                // The normal at p is -p, and p has length 1.
                let squared = 1. + y * y - 2. * y * height;
                (1. - y * height) / squared.powf(1.5) * step * intensity
            })
            .sum()
    };
    // Light of all directions, 4π a metre, over a wall of 4π square metres, is the mean of direct irradiance: Lambert's wall spreads
    // evenly what it reflects, so that every further reflection is the same everywhere.
    let mean = 2. * half * intensity;
    let quadrature = (0..1000).map(|i| direct((f64::from(i) + 0.5) / 500. - 1.));
    assert!((quadrature.sum::<f64>() / 1000. / mean - 1.).abs() < 1e-3);
    let beyond = mean * f64::from(reflected(0.5));
    for model in [Model::Direct, Model::Glossy, Model::Global] {
        let stage = build(model);
        for to in [
            vec3(0.1, 0.95, 0.2),
            vec3(0.7, 0.4, -0.5),
            vec3(-0.9, -0.1, 0.3),
        ] {
            let to = to.normalize();
            let expected = direct(to.y.into()) + if model == Model::Global { beyond } else { 0. };
            let radiance = (0.5 * expected / PI) as f32;
            let sample = shade(&stage, vec3(0.2, 0.1, 0.1), to);
            assert!(
                (sample.radiance[0] / radiance - 1.).abs() < 0.015,
                "{model:?} {to}: {sample:?} {radiance}"
            );
        }
    }
}

/// A box around an area light and a linear one: the light that is given out and not absorbed adds up. Mean irradiance over the box
/// is what the lights give, over its area, times 1 + ρ + ρ² + ρ³ + ρ⁴ if every reflection spreads it evenly; it does not quite, so
/// the test is the balance of the direct and the indirect part as rays have them.
#[test]
fn a_box_of_lights_keeps_its_energy() {
    let h = 0.3;
    let area = Light::Area {
        vertices: vec![[-h, 0., -h], [h, 0., -h], [h, 0., h], [-h, 0., h]],
        radiance: [3.; 3],
    };
    let linear = Light::Linear {
        from: [-0.5, 0.2, 0.],
        to: [0.5, 0.2, 0.],
        intensity: [0.7; 3],
    };
    let stage = global(scene(
        vec![area, linear],
        vec![closed_box()],
        vec![object("box", 0, AT_ORIGIN)],
    ));
    let cache = stage.irradiance().unwrap();
    let strata = Strata {
        rings: 40,
        sectors: 100,
    };
    let (mut ours, mut theirs) = (0., 0.);
    for (i, at) in inside(&stage).enumerate() {
        let found = cache.irradiance(&stage, &at, 0.002).irradiance.x;
        let rays = cache
            .by_rays(&stage, &at, &strata, &Stream::new(2, i as u64))
            .irradiance
            .x;
        assert!(
            (found / rays - 1.).abs() < 0.08,
            "{:?}: {found} {rays}",
            at.position
        );
        ours += found;
        theirs += rays;
    }
    assert!((ours / theirs - 1.).abs() < 0.015, "{ours} {theirs}");
}

/// Irradiance on the floor of a half-lit world: radiance 1 from x > 0 side of a wall at distance, rest dark; a wide sum in closed
/// form by quadrature.
fn world(p: DVec3, n: DVec3, direction: DVec3) -> (f64, f64) {
    // A ceiling at height 2 that glows where x > 0.3, seen from p above the floor.
    if direction.z <= 0. {
        return (0., 1e9);
    }
    let t = (2. - p.z) / direction.z;
    let x = p.x + direction.x * t;
    let _ = n;
    (if x > 0.3 { 1. } else { 0.2 }, t)
}

fn gathered(p: DVec3, n: DVec3, strata: &Strata, seed: u64) -> Gathered {
    let [u, v] = frame(n);
    let incoming: Vec<Incoming> = (0..strata.count())
        .map(|i| {
            let mut stream = Stream::new(seed, i as u64);
            let l = strata.direction(i / strata.sectors, i % strata.sectors, &mut stream);
            let (radiance, distance) = world(p, n, u * l.x + v * l.y + n * l.z);
            Incoming {
                radiance: Vec3::splat(radiance as f32),
                distance_m: distance as f32,
            }
        })
        .collect();
    strata.sum(n, &incoming)
}

/// Gradients against central differences of a finer sum.
#[test]
fn gradients_agree_with_differences() {
    let fine = Strata {
        rings: 400,
        sectors: 1000,
    };
    let irradiance = |p: DVec3, n: DVec3| f64::from(gathered(p, n, &fine, 1).irradiance.x);
    let (p, n) = (dvec3(-0.4, 0.1, 0.), dvec3(0.1, -0.05, 1.).normalize());
    // The mean of many hemispheres of the size of a record's.
    let record = Strata {
        rings: 24,
        sectors: 60,
    };
    let count = 60;
    let (mut by_place, mut by_normal) = (Vec3::ZERO, Vec3::ZERO);
    for seed in 0..count {
        let one = gathered(p, n, &record, seed);
        by_place += one.by_place[0] / count as f32;
        by_normal += one.by_normal[0] / count as f32;
    }
    for axis in frame(n) {
        let h = 0.1;
        let place = (irradiance(p + axis * h, n) - irradiance(p - axis * h, n)) / (2. * h);
        let found = f64::from(by_place.dot(axis.as_vec3()));
        assert!(
            (place - found).abs() < 0.03,
            "place {axis}: {place} {found}"
        );
        let turned = |by: f64| irradiance(p, (n + axis * by).normalize());
        let normal = (turned(h) - turned(-h)) / (2. * h);
        let found = f64::from(by_normal.dot(axis.as_vec3()));
        assert!(
            (normal - found).abs() < 0.05,
            "normal {axis}: {normal} {found}"
        );
    }
    assert!(
        by_place.length() > 0.3,
        "the world is to be uneven: {by_place}"
    );
}

/// A floor, a wall that meets it, and a plate 0.1 mm above the floor.
fn tight_places() -> Stage {
    let mut wall = square(2.);
    wall.positions = vec![[-2., 0., 0.], [2., 0., 0.], [2., 4., 0.], [-2., 4., 0.]];
    let light = Light::Point {
        position: [0., 2., 2.],
        intensity: [5.; 3],
    };
    global(scene(
        vec![light],
        vec![square(4.), wall, square(0.3)],
        vec![
            object("floor", 0, AT_ORIGIN),
            object("wall", 1, AT_ORIGIN),
            object("plate", 2, moved(0., 1e-4, 1.)),
        ],
    ))
}

/// In a corner, on a wall and in a gap: never negative, never NaN, whatever the pixel's size.
#[test]
fn tight_places_are_finite() {
    let stage = tight_places();
    let cache = stage.irradiance().unwrap();
    let at = |position: DVec3, normal: DVec3, instance: u32| Receiver {
        position,
        normal,
        face_normal: normal.as_vec3(),
        clearance: 1e-6,
        instance,
        face: 0,
    };
    for pixel in [1e-4, 5e-3, 0.5] {
        for (place, lit) in [
            (at(dvec3(0.1, 0., 1e-7), DVec3::Y, 0), true),
            (at(dvec3(0.1, 0., 0.), DVec3::Y, 0), true),
            (at(dvec3(0.1, 1e-6, 0.), DVec3::Z, 1), true),
            (at(dvec3(0.1, 1.3, 0.), DVec3::Z, 1), true),
            (at(dvec3(0.05, 0., 1.02), DVec3::Y, 0), false),
        ] {
            let found = cache.irradiance(&stage, &place, pixel).irradiance;
            assert!(
                found.is_finite() && found.min_element() >= 0.,
                "{place:?}: {found}"
            );
            if lit {
                assert!(found.x > 0.02, "{place:?} at {pixel}: {found}");
            } else if pixel < 0.01 {
                assert!(found.x < 0.02, "light leaks into the gap: {found}");
            }
        }
    }
}

/// An answer that cannot wait is provisional until the work is done, and then that which waits; nothing depends on the order.
#[test]
fn provisional_answers_become_final_ones() {
    let light = Light::Point {
        position: [0., 0.2, 0.1],
        intensity: [2.; 3],
    };
    let scene = scene(
        vec![light],
        vec![closed_box()],
        vec![object("box", 0, AT_ORIGIN)],
    );
    let patient = global(scene.clone());
    let hasty = global(scene).with_patience(Patience::AtOnce);
    let (final_one, cache) = (patient.irradiance().unwrap(), hasty.irradiance().unwrap());
    let places: Vec<Receiver> = inside(&hasty).collect();
    assert!(
        places
            .iter()
            .any(|at| cache.irradiance(&hasty, at, 0.01).is_provisional)
    );
    // Each round of work may show that finer records are wanting.
    for _ in 0..12 {
        while cache.work(&hasty) {}
        for at in &places {
            let _ = cache.irradiance(&hasty, at, 0.01);
        }
    }
    assert_eq!(cache.waiting(), 0);
    for at in places.iter().rev() {
        let (ours, theirs) = (
            cache.irradiance(&hasty, at, 0.01),
            final_one.irradiance(&patient, at, 0.01),
        );
        assert_eq!(ours, theirs);
        assert!(!ours.is_provisional);
    }
}

/// An edit makes those records stale that it concerns, which serve until they are replaced; others stay.
#[test]
fn edits_make_stale_what_they_concern() {
    let light = Light::Point {
        position: [0., 2., 0.],
        intensity: [9.; 3],
    };
    // Two floors far apart, a lid above each; rays from one pair hardly meet the other.
    let stage = global(scene(
        vec![light],
        vec![square(1.), square(0.3)],
        vec![
            object("floor", 0, AT_ORIGIN),
            object("lid", 1, moved(0., 0.7, 0.)),
            object("far floor", 0, moved(9., 0., 0.)),
            object("far lid", 1, moved(9., 0.7, 0.)),
        ],
    ))
    .with_patience(Patience::AtOnce);
    let at = |x: f64| Receiver {
        position: dvec3(x, 0., 0.1),
        normal: DVec3::Y,
        face_normal: Vec3::Y,
        clearance: 1e-6,
        instance: if x < 5. { 0 } else { 2 },
        face: 0,
    };
    let settle = |stage: &Stage| {
        let cache = stage.irradiance().unwrap();
        for _ in 0..12 {
            for x in [0.05, 9.05] {
                let _ = cache.irradiance(stage, &at(x), 0.02);
            }
            while cache.work(stage) {}
        }
        [0.05, 9.05].map(|x| cache.irradiance(stage, &at(x), 0.02))
    };
    let before = settle(&stage);
    let records = stage.irradiance().unwrap().tally().records;
    let change = ObjectMove {
        object: 1,
        transform: moved(0., 0.4, 0.),
    };
    let edited = stage.edited(&[change], &[]).unwrap();
    let cache = edited.irradiance().unwrap();
    let tally = cache.tally();
    assert!(
        tally.records == 0 && tally.stale > 0 && tally.kept > 0,
        "{tally:?} of {records}"
    );
    let near = cache.irradiance(&edited, &at(0.05), 0.02);
    assert!(
        near.is_provisional && near.irradiance == before[0].irradiance,
        "{near:?}"
    );
    let after = settle(&edited);
    assert!(!after[0].is_provisional && after[0].irradiance != before[0].irradiance);
    // Final answers forget everything: with four reflections everything depends on everything.
    let fresh = edited.with_patience(Patience::Final);
    assert_eq!(
        fresh
            .edited(&[change], &[])
            .unwrap()
            .irradiance()
            .unwrap()
            .tally()
            .records,
        0
    );
}
