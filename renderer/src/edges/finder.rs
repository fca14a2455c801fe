//! Finding the edges of a scene that matter to a view (paper sections 6.1, 6.2 and 6.5).

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DMat3, DVec3, Vec3};
use protocol::scene::{Affine, Light, Scene};

use super::adjacency::{Adjacency, EyeBox};
use super::list::{EdgeList, NO_FACE};
use super::tree::{EdgeKind, EdgeTree, FindOptions, TreeScratch};
use crate::camera::View;

/// Finds silhouettes, creases, borders and non-manifold edges of a scene's objects, and the outlines of its area lights.
///
/// Build once a scene; objects that share a mesh share its trees. Moving an object costs nothing until the next search,
/// and a search from where the last one was, with nothing moved since, costs nothing at all.
#[derive(Debug)]
pub struct EdgeFinder {
    objects: Vec<ObjectEdges>,
    lights: Vec<Vec<DVec3>>,
    scratch: TreeScratch,
    found: Vec<(u32, EdgeKind)>,
    /// Changes with every move.
    epoch: u64,
    last: Option<(View, u64)>,
    generation: u64,
}

#[derive(Debug)]
struct ObjectEdges {
    adjacency: Arc<Adjacency>,
    tree: Arc<EdgeTree>,
    transform: Affine,
    placement: Placement,
}

/// An affine map in `f64`.
#[derive(Clone, Copy, Debug)]
struct Placement {
    linear: DMat3,
    translation: DVec3,
    /// Nothing if the map is singular: such an object has no area to see.
    inverse: Option<DMat3>,
}

impl Placement {
    fn new(m: &Affine) -> Self {
        let column = |k: usize| DVec3::from([m[0][k], m[1][k], m[2][k]].map(f64::from));
        let linear = DMat3::from_cols(column(0), column(1), column(2));
        let determinant = linear.determinant();
        let regular = determinant != 0.0 && determinant.is_finite() && column(3).is_finite();
        Self {
            linear,
            translation: column(3),
            inverse: regular.then(|| linear.inverse()),
        }
    }
}

/// From object space to view space: (right, up, depth).
#[derive(Clone, Copy)]
struct ToView {
    linear: DMat3,
    translation: DVec3,
}

impl ToView {
    fn new(view: &View, linear: DMat3, translation: DVec3) -> Self {
        let axes = DMat3::from_cols(
            view.right.as_dvec3(),
            view.up.as_dvec3(),
            view.forward.as_dvec3(),
        )
        .transpose();
        Self {
            linear: axes * linear,
            translation: axes * (translation - view.eye.as_dvec3()),
        }
    }

    fn apply(&self, p: DVec3) -> DVec3 {
        self.linear * p + self.translation
    }
}

impl EdgeFinder {
    /// Builds the adjacency and edge trees of all objects. Objects without a mesh in the scene have no edges.
    pub fn new(scene: &Scene) -> Self {
        let mut meshes: HashMap<u32, Arc<Adjacency>> = HashMap::new();
        let mut trees: HashMap<(u32, u32), Arc<EdgeTree>> = HashMap::new();
        let empty = protocol::scene::Mesh::default();
        let objects = scene
            .objects
            .iter()
            .map(|object| {
                let mesh = scene.meshes.get(object.mesh as usize).unwrap_or(&empty);
                let adjacency = meshes
                    .entry(object.mesh)
                    .or_insert_with(|| Arc::new(Adjacency::new(mesh)))
                    .clone();
                let tree = trees
                    .entry((object.mesh, object.crease_angle.to_bits()))
                    .or_insert_with(|| Arc::new(EdgeTree::new(&adjacency, object.crease_angle)))
                    .clone();
                let placement = Placement::new(&object.transform);
                ObjectEdges {
                    adjacency,
                    tree,
                    transform: object.transform,
                    placement,
                }
            })
            .collect();
        let lights = scene.lights.iter().filter_map(|light| match light {
            Light::Area { vertices, .. } => Some(
                vertices
                    .iter()
                    .map(|v| DVec3::from(v.map(f64::from)))
                    .collect(),
            ),
            _ => None,
        });
        Self {
            objects,
            lights: lights.collect(),
            scratch: TreeScratch::default(),
            found: Vec::new(),
            epoch: 0,
            last: None,
            generation: 0,
        }
    }

    /// Adjacency and tree of an object, which those that share its mesh share.
    ///
    /// # Panics
    /// If there is no such object.
    pub fn prepared(&self, object: usize) -> (Arc<Adjacency>, Arc<EdgeTree>) {
        let object = &self.objects[object];
        (Arc::clone(&object.adjacency), Arc::clone(&object.tree))
    }

