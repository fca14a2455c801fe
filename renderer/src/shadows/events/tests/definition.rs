//! Events are what they are defined as, in plain determinants and angles, for lights that are nowhere in particular.

use super::*;
use crate::shadows::wedge::EventKind;

fn orientation(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> f64 {
    (b - a).cross(c - a).dot(d - a)
}

/// 1 or -1 if all are positive or negative, 0 if they differ.
fn common(signs: impl Iterator<Item = f64>) -> i32 {
    let (mut more, mut less) = (0, 0);
    for s in signs {
        more += i32::from(s > 0.0);
        less += i32::from(s < 0.0);
    }
    i32::from(less == 0) - i32::from(more == 0)
}

fn third(fixture: &Fixture, face: u32, edge: [u32; 2]) -> DVec3 {
    let corners = fixture.rings.corners(face);
    let apex = corners.iter().find(|v| !edge.contains(v)).unwrap();
    fixture.at(*apex)
}

/// Kind, corners and vertices of all VE events.
fn vertex_edge(fixture: &Fixture, light: &ShadowLight) -> Vec<(EventKind, [u32; 2], [u32; 2])> {
    let vertices = light.vertices();
    let mut found = Vec::new();
    for (index, ends) in fixture.adjacency.edges.iter().enumerate() {
        let [a, b] = ends.map(|v| fixture.at(v));
        if light.height(a) <= 0.0 && light.height(b) <= 0.0 {
            continue;
        }
        let faces = fixture.adjacency.faces(index);
        for (k, v) in vertices.iter().enumerate() {
            let beside = faces
                .iter()
                .map(|f| orientation(*v, a, b, third(fixture, *f, *ends)));
            let others = (0..vertices.len())
                .filter(|j| *j != k)
                .map(|j| orientation(*v, a, b, vertices[j]));
            match common(beside) * common(others) {
                1 => found.push((EventKind::Umbral, [light.corner(k); 2], *ends)),
                -1 => found.push((EventKind::Penumbral, [light.corner(k); 2], *ends)),
                _ => {}
            }
        }
    }
    found
}

/// Whether the faces at a vertex leave gaps in the halves above and below, seen along a line, by trying a direction
/// between any two rims.
fn gaps(fixture: &Fixture, vertex: u32, ray: DVec3, up: DVec3) -> [bool; 2] {
    let across = ray.cross(up).normalize();
    let angle = |v: u32| {
        let d = fixture.at(v) - fixture.at(vertex);
        let d = d - ray * d.dot(ray);
        d.dot(up).atan2(d.dot(across))
    };
    let tau = std::f64::consts::TAU;
    let mut sectors = Vec::new();
    for face in 0..fixture.adjacency.normals.len() as u32 {
        let corners = fixture.rings.corners(face);
        if corners.contains(&vertex) {
            let ends: Vec<f64> = corners
                .into_iter()
                .filter(|v| *v != vertex)
                .map(angle)
                .collect();
            let turn = (ends[1] - ends[0]).rem_euclid(tau);
            sectors.push(if turn < tau / 2.0 {
                (ends[0], turn)
            } else {
                (ends[1], tau - turn)
            });
        }
    }
    let open = |from: f64| {
        let mut rims: Vec<f64> = vec![0.0, tau / 2.0];
        for (start, turn) in &sectors {
            rims.extend([start, &(start + turn)].map(|a| (a - from).rem_euclid(tau)));
        }
        rims.retain(|a| *a <= tau / 2.0);
        rims.sort_unstable_by(f64::total_cmp);
        rims.windows(2).filter(|r| r[1] - r[0] > 1e-9).any(|r| {
            let a = from + 0.5 * (r[0] + r[1]);
            let beside = |(start, turn): &(f64, f64)| (a - start).rem_euclid(tau) > *turn;
            sectors.iter().all(beside)
        })
    };
    [open(0.0), open(-tau / 2.0)]
}

/// Checks the EV events of a vertex and a light edge against gaps along some of their lines.
fn check_edge_vertex(
    fixture: &Fixture,
    light: &ShadowLight,
    vertex: u32,
    k: usize,
    events: &[&Event],
) -> usize {
    let vertices = light.vertices();
    let at = fixture.at(vertex);
    let [from, to] = [k, (k + 1) % vertices.len()].map(|k| vertices[k]);
    let mut kinds = 0;
    for s in [0.03, 0.21, 0.37, 0.53, 0.77, 0.95] {
        let eye = from.lerp(to, s);
        let ray = (at - eye).normalize();
        let mut up = (to - from).cross(ray).normalize();
        let beyond = vertices.iter().map(|v| up.dot(*v - from)).sum::<f64>();
        if vertices.len() > 2 && beyond < 0.0 {
            up = -up;
        }
        let [near_gap, far_gap] = gaps(fixture, vertex, ray, up);
        let neighbours = fixture.rings.edges_at(vertex).iter().map(|e| {
            let [a, b] = fixture.adjacency.edges[*e as usize];
            up.dot(fixture.at(if a == vertex { b } else { a }) - at)
        });
        let side = common(neighbours);
        let facing = light.height(at) > 0.0;
        let linear = vertices.len() == 2;
        let penumbral = facing && (side == -1 || linear && side == 1);
        let umbral = facing && (!near_gap && far_gap || linear && near_gap && !far_gap);
        for (kind, expected) in [
            (EventKind::Penumbral, penumbral),
            (EventKind::Umbral, umbral),
        ] {
            let found = events.iter().any(|e| {
                let [a, b] = e
                    .wedge
                    .light
                    .map(|p| (p - from).dot(to - from) / (to - from).length_squared());
                e.kind == kind && a.min(b) <= s && s <= a.max(b)
            });
            assert_eq!(
                found, expected,
                "{kind:?} at {s}, vertex {vertex}, edge {k} of {light:?}: gaps {near_gap} {far_gap}"
            );
            kinds += usize::from(found);
        }
    }
    kinds
}

fn touches(e: &Event, light: &ShadowLight, k: usize, vertex: u32) -> bool {
    let n = light.vertices().len();
    let mut corners = [light.corner(k), light.corner((k + 1) % n)];
    let mut own = e.corners;
    corners.sort_unstable();
    own.sort_unstable();
    own == corners && e.vertices == [vertex; 2]
}

proptest! {
    #![proptest_config(config(6))]

    #[test]
    fn events_are_what_they_are_defined_as(seed in any::<u64>()) {
        let mut next = rng(seed);
        let mut umbral = 0;
        for (name, mesh) in meshes::all() {
            if mesh.faces.len() > 200 {
                continue;
            }
            let fixture = Fixture::new(&meshes::turned(&mesh, turn(&mut next)));
            for n in [2, 3, 4] {
                let light = polygon(n, vector(&mut next) * 3.0, next(0.05, 0.8), turn(&mut next));
                let events = fixture.find(&light, EventOptions::default());
                let mut found: Vec<_> = events
                    .iter()
                    .filter(|e| e.wedge.is_vertex_edge())
                    .map(|e| (e.kind, e.corners, e.vertices))
                    .collect();
                let mut expected = vertex_edge(&fixture, &light);
                found.sort_unstable();
                expected.sort_unstable();
                prop_assert_eq!(found, expected, "{}", name);
                for vertex in 0..fixture.adjacency.positions.len() as u32 {
                    if fixture.rings.edges_at(vertex).is_empty() {
                        continue;
                    }
                    for k in 0..if n == 2 { 1 } else { n } {
                        let own: Vec<&Event> = events.iter().filter(|e| touches(e, &light, k, vertex)).collect();
                        umbral += check_edge_vertex(&fixture, &light, vertex, k, &own);
                    }
                }
            }
        }
        prop_assert!(umbral > 20);
    }
}
