//! The search misses nothing and adds nothing, whatever the placement.

use super::*;
use crate::edges::adjacency::{EyeBox, Facing};
use crate::edges::tree::{EdgeKind, FindOptions, TreeScratch};
use crate::shadows::wedge::EventKind;

/// Tries every edge with every light vertex and every vertex with every light edge.
fn everything(fixture: &Fixture, light: &ShadowLight, options: EventOptions) -> Vec<Event> {
    let pair = Pair::new(&fixture.adjacency, &fixture.rings, light, options);
    let mut out = Vec::new();
    for edge in 0..fixture.adjacency.edges.len() {
        ve::find(&pair, edge as u32, &mut out);
    }
    if light.vertices().len() > 1 {
        let mut fan = Fan::default();
        for vertex in 0..fixture.adjacency.positions.len() {
            ev::find(&pair, vertex as u32, &mut fan, &mut out);
        }
    }
    out
}

/// Lights in places where something is not well defined.
fn awkward(fixture: &Fixture, pick: f64) -> Vec<ShadowLight> {
    let adjacency = &fixture.adjacency;
    let edge = ((adjacency.edges.len() - 1) as f64 * pick) as usize;
    let [a, b] = adjacency.edges[edge].map(|v| fixture.at(v));
    let n = adjacency.normals[adjacency.faces(edge)[0] as usize];
    let middle = (a + b) * 0.5;
    let up = n * adjacency.diagonal();
    let light = |vertices: &[DVec3]| {
        let vertices: Vec<[f32; 3]> = vertices.iter().map(|v| v.as_vec3().into()).collect();
        ShadowLight::polygon(&vertices)
    };
    let side = (b - a).cross(n);
    vec![
        // On a vertex, on an edge, on a face's plane.
        light(&[a]),
        light(&[middle]),
        light(&[a + 3.0 * (b - a)]),
        light(&[middle, middle + up]),
        light(&[a, b]),
        light(&[a + up, b + up]),
        // Over the edge and parallel to it, its vertices over those of the edge.
        light(&[a + up, b + up, b + up + side, a + up + side]),
        light(&[a + up + side, b + up + side, b + up, a + up]),
        // In the plane of the face, upright across it, and upright on the edge.
        light(&[a - side, b - side, b - 2.0 * side, a - 2.0 * side]),
        light(&[
            middle - up + side,
            middle + up + side,
            middle + up + side * 2.0,
        ]),
        light(&[a, b, b + up]),
        // Inside, or straddling.
        light(&[middle - 0.1 * up, a - 0.2 * up, b - 0.1 * up]),
        light(&[a + up, a - up, b - up, b + up]),
    ]
}

fn compare(name: &str, fixture: &Fixture, light: &ShadowLight) -> usize {
    let mut count = 0;
    for back_hidden in [false, true] {
        let options = EventOptions { back_hidden };
        let found = fixture.find(light, options);
        let expected = everything(fixture, light, options);
        assert_eq!(keys(&found), keys(&expected), "{name} {light:?}");
        for e in &found {
            let w = &e.wedge;
            for p in w.light.iter().chain(&w.blocker) {
                assert!(p.is_finite(), "{name} {e:?}");
            }
            assert!(w.blocker.iter().all(|p| light.height(*p) > -1e-5));
        }
        let mut unique = keys(&found);
        unique.dedup();
        assert_eq!(unique.len(), found.len(), "{name}: an event twice");
        count += found.len();
    }
    count
}

