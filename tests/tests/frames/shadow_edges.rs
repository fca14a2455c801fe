//! Shadow edges of area lights against dense visibility: they part what sees the whole light, a part of it, and none.

use glam::Vec3;
use protocol::scene::{Light, Material, Mesh, Model, Object, Scene, Shading};
use rays::{Ray, World};
use renderer::camera::View;
use renderer::edges::crossings::Crossings;
use renderer::edges::world::world_of;
use system_tests::shadow_accuracy::{draw, triples_of};

use crate::drive::view;

const SIZE_PX: [u32; 2] = [120, 90];
/// Height of the light, metres.
const LIGHT: f32 = 4.0;

/// How much of the light a point sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sees {
    All,
    Some,
    None,
}

fn object(mesh: u32) -> Object {
    Object {
        name: mesh.to_string(),
        mesh,
        material: 0,
        transform: [[1., 0., 0., 0.], [0., 1., 0., 0.], [0., 0., 1., 0.]],
        crease_angle: 85.0,
    }
}

/// A horizontal polygon (x and z, metres, star-shaped about its first vertex) between two heights.
fn prism(outline: &[[f32; 2]], [low, high]: [f32; 2]) -> Mesh {
    let n = outline.len() as u32;
    let at = |y: f32| outline.iter().map(move |[x, z]| [*x, y, *z]);
    let caps = (1..n - 1).flat_map(|i| [[0, i, i + 1], [n, n + i + 1, n + i]]);
    let sides = (0..n).flat_map(|i| {
        let j = (i + 1) % n;
        [[i, n + i, n + j], [i, n + j, j]]
    });
    Mesh {
        positions: at(low).chain(at(high)).collect(),
        faces: caps.chain(sides).collect(),
        ..Mesh::default()
    }
}

/// A ring about a vertical axis.
fn torus([major, minor]: [f32; 2], height: f32) -> Mesh {
    const AROUND: u32 = 32;
    const ACROSS: u32 = 16;
    let turn = |i: u32, n: u32| (i as f32 / n as f32 * std::f32::consts::TAU).sin_cos();
    let positions = (0..AROUND * ACROSS).map(|i| {
        let ((su, cu), (sv, cv)) = (turn(i / ACROSS, AROUND), turn(i % ACROSS, ACROSS));
        let r = major + minor * cv;
        [r * cu, height + minor * sv, r * su]
    });
    let vertex = |u: u32, v: u32| u % AROUND * ACROSS + v % ACROSS;
    let faces = (0..AROUND * ACROSS).flat_map(|i| {
        let (u, v) = (i / ACROSS, i % ACROSS);
        let [a, b, c, d] = [
            vertex(u, v),
            vertex(u, v + 1),
            vertex(u + 1, v + 1),
            vertex(u + 1, v),
        ];
        [[a, b, c], [a, c, d]]
    });
    Mesh {
        positions: positions.collect(),
        faces: faces.collect(),
        ..Mesh::default()
    }
}

/// Blockers over the plane y = 0, under a square light with sides of 1.2 m.
fn scene(blockers: Vec<Mesh>) -> Scene {
    let corners = |half: f32, y: f32| {
        [[-1., -1.], [1., -1.], [1., 1.], [-1., 1.]].map(|[x, z]| [x * half, y, z * half])
    };
    let floor = Mesh {
        positions: corners(9.0, 0.0).to_vec(),
        faces: vec![[0, 2, 1], [0, 3, 2]],
        ..Mesh::default()
    };
    let mut meshes = vec![floor];
    meshes.extend(blockers);
    Scene {
        shading: Shading {
            model: Model::Direct,
            ambient: [0.0; 3],
            background: [0.0; 3],
        },
        lights: vec![Light::Area {
            vertices: corners(0.6, LIGHT)
                .map(|[x, y, z]| [x + 0.13, y, z - 0.2])
                .to_vec(),
            radiance: [50.0; 3],
        }],
        materials: vec![Material {
            name: String::new(),
            diffuse: [0.5; 3],
            diffuse_map: None,
            specular: [0.0; 3],
            roughness: 1.0,
        }],
        textures: Vec::new(),
        objects: (0..meshes.len() as u32).map(object).collect(),
        meshes,
    }
}

