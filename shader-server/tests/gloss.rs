//! Glossy reflection where the answer is known.
#![allow(clippy::unwrap_used)]

mod common;

use std::sync::Arc;

use common::{AT_ORIGIN, box_of_lights, object, scene, shade, sphere, square};
use glam::{Vec3, vec3};
use protocol::{
    messages::flags,
    scene::{Light, Model},
};
use rays::Ray;
use shader_server::{Shader, Stage, random::Stream, shadows::ShadowRays};

/// In a world of radiance 1 a convex body that absorbs nothing shows radiance 1, however rough.
#[test]
fn white_furnace_of_gloss() {
    for (specular, roughness) in [(0.04, 0.3), (0.5, 0.1), (0.9, 0.7), (1., 0.4)] {
        let mut scene = scene(
            vec![],
            vec![sphere(24, 48)],
            vec![object("sphere", 0, AT_ORIGIN)],
        );
        scene.materials[0].diffuse = [1.; 3];
        scene.materials[0].specular = [specular; 3];
        scene.materials[0].roughness = roughness;
        scene.shading.model = Model::Global;
        scene.shading.background = [1.; 3];
        let stage = Stage::build(Arc::new(scene)).unwrap();
        for target in [vec3(0., 0., 0.), vec3(0.3, 0.5, 0.), vec3(0.7, 0.1, 0.)] {
            let sample = shade(&stage, vec3(0., 0.3, 4.), target);
            assert_eq!(sample.flags, flags::VIEW_DEPENDENT);
            assert!(
                (sample.radiance[0] - 1.).abs() < 0.03,
                "{specular} {roughness} {target}: {sample:?}"
            );
        }
    }
}

/// The same in a box of six area lights without indirect light, for diffuse and specular together: each light's both ways of
/// being sampled add up.
#[test]
fn furnace_of_area_lights_on_gloss() {
    let lights = box_of_lights(1.);
    for roughness in [0.05, 0.2, 0.6, 1.] {
        let mut scene = scene(
            lights.clone(),
            vec![square(0.3)],
            vec![object("card", 0, AT_ORIGIN)],
        );
        scene.shading.model = Model::Glossy;
        scene.materials[0].diffuse = [1.; 3];
        scene.materials[0].specular = [0.6, 0.3, 0.1];
        scene.materials[0].roughness = roughness;
        let stage = Stage::build(Arc::new(scene)).unwrap();
        let count = 60;
        let mut sum = Vec3::ZERO;
        for i in 0..count {
            let ray = Ray {
                origin: vec3(0.4, 0.8, 0.1),
                direction: vec3(-0.4 + 0.002 * i as f32, -0.8, -0.1).normalize(),
            };
            let sample = Shader::new(&stage, &ShadowRays::default(), 3)
                .shade(i, &ray)
                .sample;
            sum += Vec3::from(sample.radiance) / count as f32;
        }
        assert!((sum - 1.).abs().max_element() < 0.02, "{roughness}: {sum}");
    }
}

/// A point light and a short linear one in its place, of the same strength, make the same highlight.
#[test]
fn highlights_of_points_and_lines_agree() {
    let radiance = |light: Light| {
        let mut scene = scene(
            vec![light],
            vec![square(1.)],
            vec![object("card", 0, AT_ORIGIN)],
        );
        scene.shading.model = Model::Glossy;
        scene.materials[0].diffuse = [0.; 3];
        scene.materials[0].specular = [0.5; 3];
        scene.materials[0].roughness = 0.3;
        let stage = Stage::build(Arc::new(scene)).unwrap();
        shade(&stage, vec3(0., 1., 1.), vec3(0., 0., 0.1)).radiance[0]
    };
    let point = radiance(Light::Point {
        position: [0., 1., -1.],
        intensity: [2.; 3],
    });
    let line = radiance(Light::Linear {
        from: [-0.005, 1., -1.],
        to: [0.005, 1., -1.],
        intensity: [200.; 3],
    });
    assert!(
        point > 0.1 && (line / point - 1.).abs() < 0.01,
        "{point} {line}"
    );
}

