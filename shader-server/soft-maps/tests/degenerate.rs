//! Lights and receivers for which the geometry is degenerate.

mod common;

use common::{by_rays, ground, on_ground, sees, segment, sheet, solid};
use glam::{Vec3, vec3};
use rays::{Bounds, World};
use soft_maps::{BuildError, Light, Options, Receiver, SoftMaps};

fn options() -> Options {
    Options {
        texel_angle: 0.01,
        ..Options::default()
    }
}

/// Receivers everywhere, in all directions.
fn everywhere() -> impl Iterator<Item = Receiver> {
    let steps = [-3., -1., -0.5, 0., 0.25, 1., 3.];
    let normals = [Vec3::Y, Vec3::NEG_Y, Vec3::X, vec3(0.6, 0., 0.8)];
    steps.into_iter().flat_map(move |x| {
        steps.into_iter().flat_map(move |y| {
            steps.into_iter().flat_map(move |z| {
                normals.map(|normal| Receiver {
                    position: vec3(x, y, z),
                    normal,
                    face_normal: normal,
                })
            })
        })
    })
}

fn is_sound(maps: &SoftMaps) {
    for receiver in everywhere() {
        let share = maps.fraction(&receiver).share;
        assert!((0. ..=1.).contains(&share), "{receiver:?}: {share}");
    }
    for [first, second] in maps.channels() {
        let valid = |value: &f32| (0. ..=1.).contains(value);
        assert!(first.iter().chain(&second).all(valid));
    }
}

fn rectangle(half: f32, y: f32) -> Vec<Vec3> {
    // Shines down.
    vec![
        vec3(-half, y, -half),
        vec3(half, y, -half),
        vec3(half, y, half),
        vec3(-half, y, half),
    ]
}

#[test]
fn nothing_is_not_a_number() {
    let worlds = [
        World::new(vec![]),
        World::new(vec![ground(4.)]),
        // The light is in the ground, or coplanar with a sheet.
        World::new(vec![
            ground(4.),
            sheet(vec3(-1., 1., -1.), Vec3::X * 2., Vec3::Z * 2.),
        ]),
        // A blocker through the light, and the light inside of one.
        World::new(vec![
            ground(4.),
            solid(vec3(-0.2, 0.5, -0.5), vec3(0.3, 3., 0.5)),
        ]),
        World::new(vec![
            ground(4.),
            solid(vec3(-3., -2., -3.), vec3(3., 3., 3.)),
        ]),
    ];
    let lights = [
        Light::Segment([vec3(-0.5, 1., 0.), vec3(0.5, 1., 0.)]),
        Light::Segment([vec3(-0.5, 0., 0.), vec3(0.5, 0., 0.)]),
        Light::Segment([vec3(0., 1., 0.), vec3(0., 3., 0.)]),
        Light::Segment([vec3(0.5, 2., 0.5); 2]),
        Light::Segment([vec3(0.5, 2., 0.5), vec3(0.5, 2., 0.500_001)]),
        Light::Polygon {
            vertices: rectangle(0.5, 2.),
            instance: None,
        },
        Light::Polygon {
            vertices: rectangle(0.5, 1.),
            instance: Some(1),
        },
    ];
    for world in &worlds {
        for light in &lights {
            let coarse = Options {
                texel_angle: 0.03,
                ..Options::default()
            };
            is_sound(&SoftMaps::build(world, light, &coarse).unwrap());
        }
    }
}

#[test]
fn lights_that_make_no_sense_are_refused() {
    let world = World::new(vec![ground(4.)]);
    let nan = Light::Segment([Vec3::NAN, Vec3::ZERO]);
    assert_eq!(
        SoftMaps::build(&world, &nan, &options()).err(),
        Some(BuildError::NotFinite)
    );
    for vertices in [
        vec![],
        vec![Vec3::X; 4],
        vec![Vec3::ZERO, Vec3::X, Vec3::X * 2.],
    ] {
        let flat = Light::Polygon {
            vertices,
            instance: None,
        };
        assert_eq!(
            SoftMaps::build(&world, &flat, &options()).err(),
            Some(BuildError::NoArea)
        );
    }
}

