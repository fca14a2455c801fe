//! Rays aimed at edges and vertices of closed meshes must not slip through.

mod common;

use std::sync::Arc;

use common::{Random, Soup, icosphere};
use glam::{Affine3A, Quat, Vec3, vec3};
use rays::{Ray, TriangleMesh, World};

fn world(soup: &Soup, transform: Affine3A) -> World {
    let mesh = TriangleMesh::build(&soup.positions, &soup.faces);
    assert_eq!(mesh.dropped(), 0);
    World::new(vec![(Arc::new(mesh), transform)])
}

/// Targets on edges (40 an edge) and at vertices (once for each face's corner).
fn targets(soup: &Soup) -> Vec<Vec3> {
    let at = |i: u32| soup.positions[i as usize];
    let mut random = Random(7);
    let mut targets = Vec::new();
    for [a, b] in soup.edges() {
        for _ in 0..40 {
            targets.push(at(a).lerp(at(b), random.unit()));
        }
    }
    assert_eq!(targets.len(), 76_800);
    targets.extend(soup.faces.iter().flatten().map(|&i| at(i)));
    assert_eq!(targets.len(), 76_800 + 3_840);
    targets
}

fn assert_closed(name: &str, scale: f32, offset: Vec3) {
    let soup = icosphere(3).map(|p| p * scale + offset);
    let world = world(&soup, Affine3A::IDENTITY);
    let plain = world.clone().without_simd();
    let from = offset + vec3(0.1, 0.05, -0.2) * scale;
    let (mut missed, mut shadowless) = (0, 0);
    let mut rays = Vec::new();
    for target in targets(&soup) {
        for direction in [target - from, (target - from).normalize_or(Vec3::X)] {
            let ray = Ray {
                origin: from,
                direction,
            };
            let hit = world.closest(&ray, f32::INFINITY);
            assert_eq!(hit, plain.closest(&ray, f32::INFINITY), "{name}: {ray:?}");
            rays.push(ray);
            missed += usize::from(hit.is_none());
            shadowless += usize::from(world.occluder(&ray, f32::INFINITY).is_none());
        }
    }
    assert_eq!((missed, shadowless), (0, 0), "{name}: closest, any");
    let (mut hits, mut found) = (Vec::new(), Vec::new());
    for world in [&world, &plain, &world.clone().with_baseline_simd()] {
        world.closest_each(&rays, f32::INFINITY, &mut hits);
        world.occluder_each(&rays, f32::INFINITY, |_, _, _| true, &mut found);
        assert!(hits.iter().all(Option::is_some), "{name}: packets, closest");
        assert!(found.iter().all(Option::is_some), "{name}: packets, any");
    }
}

#[test]
fn unit_sphere_is_closed() {
    assert_closed("unit", 1., Vec3::ZERO);
}

#[test]
fn small_and_large_spheres_are_closed() {
    assert_closed("1e-3", 1e-3, Vec3::ZERO);
    assert_closed("1e3", 1e3, Vec3::ZERO);
}

#[test]
fn spheres_far_from_the_origin_are_closed() {
    assert_closed("moved by 1e4", 1., vec3(1e4, -1e4, 1e4));
    assert_closed("1e3, moved by 1e4", 1e3, vec3(-1e4, 1e4, 1e4));
}

#[test]
fn transformed_spheres_are_closed() {
    let soup = icosphere(3);
    let turn = Quat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.7);
    for scale in [vec3(1., 3., 0.2), vec3(-1., 1., 1.), vec3(1e-3, 1e-2, 1e-3)] {
        let transform = Affine3A::from_scale_rotation_translation(scale, turn, vec3(5., -3., 8.));
        let mesh = Arc::new(TriangleMesh::build(&soup.positions, &soup.faces));
        let elsewhere = Affine3A::from_translation(vec3(0., 100., 0.));
        let world = World::new(vec![(Arc::clone(&mesh), transform), (mesh, elsewhere)]);
        let from = transform.transform_point3(vec3(0.1, 0.05, -0.2));
        for target in targets(&soup) {
            let direction = transform.transform_point3(target) - from;
            let ray = Ray {
                origin: from,
                direction,
            };
            assert!(
                world.occluder(&ray, f32::INFINITY).is_some(),
                "{scale}: {target}"
            );
        }
    }
}

#[test]
fn axis_parallel_rays_hit_boxes_far_away() {
    let soup = Soup {
        positions: (0..8)
            .map(|i| vec3((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32) * 2. - 1.)
            .collect(),
        #[rustfmt::skip]
        faces: vec![
            [0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4],
            [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5],
        ],
    };
    let world = world(&soup, Affine3A::IDENTITY);
    for gap in [0., 1e-6, 1e-4, 0.5] {
        for distance in [10., 1e3, 1e6] {
            for tiny in [0., -0., -1e-30, -1e-42] {
                let origin = vec3(1. - gap, 0.3, distance);
                let ray = Ray {
                    origin,
                    direction: vec3(tiny, -tiny, -1.),
                };
                assert!(world.closest(&ray, f32::INFINITY).is_some(), "{ray:?}");
                let up = Ray {
                    origin: vec3(0.3, -distance, gap - 1.),
                    direction: Vec3::Y,
                };
                assert!(world.occluder(&up, f32::INFINITY).is_some(), "{up:?}");
            }
        }
    }
}

#[test]
fn broken_rays_miss() {
    let soup = icosphere(2);
    let world = world(&soup, Affine3A::IDENTITY);
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    for value in bad {
        for axis in 0..3 {
            let mut broken = Vec3::ZERO;
            broken[axis] = value;
            let rays = [
                Ray {
                    origin: broken,
                    direction: Vec3::X,
                },
                Ray {
                    origin: Vec3::ZERO,
                    direction: broken,
                },
            ];
            for ray in rays {
                assert_eq!(world.closest(&ray, f32::INFINITY), None);
                assert_eq!(world.occluder(&ray, f32::INFINITY), None);
            }
        }
    }
    let still = Ray {
        origin: Vec3::ZERO,
        direction: Vec3::ZERO,
    };
    assert_eq!(world.closest(&still, f32::INFINITY), None);
    let ray = Ray {
        origin: Vec3::ZERO,
        direction: Vec3::X,
    };
    assert_eq!(world.closest(&ray, f32::NAN), None);
}