/// Glossy reflection of a light, of what else there is and of the world beyond, against a sum over the whole hemisphere that
/// knows of no sampling: many rays evenly spread, each weighed by the reflection's closed form.
#[test]
fn gloss_agrees_with_brute_force() {
    let light = Light::Area {
        vertices: vec![
            [-0.5, 1., -1.2],
            [0.5, 1., -1.2],
            [0.5, 2., -1.2],
            [-0.5, 2., -1.2],
        ],
        radiance: [3.; 3],
    };
    let mut wall = square(1.);
    wall.positions = vec![[0.8, 0., -1.], [0.8, 0., 1.], [0.8, 1., 1.], [0.8, 1., -1.]];
    let objects = |specular: bool| {
        let mut floor = object("floor", 0, AT_ORIGIN);
        floor.material = u32::from(specular);
        vec![floor, object("wall", 1, AT_ORIGIN)]
    };
    for roughness in [0.25f32, 0.6] {
        let build = |specular: bool| {
            let mut scene = scene(
                vec![light.clone()],
                vec![square(1.), wall.clone()],
                objects(specular),
            );
            scene.shading.model = Model::Glossy;
            scene.shading.background = [0.2, 0.3, 0.5];
            let mut gloss = scene.materials[0].clone();
            gloss.diffuse = [0.; 3];
            gloss.specular = [0.5, 0.3, 0.9];
            gloss.roughness = roughness;
            scene.materials.push(gloss);
            Stage::build(Arc::new(scene)).unwrap()
        };
        // What reflected rays meet does not depend on the floor's own gloss.
        let (glossy, plain) = (build(true), build(false));
        let (eye, target) = (vec3(-0.3, 0.9, 0.9), vec3(0.1, 0., 0.1));
        let view = (eye - target).normalize();
        let shaded = |stage: &Stage, seed: u64, from: Vec3, direction: Vec3| {
            let ray = Ray {
                origin: from,
                direction,
            };
            let sample = Shader::new(stage, &ShadowRays::default(), seed)
                .shade(seed, &ray)
                .sample;
            Vec3::from(sample.radiance)
        };
        let runs = 300;
        let ours: Vec3 = (0..runs)
            .map(|i| shaded(&glossy, i, eye, -view))
            .sum::<Vec3>()
            / runs as f32;
        let side = 500;
        let facing = vec3(0.5, 0.3, 0.9);
        let (mut sum, mut lossless) = (Vec3::ZERO, Vec3::ZERO);
        for i in 0..side * side {
            let mut stream = Stream::new(11, i);
            let cell = glam::vec2((i % side) as f32, (i / side) as f32);
            let place = (cell + stream.square()) / side as f32;
            let (sin, cos) = (std::f32::consts::TAU * place.y).sin_cos();
            let sine = (1. - place.x * place.x).sqrt();
            let direction = vec3(sine * cos, place.x, sine * sin);
            let radiance = shaded(&plain, i, target + Vec3::Y * 1e-5, direction);
            sum += ggx(direction, view, roughness, facing) * direction.y * radiance;
            lossless += ggx(direction, view, roughness, Vec3::ONE) * direction.y;
        }
        let share = std::f32::consts::TAU / (side * side) as f32;
        // What single scattering of a perfect mirror's facets loses is given back (Turquin 2019).
        let given_back = 1. + facing * ((lossless * share).recip() - 1.);
        let theirs = sum * share * given_back;
        assert!(
            (ours / theirs - 1.).abs().max_element() < 0.015,
            "{roughness}: {ours} {theirs}"
        );
    }
}

/// The GGX reflection with height-correlated masking and Schlick's Fresnel term, written out anew; the normal is y.
fn ggx(light: Vec3, view: Vec3, alpha: f32, facing: Vec3) -> Vec3 {
    let half = (light + view).normalize();
    let squared = alpha * alpha;
    let d = squared / (std::f32::consts::PI * (half.y * half.y * (squared - 1.) + 1.).powi(2));
    let lambda = |cosine: f32| (-1. + (1. + squared * (1. / (cosine * cosine) - 1.)).sqrt()) / 2.;
    let g = 1. / (1. + lambda(light.y) + lambda(view.y));
    let fresnel = facing + (1. - facing) * (1. - view.dot(half)).powi(5);
    fresnel * (d * g / (4. * light.y * view.y))
}
