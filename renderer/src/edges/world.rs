//! The scene for rays of the display's own, which only ask what is visible.

use std::sync::Arc;

use glam::{Affine3A, Mat3A, Vec3, Vec3A};
use protocol::scene::{Affine, Light, Scene};
use rays::{TriangleMesh, World};

/// The scene's objects, then its area lights, in order: instances have the numbers that an
/// [`EdgeList`](super::list::EdgeList) calls objects by. An object without a mesh has an empty one.
pub fn world_of(scene: &Scene) -> World {
    let meshes: Vec<Arc<TriangleMesh>> = scene
        .meshes
        .iter()
        .map(|mesh| {
            let positions: Vec<Vec3> = mesh.positions.iter().map(|p| Vec3::from(*p)).collect();
            Arc::new(TriangleMesh::build(&positions, &mesh.faces))
        })
        .collect();
    let objects = scene.objects.iter().map(|object| {
        let mesh = meshes.get(object.mesh as usize).cloned();
        (
            mesh.unwrap_or_else(|| Arc::new(TriangleMesh::build(&[], &[]))),
            affine(&object.transform),
        )
    });
    let lights = scene.lights.iter().filter_map(|light| {
        let Light::Area { vertices, .. } = light else {
            return None;
        };
        Some((polygon(vertices), Affine3A::IDENTITY))
    });
    World::new(objects.chain(lights).collect())
}

/// An area light's polygon as a mesh.
pub fn polygon(vertices: &[[f32; 3]]) -> Arc<TriangleMesh> {
    let positions: Vec<Vec3> = vertices.iter().map(|v| Vec3::from(*v)).collect();
    let fan: Vec<[u32; 3]> = (2..positions.len() as u32).map(|i| [0, i - 1, i]).collect();
    Arc::new(TriangleMesh::build(&positions, &fan))
}

/// Rows of a scene's transform as a matrix.
pub fn affine(rows: &Affine) -> Affine3A {
    let column = |k: usize| Vec3A::new(rows[0][k], rows[1][k], rows[2][k]);
    Affine3A {
        matrix3: Mat3A::from_cols(column(0), column(1), column(2)),
        translation: column(3),
    }
}
