//! Ways to find visibility keep up with edits.
#![allow(clippy::unwrap_used)]

mod common;

use std::sync::Arc;

use common::{AT_ORIGIN, moved, object, scene, sphere, square};
use glam::{Vec3, vec3};
use protocol::{
    messages::{LightMove, ObjectMove, ShadowMethod},
    scene::{Light, Scene},
};
use rays::Ray;
use shader_server::{
    Stage,
    random::Stream,
    shadows::{Asked, Chosen, ShadowOptions, Shadows, Visibility, Wish},
};

fn area(x: f32) -> Light {
    Light::Area {
        vertices: vec![
            [x - 0.7, 3., -0.7],
            [x + 0.7, 3., -0.7],
            [x + 0.7, 3., 0.7],
            [x - 0.7, 3., 0.7],
        ],
        radiance: [3.; 3],
    }
}

fn line(x: f32) -> Light {
    Light::Linear {
        from: [x - 0.5, 2., 0.4],
        to: [x + 0.5, 2., 0.6],
        intensity: [3.; 3],
    }
}

/// A floor, a ball over it, and two lights.
fn ball_under(lights: &[Light; 2], ball: Vec3) -> Scene {
    let at = moved(ball.x, ball.y, ball.z);
    let objects = vec![object("floor", 0, AT_ORIGIN), object("ball", 1, at)];
    let mut small = sphere(12, 24);
    for position in &mut small.positions {
        *position = position.map(|x| 0.4 * x);
    }
    scene(lights.to_vec(), vec![square(3.), small], objects)
}

fn stage(scene: Scene) -> Stage {
    Stage::build(Arc::new(scene)).unwrap()
}

/// What points all over the floor see of each light, and what blocks.
fn answers(stage: &Stage, chosen: &Chosen) -> (Vec<f32>, Vec<(u32, u32)>) {
    let (mut seen, mut met) = (vec![], vec![]);
    for light in 0..stage.emitters().len() {
        let mut asked: Vec<Asked> = (0..900)
            .map(|i| {
                let place = vec3((i % 30) as f32 - 14.5, 0., (i / 30) as f32 - 14.5) / 6.;
                let ray = Ray {
                    origin: place + 0.01 * Vec3::Y,
                    direction: Vec3::NEG_Y,
                };
                let hit = stage.world().closest(&ray, 1.).unwrap();
                let surface = stage.surface(&hit).unwrap();
                let receiver = surface.seen_along(ray.direction.as_dvec3(), hit.instance, hit.face);
                Asked {
                    receiver,
                    stream: Stream::new(3, i),
                    index: i as usize,
                    unoccluded: 1.,
                    seen: -1.,
                }
            })
            .collect();
        let mut shadows = Shadows::default();
        chosen.ask(stage, light, &mut asked, &mut shadows);
        seen.extend(asked.iter().map(|asked| asked.seen));
        shadows.met.sort_unstable();
        shadows.met.dedup();
        met.extend(shadows.met);
    }
    (seen, met)
}

fn chosen(stage: &Stage, method: ShadowMethod) -> Chosen {
    let wish = Wish {
        methods: vec![method; 2],
        ..Wish::default()
    };
    Chosen::new(stage, ShadowOptions::default(), wish)
}

#[test]
fn edits_give_what_a_scene_made_anew_gives() {
    let (from, to) = (vec3(-0.5, 1., 0.), vec3(0.4, 0.8, 0.3));
    let object_moves = [ObjectMove {
        object: 1,
        transform: moved(to.x, to.y, to.z),
    }];
    let light_moves = |light: u32, value: Light| vec![LightMove { light, value }];
    let edits = [
        (&object_moves[..], vec![], [area(0.), line(0.)]),
        (&[][..], light_moves(0, area(0.6)), [area(0.6), line(0.)]),
        (&[][..], light_moves(1, line(-0.6)), [area(0.), line(-0.6)]),
    ];
    for method in [
        ShadowMethod::Rays,
        ShadowMethod::Penumbra,
        ShadowMethod::SoftMap,
    ] {
        for (objects, lights, now) in &edits {
            let before = stage(ball_under(&[area(0.), line(0.)], from));
            let after = before.edited(objects, lights).unwrap();
            let kept = chosen(&before, method).after((&before, &after), objects, lights);
            let ball = if objects.is_empty() { from } else { to };
            let anew = stage(ball_under(now, ball));
            let expected = answers(&anew, &chosen(&anew, method));
            let found = answers(&after, &kept);
            let what = format!("{method:?}, {objects:?}, {lights:?}");
            assert!(
                expected.0.iter().any(|share| *share < 0.1),
                "no shadow: {what}"
            );
            let off: Vec<f32> = found
                .0
                .iter()
                .zip(&expected.0)
                .map(|(a, b)| (a - b).abs())
                .collect();
            let worst = off.iter().copied().fold(0., f32::max);
            // Maps may cover more than maps made anew would, and have their texels elsewhere.
            let rms = (off.iter().map(|d| d * d).sum::<f32>() / off.len() as f32).sqrt();
            if method == ShadowMethod::SoftMap {
                assert!(rms < 0.03, "{what}: {rms} rms");
            } else {
                assert!(worst == 0., "{what}: {worst}");
                assert_eq!(found.1, expected.1, "{what}");
            }
        }
    }
}

/// The automatic choice is the same in every run where it must be, and what it takes is near the truth.
#[test]
fn what_is_chosen_is_steady_and_good_enough() {
    let stage = stage(ball_under(&[area(0.), line(0.)], vec3(0., 1., 0.)));
    let options = ShadowOptions {
        steady: true,
        ..ShadowOptions::default()
    };
    let of = |error| {
        let wish = Wish {
            error,
            ..Wish::default()
        };
        Chosen::new(&stage, options, wish)
    };
    let (truth, _) = answers(&stage, &of(0.));
    for error in [0.05, 0.01] {
        let (first, again) = (of(error), of(error));
        for light in 0..2 {
            assert_eq!(first.method(light), again.method(light));
        }
        let (found, _) = answers(&stage, &first);
        assert_eq!(found, answers(&stage, &again).0);
        let penumbral = found
            .iter()
            .zip(&truth)
            .filter(|(a, b)| (0.001..0.999).contains(*a) || (0.001..0.999).contains(*b));
        let squares: Vec<f32> = penumbral.map(|(a, b)| (a - b) * (a - b)).collect();
        let rms = (squares.iter().sum::<f32>() / squares.len() as f32).sqrt();
        assert!(squares.len() > 100, "{} in penumbrae", squares.len());
        assert!(rms < 1.5 * error, "{rms} for {error}");
    }
}

/// Lights past the first few are not tried: a scene may have tens of thousands.
#[test]
fn very_many_lights_are_not_all_tried() {
    let lights: Vec<Light> = (0..40).map(|i| area(0.02 * i as f32)).collect();
    let few = ball_under(&[area(0.), line(0.)], vec3(0., 1., 0.));
    let stage = stage(Scene { lights, ..few });
    let chosen = Chosen::new(&stage, ShadowOptions::default(), Wish::default());
    let told = chosen.told().next();
    let Some(protocol::ToDisplay::Shadows { lights }) = told else {
        panic!("{told:?}");
    };
    let untried = lights.iter().filter(|light| light.why.contains("too many"));
    assert_eq!(
        untried.map(|light| light.light).collect::<Vec<_>>(),
        (32..40).collect::<Vec<_>>()
    );
}
