//! All eight lanes at once, by the instructions of a level of `fearless_simd`.

use fearless_simd::{f32x8, prelude::*};

use super::Kernel;
use crate::{
    node::{Axis, LocalRay, Node, Planes, WIDTH},
    packet::Bundle,
    triangle::{Block, BlockHits},
};

/// Runs where the processor has the instructions of `S`.
#[derive(Clone, Copy)]
pub(crate) struct Vector<S>(pub(crate) S);

// No closures here: their code would be compiled for instructions that every processor has.
impl<S: Simd> Vector<S> {
    #[inline(always)]
    fn all(self, value: f32) -> f32x8<S> {
        f32x8::splat(self.0, value)
    }

    #[inline(always)]
    fn row(self, row: &[f32; WIDTH]) -> f32x8<S> {
        f32x8::simd_from(self.0, *row)
    }

    #[inline(always)]
    fn three(self, values: &[f32; 3]) -> [f32x8<S>; 3] {
        [
            self.all(values[0]),
            self.all(values[1]),
            self.all(values[2]),
        ]
    }

    /// A corner of each triangle relative to the ray's origin, sheared so that the ray runs along z.
    #[inline(always)]
    fn sheared(
        self,
        rows: &[[f32; WIDTH]; 3],
        axes: [Axis; 3],
        origin: [f32x8<S>; 3],
        shear: [f32x8<S>; 3],
    ) -> [f32x8<S>; 3] {
        let depth = self.row(&rows[axes[2] as usize]) - origin[2];
        let right = self.row(&rows[axes[0] as usize]) - origin[0];
        let up = self.row(&rows[axes[1] as usize]) - origin[1];
        [right - shear[0] * depth, up - shear[1] * depth, depth]
    }
}

#[inline(always)]
fn cross<S: Simd>(p: [f32x8<S>; 3], q: [f32x8<S>; 3]) -> f32x8<S> {
    p[0] * q[1] - p[1] * q[0]
}

impl<S: Simd> Kernel for Vector<S> {
    #[inline(always)]
    fn slabs(
        self,
        node: &Node,
        near: &Planes,
        far: &Planes,
        t_max: f32,
        enter: &mut [f32; WIDTH],
    ) -> u32 {
        let mut entry = self.all(0.);
        let mut exit = self.all(t_max);
        for axis in 0..3 {
            let near_planes = self.row(&node.bounds[near.rows[axis] as usize]);
            let far_planes = self.row(&node.bounds[far.rows[axis] as usize]);
            let to_near = near_planes - self.all(near.origin[axis]);
            let to_far = far_planes - self.all(far.origin[axis]);
            entry = (to_near * self.all(near.inverse[axis])).max(entry);
            exit = (to_far * self.all(far.inverse[axis])).min(exit);
        }
        entry.store_slice(enter);
        entry.simd_le(exit).to_bitmask() as u32
    }

    #[inline(always)]
    fn triangles(self, block: &Block, ray: &LocalRay, t_max: f32, hits: &mut BlockHits) -> u32 {
        let origin = self.three(&ray.origin);
        let shear = self.three(&ray.shear);
        let a = self.sheared(&block.corners[0], ray.axes, origin, shear);
        let b = self.sheared(&block.corners[1], ray.axes, origin, shear);
        let c = self.sheared(&block.corners[2], ray.axes, origin, shear);
        let (u, v, w) = (cross(c, b), cross(a, c), cross(b, a));
        let zero = self.all(0.);
        let all_positive = u.min(v).min(w).simd_ge(zero);
        let all_negative = u.max(v).max(w).simd_le(zero);
        let inside = (all_positive | all_negative).to_bitmask() as u32;
        if inside == 0 {
            return 0;
        }
        let determinant = (u + v) + w;
        let depth = (u * a[2] + v * b[2]) + w * c[2];
        let t = depth * shear[2] / determinant;
        // Where the determinant is zero so is the depth, and t is NaN; it also is where an edge function is.
        let in_range = t.simd_gt(zero) & t.simd_le(self.all(t_max));
        let lanes = inside & in_range.to_bitmask() as u32;
        if lanes != 0 {
            t.store_slice(&mut hits.t);
            v.store_slice(&mut hits.v);
            w.store_slice(&mut hits.w);
            determinant.store_slice(&mut hits.determinant);
        }
        lanes
    }

    #[inline(always)]
    fn rays_in_box(self, node: &Node, lane: usize, rays: &Bundle, t_max: &[f32; WIDTH]) -> u32 {
        let mut entry = self.all(0.);
        let mut exit = self.row(t_max);
        for axis in 0..3 {
            let near_plane = self.all(node.bounds[rays.near.rows[axis] as usize][lane]);
            let far_plane = self.all(node.bounds[rays.far.rows[axis] as usize][lane]);
            let inverse = self.row(&rays.inverse[axis]);
            entry = ((near_plane - self.row(&rays.near_origin[axis])) * inverse).max(entry);
            exit = ((far_plane - self.row(&rays.far_origin[axis])) * inverse).min(exit);
        }
        entry.simd_le(exit).to_bitmask() as u32
    }
}
