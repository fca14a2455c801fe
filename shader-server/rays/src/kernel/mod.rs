//! The inner loops: a ray against eight boxes, a ray against eight triangles, eight rays against a box.
//!
//! Neither version uses fused multiply-add, so every instruction set gives the same bits, and the edge functions of two
//! neighbours are exactly opposite in sign: no ray passes between them. Comparisons are phrased so that NaN misses.

mod plain;
mod vector;

pub(crate) use plain::Plain;
pub(crate) use vector::Vector;

use crate::{
    node::{LocalRay, Node, Planes, WIDTH},
    packet::Bundle,
    triangle::{Block, BlockHits},
};

/// One way to compute them.
pub(crate) trait Kernel: Copy {
    /// Lanes of `node` that are entered no later than `t_max`; puts into `enter` at what distances, 0 or more.
    fn slabs(
        self,
        node: &Node,
        near: &Planes,
        far: &Planes,
        t_max: f32,
        enter: &mut [f32; WIDTH],
    ) -> u32;

    /// Lanes of `block` with a triangle that the ray hits at a distance in (0, `t_max`], edges and corners included.
    /// `hits` is filled in if there is one.
    ///
    /// Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection", without its fall-back to doubles: an edge
    /// function that is exactly zero counts for both sides.
    fn triangles(self, block: &Block, ray: &LocalRay, t_max: f32, hits: &mut BlockHits) -> u32;

    /// Which of eight rays enter the box in a lane of `node` no later than each one's `t_max`: those that
    /// [`slabs`](Self::slabs) finds for each alone.
    fn rays_in_box(self, node: &Node, lane: usize, rays: &Bundle, t_max: &[f32; WIDTH]) -> u32;
}

#[cfg(test)]
mod tests;