/// Points of the light: what is hidden of it first or last touches its outline, so that is looked at more closely.
fn points_of(vertices: &[[f32; 3]]) -> Vec<Vec3> {
    const ALONG: usize = 96;
    const ACROSS: usize = 12;
    let v: Vec<Vec3> = vertices.iter().map(|v| Vec3::from(*v)).collect();
    let outline = (0..4).flat_map(|k| {
        let (a, b) = (v[k], v[(k + 1) % 4]);
        (0..ALONG).map(move |i| a.lerp(b, i as f32 / ALONG as f32))
    });
    let (o, x, y) = (v[0], v[1] - v[0], v[3] - v[0]);
    let share = |i: usize| (i as f32 + 0.5) / ACROSS as f32;
    let inside = (0..ACROSS * ACROSS).map(|i| o + x * share(i % ACROSS) + y * share(i / ACROSS));
    let middle = v.iter().sum::<Vec3>() / 4.0;
    // Just inside: the light's own polygon hides nothing.
    outline
        .chain(inside)
        .map(|p| middle.lerp(p, 0.9999) - Vec3::Y * 1e-4)
        .collect()
}

/// What the floor sees of the light at the middle of a pixel; nothing where a blocker stands before it.
fn floor_sees(world: &World, view: &View, light: &[Vec3], x: usize, y: usize) -> Option<Sees> {
    let eye = Ray {
        origin: view.eye,
        direction: view.direction(x as f32 + 0.5, y as f32 + 0.5),
    };
    let hit = world.closest(&eye, f32::INFINITY)?;
    if hit.instance != 0 {
        return None;
    }
    let place = eye.at(hit.t);
    let hidden = light.iter().filter(|p| {
        let ray = Ray {
            origin: **p,
            direction: place - **p,
        };
        let floor = |instance, _| instance != 0;
        world.occluder_where(&ray, 1.0, floor).is_some()
    });
    match hidden.count() {
        0 => Some(Sees::All),
        n if n == light.len() => Some(Sees::None),
        _ => Some(Sees::Some),
    }
}

/// What became of the pixels that are more than a pixel from every edge.
#[derive(Debug, Default)]
struct Parting {
    /// That see all of the light, a part, none.
    seeing: [usize; 3],
    /// That do not see as much of it as most that no edge parts them from.
    misfits: [usize; 3],
}

impl Parting {
    fn share(&self) -> f64 {
        let [misfits, all] = [self.misfits, self.seeing].map(|n| n.iter().sum::<usize>());
        misfits as f64 / all as f64
    }
}

/// Whether an edge crosses a pixel's boundary or that of a neighbour.
fn near_edge(crossings: &Crossings, x: usize, y: usize) -> bool {
    let (width, height) = (crossings.width, crossings.height);
    let span = |c: usize, n: usize| c.saturating_sub(1)..(c + 2).min(n);
    span(y, height).any(|y| span(x, width).any(|x| crossings.around(x, y) != [0; 4]))
}

fn part(blockers: Vec<Mesh>) -> Parting {
    let scene = scene(blockers);
    let view = view(SIZE_PX, [0.4, 3.2, 3.6], [0.0, 0.0, -0.1], 38.0);
    let world = world_of(&scene);
    let triples = triples_of(&scene, &view).expect("a scene that can be shaded");
    let drawn = draw(&scene, &view, &triples);
    let Light::Area { vertices, .. } = &scene.lights[0] else {
        panic!("an area light")
    };
    let light = points_of(vertices);
    let [width, height] = SIZE_PX.map(|n| n as usize);
    let mut sees = vec![None; width * height];
    for (i, seen) in sees.iter_mut().enumerate() {
        let (x, y) = (i % width, i / width);
        if !near_edge(&drawn.all, x, y) {
            *seen = floor_sees(&world, &view, &light, x, y);
        }
    }
    let mut parting = Parting::default();
    for start in 0..sees.len() {
        let mut here = [0; 3];
        let mut todo = vec![start];
        while let Some(i) = todo.pop() {
            let Some(seen) = sees[i].take() else { continue };
            here[seen as usize] += 1;
            let (x, y) = (i % width, i / width);
            todo.extend((x > 0).then(|| i - 1));
            todo.extend((x + 1 < width).then_some(i + 1));
            todo.extend((y > 0).then(|| i - width));
            todo.extend((y + 1 < height).then_some(i + width));
        }
        let most = (0..3).max_by_key(|k| here[*k]);
        for (k, n) in here.into_iter().enumerate() {
            parting.seeing[k] += n;
            parting.misfits[k] += if Some(k) == most { 0 } else { n };
        }
    }
    parting
}

const SQUARE: [[f32; 2]; 4] = [[-0.5, -0.4], [0.5, -0.4], [0.6, 0.4], [-0.5, 0.5]];

#[test]
fn edges_of_convex_blockers_part_light_and_dark_exactly() {
    for height in [[0.4, 0.8], [0.9, 1.1]] {
        let parting = part(vec![prism(&SQUARE, height)]);
        println!("convex at {height:?}: {parting:?}");
        assert!(parting.seeing.iter().all(|n| *n > 50), "{parting:?}");
        assert_eq!(parting.misfits, [0; 3], "at {height:?}: {parting:?}");
    }
}

