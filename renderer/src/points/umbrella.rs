//! Which points an object that moves may take the light from, or give it back to.

use fearless_simd::{Level, dispatch, prelude::*};
use fearless_simd_macros::simd;
use glam::{DAffine3, DVec3, Vec3};

use super::PointCache;

/// Share of a box by which it is taken to be larger, for rounding.
const SLACK: f64 = 1e-4;

/// The points from which a box stands before some part of a light: a point is in it if the convex hull of the point and the
/// light's bounds meets the box. Both bounds are taken along the axes of the box, so that this says yes too often, never
/// too rarely.
///
/// At a share `t` of the way the hull is a box about `p + t (c - p)` of half size `t e`, where `c` and `e` are those of the
/// light; it meets the other where, along each axis, its middle is no farther off than both half sizes together. That is
/// linear in `t`: six bounds on it, which leave something of [0, 1] or nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Umbrella {
    /// Rows of the map from world space to the axes of the box, relative to its middle.
    rows: [[f32; 4]; 3],
    half: [f32; 3],
    light: [f32; 3],
    light_half: [f32; 3],
}

impl Umbrella {
    /// `bounds` are lowest and highest corner in the space that `to_world` maps from; `light` are world points, at least
    /// one. Nothing if the map has no inverse: such a box takes no light.
    pub fn new(bounds: [Vec3; 2], to_world: &DAffine3, light: &[Vec3]) -> Option<Self> {
        let [low, high] = bounds.map(|p| p.as_dvec3());
        let inverse = to_world.inverse();
        let regular = inverse.is_finite() && low.cmple(high).all() && !light.is_empty();
        if !regular {
            return None;
        }
        let middle = 0.5 * (low + high);
        let size = (high - low).max_element();
        let half = 0.5 * (high - low) + DVec3::splat(SLACK * size + f64::from(f32::MIN_POSITIVE));
        let local = DAffine3::from_translation(-middle) * inverse;
        let (mut from, mut to) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in light {
            let p = local.transform_point3(p.as_dvec3());
            (from, to) = (from.min(p), to.max(p));
        }
        let m = local.matrix3;
        let row = |k: usize| {
            let row = [m.x_axis[k], m.y_axis[k], m.z_axis[k], local.translation[k]];
            row.map(|v| v as f32)
        };
        Some(Self {
            rows: [row(0), row(1), row(2)],
            half: half.as_vec3().to_array(),
            light: (0.5 * (from + to)).as_vec3().to_array(),
            light_half: (0.5 * (to - from) * (1.0 + SLACK)).as_vec3().to_array(),
        })
    }

    /// Whether the box stands before the light as seen from a world point.
    #[inline(always)]
    pub fn covers(&self, p: [f32; 3]) -> bool {
        let (mut first, mut last, mut possible) = (0.0f32, 1.0f32, true);
        for k in 0..3 {
            let row = &self.rows[k];
            let at = row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3];
            let along = self.light[k] - at;
            for (slope, room) in [
                (along - self.light_half[k], self.half[k] - at),
                (-along - self.light_half[k], self.half[k] + at),
            ] {
                let bound = room / slope;
                last = if slope > 0.0 { last.min(bound) } else { last };
                first = if slope < 0.0 { first.max(bound) } else { first };
                possible &= slope != 0.0 || room >= 0.0;
            }
        }
        possible & (first <= last)
    }

    /// Sets the mark of every slot of the cache whose place this covers, used or not; marks of others stay. Results do not
    /// depend on `level`.
    pub fn mark(&self, level: Level, cache: &PointCache, marks: &mut [u8]) {
        dispatch!(level, simd => mark_all(simd, self, &cache.position, marks));
    }
}

