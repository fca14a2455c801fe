//! Small random scenes, plain and degenerate, the same in every run.
#![allow(dead_code, reason = "each test file uses some of it")]

use std::sync::Arc;

use glam::{Affine3A, DVec3, Quat, Vec3, dvec3, vec3};
use penumbra::{BlockerMesh, Caster, Instance, Light, Receivers, Sampling, Shape};

/// Numbers that are the same everywhere (splitmix64).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(crate) fn below(&mut self, n: u64) -> u64 {
        self.bits() % n
    }

    /// In [low, high).
    pub(crate) fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * ((self.bits() >> 40) as f32 / (1 << 24) as f32)
    }

    pub(crate) fn point(&mut self, low: Vec3, high: Vec3) -> Vec3 {
        vec3(
            self.between(low.x, high.x),
            self.between(low.y, high.y),
            self.between(low.z, high.z),
        )
    }

    /// A point whose coordinates are halves: many lie in one plane or line.
    pub(crate) fn grid_point(&mut self) -> Vec3 {
        let mut half = || self.below(9) as f32 * 0.5 - 2.;
        vec3(half(), half(), half())
    }
}

pub(crate) type Triangles = (Vec<Vec3>, Vec<[u32; 3]>);

/// An axis-parallel box of `cells` cells a side, anticlockwise from outside.
pub(crate) fn cuboid(low: Vec3, high: Vec3, cells: u32) -> Triangles {
    let (mut positions, mut faces) = (Vec::new(), Vec::new());
    for axis in 0..3 {
        for side in [0, 1] {
            let first = positions.len() as u32;
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            for j in 0..=cells {
                for i in 0..=cells {
                    let mut t = Vec3::ZERO;
                    t[axis] = side as f32;
                    t[u] = i as f32 / cells as f32;
                    t[v] = j as f32 / cells as f32;
                    positions.push(low + (high - low) * t);
                }
            }
            for j in 0..cells {
                for i in 0..cells {
                    let at = |i: u32, j: u32| first + j * (cells + 1) + i;
                    let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                    if side == 1 {
                        faces.extend([[a, b, c], [a, c, d]]);
                    } else {
                        faces.extend([[a, c, b], [a, d, c]]);
                    }
                }
            }
        }
    }
    (positions, faces)
}

