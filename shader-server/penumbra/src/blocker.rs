//! Blockers in light space.

use std::f64::consts::PI;

use glam::{Affine3A, DAffine3, DMat3, DVec3, Vec3};

use crate::{
    light::{Box3, Light},
    mesh::{BlockerMesh, NONE, Polygon},
};

/// Boxes around polygons are wider than these by so many ulp of the largest coordinate, since what is met in a box is found
/// with rounding.
const PAD_ULP: f32 = 16.;

/// Edge `i` runs from its higher corner to its lower.
pub(crate) const REVERSED: u32 = 1;
/// It has four corners.
pub(crate) const QUAD: u32 = 1 << 4;
/// It blocks receivers behind it from samples before it.
pub(crate) const FROM_BEHIND: u32 = 1 << 5;
/// It blocks receivers before it from samples behind it.
pub(crate) const FROM_FRONT: u32 = 1 << 6;
/// Its plane may cut the light.
pub(crate) const CUTS: u32 = 1 << 7;
/// It is transparent in places.
pub(crate) const ALPHA: u32 = 1 << 8;
/// Its corners run the other way round than the mesh's.
pub(crate) const MIRRORED: u32 = 1 << 9;

/// A polygon as a light sees it. Light space.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub(crate) struct Blocker {
    /// Anticlockwise seen from the front; the fourth of a triangle is its third.
    pub(crate) corners: [[f32; 3]; 4],
    /// Unit normal.
    pub(crate) normal: [f32; 3],
    /// Height of the origin above the plane, negated.
    pub(crate) offset: f32,
    /// With room for rounding.
    pub(crate) bounds: Box3,
    /// Number among all polygons of a caster.
    pub(crate) key: u32,
    pub(crate) flags: u32,
}

impl Blocker {
    pub(crate) fn edges(&self) -> usize {
        if self.flags & QUAD == 0 { 3 } else { 4 }
    }

    /// Lower and upper corner of an edge: the order is the same in both polygons that share it.
    #[inline(always)]
    pub(crate) fn edge(&self, i: usize) -> [usize; 2] {
        let next = if i + 1 == self.edges() { 0 } else { i + 1 };
        if self.flags >> i & REVERSED == 0 {
            [i, next]
        } else {
            [next, i]
        }
    }

    /// Height above the plane.
    #[inline(always)]
    pub(crate) fn height(&self, [x, y, z]: [f32; 3]) -> f32 {
        let [a, b, c] = self.normal;
        ((a * x + b * y) + c * z) - self.offset
    }

    /// Lowest and highest that [`height`](Self::height) is in a box, to the bit: rounding keeps the order of sums and products.
    pub(crate) fn heights(&self, bounds: &Box3) -> [f32; 2] {
        let term = |axis: usize, pick: fn(f32, f32) -> f32| {
            let n = self.normal[axis];
            pick(n * bounds.min[axis], n * bounds.max[axis])
        };
        [f32::min as fn(f32, f32) -> f32, f32::max]
            .map(|pick| ((term(0, pick) + term(1, pick)) + term(2, pick)) - self.offset)
    }
}

/// A mesh somewhere.
#[derive(Clone, Debug)]
pub(crate) struct Placed<'a> {
    pub(crate) mesh: &'a BlockerMesh,
    to_world: DAffine3,
    mirrored: bool,
}

impl<'a> Placed<'a> {
    pub(crate) fn new(mesh: &'a BlockerMesh, to_world: &Affine3A) -> Self {
        let to_world = DAffine3 {
            matrix3: DMat3::from_cols(
                to_world.matrix3.x_axis.as_dvec3(),
                to_world.matrix3.y_axis.as_dvec3(),
                to_world.matrix3.z_axis.as_dvec3(),
            ),
            translation: to_world.translation.as_dvec3(),
        };
        Self {
            mesh,
            to_world,
            mirrored: to_world.matrix3.determinant() < 0.,
        }
    }

    /// The mesh's places in light space.
    pub(crate) fn positions(&self, light: &Light) -> Vec<[f32; 3]> {
        let positions = self.mesh.positions.iter();
        positions.map(|p| self.position(*p, light)).collect()
    }

    fn position(&self, position: Vec3, light: &Light) -> [f32; 3] {
        light.to_light(self.to_world.transform_point3(position.as_dvec3()))
    }

    /// A polygon by itself, both sides.
    pub(crate) fn blocker_alone(
        &self,
        (index, polygon): (usize, &Polygon),
        light: &Light,
    ) -> Option<Blocker> {
        let mut alone = *polygon;
        let mut positions = [[0.; 3]; 4];
        for (i, corner) in polygon
            .corners
            .iter()
            .enumerate()
            .filter(|(_, c)| **c != NONE)
        {
            positions[i] = self.position(self.mesh.positions[*corner as usize], light);
            alone.corners[i] = i as u32;
        }
        self.blocker((index, &alone), &positions, light, &[])
    }