#[test]
fn a_light_without_length_is_a_point() {
    let blocker = sheet(vec3(-0.5, 1., -0.5), Vec3::X, Vec3::Z);
    let world = World::new(vec![ground(4.), blocker]);
    let at = vec3(0.3, 3., -0.2);
    let maps = SoftMaps::build(&world, &Light::Segment([at; 2]), &options()).unwrap();
    assert_eq!(maps.stats().samples, 1);
    let mut wrong = 0;
    for i in 0..900 {
        let receiver = on_ground(-2. + 0.13 * (i % 30) as f32, -2. + 0.131 * (i / 30) as f32);
        let expected = f32::from(u8::from(sees(&world, &receiver, at, None)));
        wrong += usize::from((maps.fraction(&receiver).share - expected).abs() > 0.5);
    }
    // One texel along an outline of 6 m.
    assert!(wrong < 20, "{wrong}");
}

#[test]
fn empty_background_hides_nothing_and_takes_no_skins() {
    let lone = solid(vec3(-0.5, 1., -0.5), vec3(0.5, 2., 0.5));
    let world = World::new(vec![lone]);
    let light = Light::Segment([vec3(-1., 4., 0.), vec3(1., 4., 0.)]);
    let maps = SoftMaps::build(&world, &light, &options()).unwrap();
    let stats = maps.stats();
    assert_eq!(stats.undersampled, 0, "{stats:?}");
    assert!(stats.edges > 0);
    is_sound(&maps);
    let top = Receiver {
        position: vec3(0.2, 2., 0.1),
        normal: Vec3::Y,
        face_normal: Vec3::Y,
    };
    assert_eq!(maps.fraction(&top).share, 1.);
}

#[test]
fn receivers_that_face_away_get_nothing() {
    let world = World::new(vec![ground(4.)]);
    let light = Light::Segment([vec3(-1., 4., 0.), vec3(1., 4., 0.)]);
    let maps = SoftMaps::build(&world, &light, &options()).unwrap();
    let away = Receiver {
        position: vec3(0.1, 0., 0.2),
        normal: Vec3::NEG_Y,
        face_normal: Vec3::Y,
    };
    assert_eq!(maps.fraction(&away).share, 0.);
    let above = Light::Polygon {
        vertices: rectangle(0.5, 2.),
        instance: None,
    };
    let maps = SoftMaps::build(&world, &above, &options()).unwrap();
    let behind = Receiver {
        position: vec3(0., 3., 0.),
        normal: Vec3::NEG_Y,
        face_normal: Vec3::Y,
    };
    assert_eq!(maps.fraction(&behind).share, 0.);
    assert_eq!(maps.fraction(&on_ground(0.3, 0.2)).share, 1.);
}

#[test]
fn an_update_is_a_fresh_build_of_fewer_rows() {
    let light = Light::Segment([vec3(-1., 4., 0.), vec3(1., 4., 0.)]);
    let at = |x: f32| vec![ground(4.), solid(vec3(x, 0.5, 1.), vec3(x + 0.5, 1., 1.5))];
    let (before, after) = (World::new(at(-1.)), World::new(at(0.5)));
    let moved: Vec<Bounds> = [&before, &after].map(|w| w.instance_bounds(1)).to_vec();
    let mut maps = SoftMaps::build(&before, &light, &options()).unwrap();
    let built = maps.stats().traced_rows;
    maps.update(&after, &moved);
    let traced = maps.stats().traced_rows - built;
    assert!(0 < traced && traced < built / 4, "{traced} of {built}");
    let fresh = SoftMaps::build(&after, &light, &options()).unwrap();
    for i in 0..2500 {
        let receiver = on_ground(-3. + 0.12 * (i % 50) as f32, -3. + 0.12 * (i / 50) as f32);
        assert_eq!(maps.fraction(&receiver), fresh.fraction(&receiver));
    }
    // A world that outgrows the maps gets new ones.
    let far = World::new(vec![ground(4.), solid(vec3(6., 0.5, 6.), vec3(7., 1., 7.))]);
    maps.update(&far, &[after.instance_bounds(1), far.instance_bounds(1)]);
    let receiver = on_ground(3.9, 3.9);
    let expected = by_rays(&far, &receiver, segment(&light), 100);
    assert!((maps.fraction(&receiver).share - expected).abs() < 0.05);
}