#[simd]
fn mark_all<S: Simd>(_simd: S, umbrella: &Umbrella, position: &[Vec<f32>; 3], marks: &mut [u8]) {
    let [x, y, z] = position;
    for (((mark, &x), &y), &z) in marks.iter_mut().zip(x).zip(y).zip(z) {
        *mark |= u8::from(umbrella.covers([x, y, z]));
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DQuat};
    use protocol::messages::Sample;

    use super::*;
    use crate::sampling::place::hash_unit;

    fn random(salt: u64, id: u64) -> Vec3 {
        Vec3::from_array([1, 2, 3].map(|k| 2.0 * hash_unit(salt * 8 + k, id) - 1.0))
    }

    fn placed(id: u64) -> (DAffine3, [Vec3; 2]) {
        let turn = DQuat::from_axis_angle(random(1, id).as_dvec3().normalize(), 7.0 * id as f64);
        let size = random(2, id).abs() + 0.05;
        let shear = DMat3::from_cols(DVec3::X, DVec3::new(0.3, 1.2, 0.0), DVec3::Z);
        let at = random(3, id).as_dvec3();
        (
            DAffine3::from_mat3_translation(DMat3::from_quat(turn) * shear, at),
            [-size, size * 0.5],
        )
    }

    /// Whether some ray from the point to the light's corners or inside meets the box, by marching.
    fn meets(p: Vec3, light: &[Vec3], to_world: &DAffine3, [low, high]: [Vec3; 2]) -> bool {
        let inverse = to_world.inverse();
        let middle = light.iter().sum::<Vec3>() / light.len() as f32;
        light.iter().chain([&middle]).any(|&l| {
            (0..=400).any(|i| {
                let at = p.lerp(l, i as f32 / 400.0).as_dvec3();
                let q = inverse.transform_point3(at).as_vec3();
                q.cmpge(low).all() && q.cmple(high).all()
            })
        })
    }

    #[test]
    fn whatever_a_ray_finds_is_covered_and_little_else() {
        let (mut found, mut covered) = (0, 0);
        for id in 0..4000 {
            let (to_world, bounds) = placed(id);
            let centre = 4.0 * random(4, id);
            let light: Vec<Vec3> = (0..4).map(|k| centre + 0.3 * random(5 + k, id)).collect();
            let light = &light[..if id % 3 == 0 { 1 } else { 4 }];
            let umbrella = Umbrella::new(bounds, &to_world, light).unwrap();
            let p = 4.0 * random(10, id);
            let by_rays = meets(p, light, &to_world, bounds);
            let says = umbrella.covers(p.into());
            assert!(says || !by_rays, "{id}");
            found += u32::from(by_rays);
            covered += u32::from(says);
        }
        assert!(found > 150 && covered < found * 3 / 2, "{found} {covered}");
    }

    #[test]
    fn degenerate_boxes_lights_and_points_are_safe() {
        let flat = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
        let cube = [-Vec3::ONE, Vec3::ONE];
        assert_eq!(Umbrella::new(cube, &flat, &[Vec3::Y]), None);
        assert_eq!(
            Umbrella::new([Vec3::ONE, -Vec3::ONE], &DAffine3::IDENTITY, &[Vec3::Y]),
            None
        );
        let light = [Vec3::new(0.0, 5.0, 0.0)];
        let quad = [Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 0.0, 1.0)];
        let umbrella = Umbrella::new(quad, &DAffine3::IDENTITY, &light).unwrap();
        assert!(umbrella.covers([0.0, -1.0, 0.0]) && umbrella.covers([0.0, 0.0, 0.0]));
        assert!(!umbrella.covers([0.0, 1.0, 0.0]) && !umbrella.covers([3.0, -1.0, 0.0]));
        assert!(umbrella.covers([1.2, -1.0, 0.0]) && !umbrella.covers([1.21, -1.0, 0.0]));
        // The light in the box, the point on the light, nothing at all.
        assert!(!umbrella.covers([0.0, 5.0, 0.0]));
        let _ = umbrella.covers([f32::NAN; 3]);
        let inside = Umbrella::new(cube, &DAffine3::IDENTITY, &[Vec3::ZERO]).unwrap();
        assert!(inside.covers([9.0, 9.0, 9.0]) && inside.covers([0.0; 3]));
    }

    #[test]
    fn every_level_marks_the_same_points() {
        let mut cache = PointCache::new(999);
        for id in 0..900 {
            let sample = Sample {
                id,
                position: (3.0 * random(1, id)).into(),
                object: 0,
                radiance: [0.0; 3],
                flags: 0,
            };
            cache.insert(&sample, None);
        }
        let (to_world, bounds) = placed(3);
        let light = [Vec3::new(0.5, 4.0, 0.2), Vec3::new(0.0, 4.0, 0.0)];
        let umbrella = Umbrella::new(bounds, &to_world, &light).unwrap();
        let mut all = [Level::new(), Level::baseline()].map(|level| {
            let mut marks = vec![0; cache.capacity()];
            umbrella.mark(level, &cache, &mut marks);
            marks
        });
        let plain: Vec<u8> = (0..cache.capacity() as u32)
            .map(|slot| u8::from(umbrella.covers(cache.point(slot).into())))
            .collect();
        assert!(plain[..900].contains(&1) && plain[..900].contains(&0));
        assert!(all.iter_mut().all(|marks| *marks == plain));
    }
}
