//! Cutting events against rays and loops over all faces.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use protocol::scene::Mesh;

use super::super::faces::{INNER, LANES};
use super::*;
use crate::edges::adjacency::Adjacency;

pub(super) fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: RngSeed::Fixed(11),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

pub(super) fn tree(mesh: &Mesh) -> FaceTree {
    FaceTree::new(mesh, Arc::new(Adjacency::new(mesh)))
}

pub(super) fn mesh(positions: Vec<[f32; 3]>, faces: Vec<[u32; 3]>) -> Mesh {
    Mesh {
        positions,
        faces,
        ..Mesh::default()
    }
}

/// Loose triangles.
fn soup(triangles: &[[f32; 9]]) -> Mesh {
    let corners = triangles
        .iter()
        .flat_map(|t| [[t[0], t[1], t[2]], [t[3], t[4], t[5]], [t[6], t[7], t[8]]]);
    let faces = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
    mesh(corners.collect(), faces.collect())
}

/// A closed box.
pub(super) fn cuboid(low: [f32; 3], high: [f32; 3]) -> Mesh {
    let corner = |i: u32| [0, 1, 2].map(|k| if i >> k & 1 == 1 { high[k] } else { low[k] });
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
        .flat_map(|q: &[u32; 4]| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
    mesh((0..8).map(corner).collect(), faces.collect())
}

/// A closed, bumpy ball of `2 n²` quads' halves.
pub(super) fn ball(n: u32, bumps: f32) -> Mesh {
    let (mut positions, mut faces) = (vec![[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]], Vec::new());
    for i in 1..n {
        for j in 0..2 * n {
            let (a, b) = (
                i as f32 / n as f32 * std::f32::consts::PI,
                j as f32 / n as f32 * std::f32::consts::PI,
            );
            let p = Vec3::new(a.sin() * b.cos(), a.cos(), a.sin() * b.sin());
            let r = 1.0 + bumps * (7.0 * p.x).sin() * (6.0 * p.z).cos();
            positions.push((p * r).into());
        }
    }
    let at = |i: u32, j: u32| 2 + (i - 1) * 2 * n + j % (2 * n);
    for j in 0..2 * n {
        faces.push([0, at(1, j + 1), at(1, j)]);
        faces.push([1, at(n - 1, j), at(n - 1, j + 1)]);
        for i in 1..n - 1 {
            faces.push([at(i, j), at(i, j + 1), at(i + 1, j)]);
            faces.push([at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]);
        }
    }
    mesh(positions, faces)
}

pub(super) fn event(wedge: Wedge) -> Event {
    Event {
        wedge,
        kind: EventKind::Penumbral,
        vertices: [0, 0],
        corners: [0, 0],
    }
}

/// A VE or EV wedge from three points.
fn wedge(p: [f64; 9], vertex_edge: bool) -> Wedge {
    let [a, b, c] = [0, 3, 6].map(|i| DVec3::new(p[i], p[i + 1], p[i + 2]));
    let (light, blocker) = if vertex_edge {
        ([a, a], [b, c])
    } else {
        ([a, b], [c, c])
    };
    Wedge { light, blocker }
}

pub(super) fn receiver(tree: &FaceTree) -> Receiver<'_> {
    Receiver {
        tree,
        to_object: DAffine3::IDENTITY,
        id: 0,
        is_blocker: false,
        receives: true,
    }
}

