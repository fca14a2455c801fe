//! What the shadows of a scene are computed from, shared with the thread that computes them.

use std::sync::{Arc, OnceLock};

use glam::{DAffine3, DMat3, DVec3};
use protocol::scene::{Affine, Mesh, Scene};

use super::events::Rings;
use super::faces::FaceTree;
use super::light::ShadowLight;
use crate::edges::finder::EdgeFinder;
use crate::edges::{adjacency::Adjacency, tree::EdgeTree};

/// A mesh as a blocker and a receiver. What is costly is built when it is first needed, by whoever needs it.
#[derive(Debug)]
pub struct ShadowMesh {
    mesh: Arc<Mesh>,
    /// Edges and face planes.
    pub adjacency: Arc<Adjacency>,
    /// Its edges by what light they matter to.
    pub tree: Arc<EdgeTree>,
    rings: OnceLock<Rings>,
    faces: OnceLock<Arc<FaceTree>>,
}

impl ShadowMesh {
    /// What lies around its vertices.
    pub fn rings(&self) -> &Rings {
        self.rings.get_or_init(|| Rings::new(&self.adjacency))
    }

    /// Corners of a face, object space.
    fn corners(&self, face: u32) -> Option<[DVec3; 3]> {
        of_face(&self.mesh.faces, &self.mesh.positions, face)
    }

    /// Shading normals at the corners of a face, object space.
    fn normals(&self, face: u32) -> Option<[DVec3; 3]> {
        of_face(&self.mesh.face_normals, &self.mesh.normals, face)
    }

    /// Its faces by where they are.
    pub fn faces(&self) -> &Arc<FaceTree> {
        self.faces
            .get_or_init(|| Arc::new(FaceTree::new(&self.mesh, Arc::clone(&self.adjacency))))
    }
}

/// What a face's corners have.
fn of_face(faces: &[[u32; 3]], vectors: &[[f32; 3]], face: u32) -> Option<[DVec3; 3]> {
    let mut out = [DVec3::ZERO; 3];
    for (vector, index) in out.iter_mut().zip(faces.get(face as usize)?) {
        *vector = DVec3::from(vectors.get(*index as usize)?.map(f64::from));
    }
    Some(out)
}

/// An object of the scene.
#[derive(Clone, Debug)]
pub struct ShadowObject {
    /// Its shape.
    pub mesh: Arc<ShadowMesh>,
    /// Object to world space.
    pub to_world: DAffine3,
    /// The other way; nothing if the map is singular, and the object can neither cast nor receive.
    pub to_object: Option<DAffine3>,
}

impl ShadowObject {
    /// Corners of a face, world space; all in one place if there is no such face.
    pub fn corners(&self, face: u32) -> [DVec3; 3] {
        let corners = self.mesh.corners(face).unwrap_or_default();
        corners.map(|p| self.to_world.transform_point3(p))
    }

    /// Unit shading normal at a point of a face, world space, on either side; nothing where the mesh has none.
    pub fn shading_normal(&self, face: u32, at: DVec3) -> Option<DVec3> {
        let to_object = self.to_object?;
        let normals = self.mesh.normals(face)?;
        let [a, b, c] = self.mesh.corners(face)?;
        let p = to_object.transform_point3(at);
        let area = (b - a).cross(c - a);
        let share = |from: DVec3, to: DVec3| (from - p).cross(to - p).dot(area).max(0.0);
        let normal = normals[0] * share(b, c) + normals[1] * share(c, a) + normals[2] * share(a, b);
        // Normals are mapped by the transpose of the inverse.
        (to_object.matrix3.transpose() * normal).try_normalize()
    }

    /// Puts the object elsewhere.
    pub fn place(&mut self, transform: &Affine) {
        let column = |k: usize| DVec3::from([0, 1, 2].map(|row| f64::from(transform[row][k])));
        self.to_world = DAffine3 {
            matrix3: DMat3::from_cols(column(0), column(1), column(2)),
            translation: column(3),
        };
        let determinant = self.to_world.matrix3.determinant();
        let regular = determinant != 0.0 && determinant.is_finite();
        self.to_object =
            (regular && self.to_world.translation.is_finite()).then(|| self.to_world.inverse());
    }
}

/// Lights and objects where they are now. Cloning it copies no geometry.
#[derive(Clone, Debug, Default)]
pub struct ShadowScene {
    /// By index in the scene.
    pub lights: Vec<ShadowLight>,
    /// By index in the scene.
    pub objects: Vec<ShadowObject>,
}

impl ShadowScene {
    /// Of a scene whose edges have been prepared already.
    pub fn new(scene: &Scene, finder: &EdgeFinder) -> Self {
        let mut meshes: Vec<(*const Adjacency, *const EdgeTree, Arc<ShadowMesh>)> = Vec::new();
        let objects = scene.objects.iter().enumerate().map(|(i, object)| {
            let (adjacency, tree) = finder.prepared(i);
            let known = meshes
                .iter()
                .find(|m| std::ptr::eq(m.0, &*adjacency) && std::ptr::eq(m.1, &*tree));
            let mesh = match known {
                Some((_, _, mesh)) => Arc::clone(mesh),
                None => {
                    let mesh = scene.meshes.get(object.mesh as usize);
                    let mesh = Arc::new(ShadowMesh {
                        mesh: Arc::new(mesh.cloned().unwrap_or_default()),
                        adjacency: Arc::clone(&adjacency),
                        tree: Arc::clone(&tree),
                        rings: OnceLock::new(),
                        faces: OnceLock::new(),
                    });
                    meshes.push((&*adjacency, &*tree, Arc::clone(&mesh)));
                    mesh
                }
            };
            let mut object = ShadowObject {
                mesh,
                to_world: DAffine3::IDENTITY,
                to_object: None,
            };
            object.place(&scene.objects[i].transform);
            object
        });
        Self {
            objects: objects.collect(),
            lights: scene.lights.iter().map(ShadowLight::new).collect(),
        }
    }
}