#[test]
fn edges_of_concave_blockers_part_light_and_dark() {
    let corner: [[f32; 2]; 6] = [
        [-0.1, -0.1],
        [-0.1, 0.7],
        [-0.6, 0.7],
        [-0.6, -0.6],
        [0.8, -0.6],
        [0.8, -0.1],
    ];
    let star: Vec<[f32; 2]> = std::iter::once(0)
        .chain(1..10)
        .map(|i| {
            let (sin, cos) = (i as f32 * std::f32::consts::TAU / 10.0).sin_cos();
            let r = if i % 2 == 0 { 0.45 } else { 1.0 };
            [r * cos, r * sin]
        })
        .collect();
    let star = fan_about_middle(&star);
    let height = [0.5, 0.6];
    let shapes = [
        ("an L", prism(&corner, height), 0.002),
        ("a star", star_prism(&star, height), 0.01),
        ("a torus", torus([0.7, 0.25], 0.6), 0.002),
    ];
    for (name, mesh, bound) in shapes {
        let parting = part(vec![mesh]);
        println!("{name}: {parting:?}, {:.5} wrong", parting.share());
        assert!(parting.share() <= bound, "{name}: {parting:?}");
    }
}

/// The outline with its middle before it.
fn fan_about_middle(outline: &[[f32; 2]]) -> Vec<[f32; 2]> {
    let mut with_middle = vec![[0.0, 0.0]];
    with_middle.extend_from_slice(outline);
    with_middle
}

/// A prism whose caps are fans about the first vertex, which is not on the outline.
fn star_prism(vertices: &[[f32; 2]], [low, high]: [f32; 2]) -> Mesh {
    let n = vertices.len() as u32;
    let at = |y: f32| vertices.iter().map(move |[x, z]| [*x, y, *z]);
    let next = |i: u32| if i + 1 < n { i + 1 } else { 1 };
    let faces = (1..n).flat_map(|i| {
        let j = next(i);
        [
            [0, i, j],
            [n, n + j, n + i],
            [i, n + i, n + j],
            [i, n + j, j],
        ]
    });
    Mesh {
        positions: at(low).chain(at(high)).collect(),
        faces: faces.collect(),
        ..Mesh::default()
    }
}

/// Boundaries that three edges make (EEE) are not found, as in the paper: the error is bounded.
#[test]
fn crossed_bars_go_wrong_within_the_penumbra_alone() {
    let bar = |x: f32, z: f32| [[-x, -z], [x, -z], [x, z], [-x, z]];
    let parting = part(vec![
        prism(&bar(1.2, 0.16), [0.6, 0.7]),
        prism(&bar(0.16, 1.2), [1.0, 1.1]),
    ]);
    println!("crossed bars: {parting:?}, {:.5} wrong", parting.share());
    assert!(parting.seeing.iter().all(|n| *n > 0), "{parting:?}");
    assert_eq!(parting.misfits[0], 0, "{parting:?}");
    assert!(parting.share() < 0.005, "{parting:?}");
}

/// Of two boxes, the one that stands wholly in the other's umbra has no shadow of its own.
#[test]
fn a_blocker_in_the_shadow_of_another_draws_nothing() {
    let bar = |h: f32| [[-h, -h], [h, -h], [h, h], [-h, h]];
    let upper = || prism(&bar(0.6), [1.4, 1.5]);
    let both = |meshes| {
        let mut scene = scene(meshes);
        scene.lights[0] = Light::Point {
            position: [0.0, LIGHT, 0.0],
            intensity: [50.0; 3],
        };
        let view = view(SIZE_PX, [0.4, 3.2, 3.6], [0.0, 0.0, -0.1], 38.0);
        let mut triples = triples_of(&scene, &view).unwrap();
        // Whichever blocker its shadow rays name, the display is told of both.
        for blocker in 1..scene.objects.len() as u32 {
            triples.push(protocol::messages::Triple {
                light: 0,
                blocker,
                receiver: 0,
            });
        }
        draw(&scene, &view, &triples).shadows
    };
    let (one, two) = (
        both(vec![upper()]),
        both(vec![upper(), prism(&bar(0.2), [0.2, 0.4])]),
    );
    let count = |c: &Crossings| {
        c.horizontal
            .iter()
            .chain(&c.vertical)
            .map(|m| m.count_ones())
            .sum::<u32>()
    };
    assert!(count(&one) > 100);
    // The lower box hides a part of the picture, and with it shadow edges behind it.
    assert!(
        count(&two) <= count(&one),
        "{} of {}",
        count(&two),
        count(&one)
    );
    let beyond = two
        .horizontal
        .iter()
        .zip(&one.horizontal)
        .any(|(a, b)| a & !b != 0);
    assert!(!beyond, "edges that only the hidden box can have drawn");
}