pub(super) fn cast(event: &Event, receivers: &[Receiver<'_>]) -> Vec<ShadowEdge> {
    let (mut scratch, mut out) = (CastScratch::default(), Vec::new());
    cast_event(event, receivers, &mut scratch, &mut out);
    for edge in &out {
        assert!(edge.from.is_finite() && edge.to.is_finite(), "{edge:?}");
        assert!(edge.s[0] < edge.s[1], "{edge:?}");
        assert!(edge.t.iter().all(|t| *t >= 1.0 - 2.0 * CONTACT), "{edge:?}");
    }
    out
}

fn sorted(mut hits: Vec<Hit>) -> Vec<Hit> {
    hits.sort_by(|a, b| a.face.cmp(&b.face).then(a.s[0].total_cmp(&b.s[0])));
    hits
}

/// All hits by the tree, all without it, and of those the ones on faces that are not turned away for sure.
fn hits(tree: &FaceTree, wedge: &Wedge) -> [Vec<Hit>; 3] {
    let Some(sector) = Sector::new(wedge) else {
        return [const { Vec::new() }; 3];
    };
    let cutter = Cutter {
        tree,
        sector: &sector,
        receiver: 0,
        vertices: None,
    };
    let mut found = Vec::new();
    cutter.cut(wedge, &mut Vec::new(), &mut found);
    let (mut all, mut lit) = (Vec::new(), Vec::new());
    for part in sector.parts() {
        for face in 0..tree.len() {
            if let Some(hit) = cutter.face(face, part) {
                let f = hit.face as usize;
                let anchor = DVec3::from(tree.adjacency.anchors[f].map(f64::from));
                let normal = tree.adjacency.normals[f];
                let front = wedge.light.iter().any(|l| normal.dot(*l - anchor) > 0.0);
                if front || !tree.adjacency.solid[f] {
                    lit.push(hit);
                }
                all.push(hit);
            }
        }
    }
    [found, all, lit].map(sorted)
}

/// The nearest hit of a ray on a mesh's faces in world space; an error if that is a matter of rounding.
fn nearest(origin: DVec3, direction: DVec3, triangles: &[[DVec3; 3]]) -> Result<Option<f64>, ()> {
    let (mut best, mut doubtful) = (f64::INFINITY, f64::INFINITY);
    for [a, b, c] in triangles {
        let (u, v) = (*b - *a, *c - *a);
        let p = direction.cross(v);
        let det = u.dot(p);
        if det.abs() < 1e-9 * u.length() * p.length() {
            continue;
        }
        let from = origin - *a;
        let x = from.dot(p) / det;
        let q = from.cross(u);
        let (y, t) = (direction.dot(q) / det, v.dot(q) / det);
        let margin = x.min(y).min(1.0 - x - y);
        if t > AT_LIGHT && margin > -1e-7 {
            if margin > 1e-7 {
                best = best.min(t);
            } else {
                doubtful = doubtful.min(t);
            }
        }
    }
    if doubtful <= best * (1.0 + 1e-7) && doubtful.is_finite() {
        return Err(());
    }
    Ok(best.is_finite().then_some(best))
}

pub(super) fn triangles(mesh: &Mesh, to_world: &DAffine3) -> Vec<[DVec3; 3]> {
    let at =
        |v: u32| to_world.transform_point3(DVec3::from(mesh.positions[v as usize].map(f64::from)));
    mesh.faces.iter().map(|f| f.map(at)).collect()
}

/// Compares edges with rays along the event.
pub(super) fn check_by_rays(
    event: &Event,
    edges: &[ShadowEdge],
    triangles: &[[DVec3; 3]],
) -> usize {
    let mut tested = 0;
    for i in 0..200 {
        let s = (f64::from(i) + 0.5) / 200.0;
        let origin = event.wedge.at(s, 0.0);
        let direction = event.wedge.at(s, 1.0) - origin;
        let Ok(truth) = nearest(origin, direction, triangles) else {
            continue;
        };
        let truth = truth.filter(|t| *t >= 1.0 - CONTACT);
        if edges
            .iter()
            .any(|e| (s - e.s[0]).abs() < 1e-6 || (s - e.s[1]).abs() < 1e-6)
        {
            continue;
        }
        let here: Vec<_> = edges.iter().filter(|e| e.s[0] < s && s < e.s[1]).collect();
        assert!(here.len() <= 1, "two at {s}: {here:?}");
        match (truth, here.first()) {
            (None, None) => {}
            (Some(t), Some(edge)) => {
                let w = |k: usize| {
                    1.0 / (edge.t[k]
                        - if event.wedge.is_vertex_edge() {
                            0.0
                        } else {
                            1.0
                        })
                };
                let share = (s - edge.s[0]) / (edge.s[1] - edge.s[0]);
                let nearness = w(0) + (w(1) - w(0)) * share;
                let apex = if event.wedge.is_vertex_edge() {
                    0.0
                } else {
                    1.0
                };
                let got = apex + 1.0 / nearness;
                assert!((got - t).abs() <= 1e-6 * t, "at {s}: {got}, by ray {t}");
                let point = event.wedge.at(s, t);
                let (a, d) = (edge.from, edge.to - edge.from);
                let off = (point - a).cross(d).length() / d.length();
                assert!(off <= 1e-6 * (1.0 + point.length()), "at {s}: {off} off");
            }
            (truth, edge) => panic!("at {s}: by ray {truth:?}, but {edge:?}"),
        }
        tested += 1;
    }
    tested
}

pub(super) fn placement(p: [f64; 12]) -> DAffine3 {
    let m = DMat3::from_cols_array(&std::array::from_fn(|i| p[i]));
    DAffine3::from_mat3_translation(m, DVec3::new(p[9], p[10], p[11]) * 3.0)
}

/// Checks the boxes and normals of a node and of all below it; counts how often each face is there.
fn check_node(tree: &FaceTree, index: u32, seen: &mut [u32]) -> Vec<usize> {
    let group = &tree.groups[index as usize];
    let mut all = Vec::new();
    for lane in (0..LANES).filter(|i| group.count[*i] != 0) {
        let (start, count) = (group.start[lane], group.count[lane]);
        let held = if count == INNER {
            check_node(tree, start, seen)
        } else {
            let run: Vec<usize> = (start as usize..(start + count) as usize).collect();
            run.iter().for_each(|f| seen[*f] += 1);
            run
        };
        for &f in &held {
            let normal = tree.adjacency.normals[tree.faces[f] as usize];
            for k in 0..3 {
                let within = |x: f64, middle: &[[f32; LANES]; 3], half: &[[f32; LANES]; 3]| {
                    (x - f64::from(middle[k][lane])).abs() <= f64::from(half[k][lane])
                };
                assert!(within(normal[k], &group.normal, &group.spread));
                for v in tree.corners[f] {
                    assert!(within(tree.position(v)[k], &group.centre, &group.half));
                }
            }
        }
        all.extend(held);
    }
    all
}

#[test]
fn nodes_hold_what_is_below_them() {
    let meshes = [ball(20, 0.3), cuboid([-1.0; 3], [1.0; 3])];
    for mesh in &meshes {
        let tree = tree(mesh);
        let mut seen = vec![0; tree.len()];
        check_node(&tree, 0, &mut seen);
        assert!(seen.iter().all(|n| *n == 1));
        assert_eq!(tree.len(), mesh.faces.len());
    }
}

prop_compose! {
    fn loose(count: usize, size: f32)(
        at in prop::collection::vec((prop::array::uniform3(-2.0_f32..2.0), prop::array::uniform9(-1.0_f32..1.0)), count)
    ) -> Mesh {
        let triangles: Vec<[f32; 9]> = at
            .iter()
            .map(|(p, q)| std::array::from_fn(|i| p[i % 3] + size * q[i]))
            .collect();
        soup(&triangles)
    }
}

proptest! {
    #![proptest_config(config(60))]

    #[test]
    fn the_tree_leaves_out_nothing(
        mesh in loose(700, 0.3),
        points in prop::array::uniform9(-3.0_f64..3.0),
        vertex_edge: bool,
        scale in prop::sample::select(vec![1e-3_f32, 1.0, 1e3]),
        offset in prop::sample::select(vec![0.0_f32, 50.0]),
    ) {
        let moved = |p: &[f32; 3]| p.map(|x| (x + offset) * scale);
        let mesh = Mesh { positions: mesh.positions.iter().map(moved).collect(), ..mesh };
        let tree = tree(&mesh);
        let points = points.map(|x| (x + f64::from(offset)) * f64::from(scale));
        let [found, all, _] = hits(&tree, &wedge(points, vertex_edge));
        prop_assert_eq!(found, all);
    }

    #[test]
    fn a_closed_surface_loses_only_what_is_turned_away(
        bumps in 0.0_f32..0.4,
        points in prop::array::uniform9(-3.0_f64..3.0),
        vertex_edge: bool,
    ) {
        let tree = tree(&ball(14, bumps));
        let [found, all, lit] = hits(&tree, &wedge(points, vertex_edge));
        prop_assert!(lit.iter().all(|h| found.contains(h)));
        prop_assert!(found.iter().all(|h| all.contains(h)));
    }

    #[test]
    fn edges_are_where_rays_first_hit(
        meshes in prop::collection::vec(loose(12, 1.0), 1..4),
        points in prop::array::uniform9(-3.0_f64..3.0),
        places in prop::collection::vec(prop::array::uniform12(-1.0_f64..1.0), 3),
        vertex_edge: bool,
    ) {
        let trees: Vec<_> = meshes.iter().map(tree).collect();
        let places: Vec<_> = places.into_iter().map(placement).collect();
        prop_assume!(places.iter().all(|p| p.matrix3.determinant().abs() > 0.05));
        let receivers: Vec<_> = trees
            .iter()
            .zip(&places)
            .enumerate()
            .map(|(i, (t, p))| Receiver { to_object: p.inverse(), id: i as u32, ..receiver(t) })
            .collect();
        let all: Vec<_> = meshes.iter().zip(&places).flat_map(|(m, p)| triangles(m, p)).collect();
        let event = event(wedge(points, vertex_edge));
        let edges = cast(&event, &receivers);
        check_by_rays(&event, &edges, &all);
    }

    #[test]
    fn edges_on_closed_surfaces_are_where_rays_first_hit(
        bumps in 0.0_f32..0.4,
        points in prop::array::uniform9(-3.0_f64..3.0),
        vertex_edge: bool,
    ) {
        let mesh = ball(14, bumps);
        let tree = tree(&mesh);
        let event = event(wedge(points, vertex_edge));
        let edges = cast(&event, &[receiver(&tree)]);
        check_by_rays(&event, &edges, &triangles(&mesh, &DAffine3::IDENTITY));
    }

    #[test]
    fn shared_edges_leave_no_gaps(
        bumps in 0.0_f32..0.3,
        points in prop::array::uniform9(-0.5_f64..0.5),
        vertex_edge: bool,
        place in prop::array::uniform12(-1.0_f64..1.0),
    ) {
        let place = placement(place);
        prop_assume!(place.matrix3.determinant().abs() > 0.05);
        let inner = wedge(points, vertex_edge);
        prop_assume!(Sector::new(&inner).is_some());
        let tree = tree(&ball(20, bumps));
        let event = event(inner.transformed(&place));
        let edges = cast(&event, &[Receiver { to_object: place.inverse(), ..receiver(&tree) }]);
        let covered: f64 = edges.iter().map(|e| e.s[1] - e.s[0]).sum();
        prop_assert!((covered - 1.0).abs() < 1e-12, "covered {covered}");
        for pair in edges.windows(2) {
            prop_assert_eq!(pair[0].s[1].to_bits(), pair[1].s[0].to_bits());
        }
    }

    #[test]
    fn it_does_not_matter_where_the_object_is(
        mesh in loose(30, 0.8),
        points in prop::array::uniform9(-3.0_f64..3.0),
        vertex_edge: bool,
        place in prop::array::uniform12(-1.0_f64..1.0),
    ) {
        let place = placement(place);
        prop_assume!(place.matrix3.determinant().abs() > 0.05);
        let tree = tree(&mesh);
        let here = event(wedge(points, vertex_edge));
        let there = event(here.wedge.transformed(&place));
        let plain = cast(&here, &[receiver(&tree)]);
        let moved = cast(&there, &[Receiver { to_object: place.inverse(), ..receiver(&tree) }]);
        let total = |edges: &[ShadowEdge]| -> f64 { edges.iter().map(|e| e.s[1] - e.s[0]).sum() };
        prop_assert!((total(&plain) - total(&moved)).abs() < 1e-9);
        for edge in plain.iter().filter(|e| e.s[1] - e.s[0] > 1e-6) {
            let middle = 0.5 * (edge.s[0] + edge.s[1]);
            let same = moved.iter().find(|e| e.s[0] < middle && middle < e.s[1]);
            prop_assert_eq!(same.map(|e| e.face), Some(edge.face));
            let same = same.unwrap();
            prop_assert!((place.transform_point3(edge.from) - same.from).length() < 1e-6 * (1.0 + edge.from.length()));
            prop_assert!((edge.t[1] - same.t[1]).abs() < 1e-6 * edge.t[1]);
        }
    }
}
