//! Segments between objects against all pairs of faces.

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use protocol::scene::Mesh;

use super::super::adjacency::Adjacency;
use super::super::test_meshes::{bumpy_sphere, cube, quad, torus};
use super::*;

fn tree(mesh: &Mesh) -> Arc<FaceTree> {
    Arc::new(FaceTree::new(mesh, Arc::new(Adjacency::new(mesh))))
}

/// The segment of two triangles by testing the sides of each against the other.
fn by_sides(a: [DVec3; 3], b: [DVec3; 3]) -> Option<[DVec3; 2]> {
    let mut points: Vec<DVec3> = Vec::new();
    for (p, q) in [(a, b), (b, a)] {
        let n = (q[1] - q[0]).cross(q[2] - q[0]);
        for k in 0..3 {
            let (u, v) = (p[k], p[(k + 1) % 3]);
            let (h, g) = (n.dot(u - q[0]), n.dot(v - q[0]));
            if (h < 0.0) == (g < 0.0) {
                continue;
            }
            let x = u.lerp(v, h / (h - g));
            let inside = (0..3).all(|k| (q[(k + 1) % 3] - q[k]).cross(x - q[k]).dot(n) >= 0.0);
            if inside {
                points.push(x);
            }
        }
    }
    let far = |p: &DVec3| points.iter().map(|q| q.distance(*p)).fold(0.0, f64::max);
    let from = points
        .iter()
        .copied()
        .max_by(|p, q| far(p).total_cmp(&far(q)))?;
    let to = points
        .iter()
        .copied()
        .max_by(|p, q| p.distance(from).total_cmp(&q.distance(from)))?;
    Some([from, to])
}

fn brute(meshes: [&Mesh; 2], places: [DAffine3; 2]) -> Vec<([u32; 2], [DVec3; 2])> {
    let all = [0, 1].map(|k| {
        let at = |v: u32| {
            let p = meshes[k].positions[v as usize];
            places[k].transform_point3(DVec3::from(p.map(f64::from)))
        };
        let faces = meshes[k].faces.iter();
        faces.map(|f| f.map(at)).collect::<Vec<_>>()
    });
    let mut out = Vec::new();
    for (i, a) in all[0].iter().enumerate() {
        for (j, b) in all[1].iter().enumerate() {
            if let Some(ends) = by_sides(*a, *b) {
                out.push(([i as u32, j as u32], ends));
            }
        }
    }
    out
}

fn place(p: [f64; 6], scale: f64) -> DAffine3 {
    let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, p[0], p[1], p[2]);
    DAffine3::from_scale_rotation_translation(
        DVec3::new(scale, 1.0, -1.0),
        turn,
        DVec3::new(p[3], p[4], p[5]) * 0.5,
    )
}

fn sorted(meets: &Meets) -> Vec<Meet> {
    let mut all: Vec<Meet> = meets.iter().copied().collect();
    all.sort_by_key(|m| (m.objects, m.faces));
    all
}

fn same(found: &[Meet], truth: &[([u32; 2], [DVec3; 2])]) {
    let length = |[a, b]: [DVec3; 2]| a.distance(b);
    let at = |m: &Meet| [m.from, m.to];
    for meet in found.iter().filter(|m| length(at(m)) > 1e-9) {
        let other = truth.iter().find(|(f, _)| *f == meet.faces);
        let Some((_, [a, b])) = other else {
            panic!("{meet:?} is nowhere");
        };
        let off = |p: DVec3, q: DVec3| meet.from.distance(p) + meet.to.distance(q);
        assert!(
            off(*a, *b).min(off(*b, *a)) < 1e-8,
            "{meet:?}, by brute force {other:?}"
        );
    }
    let long = truth.iter().filter(|(_, ends)| length(*ends) > 1e-9);
    for (faces, ends) in long {
        assert!(
            found.iter().any(|m| m.faces == *faces),
            "{faces:?} {ends:?} is missing"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 24, rng_seed: RngSeed::Fixed(5), failure_persistence: None, ..ProptestConfig::default()
    })]

    #[test]
    fn all_pairs_of_faces_are_found(
        kinds in prop::array::uniform2(0_usize..3),
        at in prop::array::uniform2(prop::array::uniform6(-1.5_f64..1.5)),
        scale in 0.3_f64..2.0,
        to in prop::array::uniform6(-1.5_f64..1.5),
    ) {
        let meshes = kinds.map(|k| match k {
            0 => cube(),
            1 => bumpy_sphere(2, 0.2),
            _ => torus(12, 8, 1.0, 0.4),
        });
        let trees = [tree(&meshes[0]), tree(&meshes[1])];
        let places = [place(at[0], scale), place(at[1], 1.0)];
        let objects = |places: [DAffine3; 2]| trees.iter().cloned().zip(places);
        let mut meets = Meets::new(objects(places));
        same(&sorted(&meets), &brute([&meshes[0], &meshes[1]], places));
        // Chains are closed: every end is the end of an even number of segments.
        let ends = meets.iter().flat_map(|m| [m.from, m.to]);
        let mut ends: Vec<[u64; 3]> = ends.map(|p| p.to_array().map(f64::to_bits)).collect();
        ends.sort_unstable();
        prop_assert!(ends.chunk_by(|a, b| a == b).all(|run| run.len() % 2 == 0));
        // Moved, it is as if it had been there from the first.
        let there = place(to, 1.2);
        meets.move_object(1, there);
        prop_assert_eq!(sorted(&meets), sorted(&Meets::new(objects([places[0], there]))));
    }
}

