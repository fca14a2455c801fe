//! Watertight rays against triangles, in two levels.

use glam::{Affine3A, Vec3};

/// A ray; `direction` need not be a unit vector, distances are in its units.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// World space, metres.
    pub origin: Vec3,
    /// World space.
    pub direction: Vec3,
}

/// The closest hit of a ray.
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
/// Instance placeholder.
pub type Transform = Affine3A;