    /// Moves an object; an index past the last object is ignored.
    pub fn set_transform(&mut self, object: usize, transform: &Affine) {
        if let Some(object) = self.objects.get_mut(object)
            && object.transform != *transform
        {
            object.transform = *transform;
            object.placement = Placement::new(transform);
            self.epoch += 1;
        }
    }

    /// Moves an area light, counted among the area lights alone; vertices in metres, world space.
    pub fn set_light(&mut self, light: usize, vertices: &[[f32; 3]]) {
        if let Some(light) = self.lights.get_mut(light) {
            light.clear();
            light.extend(vertices.iter().map(|v| DVec3::from(v.map(f64::from))));
            self.epoch += 1;
        }
    }

    /// Changes whenever something has moved.
    pub fn epoch(&self) -> u64 {
        self.epoch
    }

    /// Replaces the list by the edges that matter to the view, objects outside of the picture left out. Returns false,
    /// having done nothing, if the list holds them already.
    pub fn find(&mut self, view: &View, out: &mut EdgeList) -> bool {
        if self.last == Some((*view, self.epoch))
            && out.generation == self.generation
            && self.generation > 0
        {
            return false;
        }
        out.clear();
        for index in 0..self.objects.len() {
            self.find_object(index, view, out);
        }
        let to_view = ToView::new(view, DMat3::IDENTITY, DVec3::ZERO);
        for (k, vertices) in self.lights.iter().enumerate() {
            let object = (self.objects.len() + k) as u32;
            for (i, v) in vertices.iter().enumerate() {
                let next = (i + 1) % vertices.len();
                out.from.push(to_view.apply(*v).as_vec3().into());
                out.to.push(to_view.apply(vertices[next]).as_vec3().into());
                out.kind.push(EdgeKind::Border);
                out.object.push(object);
                out.second.push(object);
                out.faces.push([NO_FACE; 2]);
                out.vertices.push([i as u32, next as u32]);
            }
        }
        self.last = Some((*view, self.epoch));
        self.generation += 1;
        out.generation = self.generation;
        true
    }

    fn find_object(&mut self, index: usize, view: &View, out: &mut EdgeList) {
        let object = &self.objects[index];
        let Some(inverse) = object.placement.inverse else {
            return;
        };
        let to_view = ToView::new(view, object.placement.linear, object.placement.translation);
        let [low, high] = object
            .adjacency
            .bounds
            .map(|p| DVec3::from(p.map(f64::from)));
        if outside_frustum(view, &to_view, low, high) {
            return;
        }
        let eye = inverse * (view.eye.as_dvec3() - object.placement.translation);
        let options = FindOptions {
            mirrored: object.placement.linear.determinant() < 0.0,
            back_hidden: eye.cmplt(low).any() || eye.cmpgt(high).any(),
        };
        self.found.clear();
        let eye = EyeBox::point(eye);
        object.tree.find(
            &object.adjacency,
            &eye,
            options,
            &mut self.scratch,
            &mut self.found,
        );
        for &(edge, kind) in &self.found {
            let ends = object.adjacency.edges[edge as usize];
            let [from, to] = ends.map(|v| {
                let p = Vec3::from(object.adjacency.positions[v as usize]).as_dvec3();
                to_view.apply(p).as_vec3().into()
            });
            let faces = object.adjacency.faces(edge as usize);
            out.from.push(from);
            out.to.push(to);
            out.kind.push(kind);
            out.object.push(index as u32);
            out.second.push(index as u32);
            out.faces
                .push([faces[0], faces.get(1).copied().unwrap_or(NO_FACE)]);
            out.vertices.push(ends);
        }
    }
}

/// Whether a box lies beyond one of the sides of the frustum.
fn outside_frustum(view: &View, to_view: &ToView, low: DVec3, high: DVec3) -> bool {
    let focal = f64::from(view.focal_px);
    // A margin of two pixels: crossings on the picture's rim count too.
    let (half_width, half_height) = (
        f64::from(view.width) * 0.5 + 2.0,
        f64::from(view.height) * 0.5 + 2.0,
    );
    let mut inside = [false; 5];
    for corner in 0..8 {
        let pick = |k: usize| {
            if corner >> k & 1 == 0 {
                low[k]
            } else {
                high[k]
            }
        };
        let p = to_view.apply(DVec3::new(pick(0), pick(1), pick(2)));
        inside[0] |= p.z > 0.0;
        inside[1] |= p.x * focal <= half_width * p.z;
        inside[2] |= p.x * focal >= -half_width * p.z;
        inside[3] |= p.y * focal <= half_height * p.z;
        inside[4] |= p.y * focal >= -half_height * p.z;
    }
    inside.contains(&false)
}
