use glam::{DAffine3, DVec2};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use protocol::scene::{Material, Mesh, Model, Object, Scene, Shading};

use super::*;
use crate::edges::finder::EdgeFinder;
use crate::shadows::geometry::ShadowScene;
use crate::shadows::wedge::EventKind;

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: RngSeed::Fixed(11),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// One object, as the store has it.
fn object(mesh: Mesh, to_world: DAffine3) -> ShadowObject {
    let scene = Scene {
        shading: Shading {
            model: Model::Direct,
            ambient: [0.0; 3],
            background: [0.0; 3],
        },
        lights: Vec::new(),
        materials: vec![Material {
            name: String::new(),
            diffuse: [1.0; 3],
            diffuse_map: None,
            specular: [0.0; 3],
            roughness: 1.0,
        }],
        textures: Vec::new(),
        meshes: vec![mesh],
        objects: vec![Object {
            name: String::new(),
            mesh: 0,
            material: 0,
            transform: [[1., 0., 0., 0.], [0., 1., 0., 0.], [0., 0., 1., 0.]],
            crease_angle: 85.0,
        }],
    };
    let mut scene = ShadowScene::new(&scene, &EdgeFinder::new(&scene));
    let mut object = scene.objects.remove(0);
    object.to_world = to_world;
    object.to_object = Some(to_world.inverse());
    object
}

/// The plane y = 0.
fn floor() -> ShadowObject {
    let mesh = Mesh {
        positions: vec![[-9.0, 0.0, -9.0], [-9.0, 0.0, 9.0], [9.0, 0.0, 0.0]],
        faces: vec![[0, 1, 2]],
        ..Mesh::default()
    };
    object(mesh, DAffine3::IDENTITY)
}

fn edge(ends: [[f64; 3]; 2], t: f64) -> ShadowEdge {
    ShadowEdge {
        from: ends[0].into(),
        to: ends[1].into(),
        s: [0.0, 1.0],
        t: [t; 2],
        receiver: 0,
        face: 0,
        kind: EventKind::Hard,
    }
}

fn graded(light: &ShadowLight, edge: &ShadowEdge, receiver: &ShadowObject) -> Grade {
    let grader = Grader::new(light).expect("a light");
    grader.grade(edge, receiver)
}

proptest! {
    #![proptest_config(config(256))]

    /// A bar that is level with the floor: its shadow begins where a point of the floor sees nothing of the light past it and
    /// ends where it sees everything. Light vertices are looked at from the floor, and edges are looked for by halving.
    #[test]
    fn widths_are_those_of_the_ramps(
        middle in prop::array::uniform3(-1.0..1.0_f32),
        corners in prop::collection::vec(prop::array::uniform3(-0.8..0.8_f32), 1..5),
        turn in 0.0..3.1_f64,
        t in 1.02..1.9_f64,
    ) {
        let corner = |c: &[f32; 3]| [0, 1, 2].map(|k| middle[k] + 0.5 * c[k] + if k == 1 { 4.0 } else { 0.0 });
        let vertices: Vec<[f32; 3]> = corners.iter().map(corner).collect();
        let light = ShadowLight::polygon(&vertices);
        let lamp = light.middle().vertices()[0];
        let along = DVec3::new(turn.cos(), 0.0, turn.sin());
        let end = DVec3::new(0.3, 0.0, -0.2);
        let grade = graded(&light, &edge([end.into(), (end + along).into()], t), &floor());
        let across = grade.across.as_dvec3();
        prop_assert!(across.dot(along).abs() < 1e-6 && across.y.abs() < 1e-6);

        let bar = lamp + (end - lamp) / t;
        let past = |off: f64| {
            let from = end + across * off;
            let plane = (bar - from).cross(along);
            light.vertices().iter().filter(|v| plane.dot(**v - from) > 0.0).count()
        };
        let all = light.vertices().len();
        let [least, most] = [past(-50.0), past(50.0)];
        prop_assert_eq!(least.abs_diff(most), all);
        let change = |from: usize| {
            let [mut low, mut high] = [-50.0, 50.0];
            for _ in 0..60 {
                let half: f64 = 0.5 * (low + high);
                let beyond = if from == least { past(half) != least } else { past(half) == most };
                if beyond { high = half } else { low = half }
            }
            low
        };
        let wanted = change(most) - change(least);
        for width in grade.width {
            prop_assert!((f64::from(width) - wanted).abs() < 1e-4 * (1.0 + wanted), "{width} {wanted}");
        }
    }

    /// Nothing on the edge gets more light than `form` says, and what is far from a small light little less.
    #[test]
    fn no_place_on_the_edge_gets_more(
        at in prop::array::uniform3(-2.0..2.0_f64),
        to in prop::array::uniform2(-2.0..2.0_f64),
        half in 0.01..0.6_f32,
    ) {
        let corner = |x: f32, z: f32| [x * half, 3.0, z * half];
        // Shines down.
        let light = ShadowLight::polygon(&[corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)]);
        prop_assert!(light.normal().y < 0.0);
        let ends = [[at[0], 0.0, at[2]], [to[0], 0.0, to[1]]];
        let form = f64::from(graded(&light, &edge(ends, 1.0), &floor()).form);
        let [from, to] = ends.map(DVec3::from);
        let mut most = 0.0_f64;
        for i in 0..=20 {
            let place = from.lerp(to, f64::from(i) / 20.0);
            let cell = |k: i32| (f64::from(k) + 0.5) / 8.0 - 1.0;
            let points = (0..16).flat_map(|i| (0..16).map(move |j| DVec2::new(cell(i), cell(j))));
            let each = points.map(|p| {
                let way = DVec3::new(p.x * f64::from(half), 3.0, p.y * f64::from(half)) - place;
                (way.y / way.length()).powi(2) / way.length_squared()
            });
            most = most.max(each.sum::<f64>() / 256.0);
        }
        prop_assert!(form >= most, "{form} {most}");
        if half < 0.05 && from.distance(to) < 0.3 {
            prop_assert!(form < 1.2 * most, "{form} {most}");
        }
    }
}

