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

    /// Its faces by where they are.
    pub fn faces(&self) -> &Arc<FaceTree> {
        self.faces
            .get_or_init(|| Arc::new(FaceTree::new(&self.mesh, Arc::clone(&self.adjacency))))
    }
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
