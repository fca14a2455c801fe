//! Binary trees by obvhs.

use glam::Vec3A;
use obvhs::{
    aabb::Aabb,
    bvh2::{Bvh2, reinsertion::ReinsertionOptimizer},
    ploc::{PlocBuilder, PlocSearchDistance, SortPrecision},
};

use crate::Bounds;

/// Share of a large tree's nodes tried for a better place; more costs build time for a few per cent of rays.
const REINSERTION: f32 = 0.2;
/// Trees of so few primitives have all their nodes tried, at no cost that is felt.
const SMALL: usize = 20_000;

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
    let share = (SMALL as f32 / boxes.len() as f32).clamp(REINSERTION, 1.);
    ReinsertionOptimizer::default().run(&mut tree, share, None);
    tree
}
