//! Vector code against plain code.

use fearless_simd::{Level, dispatch};
use glam::{Vec3, vec3};
use proptest::{prelude::*, test_runner::RngSeed};

use super::*;
use crate::{Bounds, Ray, node::Link};

/// Coordinates that make edges, corners and planes meet rays exactly, some of them extreme.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        8 => (-4i8..=4).prop_map(|i| f32::from(i) * 0.5),
        8 => -2f32..2.,
        1 => prop_oneof![Just(-0f32), Just(1e-30), Just(1e6), Just(-1e12)],
    ]
}

fn point() -> impl Strategy<Value = Vec3> {
    (coordinate(), coordinate(), coordinate()).prop_map(|(x, y, z)| vec3(x, y, z))
}

fn ray() -> impl Strategy<Value = Ray> {
    (point(), point())
        .prop_map(|(origin, direction)| Ray { origin, direction })
        .prop_filter("rays have a direction", Ray::is_valid)
}

fn block_and_node(corners: &[[Vec3; 3]]) -> (Block, Node) {
    let (mut block, mut node) = (Block::empty(), Node::empty());
    for (lane, corners) in corners.iter().enumerate() {
        block.set(lane, lane as u32, *corners);
        let bounds = corners.iter().fold(Bounds::EMPTY, |b, p| b.with_point(*p));
        node.set_child(lane, Link::leaf(lane), &bounds);
    }
    (block, node)
}

/// Everything that the kernel says, as bits.
fn answers<K: Kernel>(
    kernel: K,
    (block, node): &(Block, Node),
    rays: &[LocalRay; WIDTH],
    t_max: f32,
) -> Vec<u32> {
    let mut answers = Vec::new();
    for ray in rays {
        let mut enter = [0f32; WIDTH];
        answers.push(kernel.slabs(node, &ray.near, &ray.far, t_max, &mut enter));
        answers.extend(enter.map(f32::to_bits));
        let mut hits = BlockHits::default();
        let hit = kernel.triangles(block, ray, t_max, &mut hits);
        answers.push(hit);
        for lane in (0..WIDTH).filter(|lane| hit >> lane & 1 == 1) {
            let values = [
                hits.t[lane],
                hits.v[lane],
                hits.w[lane],
                hits.determinant[lane],
            ];
            answers.extend(values.map(f32::to_bits));
        }
    }
    if let Some(bundle) = Bundle::new(rays) {
        let reach = [t_max; WIDTH];
        answers.extend((0..WIDTH).map(|lane| kernel.rays_in_box(node, lane, &bundle, &reach)));
    }
    answers
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
        rays in prop::array::uniform8(ray()),
        t_max in prop_oneof![Just(f32::INFINITY), 0f32..4.],
    ) {
        let leaf = block_and_node(&corners);
        let rays = rays.map(|ray| LocalRay::new(&ray, 2.));
        let expected = answers(Plain, &leaf, &rays, t_max);
        for level in [Level::new(), Level::baseline()] {
            let found = dispatch!(level, simd => answers(Vector(simd), &leaf, &rays, t_max));
            prop_assert_eq!(&found, &expected, "{:?}", level);
        }
    }

    #[test]
    fn bundles_meet_a_box_where_each_ray_does_and_their_hull_misses_none(
        corners in prop::collection::vec([point(), point(), point()], WIDTH),
        first in ray(),
        spread in prop::array::uniform8((point(), point())),
        width in prop_oneof![Just(1e-3f32), Just(0.1), Just(1.)],
        t_max in prop_oneof![Just(f32::INFINITY), 0f32..4.],
    ) {
        let (_, node) = block_and_node(&corners);
        let rays = spread.map(|(origin, direction)| LocalRay::new(&Ray {
            origin: first.origin + origin * width,
            direction: first.direction + direction * width * first.direction.abs(),
        }, 2.));
        let Some(bundle) = Bundle::new(&rays) else { return Ok(()) };
        let mut enter = [0f32; WIDTH];
        let hull = Plain.slabs(&node, &bundle.near, &bundle.far, t_max, &mut enter);
        for (i, ray) in rays.iter().enumerate() {
            let mut own_enter = [0f32; WIDTH];
            let alone = Plain.slabs(&node, &ray.near, &ray.far, t_max, &mut own_enter);
            prop_assert_eq!(alone & !hull, 0, "the hull misses boxes that ray {} meets", i);
            for lane in 0..WIDTH {
                let together = Plain.rays_in_box(&node, lane, &bundle, &[t_max; WIDTH]);
                prop_assert_eq!(together >> i & 1, alone >> lane & 1);
                prop_assert!(alone >> lane & 1 == 0 || enter[lane] <= own_enter[lane]);
            }
        }
    }
}
