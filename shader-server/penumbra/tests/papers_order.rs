//! The paper's order against brute force, with every optimisation in and out.

mod scenes;

use std::sync::Arc;

use glam::{Affine3A, Vec3, dvec3, vec3};
use penumbra::{
    BlockerMesh, Caster, Instance, Light, PaperOrder, Receivers, Sampling, Shape, brute,
};
use scenes::{Random, cuboid, scene};

fn choice(bits: u32) -> PaperOrder {
    PaperOrder {
        umbra_bits: bits & 1 != 0,
        active_planes: bits & 2 != 0,
        lazy_volumes: bits & 4 != 0,
        masks_on_demand: bits & 8 != 0,
        sort_blockers: bits & 16 != 0,
        hard_volumes: bits & 32 != 0,
    }
}

#[test]
fn masks_are_those_of_brute_force_in_every_combination() {
    for seed in 0..24 {
        let sampling = Sampling {
            samples: [32, 64, 128, 256][seed as usize % 4],
            sets: 1 + seed as u32 % 8,
            seed: 9,
        };
        let (caster, receivers) = scene(1000 + seed, sampling, 40, 120);
        let expected = brute::masks(&caster, &receivers);
        for bits in 0..64 {
            let seen = caster.cast_in_papers_order(&receivers, &choice(bits));
            assert!(seen.masks() == expected, "seed {seed}, choice {bits:06b}");
        }
    }
}

/// A board over many receivers, which goes dark, and smaller things in its shadow.
fn dark() -> (Caster, Receivers) {
    let corners = [[-1., -1.], [1., -1.], [1., 1.], [-1., 1.]];
    let corners = corners.map(|[x, z]| dvec3(x * 0.3, 4., z * 0.3)).to_vec();
    let sampling = Sampling {
        samples: 64,
        sets: 8,
        seed: 2,
    };
    let light = Light::new(Shape::Polygon(corners), sampling).expect("a square");
    let mut random = Random(4);
    let (mut positions, mut faces) = (Vec::new(), Vec::new());
    for i in 0..300 {
        let low = random.point(vec3(-1., 0.5, -1.), vec3(1., 1., 1.));
        let board = i == 299;
        let (more, others) = if board {
            cuboid(vec3(-1.2, 2., -1.2), vec3(1.2, 2.1, 1.2), 1)
        } else {
            cuboid(low, low + Vec3::splat(0.05), 1)
        };
        let first = positions.len() as u32;
        positions.extend(more);
        faces.extend(others.iter().map(|face| face.map(|i| i + first)));
    }
    let mesh = Arc::new(BlockerMesh::new(&positions, &faces));
    let to_world = Affine3A::IDENTITY;
    let caster = Caster::new(vec![Instance { mesh, to_world }], light, None);
    let mut receivers = Receivers::default();
    for i in 0..6000 {
        let origin = vec3(random.between(-3., 3.), 0., random.between(-3., 3.));
        receivers.push(origin, Vec3::Y, (u32::MAX, 0), (i % 8) as u8);
    }
    (caster, receivers)
}

#[test]
fn the_hierarchy_is_built_anew_as_receivers_go_dark_and_masks_are_taken_back() {
    let (caster, receivers) = dark();
    let expected = brute::masks(&caster, &receivers);
    let all = caster.cast_in_papers_order(&receivers, &PaperOrder::ALL);
    assert!(all.masks() == expected);
    assert!(all.builds > 1, "{}", all.builds);
    let without_d = PaperOrder {
        masks_on_demand: false,
        ..PaperOrder::ALL
    };
    let full = caster.cast_in_papers_order(&receivers, &without_d);
    assert_eq!(full.masks_bytes, receivers.len() * 8);
    assert!(
        all.masks_bytes * 2 < full.masks_bytes,
        "{}",
        all.masks_bytes
    );
    let unsorted = PaperOrder {
        sort_blockers: false,
        ..PaperOrder::ALL
    };
    let late = caster.cast_in_papers_order(&receivers, &unsorted);
    assert!(late.masks() == expected && late.masks_bytes >= all.masks_bytes);
}
