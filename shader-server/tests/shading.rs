//! Radiance of scenes whose answer is known in closed form.
#![allow(clippy::unwrap_used)]

mod common;

use std::{f32::consts::PI, sync::Arc};

use common::{AT_ORIGIN, box_of_lights, object, scene, square};
use glam::{DVec3, Vec3, dvec3, vec3};
use protocol::{
    messages::{NO_OBJECT, Triple, flags},
    scene::{Light, Mesh, Scene},
};
use rays::Ray;
use shader_server::{
    Shader, Stage,
    lights::{Receiver, polygon},
    random::Stream,
    shadows::{ShadowRays, Shadows},
};

fn stage(scene: Scene) -> Stage {
    Stage::build(Arc::new(scene)).unwrap()
}

fn shade(stage: &Stage, seed: u64, from: Vec3, to: Vec3) -> protocol::messages::Sample {
    let ray = Ray {
        origin: from,
        direction: (to - from).normalize(),
    };
    Shader::new(stage, &ShadowRays::default(), seed)
        .shade(1, &ray)
        .sample
}

fn quad(corners: [[f32; 3]; 4]) -> Mesh {
    Mesh {
        positions: corners.to_vec(),
        faces: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

/// A rectangle facing down at height `y`.
fn ceiling_light(x: [f32; 2], z: [f32; 2], y: f32, radiance: f32) -> Light {
    let vertices = vec![
        [x[0], y, z[0]],
        [x[1], y, z[0]],
        [x[1], y, z[1]],
        [x[0], y, z[1]],
    ];
    Light::Area {
        vertices,
        radiance: [radiance; 3],
    }
}

/// In a box of six lights of radiance 2 every irradiance is 2π: a surface of reflectance 0.5 shows radiance 1, however it
/// lies.
#[test]
fn furnace_of_area_lights() {
    let lights = box_of_lights(2.);
    let tilted = quad([
        [-0.3, 0.1, -0.3],
        [-0.2, 0., 0.3],
        [0.3, -0.1, 0.3],
        [0.2, 0., -0.3],
    ]);
    let stage = stage(scene(
        lights,
        vec![tilted],
        vec![object("card", 0, AT_ORIGIN)],
    ));
    for eye in [vec3(0.2, 0.8, 0.1), vec3(-0.1, -0.7, 0.3)] {
        for target in [
            vec3(0., 0., 0.),
            vec3(0.1, -0.01, 0.1),
            vec3(-0.2, 0.03, -0.1),
        ] {
            let sample = shade(&stage, 3, eye, target);
            assert_eq!((sample.object, sample.flags), (0, 0));
            assert!((sample.radiance[0] - 1.).abs() < 1e-4, "{sample:?}");
        }
        let light = shade(&stage, 3, eye, eye + vec3(5., 0.2, 0.1));
        assert_eq!((light.flags, light.radiance), (flags::LIGHT, [2.; 3]));
    }
}

/// In a sphere of radius 1 around a point light of 2π W/sr every irradiance is 2π.
#[test]
fn furnace_of_a_point_light() {
    let (rings, around) = (80, 160);
    let mut sphere = Mesh::default();
    for ring in 0..=rings {
        let (sin, cos) = (PI * ring as f32 / rings as f32).sin_cos();
        for step in 0..around {
            let (s, c) = (2. * PI * step as f32 / around as f32).sin_cos();
            sphere.positions.push([sin * c, cos, sin * s]);
            sphere.normals.push([sin * c, cos, sin * s]);
        }
    }
    for ring in 0..rings {
        for step in 0..around {
            let next = (step + 1) % around;
            let [a, b] = [ring * around + step, ring * around + next];
            let [c, d] = [a + around, b + around];
            sphere.faces.extend([[a, b, c], [b, d, c]]);
        }
    }
    sphere.face_normals = sphere.faces.clone();
    let light = Light::Point {
        position: [0.; 3],
        intensity: [2. * PI; 3],
    };
    let stage = stage(scene(
        vec![light],
        vec![sphere],
        vec![object("sphere", 0, AT_ORIGIN)],
    ));
    for i in 0..200 {
        let (a, b) = (i as f32 * 2.4, (i as f32 + 0.5) / 100. - 1.);
        let r = (1. - b * b).sqrt();
        let sample = shade(
            &stage,
            1,
            vec3(0.3, 0.1, -0.2),
            vec3(r * a.cos(), b, r * a.sin()),
        );
        assert!((sample.radiance[1] - 1.).abs() < 2e-3, "{sample:?}");
    }
}

#[test]
fn linear_lights_follow_the_closed_form_and_are_halved_by_half_a_screen() {
    let light = Light::Linear {
        from: [-2., 1.5, 0.],
        to: [2., 1.5, 0.],
        intensity: [3.; 3],
    };
    let floor = object("floor", 0, AT_ORIGIN);
    let open = stage(scene(
        vec![light.clone()],
        vec![square(4.)],
        vec![floor.clone()],
    ));
    // E = I·2a/(h·√(a²+h²))
    let expected = 0.5 / PI * 3. * 2. * 2. / (1.5 * (4f32 + 2.25).sqrt());
    let sample = shade(&open, 1, vec3(0.1, 1., 2.), Vec3::ZERO);
    assert!(
        (sample.radiance[0] / expected - 1.).abs() < 1e-5,
        "{sample:?}"
    );

    let screen = quad([[0., 0.5, -1.], [0., 0.5, 1.], [9., 0.5, 1.], [9., 0.5, -1.]]);
    let objects = vec![floor, object("screen", 1, AT_ORIGIN)];
    let half = stage(scene(vec![light], vec![square(4.), screen], objects));
    for seed in 0..50 {
        let sample = shade(&half, seed, vec3(-0.1, 0.4, 2.), Vec3::ZERO);
        assert!(
            (sample.radiance[0] / expected - 0.5).abs() < 4e-3,
            "{sample:?}"
        );
    }
}

/// A half-plane blocker cuts a rectangle off an area light; what is left has a closed form too.
#[test]
fn penumbrae_of_area_lights_follow_the_closed_form() {
    let light = ceiling_light([-1., 1.], [-1., 1.], 2., 1.);
    let screen = quad([[0., 1., -9.], [0., 1., 9.], [9., 1., 9.], [9., 1., -9.]]);
    let objects = vec![
        object("floor", 0, AT_ORIGIN),
        object("screen", 1, AT_ORIGIN),
    ];
    let stage = stage(scene(vec![light], vec![square(4.), screen], objects));
    let runs = 64;
    for x in [-0.9f32, -0.6, -0.3, 0., 0.25, 0.45, 0.49] {
        // From (x, 0, 0) the edge x = 0, y = 1 is seen at -x on the light's plane.
        let edge = f64::from((-x).clamp(-1., 1.));
        let p = dvec3(x.into(), 0., 0.);
        let part = |x: [f64; 2]| {
            let corners = [(x[0], -1.), (x[1], -1.), (x[1], 1.), (x[0], 1.)];
            polygon::irradiance(corners.iter().map(|(x, z)| dvec3(*x, 2., *z) - p), DVec3::Y)
        };
        let to_radiance = 0.5 / std::f64::consts::PI;
        let (expected, whole) = (
            part([-1., edge]) * to_radiance,
            part([-1., 1.]) * to_radiance,
        );
        let (mut mean, mut spread) = (0., 0.);
        for seed in 0..runs {
            let target = vec3(x, 0., 0.);
            let sample = shade(&stage, seed, target + vec3(-0.2, 0.6, 0.1), target);
            mean += f64::from(sample.radiance[0]) / runs as f64;
            spread += (f64::from(sample.radiance[0]) - expected).powi(2) / runs as f64;
        }
        assert!(
            (mean - expected).abs() < 0.004 * whole,
            "{x}: {mean} {expected} of {whole}"
        );
        assert!(
            spread.sqrt() < 0.015 * whole,
            "{x}: {} of {whole}",
            spread.sqrt()
        );
    }
}

#[test]
fn lights_block_lights_but_make_no_triples() {
    let lamp = ceiling_light([-0.2, 0.2], [-0.2, 0.2], 1., 0.);
    let above = Light::Point {
        position: [0., 3., 0.],
        intensity: [9.; 3],
    };
    let floor = object("floor", 0, AT_ORIGIN);
    let stage = stage(scene(vec![above, lamp], vec![square(4.)], vec![floor]));
    let shadows = ShadowRays::default();
    let mut shader = Shader::new(&stage, &shadows, 1);
    let ray = Ray {
        origin: vec3(0., 0.5, 1.),
        direction: vec3(0., -0.5, -1.).normalize(),
    };
    assert_eq!(shader.shade(1, &ray).sample.radiance, [0.; 3]);
    assert_eq!(shader.take_triples(), []);
    // From above, the lamp shows its dark back.
    let down = Ray {
        origin: vec3(0., 2., 0.),
        direction: Vec3::NEG_Y,
    };
    let sample = shader.shade(2, &down).sample;
    assert_eq!(
        (sample.object, sample.flags, sample.radiance),
        (1, flags::LIGHT, [0.; 3])
    );
    let up = Ray {
        direction: Vec3::Y,
        ..down
    };
    let miss = shader.shade(3, &up).sample;
    assert_eq!(
        (miss.object, miss.flags, miss.radiance),
        (NO_OBJECT, flags::MISS, [0.25, 0.5, 1.])
    );
}

/// Shadows reach to within a tenth of a millimetre of a box on the floor, and the lit side is lit as close.
#[test]
fn contact_shadows_are_tight() {
    for (scale, offset) in [(1., 0.), (1., 100.), (0.01, 0.)] {
        let wall = quad([
            [offset, 0., -scale],
            [offset, 0., scale],
            [offset, scale, scale],
            [offset, scale, -scale],
        ]);
        let mut floor = square(4. * scale);
        floor.positions.iter_mut().for_each(|p| p[0] += offset);
        let (x, y, small) = (offset - 2. * scale, 2. * scale, 0.01 * scale);
        let point = Light::Point {
            position: [x, y, 0.],
            intensity: [1.; 3],
        };
        let area = ceiling_light([x - small, x + small], [-small, small], y, 100.);
        for light in [point, area] {
            let objects = vec![object("floor", 0, AT_ORIGIN), object("wall", 1, AT_ORIGIN)];
            let stage = stage(scene(
                vec![light],
                vec![floor.clone(), wall.clone()],
                objects,
            ));
            let shadows = ShadowRays::default();
            let mut triples = vec![];
            for (gap, lit) in [(1e-4, false), (-1e-4, true), (0.01, false), (-0.01, true)] {
                let target = vec3(offset + gap, 0., 0.1 * scale);
                let mut shader = Shader::new(&stage, &shadows, 1);
                let ray = Ray {
                    origin: target + Vec3::Y * scale,
                    direction: Vec3::NEG_Y,
                };
                let sample = shader.shade(1, &ray).sample;
                assert_eq!(sample.object, 0);
                assert_eq!(sample.radiance[0] > 0., lit, "{scale} {offset} {gap}");
                triples.extend(shader.take_triples());
            }
            assert_eq!(
                triples,
                [Triple {
                    light: 0,
                    blocker: 1,
                    receiver: 0
                }; 2]
            );
        }
    }
}

/// Turned, mirrored and unevenly scaled instances are lit as the same surface laid out in world space.
#[test]
fn transforms_change_nothing_but_the_place() {
    let world = [
        [-0.5f32, 0.2, -1.],
        [-0.7, 0., 1.],
        [0.9, 0.3, 1.2],
        [1.1, 0.5, -0.8],
    ];
    let lights = vec![
        ceiling_light([-1., 1.], [-1., 1.], 2., 1.),
        Light::Point {
            position: [0.5, 1.5, 0.3],
            intensity: [1.; 3],
        },
    ];
    let plain = quad(world);
    let card = object("card", 0, AT_ORIGIN);
    let expected = stage(scene(lights.clone(), vec![plain], vec![card]));
    // p' = m·p with a determinant below zero, inverted by hand: x and z exchanged and stretched.
    let transform = [[0., 0., 4., 1.], [0., 0.5, 0., -2.], [0.25, 0., 0., 3.]];
    let local = world.map(|[x, y, z]| [(z - 3.) / 0.25, (y + 2.) / 0.5, (x - 1.) / 4.]);
    let moved = stage(scene(
        lights,
        vec![quad(local)],
        vec![object("card", 0, transform)],
    ));
    for (x, z) in [(0., 0.), (0.3, 0.5), (-0.4, -0.6), (0.8, 0.9)] {
        let (eye, target) = (vec3(x, 1.2, z + 0.2), vec3(x, 0.2, z));
        let a = shade(&expected, 1, eye, target);
        let b = shade(&moved, 1, eye, target);
        assert!(
            Vec3::from(a.position).abs_diff_eq(b.position.into(), 1e-5),
            "{a:?} {b:?}"
        );
        assert!(
            (a.radiance[0] / b.radiance[0] - 1.).abs() < 1e-4,
            "{a:?} {b:?}"
        );
    }
}

/// Drawing faces onto a light finds what many rays find, for lights of any shape, near the horizon too; what is drawn reports
/// what blocks, and asks no rays.
#[test]
fn drawn_faces_shade_as_rays_do() {
    let outlines = [
        vec![[-1., 2., -1.], [1., 2., -1.], [1., 2., 1.], [-1., 2., 1.]],
        vec![[-1., 2., -1.], [1., 2.2, -1.], [0., 2., 1.2]],
        vec![[4., 0.1, -1.], [4., 1.3, -1.], [4., 1.3, 1.], [4., 0.1, 1.]],
    ];
    let bars = [-0.6f32, -0.1, 0.3].map(|x| {
        quad([
            [x, 0.9, -9.],
            [x + 0.2, 0.9, -9.],
            [x + 0.2, 0.9, 9.],
            [x, 0.9, 9.],
        ])
    });
    let upright = quad([
        [1.5, -1., -0.3],
        [1.5, -1., 0.4],
        [1.5, 0.6, 0.4],
        [1.5, 0.6, -0.3],
    ]);
    let mut objects = vec![object("floor", 0, AT_ORIGIN)];
    objects.extend((1..=4).map(|mesh| object("blocker", mesh, AT_ORIGIN)));
    let [a, b, c] = bars;
    let meshes = vec![square(4.), a, b, c, upright];
    let mut partly = 0;
    for vertices in outlines {
        let light = Light::Area {
            vertices,
            radiance: [1.; 3],
        };
        let stage = stage(scene(vec![light], meshes.clone(), objects.clone()));
        let emitter = &stage.emitters()[0];
        let rays = ShadowRays {
            max_rays: 0,
            strata: 32,
            drawn_faces: 0,
        };
        for i in 0..60 {
            let mut stream = Stream::new(8, i);
            let at = (stream.square().as_dvec2() - 0.5) * 2.;
            let receiver = Receiver {
                position: dvec3(at.x, 0., at.y),
                normal: DVec3::Y,
                face_normal: Vec3::Y,
                clearance: 1e-6,
                instance: 0,
                face: 0,
            };
            let ask = |method: &ShadowRays, seed: u64| {
                let mut met = Shadows::default();
                let stream = &mut Stream::new(seed, i);
                let seen = method.fraction(&stage, emitter, &receiver, stream, &mut met);
                met.blockers.sort_unstable();
                (seen, met)
            };
            let mean =
                |method: &ShadowRays| (0..4).map(|seed| ask(method, seed).0).sum::<f32>() / 4.;
            let (drawn, traced) = (mean(&ShadowRays::default()), mean(&rays));
            assert!(
                (drawn - traced).abs() < 0.012,
                "{receiver:?}: {drawn} {traced}"
            );
            let (seen, met) = ask(&ShadowRays::default(), 1);
            assert_eq!(met.rays, 0);
            if (0.02..0.98).contains(&seen) {
                partly += 1;
                // A ray knows of one blocker alone, where another may be in the way too.
                let traced = ask(&rays, 1).1.blockers;
                assert!(
                    traced.iter().all(|b| met.blockers.contains(b)),
                    "{receiver:?}: {traced:?} {:?}",
                    met.blockers
                );
            }
        }
    }
    assert!(partly > 20, "{partly}");
}
