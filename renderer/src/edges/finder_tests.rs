//! The finder and the hiding of edges on whole scenes.

use glam::{DAffine3, DQuat, DVec3, Vec3};
use protocol::messages::Camera;
use protocol::scene::{Affine, Light, Mesh, Model, Object, Scene, Shading};

use super::adjacency::Adjacency;
use super::by_rays::RaySettings;
use super::crossings::Crossings;
use super::depth::{DepthBuffer, DepthOffset};
use super::finder::EdgeFinder;
use super::list::EdgeList;
use super::test_meshes::{self, closed, open, quad, torus};
use super::tree::EdgeKind;
use super::truth::Truth;
use super::visibility::{EdgeDrawer, Hiding};
use super::world::world_of;
use crate::camera::View;

fn rows(m: &DAffine3) -> Affine {
    let (l, t) = (m.matrix3, m.translation);
    std::array::from_fn(|r| {
        [
            l.x_axis[r] as f32,
            l.y_axis[r] as f32,
            l.z_axis[r] as f32,
            t[r] as f32,
        ]
    })
}

fn scene(meshes: Vec<Mesh>, objects: &[(u32, DAffine3)]) -> Scene {
    let objects = objects
        .iter()
        .enumerate()
        .map(|(i, (mesh, at))| Object {
            name: i.to_string(),
            mesh: *mesh,
            material: 0,
            transform: rows(at),
            crease_angle: 85.0,
        })
        .collect();
    Scene {
        shading: Shading {
            model: Model::Direct,
            ambient: [0.0; 3],
            background: [0.0; 3],
        },
        lights: Vec::new(),
        materials: Vec::new(),
        textures: Vec::new(),
        meshes,
        objects,
    }
}

fn view(eye: [f32; 3], target: [f32; 3], size: u32) -> View {
    View::new(&Camera {
        eye,
        target,
        up: [0.0, 1.0, 0.1],
        fov_y: 50.0,
        width: size,
        height: size,
    })
}

fn placements() -> Vec<DAffine3> {
    let turn = |a: f64| DQuat::from_axis_angle(DVec3::new(0.3, 1.0, -0.2).normalize(), a);
    vec![
        DAffine3::IDENTITY,
        DAffine3::from_scale_rotation_translation(
            DVec3::splat(0.5),
            turn(1.0),
            DVec3::new(1.5, 0.3, -1.0),
        ),
        DAffine3::from_scale_rotation_translation(
            DVec3::new(0.4, 1.2, 0.7),
            turn(2.0),
            DVec3::new(-1.5, 0.0, 0.5),
        ),
        DAffine3::from_scale_rotation_translation(
            DVec3::new(-0.6, 0.6, 0.6),
            turn(4.0),
            DVec3::new(0.0, 1.4, 0.2),
        ),
    ]
}

#[test]
fn objects_in_their_places_have_the_silhouettes_of_moved_meshes() {
    let mesh = torus(20, 12, 1.0, 0.4);
    let adjacency = Adjacency::new(&mesh);
    let objects: Vec<_> = placements().into_iter().map(|at| (0, at)).collect();
    let scene = scene(vec![mesh], &objects);
    let mut finder = EdgeFinder::new(&scene);
    let mut edges = EdgeList::default();
    for eye in [[0.3, 1.0, 7.0], [5.0, 2.0, 3.0], [-4.0, -3.0, 5.0]] {
        let view = view(eye, [0.0; 3], 256);
        assert!(finder.find(&view, &mut edges));
        for (o, (_, at)) in objects.iter().enumerate() {
            // The transform as the finder knows it, in f32.
            let m = super::world::affine(&rows(at));
            let place = |v: u32| {
                m.transform_point3(adjacency.positions[v as usize].into())
                    .as_dvec3()
            };
            let front = |f: u32| {
                let [a, b, c] = scene.meshes[0].faces[f as usize].map(place);
                (b - a).cross(c - a).dot(view.eye.as_dvec3() - a) > 0.0
            };
            let mut expected: Vec<[u32; 2]> = (0..adjacency.edges.len())
                .filter(|e| front(adjacency.faces(*e)[0]) != front(adjacency.faces(*e)[1]))
                .map(|e| adjacency.edges[e])
                .collect();
            let of_object: Vec<usize> = (0..edges.len())
                .filter(|i| edges.object[*i] == o as u32)
                .collect();
            let mut found: Vec<_> = of_object.iter().map(|i| edges.vertices[*i]).collect();
            expected.sort_unstable();
            found.sort_unstable();
            assert_eq!(found, expected, "object {o}");
            for i in of_object {
                let ends = [edges.from[i], edges.to[i]];
                for (v, p) in edges.vertices[i].into_iter().zip(ends) {
                    let expected = view.to_view(place(v).as_vec3());
                    assert!(expected.distance(Vec3::from(p)) < 1e-4);
                }
            }
        }
    }
}

