//! One lane after another.

use super::Kernel;
use crate::{
    node::{LocalRay, Node, Planes, WIDTH},
    packet::Bundle,
    triangle::{Block, BlockHits},
};

/// Runs anywhere.
#[derive(Clone, Copy)]
pub(crate) struct Plain;

impl Kernel for Plain {
    #[inline(always)]
    fn slabs(
        self,
        node: &Node,
        near: &Planes,
        far: &Planes,
        t_max: f32,
        enter: &mut [f32; WIDTH],
    ) -> u32 {
        *enter = [0.; WIDTH];
        let mut leave = [t_max; WIDTH];
        for axis in 0..3 {
            let near_planes = &node.bounds[near.rows[axis] as usize];
            let far_planes = &node.bounds[far.rows[axis] as usize];
            for lane in 0..WIDTH {
                let entry = (near_planes[lane] - near.origin[axis]) * near.inverse[axis];
                let exit = (far_planes[lane] - far.origin[axis]) * far.inverse[axis];
                enter[lane] = larger(entry, enter[lane]);
                leave[lane] = smaller(exit, leave[lane]);
            }
        }
        (0..WIDTH).fold(0, |lanes, lane| {
            lanes | u32::from(enter[lane] <= leave[lane]) << lane
        })
    }

    #[inline(always)]
    fn triangles(self, block: &Block, ray: &LocalRay, t_max: f32, hits: &mut BlockHits) -> u32 {
        let [x, y, z] = ray.axes.map(|axis| axis as usize);
        let [origin_x, origin_y, origin_z] = ray.origin;
        let mut lanes = 0;
        for lane in 0..WIDTH {
            let [a, b, c] = [0, 1, 2].map(|corner| {
                let rows = &block.corners[corner];
                let depth = rows[z][lane] - origin_z;
                [
                    (rows[x][lane] - origin_x) - ray.shear[0] * depth,
                    (rows[y][lane] - origin_y) - ray.shear[1] * depth,
                    depth,
                ]
            });
            let u = c[0] * b[1] - c[1] * b[0];
            let v = a[0] * c[1] - a[1] * c[0];
            let w = b[0] * a[1] - b[1] * a[0];
            let inside = (u >= 0. && v >= 0. && w >= 0.) || (u <= 0. && v <= 0. && w <= 0.);
            let determinant = (u + v) + w;
            let t = ((u * a[2] + v * b[2]) + w * c[2]) * ray.shear[2] / determinant;
            if inside && determinant != 0. && t > 0. && t <= t_max {
                lanes |= 1 << lane;
                hits.t[lane] = t;
                hits.v[lane] = v;
                hits.w[lane] = w;
                hits.determinant[lane] = determinant;
            }
        }
        lanes
    }

    #[inline(always)]
    fn rays_in_box(self, node: &Node, lane: usize, rays: &Bundle, t_max: &[f32; WIDTH]) -> u32 {
        let mut bits = 0;
        for (ray, &t_max) in t_max.iter().enumerate() {
            let (mut enter, mut leave) = (0f32, t_max);
            for axis in 0..3 {
                let near_plane = node.bounds[rays.near.rows[axis] as usize][lane];
                let far_plane = node.bounds[rays.far.rows[axis] as usize][lane];
                let inverse = rays.inverse[axis][ray];
                let entry = (near_plane - rays.near_origin[axis][ray]) * inverse;
                let exit = (far_plane - rays.far_origin[axis][ray]) * inverse;
                enter = larger(entry, enter);
                leave = smaller(exit, leave);
            }
            bits |= u32::from(enter <= leave) << ray;
        }
        bits
    }
}

/// Of zeros of both signs the second, as vector instructions do it.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