/// Triangles of every kind: plain, on a coarse grid, slivers, without area, huge.
pub(crate) fn soup(random: &mut Random, count: usize) -> Triangles {
    let (mut positions, mut faces) = (Vec::new(), Vec::new());
    for i in 0..count as u32 {
        let (low, high) = (Vec3::splat(-2.), Vec3::splat(2.));
        let a = random.point(low, high);
        let corners = match random.below(8) {
            0..=2 => {
                let size = random.between(0.1, 1.5);
                [
                    a,
                    a + random.point(low, high) * size * 0.5,
                    a + random.point(low, high) * size * 0.5,
                ]
            }
            3 | 4 => [
                random.grid_point(),
                random.grid_point(),
                random.grid_point(),
            ],
            5 => {
                let along = random.point(low, high);
                let thin = random.between(0., 1e-5);
                [
                    a,
                    a + along,
                    a + along * 0.6 + random.point(low, high) * thin,
                ]
            }
            6 => [a, a, random.point(low, high)],
            _ => [
                a,
                a + random.point(low, high) * 30.,
                a + random.point(low, high) * 30.,
            ],
        };
        positions.extend(corners);
        faces.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    (positions, faces)
}

/// Lights of every kind; most shine down from above.
pub(crate) fn light(random: &mut Random, kind: u64, sampling: Sampling) -> Light {
    let height = f64::from(random.between(1., 3.));
    let turn = glam::DQuat::from_euler(
        glam::EulerRot::XYZ,
        f64::from(random.between(-0.5, 0.5)),
        f64::from(random.between(-3., 3.)),
        f64::from(random.between(-0.5, 0.5)),
    );
    let at = |p: DVec3| turn * p + dvec3(0.1, height, -0.2);
    let size = f64::from(random.between(0.2, 1.5));
    let square = [
        dvec3(-1., 0., -1.),
        dvec3(1., 0., -1.),
        dvec3(1., 0., 1.),
        dvec3(-1., 0., 1.),
    ];
    let shape = match kind % 8 {
        // Corners on the blockers' grid, exactly.
        0 => Shape::Polygon(square.map(|p| p * 0.5 + dvec3(0., 2., 0.)).to_vec()),
        1 => Shape::Polygon(square.map(|p| at(p * size)).to_vec()),
        2 => Shape::Polygon(square[..3].iter().map(|p| at(*p * size)).collect()),
        3 => Shape::Polygon(
            (0..5)
                .map(|i| {
                    let angle = f64::from(i) * std::f64::consts::TAU / 5.;
                    at(dvec3(angle.cos(), 0., angle.sin()) * size)
                })
                .collect(),
        ),
        4 => Shape::Polygon(vec![at(DVec3::ZERO); 4]),
        5 => Shape::Polygon(vec![at(DVec3::X * size), at(-DVec3::X * size)]),
        6 => Shape::Box {
            centre: at(DVec3::ZERO),
            half_axes: [
                turn * DVec3::X * size,
                turn * DVec3::Y * 0.3,
                turn * DVec3::Z * 0.5,
            ],
        },
        _ => Shape::Ball {
            centre: at(DVec3::ZERO),
            radius: size * 0.7,
        },
    };
    Light::new(shape, sampling).expect("sound shapes")
}

/// Receivers on surfaces, in the open, on the grid, behind the light, in its plane; some without a horizon.
pub(crate) fn receivers(random: &mut Random, count: usize, instances: u32) -> Receivers {
    let mut receivers = Receivers::default();
    for _ in 0..count {
        let origin = match random.below(6) {
            0 => random.grid_point(),
            1 => random.point(Vec3::splat(-4.), Vec3::splat(4.)),
            2 => vec3(random.between(-2., 2.), 2., random.between(-2., 2.)),
            _ => random.point(vec3(-2., -2.5, -2.), vec3(2., -1., 2.)),
        };
        let normal = match random.below(4) {
            0 => Vec3::ZERO,
            1 => random
                .point(Vec3::splat(-1.), Vec3::ONE)
                .normalize_or(Vec3::Y),
            _ => Vec3::Y,
        };
        let own = (
            random.below(u64::from(instances) + 1) as u32,
            random.below(20) as u32,
        );
        receivers.push(origin, normal, own, random.below(8) as u8);
    }
    receivers
}

/// Meshes: triangles of every kind, a closed box of cells, one turned inside out, a mirrored one.
pub(crate) fn instances(random: &mut Random, triangles: usize) -> Vec<Instance> {
    let place = |mesh: BlockerMesh, to_world: Affine3A| Instance {
        mesh: Arc::new(mesh),
        to_world,
    };
    let (positions, faces) = soup(random, triangles);
    let mut all = vec![place(
        BlockerMesh::new(&positions, &faces),
        Affine3A::IDENTITY,
    )];
    for kind in 0..3 {
        let low = random.point(Vec3::splat(-1.8), Vec3::splat(1.));
        let high = low + random.point(Vec3::splat(0.1), Vec3::splat(0.8));
        let (positions, mut faces) = cuboid(low, high, 1 + kind);
        let turn = Quat::from_rotation_y(random.between(0., 3.));
        let scale = match kind {
            0 => Vec3::ONE,
            1 => vec3(-1., 1., 1.),
            _ => {
                faces.iter_mut().for_each(|face| face.swap(0, 1));
                vec3(1.2, 0.7, 1.)
            }
        };
        all.push(place(
            BlockerMesh::new(&positions, &faces),
            Affine3A::from_scale_rotation_translation(scale, turn, Vec3::ZERO),
        ));
    }
    all
}

/// A scene of everything.
pub(crate) fn scene(
    seed: u64,
    sampling: Sampling,
    triangles: usize,
    count: usize,
) -> (Caster, Receivers) {
    let mut random = Random(seed);
    let instances = instances(&mut random, triangles);
    let light = light(&mut random, seed, sampling);
    let receivers = receivers(&mut random, count, instances.len() as u32);
    (Caster::new(instances, light, None), receivers)
}