#[test]
fn a_still_scene_is_not_searched_again() {
    let mut scene = scene(vec![torus(12, 8, 1.0, 0.4)], &[(0, DAffine3::IDENTITY)]);
    scene.lights.push(Light::Area {
        vertices: vec![
            [-1.0, 2.0, 0.0],
            [1.0, 2.0, 0.0],
            [1.0, 2.5, 1.0],
            [-1.0, 2.5, 1.0],
        ],
        radiance: [1.0; 3],
    });
    let mut finder = EdgeFinder::new(&scene);
    let view = view([0.0, 1.0, 6.0], [0.0; 3], 128);
    let (mut edges, mut other) = (EdgeList::default(), EdgeList::default());
    assert!(finder.find(&view, &mut edges));
    assert_eq!(
        edges.object.iter().filter(|o| **o == 1).count(),
        4,
        "the light's outline"
    );
    assert!(!finder.find(&view, &mut edges));
    assert!(finder.find(&view, &mut other), "another list is not full");
    assert_eq!(edges.from, other.from);

    let (world, mut drawer) = (world_of(&scene), EdgeDrawer::default());
    let mut crossings = Crossings::new(128, 128);
    let hiding = Hiding::Rays(&world, RaySettings::default());
    assert!(drawer.draw(&view, &other, hiding, false, &mut crossings));
    assert!(!drawer.draw(&view, &other, hiding, false, &mut crossings));

    let before = other.clone();
    finder.set_transform(0, &scene.objects[0].transform);
    assert!(!finder.find(&view, &mut other), "moved to where it was");
    finder.set_transform(
        0,
        &rows(&DAffine3::from_translation(DVec3::new(0.1, 0.0, 0.0))),
    );
    assert!(finder.find(&view, &mut other));
    assert!(before.from != other.from && before.generation != other.generation);
    assert!(drawer.draw(&view, &other, hiding, false, &mut crossings));
    finder.set_transform(
        0,
        &rows(&DAffine3::from_translation(DVec3::new(0.0, 0.0, 20.0))),
    );
    finder.set_transform(
        0,
        &rows(&DAffine3::from_translation(DVec3::new(0.0, 0.0, 20.0))),
    );
    finder.find(&view, &mut other);
    assert_eq!(
        other.count(EdgeKind::Border),
        other.len(),
        "the torus is behind the eye"
    );
    finder.set_transform(0, &[[0.0; 4]; 3]);
    finder.find(&view, &mut other);
    assert_eq!(other.len(), 4, "a flattened object has no edges");
}

/// A far square whose right half a near one hides.
fn two_squares() -> Scene {
    let far =
        DAffine3::from_scale_rotation_translation(DVec3::splat(2.0), DQuat::IDENTITY, DVec3::ZERO);
    let near = DAffine3::from_translation(DVec3::new(1.0, 0.0, 5.0));
    scene(vec![quad()], &[(0, far), (0, near)])
}

#[test]
fn what_a_nearer_surface_hides_is_not_drawn() {
    let scene = two_squares();
    let camera = Camera {
        eye: [0.0, 0.0, 10.0],
        target: [0.0; 3],
        up: [0.0, 1.0, 0.0],
        fov_y: 60.0,
        width: 256,
        height: 256,
    };
    let view = View::new(&camera);
    let mut finder = EdgeFinder::new(&scene);
    let mut edges = EdgeList::default();
    finder.find(&view, &mut edges);
    let world = world_of(&scene);
    let mut drawer = EdgeDrawer::default();
    let mut crossings = Crossings::new(256, 256);
    drawer.draw(
        &view,
        &edges,
        Hiding::Rays(&world, RaySettings::default()),
        true,
        &mut crossings,
    );
    // Both squares are 44.34 px from the middle at their rims; the near one spans twice that from the middle on.
    let side = f64::from(view.focal_px) * 2.0 / 10.0;
    let visible = drawer.visible();
    let mut length = [0.0_f64; 2];
    for i in 0..visible.len() {
        let [a, b] = visible.segment[i]
            .ends
            .map(|p| p.map(|x| x as f64 / 1024.0));
        let part = visible.range[i][1] - visible.range[i][0];
        length[edges.object[visible.edge[i] as usize] as usize] +=
            (b[0] - a[0]).hypot(b[1] - a[1]) * part;
    }
    assert!(
        (length[1] - 8.0 * side).abs() < 0.01,
        "{length:?}: the near square is seen whole"
    );
    assert!(
        (length[0] - 4.0 * side).abs() < 1.0,
        "{length:?}: half of the far one is seen"
    );

    // The paper's way needs points: here one in every pixel.
    let depth = |i: usize| {
        let direction = view.direction((i % 256) as f32 + 0.5, (i / 256) as f32 + 0.5);
        let ray = rays::Ray {
            origin: view.eye,
            direction,
        };
        world
            .closest(&ray, f32::INFINITY)
            .map_or(f32::INFINITY, |hit| hit.t)
    };
    let buffer = DepthBuffer {
        width: 256,
        height: 256,
        depth: (0..256 * 256).map(depth).collect(),
    };
    let mut by_points = Crossings::new(256, 256);
    drawer.draw(
        &view,
        &edges,
        Hiding::Points(&buffer, DepthOffset::default()),
        true,
        &mut by_points,
    );
    let count = |c: &Crossings| {
        c.horizontal
            .iter()
            .chain(&c.vertical)
            .map(|m| m.count_ones())
            .sum::<u32>()
    };
    let (rays, points) = (count(&crossings), count(&by_points));
    assert!(
        points >= rays && points <= rays + 24,
        "{points} crossings by points, {rays} by rays"
    );
}

