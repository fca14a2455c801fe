//! The two inner loops: a ray against eight boxes and against eight triangles.
//!
//! Neither uses fused multiply-add, so every instruction set gives the same bits, and an edge function of two
//! neighbours is exactly opposite in sign: no ray passes between them. Comparisons are phrased so that NaN misses.

use crate::{
    node::{LocalRay, Node, WIDTH},
    triangle::{Block, BlockHits},
};

/// Lanes of `node` that the ray enters no later than `t_max`, and at what distances.
#[inline(always)]
pub(crate) fn slabs(node: &Node, ray: &LocalRay, t_max: f32) -> (u32, [f32; WIDTH]) {
    let mut near = [0f32; WIDTH];
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
    let mut lanes = 0;
    for lane in 0..WIDTH {
        lanes |= u32::from(near[lane] <= far[lane]) << lane;
    }
    (lanes, near)
}

/// Triangles of `block` that the ray hits at distances in (0, `t_max`], edges and corners included.
///
/// Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection", without its fall-back to doubles: an edge
/// function that is exactly zero counts for both sides.
#[inline(always)]
pub(crate) fn triangles(block: &Block, ray: &LocalRay, t_max: f32) -> BlockHits {
    let [x, y, z] = ray.axes;
    let mut sheared = [[[0f32; WIDTH]; 3]; 3];
    for (sheared, corner) in sheared.iter_mut().zip(&block.corners) {
        for lane in 0..WIDTH {
            let depth = corner[z][lane] - ray.origin[z];
            sheared[0][lane] = (corner[x][lane] - ray.origin[x]) - ray.shear[0] * depth;
            sheared[1][lane] = (corner[y][lane] - ray.origin[y]) - ray.shear[1] * depth;
            sheared[2][lane] = depth;
        }
    }
    let [a, b, c] = &sheared;
    let mut hits = BlockHits {
        lanes: 0,
        t: [0.; WIDTH],
        v: [0.; WIDTH],
        w: [0.; WIDTH],
        determinant: [0.; WIDTH],
    };
    let mut inside = [false; WIDTH];
    for lane in 0..WIDTH {
        let u = c[0][lane] * b[1][lane] - c[1][lane] * b[0][lane];
        let v = a[0][lane] * c[1][lane] - a[1][lane] * c[0][lane];
        let w = b[0][lane] * a[1][lane] - b[1][lane] * a[0][lane];
        let determinant = u + v + w;
        let depth = u * a[2][lane] + v * b[2][lane] + w * c[2][lane];
        let t = depth * ray.shear[2] / determinant;
        let same_side = ((u >= 0.) & (v >= 0.) & (w >= 0.)) | ((u <= 0.) & (v <= 0.) & (w <= 0.));
        inside[lane] = same_side & (determinant != 0.) & (t > 0.) & (t <= t_max);
        hits.t[lane] = t;
        hits.v[lane] = v;
        hits.w[lane] = w;
        hits.determinant[lane] = determinant;
    }
    for (lane, inside) in inside.into_iter().enumerate() {
        hits.lanes |= u32::from(inside) << lane;
    }
    hits
}
