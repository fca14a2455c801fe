//! The lower level: a tree over the triangles of one mesh.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::{
    Bounds,
    build::binary_tree,
    collapse::collapse,
    node::{Tree, WIDTH},
    triangle::Block,
};

/// Largest coordinate that is traced; beyond it products of three coordinates would overflow.
const MAX_COORDINATE: f32 = 1e12;

/// Triangles in object space with a tree over them.
#[derive(Clone, Debug)]
pub struct TriangleMesh {
    pub(crate) tree: Tree,
    pub(crate) blocks: Vec<Block>,
    pub(crate) extent: f32,
    bounds: Bounds,
    dropped: usize,
}

impl TriangleMesh {
    /// Builds the tree. Face `i` of a hit is `faces[i]`.
    ///
    /// Faces that no ray can hit are left out and counted by [`dropped`](Self::dropped): those without area, with an
    /// index past `positions`, or with a coordinate that is not finite or is above 1e12 in size.
    #[must_use]
    pub fn build(positions: &[Vec3], faces: &[[u32; 3]]) -> Self {
        let usable: Vec<(u32, [Vec3; 3])> = faces
            .par_iter()
            .enumerate()
            .filter_map(|(face, corners)| Some((face as u32, usable_corners(positions, *corners)?)))
            .collect();
        let boxes: Vec<Bounds> = usable
            .par_iter()
            .map(|(_, corners)| corners.iter().fold(Bounds::EMPTY, |b, &p| b.with_point(p)))
            .collect();
        let bounds = boxes.iter().fold(Bounds::EMPTY, |all, b| all.union(*b));

        let mut blocks = Vec::with_capacity(usable.len() / 4 + 1);
        let mut tree = Tree::default();
        if !boxes.is_empty() {
            tree = collapse(&binary_tree(&boxes), WIDTH as u32, |primitives| {
                let mut block = Block::empty();
                for (lane, &primitive) in primitives.iter().enumerate() {
                    let (face, corners) = usable[primitive as usize];
                    block.set(lane, face, corners);
                }
                blocks.push(block);
                blocks.len() - 1
            });
        }
        let dropped = faces.len() - usable.len();
        Self {
            tree,
            blocks,
            extent: bounds.max_abs(),
            bounds,
            dropped,
        }
    }

    /// Bounds of the faces in the tree, object space.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// How many faces no ray can hit.
    #[must_use]
    pub fn dropped(&self) -> usize {
        self.dropped
    }

    /// Size in memory, bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(&self.tree.nodes[..]) + size_of_val(&self.blocks[..])
    }
}

fn usable_corners(positions: &[Vec3], face: [u32; 3]) -> Option<[Vec3; 3]> {
    let corner = |i: u32| positions.get(i as usize).copied();
    let corners = [corner(face[0])?, corner(face[1])?, corner(face[2])?];
    let traceable = corners
        .iter()
        .all(|p| p.abs().cmple(Vec3::splat(MAX_COORDINATE)).all());
    let [a, b, c]: [DVec3; 3] = corners.map(Vec3::as_dvec3);
    let area = (b - a).cross(c - a);
    (traceable && area != DVec3::ZERO).then_some(corners)
}
