//! Both loops one lane after another.

use super::Kernel;
use crate::{
    node::{LocalRay, Node, WIDTH},
    triangle::{Block, BlockHits},
};

/// Runs anywhere.
pub(crate) struct Plain;

impl Kernel for Plain {
    #[inline(always)]
    fn slabs(node: &Node, ray: &LocalRay, t_max: f32, near: &mut [f32; WIDTH]) -> u32 {
        *near = [0.; WIDTH];
        let mut far = [t_max; WIDTH];
        for axis in 0..3 {
            let near_planes = &node.bounds[ray.near_row[axis]];
            let far_planes = &node.bounds[ray.far_row[axis]];
            for lane in 0..WIDTH {
                let entry = (near_planes[lane] - ray.near_origin[axis]) * ray.inverse[axis];
                let exit = (far_planes[lane] - ray.far_origin[axis]) * ray.inverse[axis];
                near[lane] = if entry > near[lane] {
                    entry
                } else {
                    near[lane]
                };
                far[lane] = if exit < far[lane] { exit } else { far[lane] };
            }
        }
        (0..WIDTH).fold(0, |lanes, lane| {
            lanes | u32::from(near[lane] <= far[lane]) << lane
        })
    }

    #[inline(always)]
    fn triangles(block: &Block, ray: &LocalRay, t_max: f32, hits: &mut BlockHits) -> u32 {
        let [x, y, z] = ray.axes;
        let mut lanes = 0;
        for lane in 0..WIDTH {
            let [a, b, c] = [0, 1, 2].map(|corner| {
                let rows = &block.corners[corner];
                let depth = rows[z][lane] - ray.origin[z];
                [
                    (rows[x][lane] - ray.origin[x]) - ray.shear[0] * depth,
                    (rows[y][lane] - ray.origin[y]) - ray.shear[1] * depth,
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
}
