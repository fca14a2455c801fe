//! Properties of the finder over hard meshes and views.

use glam::DVec3;
use proptest::prelude::*;
use proptest::test_runner::{RngSeed, TestRng};

use super::adjacency::{Adjacency, EyeBox, Facing};
use super::test_meshes::{self, placed};
use super::tree::{EdgeKind, EdgeTree, FindOptions, TreeScratch};

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: RngSeed::Fixed(7),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

fn rng() -> impl FnMut(f64, f64) -> f64 {
    let mut rng = TestRng::deterministic_rng(prop::test_runner::RngAlgorithm::ChaCha);
    move |low, high| low + (high - low) * (f64::from(rng.next_u32()) / f64::from(u32::MAX))
}

/// What an edge is, from Eq. 1 for every edge, in the plainest words.
fn brute(
    adjacency: &Adjacency,
    crease_angle: f32,
    eye: &EyeBox,
    options: FindOptions,
) -> Vec<(u32, EdgeKind)> {
    let mut found = Vec::new();
    for edge in 0..adjacency.edges.len() {
        let faces = adjacency.faces(edge);
        let facing: Vec<Facing> = faces.iter().map(|f| adjacency.facing(*f, eye)).collect();
        let may = |side: Facing| facing.iter().any(|f| *f == side || *f == Facing::Mixed);
        let crease = faces.iter().any(|a| {
            faces.iter().any(|b| {
                let cosine = adjacency.normals[*a as usize].dot(adjacency.normals[*b as usize]);
                a != b && cosine < f64::from(crease_angle).to_radians().cos()
            })
        }) || faces.iter().any(|a| {
            let material = |f: &u32| adjacency.materials.get(*f as usize);
            faces.iter().any(|b| material(a) != material(b))
        });
        let differ = match (faces.len(), adjacency.twisted[edge]) {
            (2, true) => {
                facing.iter().all(|f| *f != Facing::Back)
                    || facing.iter().all(|f| *f != Facing::Front)
            }
            _ => may(Facing::Front) && may(Facing::Back),
        };
        let seen = !options.back_hidden
            || !faces.iter().all(|f| adjacency.solid[*f as usize])
            || may(if options.mirrored {
                Facing::Back
            } else {
                Facing::Front
            });
        match faces.len() {
            1 => found.push((edge as u32, EdgeKind::Border)),
            2 if differ => found.push((edge as u32, EdgeKind::Silhouette)),
            2 if crease && seen => found.push((edge as u32, EdgeKind::Crease)),
            3.. if differ || crease => found.push((edge as u32, EdgeKind::NonManifold)),
            _ => {}
        }
    }
    found.sort_unstable();
    found
}

/// Eyes at random, on face planes, on vertices and edges, inside and far away.
fn eyes(adjacency: &Adjacency, random: usize) -> Vec<DVec3> {
    let mut next = rng();
    let [low, high] = adjacency.bounds.map(|p| DVec3::from(p.map(f64::from)));
    let (centre, size) = ((low + high) * 0.5, (high - low).length().max(1e-6));
    let mut eyes = Vec::new();
    for i in 0..random {
        let direction = DVec3::new(next(-1.0, 1.0), next(-1.0, 1.0), next(-1.0, 1.0));
        let reach = [0.3, 1.0, 3.0, 30.0, 1e6][i % 5];
        eyes.push(centre + direction * size * reach);
    }
    let at = |v: u32| DVec3::from(adjacency.positions[v as usize].map(f64::from));
    for edge in adjacency
        .edges
        .iter()
        .step_by((adjacency.edges.len() / 40).max(1))
    {
        eyes.push(at(edge[0]));
        eyes.push((at(edge[0]) + at(edge[1])) * 0.5);
        // On the planes of the faces beside it, or as near as f64 gets.
        eyes.push(at(edge[0]) + (at(edge[1]) - at(edge[0])) * 3.0);
    }
    for (n, a) in adjacency
        .normals
        .iter()
        .zip(&adjacency.anchors)
        .step_by((adjacency.normals.len() / 40).max(1))
    {
        if *n != DVec3::ZERO {
            let side = n.any_orthonormal_vector();
            eyes.push(DVec3::from(a.map(f64::from)) + side * size * 2.0);
        }
    }
    for axis in 0..3 {
        for bound in [low, high] {
            let mut eye = centre + DVec3::splat(2.5 * size);
            eye[axis] = bound[axis];
            eyes.push(eye);
        }
    }
    eyes
}

