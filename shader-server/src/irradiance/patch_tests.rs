//! Patches against geometry.
#![allow(clippy::unwrap_used)]

use std::sync::Arc;

use glam::{DVec3, Vec2, dvec3};
use protocol::scene::{Mesh, Model, Object, Scene, Shading};

use super::*;
use crate::random::Stream;

/// A floor of 8 m by 6 m and a small triangle that stands on it.
fn stage() -> Stage {
    let floor = Mesh {
        positions: vec![[0., 0., 0.], [8., 0., 0.], [8., 0., 6.], [0., 0., 6.]],
        faces: vec![[0, 2, 1], [0, 3, 2]],
        ..Mesh::default()
    };
    let blade = Mesh {
        positions: vec![[5.1, 0., 1.1], [5.3, 0., 1.2], [5.2, 0.5, 1.15]],
        faces: vec![[0, 1, 2]],
        ..Mesh::default()
    };
    let object = |mesh| Object {
        name: String::new(),
        mesh,
        material: 0,
        transform: [[1., 0., 0., 0.], [0., 1., 0., 0.], [0., 0., 1., 0.]],
        crease_angle: 30.,
    };
    let scene = Scene {
        shading: Shading {
            model: Model::Direct,
            ambient: [0.; 3],
            background: [0.; 3],
        },
        lights: vec![],
        materials: vec![protocol::scene::Material {
            name: String::new(),
            diffuse: [0.5; 3],
            diffuse_map: None,
            specular: [0.; 3],
            roughness: 1.,
        }],
        textures: vec![],
        meshes: vec![floor, blade],
        objects: vec![object(0), object(1)],
    };
    Stage::build(Arc::new(scene)).unwrap()
}

/// Every place is that of the patch found there, and every point of a patch is found in it.
#[test]
fn places_and_patches_are_one_to_one() {
    let stage = stage();
    let patches = Patches::new(&stage, 0.5);
    assert!(patches.slots.len() > 1000, "{}", patches.slots.len());
    let mut stream = Stream::new(3, 4);
    for slot in 0..patches.slots.len() as u32 {
        let piece = patches.piece(slot);
        for _ in 0..4 {
            // Points on the very border may be rounded into the next patch.
            let inside = stream.square() * 0.98 + 0.005;
            let barycentric = piece.barycentric(inside);
            let of = [piece.instance, piece.face];
            let found = patches.find(of, barycentric, piece.is_front);
            assert_eq!(found, Some((slot, piece)));
        }
    }
}

/// The patches of a face are alike in size and cover it: points of all of them together are even over the face.
#[test]
fn patches_cover_their_face() {
    let stage = stage();
    let patches = Patches::new(&stage, 0.5);
    let mut count = 0.;
    let mut sum = DVec3::ZERO;
    for slot in 0..patches.slots.len() as u32 {
        let piece = patches.piece(slot);
        if (piece.instance, piece.face, piece.is_front) != (0, 0, true) {
            continue;
        }
        assert!(piece.size_m(&stage) <= 0.5);
        for place in [
            Vec2::new(0.2, 0.2),
            Vec2::new(0.6, 0.2),
            Vec2::new(0.2, 0.6),
        ] {
            sum += piece.point(&stage, place).unwrap().0.position;
            count += 1.;
        }
    }
    // The middle of the first triangle.
    assert!(
        (sum / count).distance(dvec3(16. / 3., 0., 2.)) < 1e-3,
        "{}",
        sum / count
    );
}

/// Something stands on the patches around the blade's foot, seen from above, and on no others.
#[test]
fn what_stands_on_a_patch_is_noticed() {
    let stage = stage();
    let patches = Patches::new(&stage, 0.5);
    let mut mixed = 0;
    for slot in 0..patches.slots.len() as u32 {
        let piece = patches.piece(slot);
        if piece.instance == 1 {
            continue;
        }
        let (at, _) = piece.point(&stage, Vec2::splat(1. / 3.)).unwrap();
        let is_bare = piece.is_bare(&stage);
        let is_above = at.normal.y > 0.;
        let near = at.position.distance(dvec3(5.2, 0., 1.15)) < 0.5;
        assert!(is_bare || (is_above && near), "{piece:?}");
        mixed += u32::from(!is_bare);
    }
    assert!(mixed > 0);
}
