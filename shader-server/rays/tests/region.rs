//! A region said to be empty lets every ray through.

mod common;

use std::sync::Arc;

use common::{Random, soup};
use glam::{Affine3A, Quat, Vec3, vec3};
use rays::{Ray, Region, TriangleMesh, World};

/// The pyramid from `apex` over a parallelogram, cut off at it.
fn pyramid(apex: Vec3, corner: Vec3, sides: [Vec3; 2]) -> Region {
    let [a, b] = sides;
    let corners = [corner, corner + a, corner + a + b, corner + b].map(|c| c - apex);
    let middle = corners.iter().sum::<Vec3>();
    let mut planes = [(Vec3::ZERO, 0.); 6];
    for i in 0..4 {
        let normal = corners[i].cross(corners[(i + 1) % 4]).normalize_or_zero();
        planes[i] = (
            if normal.dot(middle) < 0. {
                -normal
            } else {
                normal
            },
            -1e-5,
        );
    }
    let normal = a.cross(b).normalize_or_zero();
    let normal = if normal.dot(middle) > 0. {
        -normal
    } else {
        normal
    };
    planes[4] = (normal, normal.dot(corners[0]));
    Region::new(apex, planes)
}

#[test]
fn empty_regions_let_every_ray_through() {
    let mut random = Random(5);
    let (mut empty, mut full) = (0, 0);
    for round in 0..400 {
        let soup = soup(&mut random, 1 + round % 40, 0.15);
        let mesh = Arc::new(TriangleMesh::build(&soup.positions, &soup.faces));
        let turned = Affine3A::from_scale_rotation_translation(
            vec3(1., -0.5, 0.7),
            Quat::from_rotation_x(0.1 * round as f32),
            random.cube(),
        );
        let mut instances = vec![(Arc::clone(&mesh), Affine3A::IDENTITY)];
        if round % 3 != 0 {
            instances.push((mesh, turned));
        }
        let world = World::new(instances);
        let plain = world.clone().without_simd();
        for _ in 0..50 {
            let (apex, corner) = (random.cube() * 1.5, random.cube() * 1.5);
            let sides = [random.cube() * 0.3, random.cube() * 0.3];
            let region = pyramid(apex, corner, sides);
            let touched = world.may_touch(&region, |_, _| true);
            assert_eq!(touched, plain.may_touch(&region, |_, _| true));
            assert!(!world.may_touch(&region, |_, _| false));
            let mut blocked = false;
            for _ in 0..40 {
                let target = corner + sides[0] * random.unit() + sides[1] * random.unit();
                let ray = Ray {
                    origin: apex,
                    direction: target - apex,
                };
                blocked |= world.occluder(&ray, 1.).is_some();
            }
            assert!(
                touched || !blocked,
                "round {round}: a ray is blocked in an empty region"
            );
            empty += usize::from(!touched);
            full += usize::from(blocked);
        }
    }
    assert!(empty > 2000 && full > 2000, "{empty} empty, {full} blocked");
}

#[test]
fn broken_regions_are_never_empty() {
    let mesh = Arc::new(TriangleMesh::build(
        &[Vec3::X, Vec3::Y, Vec3::Z],
        &[[0, 1, 2]],
    ));
    let world = World::new(vec![(mesh, Affine3A::IDENTITY)]);
    let region = Region::new(Vec3::NAN, [(Vec3::X, 0.); 6]);
    assert!(world.may_touch(&region, |_, _| true));
}
