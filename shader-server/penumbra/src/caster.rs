//! What stands in a light's way, ready for batches of receivers.

use std::sync::Arc;

use fearless_simd::Level;
use glam::Affine3A;
use rayon::prelude::*;

use crate::{
    blocker::{Blocker, Placed},
    light::{Box3, Light},
    mesh::{BlockerMesh, NONE},
    tree::Tree,
};

/// A mesh somewhere. Instance and face numbers are those of a [`rays::World`] of the same meshes.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Its shape, shared by all instances of it.
    pub mesh: Arc<BlockerMesh>,
    /// Object space to world space; may mirror.
    pub to_world: Affine3A,
}

/// An instance as the light sees it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Part {
    /// In the order of the tree's leaves.
    pub(crate) blockers: Vec<Blocker>,
    pub(crate) tree: Tree,
    bounds: Option<Box3>,
}

/// One light and all that may stand in its way.
///
/// Kept from batch to batch; after an edit only what moved is made anew.
#[derive(Clone, Debug)]
pub struct Caster {
    light: Light,
    instances: Vec<Instance>,
    /// Key of each instance's first polygon.
    first_keys: Vec<u32>,
    /// Does not block: the light itself.
    ignored: Option<u32>,
    cull: bool,
    pub(crate) parts: Vec<Part>,
    pub(crate) top: Tree,
    /// Which part each leaf of the upper tree is.
    pub(crate) top_order: Vec<u32>,
    pub(crate) level: Level,
}

impl Caster {
    /// Sees `instances` from `light`, whose own instance, if it is one, does not block. In parallel on the current rayon pool.
    #[must_use]
    pub fn new(instances: Vec<Instance>, light: Light, light_instance: Option<u32>) -> Self {
        let mut first_keys = Vec::with_capacity(instances.len());
        let mut next = 0;
        for instance in &instances {
            first_keys.push(next);
            next += instance.mesh.polygons.len() as u32;
        }
        let mut caster = Self {
            light,
            instances,
            first_keys,
            ignored: light_instance,
            cull: true,
            parts: Vec::new(),
            top: Tree::default(),
            top_order: Vec::new(),
            level: Level::new(),
        };
        caster.rebuild();
        caster
    }

    /// The same, with both sides of closed shells in the light's way: the same masks but for ties, in twice the
    /// time.
    #[must_use]
    pub fn with_both_sides(mut self) -> Self {
        self.cull = false;
        self.rebuild();
        self
    }

    /// The same, cast with the vector instructions that every processor of this architecture has: same results, to the bit.
    #[must_use]
    pub fn with_baseline_simd(mut self) -> Self {
        self.level = Level::baseline();
        self
    }

    fn rebuild(&mut self) {
        let parts = (0..self.instances.len()).into_par_iter();
        self.parts = parts.map(|instance| self.part(instance)).collect();
        self.raise();
    }

    fn part(&self, index: usize) -> Part {
        if self.ignored == Some(index as u32) {
            return Part::default();
        }
        let Instance { mesh, to_world } = &self.instances[index];
        let placed = Placed::new(mesh, to_world);
        let positions = placed.positions(&self.light);
        let needed = if self.cull {
            placed.needed(&positions, &self.light)
        } else {
            Vec::new()
        };
        let mut blockers: Vec<Blocker> = mesh
            .polygons
            .iter()
            .enumerate()
            .filter_map(|polygon| placed.blocker(polygon, &positions, &self.light, &needed))
            .collect();
        for blocker in &mut blockers {
            blocker.key += self.first_keys[index];
        }
        if self.light.is_planar() {
            blockers.retain(|blocker| blocker.bounds.max[2] > 0.);
        }
        let boxes: Vec<Box3> = blockers.iter().map(|blocker| blocker.bounds).collect();
        let (tree, order) = Tree::build(&boxes);
        Part {
            blockers: order
                .iter()
                .map(|i| blockers[*i as usize].clone())
                .collect(),
            tree,
            bounds: boxes.into_iter().reduce(|a, b| a.union(&b)),
        }
    }

    /// Builds the upper tree.
    fn raise(&mut self) {
        let (mut boxes, mut parts) = (Vec::new(), Vec::new());
        for (index, part) in self.parts.iter().enumerate() {
            if let Some(bounds) = part.bounds {
                boxes.push(bounds);
                parts.push(index as u32);
            }
        }
        let (top, order) = Tree::build(&boxes);
        self.top = top;
        self.top_order = order.into_iter().map(|i| parts[i as usize]).collect();
    }

    /// Moves instances, each to an object-to-world transform; numbers past the end are passed over.
    pub fn move_instances(&mut self, moves: &[(u32, Affine3A)]) {
        for (index, to_world) in moves {
            if let Some(instance) = self.instances.get_mut(*index as usize) {
                instance.to_world = *to_world;
            }
        }
        let moved: Vec<(u32, Part)> = moves
            .par_iter()
            .filter(|(index, _)| (*index as usize) < self.instances.len())
            .map(|(index, _)| (*index, self.part(*index as usize)))
            .collect();
        for (index, part) in moved {
            self.parts[index as usize] = part;
        }
        self.raise();
    }

    /// Puts another light in the place of the old one.
    pub fn set_light(&mut self, light: Light) {
        self.light = light;
        self.rebuild();
    }

    /// The light.
    #[must_use]
    pub fn light(&self) -> &Light {
        &self.light
    }

    /// What stands in its way, or would if it were elsewhere.
    #[must_use]
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// The instance that does not block.
    #[must_use]
    pub fn ignored(&self) -> Option<u32> {
        self.ignored
    }

    /// Polygons that may block, after merging and without those that have their backs to the light.
    #[must_use]
    pub fn blockers(&self) -> usize {
        self.parts.iter().map(|part| part.blockers.len()).sum()
    }

    /// Size of blockers and trees in memory, bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let of = |part: &Part| size_of_val(&part.blockers[..]) + size_of_val(&part.tree.nodes[..]);
        self.parts.iter().map(of).sum()
    }

    /// The number of the polygon that a face is part of, or [`NONE`].
    pub(crate) fn key(&self, (instance, face): (u32, u32)) -> u32 {
        let Some(Instance { mesh, .. }) = self.instances.get(instance as usize) else {
            return NONE;
        };
        match mesh.polygon_of_face.get(face as usize) {
            Some(polygon) if *polygon != NONE => self.first_keys[instance as usize] + polygon,
            _ => NONE,
        }
    }

    /// A polygon of an instance as the light sees it, both sides.
    pub(crate) fn blocker(&self, instance: usize, polygon: u32) -> Option<Blocker> {
        let Instance { mesh, to_world } = self.instances.get(instance)?;
        let shape = mesh.polygons.get(polygon as usize)?;
        Placed::new(mesh, to_world).blocker_alone((polygon as usize, shape), &self.light)
    }

    /// The polygon of a blocker in its mesh.
    pub(crate) fn polygon(&self, instance: usize, blocker: &Blocker) -> u32 {
        blocker.key - self.first_keys[instance]
    }
}