#[test]
fn the_tree_finds_what_brute_force_finds() {
    let mut scratch = TreeScratch::default();
    let mut found = Vec::new();
    let meshes = test_meshes::closed().into_iter().chain(test_meshes::open());
    for (name, mesh) in meshes {
        for (scale, offset) in [(1.0, 0.0), (1e-3, 0.0), (1e3, 0.0), (1.0, 1e4)] {
            let adjacency = Adjacency::new(&placed(&mesh, scale, offset));
            for crease_angle in [85.0, 20.0] {
                let tree = EdgeTree::new(&adjacency, crease_angle);
                for (i, eye) in eyes(&adjacency, 150).into_iter().enumerate() {
                    let options = FindOptions {
                        mirrored: i % 3 == 0,
                        back_hidden: i % 2 == 0,
                    };
                    let reach = if i % 4 == 0 {
                        DVec3::splat(f64::from(scale) * 0.2)
                    } else {
                        DVec3::ZERO
                    };
                    let eye = EyeBox {
                        low: eye - reach,
                        high: eye + reach,
                    };
                    found.clear();
                    tree.find(&adjacency, &eye, options, &mut scratch, &mut found);
                    found.sort_unstable();
                    assert_eq!(
                        found,
                        brute(&adjacency, crease_angle, &eye, options),
                        "{name}, scale {scale}, offset {offset}, {eye:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn faces_of_different_materials_meet_in_an_edge() {
    let mut mesh = test_meshes::torus(24, 12, 1.0, 0.4);
    mesh.face_materials = (0..mesh.faces.len() as u32).map(|f| f / 100).collect();
    let adjacency = Adjacency::new(&mesh);
    let tree = EdgeTree::new(&adjacency, 85.0);
    let (mut scratch, mut found) = (TreeScratch::default(), Vec::new());
    for eye in eyes(&adjacency, 40) {
        found.clear();
        let (eye, options) = (EyeBox::point(eye), FindOptions::default());
        tree.find(&adjacency, &eye, options, &mut scratch, &mut found);
        found.sort_unstable();
        assert_eq!(found, brute(&adjacency, 85.0, &eye, options));
        let creases = found.iter().filter(|(_, kind)| *kind == EdgeKind::Crease);
        assert!(creases.count() > 20);
    }
    mesh.face_materials.fill(3);
    assert!(Adjacency::new(&mesh).materials.is_empty());
}

#[test]
fn silhouettes_of_closed_meshes_close() {
    let mut scratch = TreeScratch::default();
    let mut found = Vec::new();
    for (name, mesh) in test_meshes::closed() {
        let adjacency = Adjacency::new(&mesh);
        assert!(
            adjacency.first_face.windows(2).all(|w| w[1] - w[0] == 2),
            "{name} is not closed"
        );
        let tree = EdgeTree::new(&adjacency, 180.0);
        for eye in eyes(&adjacency, 1000) {
            found.clear();
            let eye = EyeBox::point(eye);
            tree.find(
                &adjacency,
                &eye,
                FindOptions::default(),
                &mut scratch,
                &mut found,
            );
            let mut degree = vec![0; adjacency.positions.len()];
            let mut seen = vec![false; adjacency.edges.len()];
            for (edge, kind) in &found {
                assert_eq!(*kind, EdgeKind::Silhouette);
                assert!(
                    !std::mem::replace(&mut seen[*edge as usize], true),
                    "an edge twice"
                );
                for v in adjacency.edges[*edge as usize] {
                    degree[v as usize] += 1;
                }
            }
            assert!(
                degree.iter().all(|d| d % 2 == 0),
                "{name}, {eye:?}: an open silhouette"
            );
        }
    }
}

proptest! {
    #![proptest_config(config(64))]

    #[test]
    fn soups_of_triangles_agree_with_brute_force(
        corners in prop::collection::vec(prop::array::uniform3(0_i8..4), 12),
        faces in prop::collection::vec(prop::array::uniform3(0_u32..13), 1..60),
        eye in prop::array::uniform3(-8_i8..12),
    ) {
        // Small integers: plenty of coplanar, repeated and degenerate faces, and eyes on their planes.
        let positions = corners.iter().map(|p| p.map(f32::from)).collect();
        let adjacency = Adjacency::new(&test_meshes::mesh(positions, faces));
        let tree = EdgeTree::new(&adjacency, 60.0);
        let eye = EyeBox::point(DVec3::from(eye.map(f64::from)) * 0.5);
        let mut found = Vec::new();
        tree.find(&adjacency, &eye, FindOptions::default(), &mut TreeScratch::default(), &mut found);
        found.sort_unstable();
        prop_assert_eq!(found, brute(&adjacency, 60.0, &eye, FindOptions::default()));
    }
}