proptest! {
    #![proptest_config(config(6))]

    #[test]
    fn the_tree_finds_what_trying_everything_finds(seed in any::<u64>(), pick in 0.0..1.0_f64) {
        let mut next = rng(seed);
        let mut count = 0;
        for (name, mesh) in meshes::all() {
            let fixture = Fixture::new(&mesh);
            for (n, reach) in [(1, 2.0), (2, 3.0), (3, 0.3), (4, 4.0), (4, 30.0), (7, 2.0)] {
                let radius = [1e-3, 0.1, 1.0][(next(0.0, 3.0) as usize).min(2)];
                let light = polygon(n, vector(&mut next) * reach, radius, turn(&mut next));
                count += compare(name, &fixture, &light);
            }
            for light in awkward(&fixture, pick) {
                count += compare(name, &fixture, &light);
            }
        }
        prop_assert!(count > 1000);
    }

    #[test]
    fn a_point_light_has_the_silhouettes(seed in any::<u64>()) {
        let mut next = rng(seed);
        for (name, mesh) in meshes::all() {
            let fixture = Fixture::new(&mesh);
            let at = (vector(&mut next) * 3.0).as_vec3();
            let light = ShadowLight::polygon(&[at.into()]);
            let eye = EyeBox::point(at.as_dvec3());
            let mut silhouettes = Vec::new();
            fixture.tree.find(
                &fixture.adjacency,
                &eye,
                FindOptions::default(),
                &mut TreeScratch::default(),
                &mut silhouettes,
            );
            let mut expected: Vec<[u32; 2]> = silhouettes
                .iter()
                .filter(|(_, kind)| matches!(kind, EdgeKind::Silhouette | EdgeKind::Border))
                .map(|(edge, _)| fixture.adjacency.edges[*edge as usize])
                .collect();
            let events = fixture.find(&light, EventOptions::default());
            prop_assert!(events.iter().all(|e| e.kind == EventKind::Hard));
            let branching = |e: &&Event| fixture.rings.branching.iter().any(
                |b| fixture.adjacency.edges[*b as usize] == e.vertices);
            let mut found: Vec<[u32; 2]> =
                events.iter().filter(|e| !branching(e)).map(|e| e.vertices).collect();
            expected.sort_unstable();
            found.sort_unstable();
            prop_assert_eq!(found, expected, "{}", name);

            // Of the reflex edges of closed meshes none is reached, and of the others all are.
            let kept = fixture.find(&light, EventOptions { back_hidden: true });
            for event in &events {
                let edge = fixture.adjacency.edges.iter().position(|e| *e == event.vertices).unwrap();
                let hidden = reached_through_the_inside(&fixture, edge, at.as_dvec3());
                prop_assert_eq!(kept.contains(event), !hidden, "{}", name);
            }
        }
    }

    #[test]
    fn a_light_without_size_is_a_point(seed in any::<u64>()) {
        let mut next = rng(seed);
        let at = (vector(&mut next) * 2.0).as_vec3().to_array();
        for (_, mesh) in meshes::all() {
            let fixture = Fixture::new(&mesh);
            let options = EventOptions::default();
            let point = fixture.find(&ShadowLight::polygon(&[at]), options);
            for n in [2, 3, 4] {
                let light = ShadowLight::polygon(&vec![at; n]);
                prop_assert_eq!(&fixture.find(&light, options), &point);
            }
        }
    }

    #[test]
    fn a_reflection_changes_nothing(seed in any::<u64>()) {
        let mut next = rng(seed);
        let mirror = DAffine3::from_scale(DVec3::new(-2.0, 1.0, 0.5));
        for (name, mesh) in meshes::all() {
            // The mirrored object, in its own coordinates and as a mesh in the world's.
            let fixture = Fixture::new(&mesh);
            let flat = |p: &[f32; 3]| mirror.transform_point3(DVec3::from(p.map(f64::from))).as_vec3();
            let positions = mesh.positions.iter().map(|p| flat(p).to_array()).collect();
            let world = Fixture::new(&Mesh { positions, ..mesh.clone() });
            let light = polygon(4, vector(&mut next) * 4.0, 0.5, turn(&mut next));
            let options = EventOptions::default();
            let local = fixture.find(&light.transformed(&mirror.inverse()), options);
            let mut names: Vec<_> = local.iter().map(named).collect();
            let mut expected: Vec<_> = world.find(&light, options).iter().map(named).collect();
            names.sort_unstable();
            expected.sort_unstable();
            prop_assert_eq!(names, expected, "{}", name);
        }
    }
}

/// Kind, light vertices and blocker vertices of an event, whichever way it runs.
fn named(e: &Event) -> (EventKind, [u32; 2], [u32; 2]) {
    let sorted = |mut pair: [u32; 2]| {
        pair.sort_unstable();
        pair
    };
    (e.kind, sorted(e.corners), sorted(e.vertices))
}

/// Whether the point just before an edge, coming from the light, is behind all faces that could hide it.
fn reached_through_the_inside(fixture: &Fixture, edge: usize, light: DVec3) -> bool {
    let adjacency = &fixture.adjacency;
    let faces = adjacency.faces(edge);
    if faces.len() != 2 || !adjacency.solid[faces[0] as usize] {
        return false;
    }
    let [a, b] = adjacency.edges[edge].map(|v| fixture.at(v));
    let before = (a + b) * 0.5 + (light - (a + b) * 0.5) * 1e-3;
    let behind = |f: &u32| adjacency.facing(*f, &EyeBox::point(before)) == Facing::Back;
    // A solid is where all planes are behind at a convex edge, where any is at a reflex one.
    let apex = fixture.rings.corners(faces[1]);
    let apex = apex
        .iter()
        .find(|v| !adjacency.edges[edge].contains(v))
        .unwrap();
    let convex = adjacency.facing(faces[0], &EyeBox::point(fixture.at(*apex))) == Facing::Back;
    if convex {
        faces.iter().all(behind)
    } else {
        faces.iter().any(behind)
    }
}
