//! The two inner loops: a ray against eight boxes and against eight triangles.
//!
//! No version uses fused multiply-add, so every instruction set gives the same bits, and the edge functions of two
//! neighbours are exactly opposite in sign: no ray passes between them. Comparisons are phrased so that NaN misses.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod plain;

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;
pub(crate) use plain::Plain;

use crate::{
    node::{LocalRay, Node, WIDTH},
    triangle::{Block, BlockHits},
};

/// One way to compute both.
pub(crate) trait Kernel {
    /// Lanes of `node` that the ray enters no later than `t_max`; puts into `near` at what distances.
    fn slabs(node: &Node, ray: &LocalRay, t_max: f32, near: &mut [f32; WIDTH]) -> u32;

    /// Lanes of `block` with a triangle that the ray hits at a distance in (0, `t_max`], edges and corners included.
    /// `hits` is filled in if there is one.
    ///
    /// Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection", without its fall-back to doubles: an edge
    /// function that is exactly zero counts for both sides.
    fn triangles(block: &Block, ray: &LocalRay, t_max: f32, hits: &mut BlockHits) -> u32;
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use glam::{Vec3, vec3};
    use proptest::{prelude::*, test_runner::RngSeed};

    use super::*;
    use crate::{Bounds, Ray};

    /// Coordinates that make edges, corners and planes meet rays exactly, some of them broken.
    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![
            8 => (-4i8..=4).prop_map(|i| f32::from(i) * 0.5),
            8 => -2f32..2.,
            1 => prop_oneof![Just(-0f32), Just(1e-30), Just(1e6), Just(f32::NAN), Just(f32::INFINITY)],
        ]
    }

    fn point() -> impl Strategy<Value = Vec3> {
        (coordinate(), coordinate(), coordinate()).prop_map(|(x, y, z)| vec3(x, y, z))
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 3000,
            rng_seed: RngSeed::Fixed(23),
            failure_persistence: None,
            ..ProptestConfig::default()
        })]

        #[test]
        fn vector_and_plain_code_agree_to_the_bit(
            corners in prop::collection::vec([point(), point(), point()], 0..=WIDTH),
            origin in point(),
            direction in point(),
            t_max in prop_oneof![Just(f32::INFINITY), 0f32..4.],
        ) {
            if Avx2::detect().is_none() {
                return Ok(());
            }
            let mut block = Block::empty();
            let mut node = Node::empty();
            for (lane, corners) in corners.iter().enumerate() {
                block.set(lane, lane as u32, *corners);
                let bounds = corners.iter().fold(Bounds::EMPTY, |b, p| b.with_point(*p));
                node.set_bounds(lane, &bounds);
            }
            let ray = LocalRay::new(&Ray { origin, direction }, 2.);
            let (mut near_a, mut near_b) = ([0f32; WIDTH], [0f32; WIDTH]);
            let a = Plain::slabs(&node, &ray, t_max, &mut near_a);
            let b = Avx2::slabs(&node, &ray, t_max, &mut near_b);
            prop_assert_eq!(a, b);
            prop_assert_eq!(near_a.map(f32::to_bits), near_b.map(f32::to_bits));

            let (mut hits_a, mut hits_b) = (BlockHits::default(), BlockHits::default());
            let a = Plain::triangles(&block, &ray, t_max, &mut hits_a);
            let b = Avx2::triangles(&block, &ray, t_max, &mut hits_b);
            prop_assert_eq!(a, b);
            for lane in (0..WIDTH).filter(|lane| a >> lane & 1 == 1) {
                let bits = |h: &BlockHits| {
                    [h.t[lane], h.v[lane], h.w[lane], h.determinant[lane]].map(f32::to_bits)
                };
                prop_assert_eq!(bits(&hits_a), bits(&hits_b));
            }
        }
    }
}
