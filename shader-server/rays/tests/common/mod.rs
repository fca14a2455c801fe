//! Meshes, a random generator, and the slow obvious way to trace.
#![allow(dead_code, missing_docs, unreachable_pub)]

use std::collections::HashMap;

use glam::{Affine3A, Vec3, Vec3A, vec3};
use rays::{Hit, Ray};

pub struct Soup {
    pub positions: Vec<Vec3>,
    pub faces: Vec<[u32; 3]>,
}

/// A closed sphere of 20·4ⁿ faces around the origin.
pub fn icosphere(subdivisions: u32) -> Soup {
    let p = (1. + 5f32.sqrt()) / 2.;
    #[rustfmt::skip]
    let mut positions: Vec<Vec3> = [
        [-1., p, 0.], [1., p, 0.], [-1., -p, 0.], [1., -p, 0.], [0., -1., p], [0., 1., p],
        [0., -1., -p], [0., 1., -p], [p, 0., -1.], [p, 0., 1.], [-p, 0., -1.], [-p, 0., 1.],
    ].map(|v: [f32; 3]| Vec3::from(v).normalize()).to_vec();
    #[rustfmt::skip]
    let mut faces: Vec<[u32; 3]> = vec![
        [0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4],
        [11, 10, 2], [10, 7, 6], [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8],
        [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1],
    ];
    for _ in 0..subdivisions {
        let mut middle = HashMap::new();
        let mut split = |a: u32, b: u32| {
            *middle.entry((a.min(b), a.max(b))).or_insert_with(|| {
                positions.push((positions[a as usize] + positions[b as usize]).normalize());
                positions.len() as u32 - 1
            })
        };
        faces = faces
            .iter()
            .flat_map(|&[a, b, c]| {
                let (d, e, f) = (split(a, b), split(b, c), split(c, a));
                [[a, d, f], [b, e, d], [c, f, e], [d, e, f]]
            })
            .collect();
    }
    Soup { positions, faces }
}

impl Soup {
    pub fn map(mut self, f: impl Fn(Vec3) -> Vec3) -> Self {
        self.positions.iter_mut().for_each(|p| *p = f(*p));
        self
    }

    /// Each undirected edge once.
    pub fn edges(&self) -> Vec<[u32; 2]> {
        let mut edges: Vec<[u32; 2]> = self
            .faces
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]].map(|[p, q]| [p.min(q), p.max(q)]))
            .collect();
        edges.sort_unstable();
        edges.dedup();
        edges
    }
}

/// A small generator (SplitMix64), so that test data is the same everywhere.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u64 << 24) as f32
    }

    /// In [-1, 1)³.
    pub fn cube(&mut self) -> Vec3 {
        vec3(self.unit(), self.unit(), self.unit()) * 2. - 1.
    }

    pub fn pick(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }
}

/// Random triangles of about `size` in the unit cube, some on a coarse grid so that they touch and coincide.
pub fn soup(random: &mut Random, count: usize, size: f32) -> Soup {
    let mut positions = Vec::new();
    let mut faces = Vec::new();
    for _ in 0..count {
        let centre = random.cube();
        let first = positions.len() as u32;
        let snap = random.pick(3) == 0;
        for _ in 0..3 {
            let p = centre + random.cube() * size;
            positions.push(if snap { (p * 4.).round() / 4. } else { p });
        }
        faces.push([first, first + 1, first + 2]);
    }
    Soup { positions, faces }
}

/// Distance and weights of one triangle, or none: the same arithmetic as the crate's, one face at a time.
pub fn intersect(corners: [Vec3; 3], ray: &Ray) -> Option<(f32, [f32; 2])> {
    let size = ray.direction.abs();
    let z = if size.x > size.y && size.x > size.z {
        0
    } else if size.x <= size.y && size.y > size.z {
        1
    } else {
        2
    };
    let (x, y) = ((z + 1) % 3, (z + 2) % 3);
    let d = ray.direction;
    let sz = 1. / d[z];
    let (sx, sy) = (d[x] * sz, d[y] * sz);
    let [a, b, c] = corners.map(|p| {
        let p = p - ray.origin;
        vec3(p[x] - sx * p[z], p[y] - sy * p[z], p[z])
    });
    let u = c.x * b.y - c.y * b.x;
    let v = a.x * c.y - a.y * c.x;
    let w = b.x * a.y - b.y * a.x;
    let inside = (u >= 0. && v >= 0. && w >= 0.) || (u <= 0. && v <= 0. && w <= 0.);
    let determinant = u + v + w;
    if !inside || determinant == 0. {
        return None;
    }
    let t = (u * a.z + v * b.z + w * c.z) * sz / determinant;
    let scale = 1. / determinant;
    (t > 0.).then_some((t, [v * scale, w * scale]))
}

/// Closest hit by trying every face; `to_object` is what the world computes from the instance's transform.
pub fn brute_closest(instances: &[(&Soup, Affine3A)], ray: &Ray, t_max: f32) -> Option<Hit> {
    let mut best: Option<Hit> = None;
    for (instance, (soup, transform)) in instances.iter().enumerate() {
        let local = to_object(transform, ray);
        for (face, corners) in soup.faces.iter().enumerate() {
            let corners = corners.map(|i| soup.positions[i as usize]);
            let area = (corners[1] - corners[0])
                .as_dvec3()
                .cross((corners[2] - corners[0]).as_dvec3());
            if area.length_squared() == 0. {
                continue;
            }
            if let Some((t, barycentric)) = intersect(corners, &local)
                && t <= best.map_or(t_max, |hit| hit.t)
                && best.is_none_or(|hit| t < hit.t)
            {
                best = Some(Hit {
                    t,
                    instance: instance as u32,
                    face: face as u32,
                    barycentric,
                });
            }
        }
    }
    best
}

fn to_object(transform: &Affine3A, ray: &Ray) -> Ray {
    if *transform == Affine3A::IDENTITY {
        return *ray;
    }
    let inverse = glam::DAffine3::from_mat3_translation(
        glam::DMat3::from_cols(
            transform.matrix3.x_axis.as_dvec3(),
            transform.matrix3.y_axis.as_dvec3(),
            transform.matrix3.z_axis.as_dvec3(),
        ),
        transform.translation.as_dvec3(),
    )
    .inverse();
    let inverse = Affine3A {
        matrix3: glam::Mat3A::from_cols(
            inverse.matrix3.x_axis.as_vec3a(),
            inverse.matrix3.y_axis.as_vec3a(),
            inverse.matrix3.z_axis.as_vec3a(),
        ),
        translation: inverse.translation.as_vec3a(),
    };
    Ray {
        origin: inverse.transform_point3a(Vec3A::from(ray.origin)).into(),
        direction: inverse
            .transform_vector3a(Vec3A::from(ray.direction))
            .into(),
    }
}
