//! Contact, hiding, a blocker's own shadow, and events that are no events.

use std::sync::Arc;

use glam::{DAffine3, DVec3};
use proptest::prelude::*;
use protocol::scene::Mesh;

use super::tests::{
    ball, cast, check_by_rays, config, cuboid, event, mesh, placement, receiver, tree, triangles,
};
use super::*;
use crate::edges::adjacency::EyeBox;

fn floor() -> Mesh {
    mesh(
        vec![
            [-9.0, 0.0, -9.0],
            [9.0, 0.0, -9.0],
            [9.0, 0.0, 9.0],
            [-9.0, 0.0, 9.0],
        ],
        vec![[0, 2, 1], [0, 3, 2]],
    )
}

/// Receivers of a box on a floor: the floor and the box.
fn on_floor<'a>(floor: &'a FaceTree, cuboid: &'a FaceTree) -> [Receiver<'a>; 2] {
    [
        Receiver {
            id: 0,
            ..receiver(floor)
        },
        Receiver {
            id: 1,
            is_blocker: true,
            ..receiver(cuboid)
        },
    ]
}

fn welded(tree: &FaceTree, at: [f32; 3]) -> u32 {
    tree.adjacency
        .positions
        .iter()
        .position(|p| *p == at)
        .unwrap() as u32
}

/// The event of a light vertex and an edge of a mesh.
fn of_edge(tree: &FaceTree, light: DVec3, ends: [[f32; 3]; 2]) -> Event {
    let vertices = ends.map(|e| welded(tree, e));
    Event {
        wedge: Wedge {
            light: [light; 2],
            blocker: vertices.map(|v| tree.position(tree.own_vertex(v))),
        },
        kind: EventKind::Hard,
        vertices,
        corners: [0; 2],
    }
}

#[test]
fn contact_is_kept_from_its_first_point() {
    let (floor, cuboid) = (
        tree(&floor()),
        tree(&cuboid([-1.0, 0.0, -1.0], [1.0, 2.0, 1.0])),
    );
    let light = DVec3::new(-6.0, 5.0, -1.5);
    let upright = of_edge(&cuboid, light, [[1.0, 0.0, -1.0], [1.0, 2.0, -1.0]]);
    let edges = cast(&upright, &on_floor(&floor, &cuboid));
    assert_eq!(edges.first().map(|e| e.s[0]), Some(0.0));
    assert_eq!(edges.last().map(|e| e.s[1]), Some(1.0));
    assert_eq!(edges[0].from, DVec3::new(1.0, 0.0, -1.0));
    assert!((edges[0].t[0] - 1.0).abs() < 1e-12);
    // The top is 2 below 5: its shadow is 5/3 as far away.
    assert!((edges.last().unwrap().t[1] - 5.0 / 3.0).abs() < 1e-12);
    assert!(edges.iter().all(|e| e.receiver == 0));
    // What lies on the floor touches it.
    let lower = of_edge(&cuboid, light, [[1.0, 0.0, -1.0], [1.0, 0.0, 1.0]]);
    for edge in cast(&lower, &on_floor(&floor, &cuboid)) {
        assert!(edge.t.iter().all(|t| (t - 1.0).abs() <= CONTACT));
    }
    // The far end of the lower edge is behind the box.
    let hidden = of_edge(&cuboid, light, [[1.0, 0.0, 1.0], [1.0, 2.0, 1.0]]);
    let edges = cast(&hidden, &on_floor(&floor, &cuboid));
    assert!(edges.is_empty(), "{edges:?}");
}

/// A floor with a box standing on it whose corner (2, 0, 0) is a vertex of the floor: one mesh, one vertex.
fn grown_from_floor() -> Mesh {
    let mut both = cuboid([0.0, 0.0, 0.0], [2.0, 2.0, 2.0]);
    let floor = floor().positions;
    both.positions.extend(floor);
    both.faces
        .extend([[8, 1, 9], [9, 1, 10], [10, 1, 11], [11, 1, 8]]);
    both
}