    /// Polygon `index`, unless nothing of it is left or no side of it is [`needed`](Self::needed).
    pub(crate) fn blocker(
        &self,
        (index, polygon): (usize, &Polygon),
        positions: &[[f32; 3]],
        light: &Light,
        needed: &[u32],
    ) -> Option<Blocker> {
        let quad = polygon.corners[3] != NONE;
        let n = if quad { 4 } else { 3 };
        let mut corners = [[0.; 3]; 4];
        for (i, corner) in corners.iter_mut().enumerate() {
            let i = i.min(n - 1);
            let from = if self.mirrored { n - 1 - i } else { i };
            *corner = positions[polygon.corners[from] as usize];
        }
        let [a, b, c, d] = corners.map(|p| Vec3::from(p).as_dvec3());
        let normal = ((b - a).cross(c - a) + (c - a).cross(d - a)).try_normalize()?;
        let normal = normal.as_vec3().to_array();
        let middle = corners[..n].iter().map(|p| Vec3::from(*p).as_dvec3());
        let middle = middle.sum::<DVec3>() / n as f64;
        let offset = Vec3::from(normal).as_dvec3().dot(middle) as f32;
        let mut bounds = Box3::EMPTY;
        corners.iter().for_each(|corner| bounds.add(*corner));
        let largest = bounds.max_abs().max(light.bounds.max_abs());
        let mut blocker = Blocker {
            corners,
            normal,
            offset,
            bounds: bounds.padded(PAD_ULP * f32::EPSILON * largest),
            key: index as u32,
            flags: if quad { QUAD } else { 0 },
        };
        for i in 0..n {
            if corners[(i + 1) % n] < corners[i] {
                blocker.flags |= REVERSED << i;
            }
        }
        if self.mirrored {
            blocker.flags |= MIRRORED;
        }
        if polygon.alpha_face != NONE {
            blocker.flags |= ALPHA;
        }
        let [lowest, highest] = blocker.heights(&light.bounds);
        if !(lowest.is_finite() && highest.is_finite()) {
            return None;
        }
        let needed = needed.get(polygon.shell as usize);
        let needed = needed.copied().unwrap_or(FROM_BEHIND | FROM_FRONT);
        if highest > 0. {
            blocker.flags |= needed & FROM_BEHIND;
        }
        if lowest < 0. {
            blocker.flags |= needed & FROM_FRONT;
        }
        if lowest <= 0. && highest >= 0. {
            blocker.flags |= CUTS;
        }
        (blocker.flags & (FROM_BEHIND | FROM_FRONT) != 0).then_some(blocker)
    }

    /// Of each shell of the mesh, which sides of its polygons must be tried.
    ///
    /// Half of them, if it is closed and does not come near the light: whoever leaves the light first enters the shell if the
    /// light is outside, and leaves it if the light is inside. Which it is the winding number says: it is 0 outside; inside it is
    /// 1, or -1 where the shell is turned inside out, and then its volume is negative.
    pub(crate) fn needed(&self, positions: &[[f32; 3]], light: &Light) -> Vec<u32> {
        let mut apart = self.mesh.closed.clone();
        let mut winding = vec![0f64; apart.len()];
        let mut volume = vec![0f64; apart.len()];
        let near = light.bounds.padded(1e-5 * light.bounds.max_abs());
        let [lo, hi] = [near.min, near.max].map(|p| Vec3::from(p).as_dvec3());
        let middle = lo.midpoint(hi);
        let turn = if self.mirrored { -1. } else { 1. };
        for polygon in &self.mesh.polygons {
            let shell = polygon.shell as usize;
            if !apart[shell] {
                continue;
            }
            let n = if polygon.corners[3] == NONE { 3 } else { 4 };
            let mut bounds = Box3::EMPTY;
            for corner in &polygon.corners[..n] {
                bounds.add(positions[*corner as usize]);
            }
            if bounds.overlaps(&near) {
                apart[shell] = false;
                continue;
            }
            for i in 2..n {
                let [a, b, c] = [0, i - 1, i].map(|corner| {
                    let corner = positions[polygon.corners[corner] as usize];
                    Vec3::from(corner).as_dvec3() - middle
                });
                winding[shell] += turn * solid_angle(a, b, c);
                volume[shell] += turn * a.dot(b.cross(c));
            }
        }
        (0..apart.len())
            .map(|shell| {
                let number = winding[shell] / (4. * PI);
                let lowest = if volume[shell] < 0. { -1. } else { 0. };
                if apart[shell] && (number - lowest).abs() < 0.01 {
                    FROM_BEHIND
                } else if apart[shell] && (number - lowest - 1.).abs() < 0.01 {
                    FROM_FRONT
                } else {
                    FROM_BEHIND | FROM_FRONT
                }
            })
            .collect()
    }
}

/// The solid angle of a triangle from the origin, positive if it shows its back (Van Oosterom and Strackee 1983).
fn solid_angle(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let [x, y, z] = [a.length(), b.length(), c.length()];
    let divisor = x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y;
    2. * a.dot(b.cross(c)).atan2(divisor)
}
