use protocol::messages::{Camera, LightMove, ObjectMove, Sample};
use protocol::scene::{Mesh, Model, Object, Scene, Shading};

use super::*;
use crate::camera::View;
use crate::config::{Choices, PointCulling, Switch};
use crate::frame::{Received, Wanted};

const FLOOR: u32 = 0;
const CUBE: u32 = 1;

fn box_mesh(half: [f32; 3]) -> Mesh {
    let corner =
        |k: usize| std::array::from_fn(|axis| half[axis] * (2.0 * (k >> axis & 1) as f32 - 1.0));
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let faces = quads
        .iter()
        .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    Mesh {
        positions: (0..8).map(corner).collect(),
        faces: faces.collect(),
        ..Mesh::default()
    }
}

/// A floor whose top is y = 0 and a cube of one metre at (-3, 2, 0), under a point light and an area light that faces down.
fn scene() -> Scene {
    let object = |mesh: u32, [x, y, z]: [f32; 3]| Object {
        name: format!("object {mesh}"),
        mesh,
        material: 0,
        transform: [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, y], [0.0, 0.0, 1.0, z]],
        crease_angle: 85.0,
    };
    Scene {
        shading: Shading {
            model: Model::Direct,
            ambient: [0.0; 3],
            background: [0.0; 3],
        },
        lights: vec![
            Light::Point {
                position: [0.0, 4.0, 0.0],
                intensity: [9.0; 3],
            },
            Light::Area {
                vertices: vec![
                    [3.0, 4.0, 0.0],
                    [4.0, 4.0, 0.0],
                    [4.0, 4.0, 1.0],
                    [3.0, 4.0, 1.0],
                ],
                radiance: [5.0; 3],
            },
        ],
        materials: Vec::new(),
        textures: Vec::new(),
        meshes: vec![box_mesh([10.0, 0.5, 10.0]), box_mesh([0.5; 3])],
        objects: vec![object(0, [0.0, -0.5, 0.0]), object(1, [-3.0, 2.0, 0.0])],
    }
}

fn display_of(due_first: Switch) -> (Display, View) {
    let choices = Choices {
        due_first,
        point_culling: PointCulling::None,
        ..Choices::default()
    };
    let mut display = Display::new(&scene(), choices, 64, 48, 1);
    let view = View::new(&Camera {
        eye: [0.0, 12.0, 9.0],
        target: [0.0, 0.0, 0.0],
        up: [0.0, 1.0, 0.0],
        fov_y: 60.0,
        width: 64,
        height: 48,
    });
    display.begin(&view, 1);
    (display, view)
}

fn received(epoch: u32, id: u64, position: [f32; 3], object: u32, flags: u32) -> Received {
    let radiance = [1.0, 0.5, 0.25];
    let sample = Sample {
        id,
        position,
        object,
        radiance,
        flags,
    };
    Received {
        view: 1,
        epoch,
        sample,
        texel: None,
    }
}

fn shifted(x: f32) -> Edit {
    let transform = [
        [1.0, 0.0, 0.0, x],
        [0.0, 1.0, 0.0, 2.0],
        [0.0, 0.0, 1.0, 0.0],
    ];
    let object = CUBE;
    Edit {
        objects: vec![ObjectMove { object, transform }],
        lights: Vec::new(),
    }
}

/// Whether the point with this id's place, in slot order of insertion, is due.
fn due(display: &Display, object: u32, near: [f32; 3]) -> bool {
    let slot = (0..display.cache.capacity() as u32).find(|&s| {
        display.cache.w[s as usize] == 1.0
            && display.cache.info[s as usize].object == object
            && (display.cache.point(s) - Vec3::from(near)).length() < 1e-4
    });
    display.due.is_due(slot.unwrap())
}