proptest! {
    #![proptest_config(config(40))]

    #[test]
    fn contact_within_one_mesh_is_kept(
        x in -6.0_f64..-3.0,
        y in 5.0_f64..7.0,
        z in -3.0_f64..-0.5,
        place in prop::array::uniform12(-1.0_f64..1.0),
    ) {
        let place = placement(place);
        prop_assume!(place.matrix3.determinant().abs() > 0.05);
        let tree = tree(&grown_from_floor());
        let light = DVec3::new(x, y, z);
        let here = of_edge(&tree, light, [[2.0, 0.0, 0.0], [2.0, 2.0, 0.0]]);
        let event = Event { wedge: here.wedge.transformed(&place), ..here };
        let own = Receiver {
            is_blocker: true,
            to_object: place.inverse(),
            ..receiver(&tree)
        };
        let edges = cast(&event, &[own]);
        let covered: f64 = edges.iter().map(|e| e.s[1] - e.s[0]).sum();
        prop_assert!((covered - 1.0).abs() < 1e-12);
        prop_assert_eq!(edges[0].s[0], 0.0);
        prop_assert_eq!(edges[0].t[0], 1.0);
        let corner = place.transform_point3(DVec3::new(2.0, 0.0, 0.0));
        prop_assert!(edges[0].from.distance(corner) < 1e-12 * (1.0 + event.wedge.light[0].length()));
    }

    #[test]
    fn a_blocker_receives_its_own_shadow(
        bumps in 0.1_f32..0.4,
        light in prop::array::uniform3(-1.0_f64..1.0),
        distance in 1.5_f64..4.0,
    ) {
        let light = DVec3::from(light).try_normalize().unwrap_or(DVec3::Y) * distance;
        let mesh = ball(14, bumps);
        let tree = tree(&mesh);
        let adjacency = tree.adjacency.clone();
        let eye = EyeBox::point(light);
        let outline = (0..adjacency.edges.len()).filter(|e| {
            let faces = adjacency.faces(*e);
            adjacency.facing(faces[0], &eye) != adjacency.facing(faces[1], &eye)
        });
        let own = Receiver { is_blocker: true, ..receiver(&tree) };
        let all = triangles(&mesh, &DAffine3::IDENTITY);
        for edge in outline.step_by(23) {
            let vertices = adjacency.edges[edge];
            let event = of_edge(&tree, light, vertices.map(|v| adjacency.positions[v as usize]));
            let others = |f: &usize| !adjacency.faces(edge).contains(&(*f as u32));
            let others: Vec<_> = (0..all.len()).filter(others).map(|f| all[f]).collect();
            check_by_rays(&event, &cast(&event, &[own]), &others);
        }
    }
}

#[test]
fn what_lies_before_the_blocker_hides_the_event() {
    let (floor, cuboid) = (
        tree(&floor()),
        tree(&cuboid([-1.0, 1.0, -1.0], [1.0, 2.0, 1.0])),
    );
    let light = DVec3::new(0.3, 5.0, 0.2);
    let top = of_edge(&cuboid, light, [[1.0, 2.0, -1.0], [1.0, 2.0, 1.0]]);
    let lower = of_edge(&cuboid, light, [[1.0, 1.0, -1.0], [1.0, 1.0, 1.0]]);
    let receivers = on_floor(&floor, &cuboid);
    assert!(!cast(&top, &receivers).is_empty());
    assert!(cast(&lower, &receivers).is_empty());
    // A hider only: nothing on it, and nothing behind it.
    let mut only = receivers;
    only[0].receives = false;
    assert!(cast(&top, &only).is_empty());
}

#[test]
fn a_light_in_a_ceiling_is_not_hidden_by_it() {
    let (floor, cuboid) = (
        tree(&floor()),
        tree(&cuboid([-1.0, 1.0, -1.0], [1.0, 2.0, 1.0])),
    );
    let mut ceiling = floor.clone();
    Arc::make_mut(&mut ceiling.adjacency)
        .positions
        .iter_mut()
        .for_each(|p| p[1] = 5.0);
    let ceiling = tree(&Mesh {
        positions: ceiling.adjacency.positions.clone(),
        faces: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    });
    let top = of_edge(
        &cuboid,
        DVec3::new(0.3, 5.0 - 1e-9, 0.2),
        [[1.0, 2.0, -1.0], [1.0, 2.0, 1.0]],
    );
    let receivers = on_floor(&floor, &cuboid);
    let all = [
        receivers[0],
        receivers[1],
        Receiver {
            id: 2,
            ..receiver(&ceiling)
        },
    ];
    assert_eq!(cast(&top, &all).len(), cast(&top, &receivers).len());
}

