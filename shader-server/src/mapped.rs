//! Diffuse maps read where a ray meets a face.

use glam::{DAffine3, DVec2, DVec3, Vec2, Vec3};
use protocol::scene::Mesh;
use textures::{Footprint, Map};

/// Least cosine between a beam and a surface's normal: beyond it the footprint is longer than any map is read for.
const GRAZING: f64 = 1e-3;

/// A thin cone of light paths around a ray, where it meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beam {
    /// Unit direction of the ray, world space.
    pub direction: Vec3,
    /// Width across the ray, metres.
    pub width: f32,
}

/// A point of a face.
pub(crate) struct FacePoint<'a> {
    pub(crate) to_world: &'a DAffine3,
    pub(crate) mesh: &'a Mesh,
    pub(crate) face: usize,
    /// Corners of the face, object space.
    pub(crate) corners: [DVec3; 3],
    /// The point's barycentric coordinates.
    pub(crate) weights: [f64; 3],
}

impl FacePoint<'_> {
    /// The map's linear colour there: averaged over what a beam covers, or read at the point. Nothing where the face has no
    /// texture coordinates.
    pub(crate) fn colour(&self, map: &Map, beam: Option<&Beam>) -> Option<Vec3> {
        let uvs = self.mesh.face_uvs.get(self.face)?.map(|i| {
            let uv = self.mesh.uvs.get(i as usize).copied().unwrap_or_default();
            Vec2::from(uv).as_dvec2()
        });
        let uv: DVec2 = (0..3).map(|k| uvs[k] * self.weights[k]).sum();
        Some(match beam {
            None => map.bilinear(uv.as_vec2()),
            Some(beam) => map.filtered(uv.as_vec2(), &self.footprint(&uvs, beam)),
        })
    }

    /// What a beam covers of the face, in texture coordinates: across the plane of incidence its own width, along it as much
    /// longer as the surface leans away.
    fn footprint(&self, uvs: &[DVec2; 3], beam: &Beam) -> Footprint {
        let [a, b, c] = self.corners.map(|p| self.to_world.transform_point3(p));
        let (ab, ac) = (b - a, c - a);
        let normal = ab.cross(ac);
        let size = normal.length_squared();
        let direction = beam.direction.as_dvec3();
        let across = normal.cross(direction).try_normalize();
        let across = across.unwrap_or_else(|| ab.normalize_or_zero());
        let along = across.cross(normal).normalize_or_zero();
        let cosine = (direction.dot(normal) / size.sqrt()).abs().max(GRAZING);
        // Coordinates of a step in the plane along the face's two sides, by areas.
        let to_uv = |step: DVec3| {
            let v = step.cross(ac).dot(normal) / size;
            let w = ab.cross(step).dot(normal) / size;
            ((uvs[1] - uvs[0]) * v + (uvs[2] - uvs[0]) * w).as_vec2()
        };
        let width = f64::from(beam.width);
        Footprint {
            across: to_uv(across * width),
            along: to_uv(along * (width / cosine)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_beam_covers_its_width_and_more_the_more_the_face_leans() {
        let mesh = Mesh::default();
        let to_world = DAffine3::from_scale(DVec3::splat(2.0));
        let point = FacePoint {
            to_world: &to_world,
            mesh: &mesh,
            face: 0,
            corners: [DVec3::ZERO, DVec3::X, DVec3::NEG_Z],
            weights: [1.0, 0.0, 0.0],
        };
        // One turn of the map is two metres.
        let uvs = [DVec2::ZERO, DVec2::X, DVec2::Y];
        for lean in [0.0f32, 0.5, 1.2] {
            let beam = Beam {
                direction: Vec3::new(0.0, -lean.cos(), -lean.sin()),
                width: 0.01,
            };
            let Footprint { across, along } = point.footprint(&uvs, &beam);
            assert!((across.length() - 0.005).abs() < 1e-6);
            assert!((along.length() - 0.005 / lean.cos()).abs() < 1e-6);
            assert!(across.dot(along).abs() < 1e-9);
            if lean > 0.0 {
                assert!(across.y.abs() < 1e-9 && along.x.abs() < 1e-9);
            }
        }
    }
}