#[test]
fn points_travel_exactly_and_shadows_old_and_new_are_due() {
    let (mut display, view) = display_of(Switch::On);
    let places = [[-3.25f32, 2.5, 0.125], [-2.5, 1.75, 0.25]];
    // Beyond the cube from the point light before and after, and elsewhere.
    let floor = [[-6.0f32, 0.0, 0.0], [6.0, 0.0, 0.0], [0.0, 0.0, 5.0]];
    let on_cube = places.iter().map(|p| (*p, CUBE));
    let on_floor = floor.iter().map(|p| (*p, FLOOR));
    let samples: Vec<Received> = on_cube
        .chain(on_floor)
        .zip(1..)
        .map(|((p, object), id)| received(0, id, p, object, 0))
        .collect();
    display.receive(&samples, 1);
    display.draw(&view, 1);
    assert_eq!((display.due(), display.epoch()), (0, 0));

    let changes = display.edit(1, &shifted(3.0));
    assert_eq!(changes.objects.len(), 1);
    for p in places {
        assert!(due(&display, CUBE, [p[0] + 6.0, p[1], p[2]]));
    }
    assert_eq!(
        [0, 1, 2].map(|i| due(&display, FLOOR, floor[i])),
        [true, true, false]
    );
    let exact: Vec<u32> = (0..display.cache.capacity() as u32)
        .filter(|&s| {
            display.cache.info[s as usize].object == CUBE && display.cache.w[s as usize] == 1.0
        })
        .collect();
    for (slot, p) in exact.iter().zip(places) {
        assert_eq!(
            display.cache.point(*slot),
            Vec3::new(p[0] + 6.0, p[1], p[2])
        );
    }
    assert!(display.edit(2, &shifted(3.0)).is_empty());

    // A new sample on the spot ends it; one of the epoch before does not enter.
    let points = display.cache.len();
    display.receive(&[received(1, 10, floor[0], FLOOR, 0)], 1);
    assert_eq!(
        (display.late(), display.cache.len(), display.due()),
        (1, points, 4)
    );
    display.receive(&[received(2, 11, floor[0], FLOOR, 0)], 1);
    assert_eq!(
        (display.late(), display.cache.len(), display.due()),
        (1, points, 3)
    );
}

#[test]
fn a_turn_carries_points_with_it() {
    let (mut display, _) = display_of(Switch::On);
    display.receive(&[received(0, 1, [-2.5, 2.25, 0.25], CUBE, 0)], 1);
    let transform = [
        [0.0, 0.0, 2.0, 1.0],
        [0.0, 2.0, 0.0, 3.0],
        [-2.0, 0.0, 0.0, 5.0],
    ];
    let object = CUBE;
    let edit = Edit {
        objects: vec![ObjectMove { object, transform }],
        lights: Vec::new(),
    };
    display.edit(1, &edit);
    // (0.5, 0.25, 0.25) of the cube.
    assert!(due(&display, CUBE, [1.5, 3.5, 4.0]));
    // Squashed flat it keeps no place for points when it moves on.
    let flat = [[0.0; 4], transform[1], transform[2]];
    let edit = |transform| Edit {
        objects: vec![ObjectMove { object, transform }],
        lights: Vec::new(),
    };
    display.edit(2, &edit(flat));
    display.edit(3, &edit(transform));
    assert_eq!((display.cache.len(), display.due()), (0, 0));
}

#[test]
fn a_changed_light_makes_what_it_lights_due_and_its_own_points_follow() {
    let (mut display, view) = display_of(Switch::On);
    let below = received(0, 1, [0.0, 0.0, 0.0], FLOOR, 0);
    let above = received(0, 2, [0.0, 6.0, 0.0], FLOOR, 0);
    let itself = received(0, 3, [3.5, 4.0, 0.5], 1, flags::LIGHT);
    display.receive(&[below, above, itself], 1);
    display.draw(&view, 1);
    let mut value = display.placed().lights()[1].clone();
    if let Light::Area { vertices, radiance } = &mut value {
        vertices.iter_mut().for_each(|v| v[0] -= 1.0);
        *radiance = [1.0; 3];
    }
    let lights = vec![LightMove { light: 1, value }];
    let objects = Vec::new();
    display.edit(1, &Edit { objects, lights });
    let lit = [[0.0, 0.0, 0.0], [0.0, 6.0, 0.0]].map(|p| due(&display, FLOOR, p));
    assert_eq!(lit, [true, false]);
    assert!(due(&display, 1, [2.5, 4.0, 0.5]));
}

#[test]
fn without_the_switch_nothing_is_due_and_asking_for_due_points_comes_to_an_end() {
    let (mut display, _) = display_of(Switch::Off);
    display.receive(&[received(0, 1, [-2.5, 2.25, 0.25], CUBE, 0)], 1);
    display.edit(1, &shifted(3.0));
    assert_eq!((display.due(), display.cache.len()), (0, 1));

    let (mut display, view) = display_of(Switch::On);
    display.receive(&[received(0, 1, [-2.5, 2.25, 0.25], CUBE, 0)], 1);
    display.draw(&view, 1);
    display.edit(1, &shifted(3.0));
    display.draw(&view, 1);
    let mut wanted = Wanted::default();
    display.plan(200, None, &mut wanted);
    let at = view.project(Vec3::new(3.5, 2.25, 0.25)).unwrap();
    let pixel = (at.0 as u16, at.1 as u16);
    assert!(wanted.here.iter().any(|r| (r.x, r.y) == pixel));
    let ray = view.direction(at.0, at.1);
    for (id, left) in [(5, 1), (6, 1), (7, 0)] {
        let behind = view.eye + ray * (view.eye.y / -ray.y);
        display.receive(&[received(1, id, behind.into(), FLOOR, 0)], 1);
        assert_eq!(display.due(), left);
    }
}