#[test]
fn degenerate_events_keep_nothing() {
    let floor = tree(&floor());
    let p = [
        DVec3::new(0.0, 3.0, 0.0),
        DVec3::new(0.5, 1.0, 0.2),
        DVec3::new(-0.5, 1.0, 0.3),
    ];
    let bad = DVec3::splat(f64::NAN);
    let far = DVec3::splat(f64::INFINITY);
    let wedges = [
        // A light on the line of the blocker's edge, a light in the edge, no edge, nothing at all.
        ([p[0]; 2], [p[1], p[1] * 2.0 - p[0]]),
        ([p[1]; 2], [p[1], p[2]]),
        ([p[0]; 2], [p[1]; 2]),
        ([p[0]; 2], [p[0]; 2]),
        ([p[0], p[2]], [p[2]; 2]),
        ([p[0], p[0] * 2.0 - p[1]], [p[1]; 2]),
        ([p[0], p[2]], [p[1], p[2]]),
        ([bad; 2], [p[1], p[2]]),
        ([p[0]; 2], [bad, p[2]]),
        ([far; 2], [p[1], p[2]]),
        ([p[0]; 2], [far, p[2]]),
        // In the floor's plane.
        ([DVec3::ZERO; 2], [DVec3::X, DVec3::Z]),
        ([DVec3::ZERO, DVec3::X], [DVec3::Z; 2]),
        ([DVec3::new(0.1, 0.0, 0.7); 2], [DVec3::X, DVec3::Z]),
        // The floor is behind.
        (
            [DVec3::new(0.1, 1.0, 0.7); 2],
            [DVec3::X + DVec3::Y * 2.0, DVec3::Z + DVec3::Y * 2.0],
        ),
    ];
    for (light, blocker) in wedges {
        let edges = cast(&event(Wedge { light, blocker }), &[receiver(&floor)]);
        assert!(edges.is_empty(), "{light:?} {blocker:?}: {edges:?}");
    }
    let flat = Receiver {
        to_object: DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0)).inverse(),
        ..receiver(&floor)
    };
    let seen = event(Wedge {
        light: [p[0]; 2],
        blocker: [p[1], p[2]],
    });
    assert!(cast(&seen, &[flat]).is_empty());
    assert!(!cast(&seen, &[receiver(&floor)]).is_empty());
    let nothing = tree(&Mesh::default());
    assert!(cast(&seen, &[receiver(&nothing)]).is_empty());
}

#[test]
fn points_on_a_grid_give_no_nonsense() {
    // Wedges through vertices and edges, along faces and touching corners.
    let mesh = cuboid([-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]);
    let tree = tree(&mesh);
    let all = triangles(&mesh, &DAffine3::IDENTITY);
    let at = |i: u32| {
        DVec3::new(
            f64::from(i % 5) - 2.0,
            f64::from(i / 5 % 5) - 2.0,
            f64::from(i / 25) - 2.0,
        )
    };
    let mut tested = 0;
    for i in (0..125).step_by(3) {
        for j in (0..125).step_by(7) {
            for k in (0..125).step_by(11) {
                for vertex_edge in [true, false] {
                    let (light, blocker) = if vertex_edge {
                        ([at(i); 2], [at(j), at(k)])
                    } else {
                        ([at(i), at(j)], [at(k); 2])
                    };
                    let event = event(Wedge { light, blocker });
                    let edges = cast(&event, &[receiver(&tree)]);
                    let far = Sector::new(&event.wedge).is_some_and(|s| {
                        all.iter()
                            .all(|t| t.iter().all(|p| (*p - s.apex).dot(s.normal).abs() > 1e-9))
                    });
                    if far {
                        tested += check_by_rays(&event, &edges, &all);
                    }
                }
            }
        }
    }
    assert!(tested > 10_000, "{tested}");
}