#[test]
fn what_only_touches_does_not_meet() {
    let (cube, sheet) = (tree(&cube()), tree(&quad()));
    let at = |x: f64, y: f64, z: f64| DAffine3::from_translation(DVec3::new(x, y, z));
    let big = DAffine3::from_scale(DVec3::new(5.0, 5.0, 1.0));
    let count = |a: (&Arc<FaceTree>, DAffine3), b: (&Arc<FaceTree>, DAffine3)| {
        let objects = [a, b].map(|(t, p)| (t.clone(), p));
        Meets::new(objects).iter().count()
    };
    // In the same place, side by side, one on the other, on a sheet, and far from it.
    assert_eq!(
        count((&cube, at(0.0, 0.0, 0.0)), (&cube, at(0.0, 0.0, 0.0))),
        0
    );
    assert_eq!(
        count((&cube, at(0.0, 0.0, 0.0)), (&cube, at(2.0, 0.0, 0.0))),
        0
    );
    assert_eq!(count((&sheet, big), (&cube, at(0.0, 0.0, 1.0))), 0);
    assert_eq!(count((&sheet, big), (&cube, at(0.0, 0.0, 9.0))), 0);
    assert_eq!(count((&sheet, big), (&sheet, at(0.3, 0.2, 0.0))), 0);
    // Through it: four sides of two faces each, cut by the sheet's diagonal or not.
    let through = [(sheet.clone(), big), (cube.clone(), at(0.3, 0.2, 0.5))];
    let meets = Meets::new(through);
    let length: f64 = meets.iter().map(|m| m.from.distance(m.to)).sum();
    assert!((length - 8.0).abs() < 1e-9, "{length}");
    // Flat, not a number, or no faces at all.
    let flat = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
    assert_eq!(count((&sheet, big), (&cube, flat)), 0);
    assert_eq!(count((&sheet, big), (&cube, at(f64::NAN, 0.0, 0.0))), 0);
    let nothing = tree(&Mesh::default());
    assert_eq!(count((&nothing, big), (&cube, at(0.0, 0.0, 0.0))), 0);
}

#[test]
fn only_pairs_of_the_moved_object_change() {
    let cube = tree(&cube());
    let at = |x: f64| DAffine3::from_translation(DVec3::new(x, 0.3 * x, 0.2 * x));
    let mut meets = Meets::new([0.0, 1.0, 1.5].map(|x| (cube.clone(), at(x))));
    let of = |meets: &Meets, pair: [u32; 2]| meets.pairs.get(&pair).cloned();
    let before = of(&meets, [0, 1]);
    assert!(before.is_some() && of(&meets, [0, 2]).is_some() && of(&meets, [1, 2]).is_some());
    meets.move_object(2, at(-1.0));
    assert_eq!(of(&meets, [0, 1]), before);
    assert!(of(&meets, [0, 2]).is_some());
    meets.move_object(2, at(50.0));
    assert!(of(&meets, [0, 2]).is_none() && of(&meets, [1, 2]).is_none());
    meets.move_object(7, at(0.0));
    assert_eq!(meets.pairs.len(), 1);
}