/// A light as long as `l` that is level with the floor, a blocker at height `d` and the light at `h`.
#[test]
fn widths_are_as_similar_triangles_say() {
    let light = ShadowLight::polygon(&[[-0.5, 4.0, 0.0], [0.5, 4.0, 0.0]]);
    for d in [0.0, 0.1, 1.0, 2.0] {
        let [l, h] = [1.0, 4.0];
        let across = edge([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]], h / (h - d));
        let grade = graded(&light, &across, &floor());
        let wanted = l * d / (h - d);
        assert!(
            (f64::from(grade.width[0]) - wanted).abs() < 1e-6,
            "{grade:?} {wanted}"
        );
        // Along the light there is none.
        let along = edge([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], h / (h - d));
        assert!(graded(&light, &along, &floor()).width[0] < 1e-6);
    }
}

#[test]
fn a_light_that_partly_lies_below_the_horizon_has_penumbrae_without_end() {
    let light = ShadowLight::polygon(&[[5.0, 0.3, 0.0], [5.0, -0.1, 0.0]]);
    let across = edge([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]], 1.5);
    let width = graded(&light, &across, &floor()).width[0];
    assert!(width >= 1e8, "{width}");
    let touching = edge([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]], 1.0);
    assert_eq!(graded(&light, &touching, &floor()).width, [0.0; 2]);
}

/// A facet that is turned to the light, smoothed so that its left corner is turned away: there is little light there.
#[test]
fn round_surfaces_lose_their_light_where_they_turn_away() {
    let away = [-1.0, 0.0, 0.0];
    let mesh = |normals: Vec<[f32; 3]>, face_normals: Vec<[u32; 3]>| Mesh {
        positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.0, 1.0]],
        faces: vec![[0, 2, 1]],
        normals,
        face_normals,
        ..Mesh::default()
    };
    let up = [0.0, 1.0, 0.0];
    let smooth = || mesh(vec![away, up], vec![[0, 1, 1]]);
    let light = ShadowLight::polygon(&[[0.5, 3.0, 0.3]]);
    let at = |x: f64| edge([[x, 0.0, 0.001], [x + 0.001, 0.0, 0.002]], 1.1);
    let place = DAffine3::IDENTITY;
    let form = |x: f64, mesh: Mesh| graded(&light, &at(x), &object(mesh, place)).form;
    let flat = form(0.002, mesh(Vec::new(), Vec::new()));
    assert!((flat - 0.105).abs() < 0.005, "{flat}");
    assert!(form(0.002, smooth()) < 0.03 * flat);
    assert!(form(0.99, smooth()) > 0.95 * form(0.99, mesh(Vec::new(), Vec::new())));
    // Squeezing an object turns its normals as it turns its faces.
    let squeezed = DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0));
    let moved = ShadowLight::polygon(&[[0.5, 3.0, -0.3]]);
    let mirrored = edge([[0.99, 0.0, -0.001], [0.991, 0.0, -0.002]], 1.1);
    let there = graded(&moved, &mirrored, &object(smooth(), squeezed)).form;
    assert!((there / form(0.99, smooth()) - 1.0).abs() < 1e-3, "{there}");
}

#[test]
fn what_has_no_place_is_nothing_to_grade() {
    let light = ShadowLight::polygon(&[[0.0, 3.0, 0.0]]);
    let lost = ShadowEdge {
        face: 7,
        ..edge([[0.0; 3], [1.0, 0.0, 0.0]], 1.5)
    };
    let grade = graded(&light, &lost, &floor());
    assert_eq!((grade.width, grade.form), ([0.0; 2], 0.0));
    assert!(Grader::new(&ShadowLight::polygon(&[[f32::NAN; 3]])).is_none());
}
