//! Watertight rays against triangles, in two levels.
//!
//! A [`TriangleMesh`] is an object-space tree over triangles, shared by every instance of it; a [`World`] is a tree
//! over instances. Trees are obvhs binary trees (PLOC and reinsertion) collapsed to eight children a node; nodes,
//! leaves, triangle test and traversal are this crate's own, because rays here aim at edges and vertices on purpose
//! and must not slip between two faces.
//!
//! ```
//! use std::sync::Arc;
//! use glam::{Affine3A, Vec3, vec3};
//! use rays::{Ray, TriangleMesh, World};
//!
//! let corners = [vec3(0., 0., 0.), vec3(1., 0., 0.), vec3(0., 1., 0.)];
//! let mesh = Arc::new(TriangleMesh::build(&corners, &[[0, 1, 2]]));
//! let world = World::new(vec![(mesh, Affine3A::from_translation(vec3(0., 0., -2.)))]);
//! let ray = Ray { origin: vec3(0.25, 0.25, 0.), direction: Vec3::NEG_Z };
//! let hit = world.closest(&ray, f32::INFINITY).expect("the ray points at the triangle");
//! assert_eq!((hit.t, hit.instance, hit.face), (2., 0, 0));
//! ```

mod build;
mod collapse;
mod dispatch;
mod kernel;
mod mesh;
mod node;
mod packet;
mod prefetch;
mod query;
mod region;
mod traverse;
mod triangle;
mod world;

pub use mesh::TriangleMesh;
pub use region::Region;
pub use world::{Recent, World};

use glam::Vec3;

/// A ray; `direction` need not be a unit vector, distances are in its units.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// World space, metres.
    pub origin: Vec3,
    /// World space.
    pub direction: Vec3,
}

impl Ray {
    /// The point at distance `t`, in units of the direction.
    #[must_use]
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }

    /// Whether the ray can hit anything: all numbers finite and the direction not zero.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        self.origin.is_finite() && self.direction.is_finite() && self.direction != Vec3::ZERO
    }
}

/// The closest hit of a ray. Of hits at the same distance it is the one with the smallest instance, then face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Index of the instance.
    pub instance: u32,
    /// Index of the face in its mesh.
    pub face: u32,
    /// Barycentric weights of the face's second and third vertex.
    pub barycentric: [f32; 2],
}

/// Something that blocks a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Occluder {
    /// Index of the instance.
    pub instance: u32,
    /// Index of the face in its mesh.
    pub face: u32,
}

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest coordinates.
    pub min: Vec3,
    /// Largest coordinates.
    pub max: Vec3,
}

impl Bounds {
    /// A box that holds nothing, and to which anything can be added.
    pub const EMPTY: Self = Self {
        min: Vec3::splat(f32::INFINITY),
        max: Vec3::splat(f32::NEG_INFINITY),
    };

    /// Whether nothing is inside.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// The smallest box with this one and `point` in it.
    #[must_use]
    pub fn with_point(self, point: Vec3) -> Self {
        Self {
            min: self.min.min(point),
            max: self.max.max(point),
        }
    }

    /// The smallest box with both in it.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// Largest absolute coordinate, 0 if empty.
    #[must_use]
    pub fn max_abs(&self) -> f32 {
        if self.is_empty() {
            0.
        } else {
            self.min.abs().max(self.max.abs()).max_element()
        }
    }
}
