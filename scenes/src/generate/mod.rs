//! Meshes made by formula.

mod builder;
mod chain;
mod furniture;
mod head;
mod limits;
mod params;
mod plants;
mod round;
mod solids;
mod tube;

use protocol::scene::{Affine, Mesh};

use crate::transform::IDENTITY;

pub(crate) use params::Generator;

/// What a generator makes: each mesh once, and where its copies are.
pub(crate) struct Made {
    pub(crate) meshes: Vec<Mesh>,
    pub(crate) copies: Vec<MeshCopy>,
}

/// One of the objects that a generator makes.
pub(crate) struct MeshCopy {
    /// What follows the object's name and a slash; `None` if there is only one.
    pub(crate) name: Option<String>,
    /// Index into [`Made::meshes`].
    pub(crate) mesh: usize,
    /// From the mesh to the object.
    pub(crate) transform: Affine,
}

impl From<Mesh> for Made {
    fn from(mesh: Mesh) -> Self {
        Self {
            meshes: vec![mesh],
            copies: vec![MeshCopy {
                name: None,
                mesh: 0,
                transform: IDENTITY,
            }],
        }
    }
}

#[cfg(test)]
mod tests;
