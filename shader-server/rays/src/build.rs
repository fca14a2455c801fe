//! Binary trees by obvhs.

use glam::Vec3A;
use obvhs::{
    aabb::Aabb,
    bvh2::{Bvh2, reinsertion::ReinsertionOptimizer},
    ploc::{PlocBuilder, PlocSearchDistance, SortPrecision},
};

use crate::Bounds;

/// Share of nodes tried for a better place; more costs build time for a few per cent of rays.
const REINSERTION: f32 = 0.2;

/// A binary tree over `boxes`, one primitive a leaf; leaf `i` of the result stands for `boxes[primitive_indices[i]]`.
/// Boxes must be finite.
pub(crate) fn binary_tree(boxes: &[Bounds]) -> Bvh2 {
    let boxes: Vec<Aabb> = boxes
        .iter()
        .map(|b| Aabb::new(Vec3A::from(b.min), Vec3A::from(b.max)))
        .collect();
    let indices = (0..boxes.len() as u32).collect();
    let mut tree = PlocBuilder::with_capacity(boxes.len()).build(
        PlocSearchDistance::Medium,
        &boxes,
        indices,
        SortPrecision::U64,
        3,
    );
    ReinsertionOptimizer::default().run(&mut tree, REINSERTION, None);
    tree
}
