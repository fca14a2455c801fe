//! Both loops with all eight lanes at once.

use std::arch::x86_64::*;

use super::Kernel;
use crate::{
    node::{LocalRay, Node, WIDTH},
    triangle::{Block, BlockHits},
};

/// Runs where the processor has AVX2; its methods may only be called if [`Avx2::detect`] gave one.
pub(crate) struct Avx2(());

impl Avx2 {
    /// One, if this machine has the instructions.
    pub(crate) fn detect() -> Option<Self> {
        std::arch::is_x86_feature_detected!("avx2").then_some(Self(()))
    }
}

#[expect(
    unsafe_code,
    reason = "this kernel is only chosen where the processor has AVX2"
)]
impl Kernel for Avx2 {
    #[inline(always)]
    fn slabs(node: &Node, ray: &LocalRay, t_max: f32, near: &mut [f32; WIDTH]) -> u32 {
        // SAFETY: the caller got an `Avx2` from `detect`.
        unsafe { slabs(node, ray, t_max, near) }
    }

    #[inline(always)]
    fn triangles(block: &Block, ray: &LocalRay, t_max: f32, hits: &mut BlockHits) -> u32 {
        // SAFETY: as above.
        unsafe { triangles(block, ray, t_max, hits) }
    }
}

#[inline]
#[target_feature(enable = "avx2")]
#[expect(unsafe_code, reason = "an array of eight is as long as what is read")]
fn load(row: &[f32; WIDTH]) -> __m256 {
    // SAFETY: unaligned read of exactly the array.
    unsafe { _mm256_loadu_ps(row.as_ptr()) }
}

#[inline]
#[target_feature(enable = "avx2")]
#[expect(
    unsafe_code,
    reason = "an array of eight is as long as what is written"
)]
fn store(row: &mut [f32; WIDTH], value: __m256) {
    // SAFETY: unaligned write of exactly the array.
    unsafe { _mm256_storeu_ps(row.as_mut_ptr(), value) }
}

#[inline]
#[target_feature(enable = "avx2")]
fn slabs(node: &Node, ray: &LocalRay, t_max: f32, near: &mut [f32; WIDTH]) -> u32 {
    // max and min give their second operand where one is NaN: a plane that says nothing changes nothing.
    let mut enter = _mm256_setzero_ps();
    let mut leave = _mm256_set1_ps(t_max);
    for axis in 0..3 {
        let inverse = _mm256_set1_ps(ray.inverse[axis]);
        let near_planes = load(&node.bounds[ray.near_row[axis]]);
        let far_planes = load(&node.bounds[ray.far_row[axis]]);
        let to_near = _mm256_sub_ps(near_planes, _mm256_set1_ps(ray.near_origin[axis]));
        let to_far = _mm256_sub_ps(far_planes, _mm256_set1_ps(ray.far_origin[axis]));
        enter = _mm256_max_ps(_mm256_mul_ps(to_near, inverse), enter);
        leave = _mm256_min_ps(_mm256_mul_ps(to_far, inverse), leave);
    }
    store(near, enter);
    _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(enter, leave)) as u32
}

#[inline]
#[target_feature(enable = "avx2")]
fn triangles(block: &Block, ray: &LocalRay, t_max: f32, hits: &mut BlockHits) -> u32 {
    let [x, y, z] = ray.axes;
    let [origin_x, origin_y, origin_z] = [x, y, z].map(|axis| _mm256_set1_ps(ray.origin[axis]));
    let [shear_x, shear_y, shear_z] = ray.shear.map(|s| _mm256_set1_ps(s));
    let sheared = |rows: &[[f32; WIDTH]; 3]| {
        let depth = _mm256_sub_ps(load(&rows[z]), origin_z);
        let right = _mm256_sub_ps(load(&rows[x]), origin_x);
        let up = _mm256_sub_ps(load(&rows[y]), origin_y);
        [
            _mm256_sub_ps(right, _mm256_mul_ps(shear_x, depth)),
            _mm256_sub_ps(up, _mm256_mul_ps(shear_y, depth)),
            depth,
        ]
    };
    let [a, b, c] = [
        sheared(&block.corners[0]),
        sheared(&block.corners[1]),
        sheared(&block.corners[2]),
    ];
    let cross = |p: &[__m256; 3], q: &[__m256; 3]| {
        _mm256_sub_ps(_mm256_mul_ps(p[0], q[1]), _mm256_mul_ps(p[1], q[0]))
    };
    let (u, v, w) = (cross(&c, &b), cross(&a, &c), cross(&b, &a));
    let zero = _mm256_setzero_ps();
    let positive = _mm256_and_ps(
        _mm256_cmp_ps::<_CMP_GE_OQ>(u, zero),
        _mm256_and_ps(
            _mm256_cmp_ps::<_CMP_GE_OQ>(v, zero),
            _mm256_cmp_ps::<_CMP_GE_OQ>(w, zero),
        ),
    );
    let negative = _mm256_and_ps(
        _mm256_cmp_ps::<_CMP_LE_OQ>(u, zero),
        _mm256_and_ps(
            _mm256_cmp_ps::<_CMP_LE_OQ>(v, zero),
            _mm256_cmp_ps::<_CMP_LE_OQ>(w, zero),
        ),
    );
    let inside = _mm256_or_ps(positive, negative);
    if _mm256_movemask_ps(inside) == 0 {
        return 0;
    }
    let determinant = _mm256_add_ps(_mm256_add_ps(u, v), w);
    let sum = _mm256_add_ps(_mm256_mul_ps(u, a[2]), _mm256_mul_ps(v, b[2]));
    let depth = _mm256_add_ps(sum, _mm256_mul_ps(w, c[2]));
    let t = _mm256_div_ps(_mm256_mul_ps(depth, shear_z), determinant);
    let in_range = _mm256_and_ps(
        _mm256_cmp_ps::<_CMP_GT_OQ>(t, zero),
        _mm256_cmp_ps::<_CMP_LE_OQ>(t, _mm256_set1_ps(t_max)),
    );
    let solid = _mm256_cmp_ps::<_CMP_NEQ_OQ>(determinant, zero);
    let hit = _mm256_and_ps(inside, _mm256_and_ps(in_range, solid));
    let lanes = _mm256_movemask_ps(hit) as u32;
    if lanes != 0 {
        store(&mut hits.t, t);
        store(&mut hits.v, v);
        store(&mut hits.w, w);
        store(&mut hits.determinant, determinant);
    }
    lanes
}