#[test]
fn sparse_tests_agree_with_dense_ones() {
    let objects: Vec<_> = placements().into_iter().map(|at| (0, at)).collect();
    let scene = scene(vec![torus(64, 32, 1.0, 0.4)], &objects);
    let world = world_of(&scene);
    let mut finder = EdgeFinder::new(&scene);
    let mut edges = EdgeList::default();
    let mut drawer = EdgeDrawer::default();
    for eye in [[0.3, 1.0, 7.0], [5.0, 2.0, 3.0], [-4.0, -3.0, 5.0]] {
        let view = view(eye, [0.0; 3], 512);
        finder.find(&view, &mut edges);
        let mut drawn = |spacing_px: f32| {
            let mut crossings = Crossings::new(512, 512);
            let settings = RaySettings {
                spacing_px,
                ..RaySettings::default()
            };
            drawer.draw(
                &view,
                &edges,
                Hiding::Rays(&world, settings),
                true,
                &mut crossings,
            );
            crossings
        };
        let (sparse, dense) = (drawn(4.0), drawn(0.5));
        let differ = sparse
            .horizontal
            .iter()
            .zip(&dense.horizontal)
            .filter(|(a, b)| a != b)
            .count();
        let all = dense.horizontal.iter().filter(|m| **m != 0).count();
        assert!(differ * 50 < all, "{differ} of {all} boundaries differ");
    }
}

#[test]
fn the_zoo_has_an_edge_wherever_its_pictures_have_a_step() {
    for (name, mesh) in closed().into_iter().chain(open()) {
        if name == "zigzag" {
            continue;
        }
        let scene = scene(vec![mesh], &[(0, DAffine3::IDENTITY)]);
        let world = world_of(&scene);
        let mut finder = EdgeFinder::new(&scene);
        let mut edges = EdgeList::default();
        let (mut steps, mut drawn) = (0, 0);
        for eye in [
            [1.7, 2.3, 4.1],
            [-4.0, 0.2, 1.3],
            [0.4, -3.5, -3.0],
            [0.3, 0.4, 0.6],
        ] {
            let view = view(eye, [0.1, 0.05, 0.0], 128);
            finder.find(&view, &mut edges);
            let mut drawer = EdgeDrawer::default();
            let mut crossings = Crossings::new(128, 128);
            let settings = RaySettings {
                spacing_px: 1.0,
                ..RaySettings::default()
            };
            drawer.draw(
                &view,
                &edges,
                Hiding::Rays(&world, settings),
                false,
                &mut crossings,
            );
            let score = Truth::new(&scene, &world, &view, 3, 0.002).score_within(&crossings, 8);
            steps += score.steps;
            drawn += score.steps_drawn;
        }
        assert!(
            steps > 0 && drawn * 100 >= steps * 99,
            "{name}: {drawn} of {steps} steps in depth"
        );
    }
}

#[test]
fn a_mesh_with_many_silhouettes_costs_little_more_than_brute_force() {
    let mesh = test_meshes::zigzag(3000);
    let adjacency = Adjacency::new(&mesh);
    let tree = super::tree::EdgeTree::new(&adjacency, 180.0);
    let eye = super::adjacency::EyeBox::point(DVec3::new(8.0, 0.3, 75.0));
    let mut found = Vec::new();
    let cost = tree.find(
        &adjacency,
        &eye,
        Default::default(),
        &mut Default::default(),
        &mut found,
    );
    assert!(found.len() > 1000, "{} silhouettes", found.len());
    // Work, not time, so that the test means the same on a busy machine.
    assert!(
        cost.nodes + cost.edges <= adjacency.edges.len() * 6 / 5,
        "{cost:?}"
    );
    assert!(cost.exact * 100 <= cost.edges, "{cost:?}");
}
