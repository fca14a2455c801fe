//! Small worlds, a random generator, and the slow obvious way to find what is seen of a light.
#![allow(dead_code, missing_docs, unreachable_pub)]

use std::sync::Arc;

use glam::{Affine3A, Vec3, vec3};
use rays::{Ray, TriangleMesh, World};
use soft_maps::{Light, Receiver};

pub type Placed = (Arc<TriangleMesh>, Affine3A);

/// A parallelogram from a corner and two sides.
pub fn sheet(corner: Vec3, u: Vec3, v: Vec3) -> Placed {
    let corners = [corner, corner + u, corner + u + v, corner + v];
    let mesh = TriangleMesh::build(&corners, &[[0, 1, 2], [0, 2, 3]]);
    (Arc::new(mesh), Affine3A::IDENTITY)
}

/// A closed box.
pub fn solid(min: Vec3, max: Vec3) -> Placed {
    let corners: Vec<Vec3> = (0..8)
        .map(|i| {
            let pick = |axis: usize| {
                if i >> axis & 1 == 0 {
                    min[axis]
                } else {
                    max[axis]
                }
            };
            vec3(pick(0), pick(1), pick(2))
        })
        .collect();
    #[rustfmt::skip]
    let quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let faces: Vec<[u32; 3]> = quads
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
        .collect();
    let mesh = TriangleMesh::build(&corners, &faces);
    (Arc::new(mesh), Affine3A::IDENTITY)
}

/// The plane y = 0, `half` metres to each side.
pub fn ground(half: f32) -> Placed {
    sheet(
        vec3(-half, 0., -half),
        Vec3::X * 2. * half,
        Vec3::Z * 2. * half,
    )
}

pub fn on_ground(x: f32, z: f32) -> Receiver {
    Receiver {
        position: vec3(x, 0., z),
        normal: Vec3::Y,
        face_normal: Vec3::Y,
    }
}

/// What a piece of the light around `place` gives the receiver, up to a factor.
pub fn weight(receiver: &Receiver, place: Vec3, facing: Option<Vec3>) -> f64 {
    let q = (place - receiver.position).as_dvec3();
    let square = q.length_squared();
    let cosine = q.dot(receiver.normal.as_dvec3()).max(0.);
    let value = match facing {
        None => cosine / (square * square.sqrt()),
        Some(n) => cosine * (-q.dot(n.as_dvec3())).max(0.) / (square * square),
    };
    if value.is_finite() { value } else { 0. }
}

/// Whether nothing is between a receiver and a place of the light.
pub fn sees(world: &World, receiver: &Receiver, place: Vec3, ignored: Option<u32>) -> bool {
    let towards = place - receiver.position;
    let side = if towards.dot(receiver.face_normal) < 0. {
        -1.
    } else {
        1.
    };
    let origin = receiver.position + receiver.face_normal * (side * 1e-4);
    let ray = Ray {
        origin,
        direction: place - origin,
    };
    world
        .occluder_where(&ray, 1. - 1e-5, |instance, _| Some(instance) != ignored)
        .is_none()
}

/// Share of a linear light's irradiance that arrives, by `count` rays.
pub fn by_rays(world: &World, receiver: &Receiver, ends: [Vec3; 2], count: u32) -> f32 {
    let (mut seen, mut all) = (0., 0.);
    for i in 0..count {
        let place = ends[0].lerp(ends[1], (i as f32 + 0.5) / count as f32);
        let weight = weight(receiver, place, None);
        all += weight;
        if weight > 0. && sees(world, receiver, place, None) {
            seen += weight;
        }
    }
    if all > 0. { (seen / all) as f32 } else { 0. }
}

pub fn segment(light: &Light) -> [Vec3; 2] {
    match light {
        Light::Segment(ends) => *ends,
        Light::Polygon { .. } => panic!("a segment"),
    }
}

/// A small generator (SplitMix64), so that test data is the same everywhere.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u64 << 24) as f32
    }

    pub fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }
}
