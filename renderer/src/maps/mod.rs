//! Diffuse maps of the scene, as the display puts them on.
//!
//! Interpolating textured radiance between sparse samples would blur the texture to mush. A textured sample says what its map
//! did to it (`Textured` in `PROTOCOL.md`): the display gives it the radiance that it would have under the map's mean
//! instead ([`Maps::flatten`]), which varies smoothly, interpolates that, and multiplies each pixel by what its own part of
//! the map is to the mean ([`paint::Paint`]). A scene without maps pays nothing.

mod factors;
pub mod paint;
mod projected;

use ::textures::Map;
use glam::Vec3;
use protocol::messages::Texel;
use protocol::scene::{Material, Mesh, Scene};

/// Marks a point whose surface has no map, in [`PointTexel::face`].
pub const NO_FACE: u32 = u32::MAX;

/// What a cached point remembers of its surface's map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointTexel {
    /// Face of the object's mesh, or [`NO_FACE`].
    pub face: u32,
    /// Share of the point's colour that the map's mean multiplies, a channel each, in [0, 1]: less than 1 where the surface
    /// also shines by itself.
    pub share: [f32; 3],
}

impl PointTexel {
    /// Of a surface without a map.
    pub const NONE: Self = Self {
        face: NO_FACE,
        share: [0.0; 3],
    };
}

/// A face and the part of its material's map that lies on it.
#[derive(Clone, Copy, Debug)]
struct Face {
    /// Object space.
    corners: [Vec3; 3],
    uvs: [[f32; 2]; 3],
    /// Index of the map; none if the face has no map.
    map: Option<u32>,
    /// What the material multiplies the map by.
    base: Vec3,
}

/// The maps of a scene's objects and the faces they lie on.
#[derive(Clone, Debug)]
pub struct Maps {
    maps: Vec<Map>,
    /// Of each map; no channel is less than [`DARKEST`].
    means: Vec<Vec3>,
    /// For each object, which of `meshes` it is; the first, which is empty, where none of its faces has a map.
    objects: Vec<usize>,
    meshes: Vec<Vec<Face>>,
}

/// Least mean of a map's channel that colours are divided by: where a map is darker nothing is to be seen of it.
const DARKEST: f32 = 1e-3;

impl Maps {
    /// Decodes the maps that some object wears; nothing if none does.
    pub fn new(scene: &Scene) -> Option<Self> {
        let mut meshes = vec![Vec::new()];
        let mut known: Vec<((u32, u32), usize)> = Vec::new();
        let objects: Vec<usize> = scene
            .objects
            .iter()
            .map(|object| {
                let key = (object.mesh, object.material);
                if let Some((_, place)) = known.iter().find(|(k, _)| *k == key) {
                    return *place;
                }
                let mesh = scene.meshes.get(object.mesh as usize);
                let faces = mesh.map_or(Vec::new(), |m| faces(m, object.material, scene));
                let place = if faces.is_empty() { 0 } else { meshes.len() };
                if place > 0 {
                    meshes.push(faces);
                }
                known.push((key, place));
                place
            })
            .collect();
        if meshes.len() == 1 {
            return None;
        }
        let maps: Vec<Map> = scene.textures.iter().map(Map::new).collect();
        let means = maps.iter().map(|m| m.mean().max(Vec3::splat(DARKEST)));
        Some(Self {
            means: means.collect(),
            maps,
            objects,
            meshes,
        })
    }

    fn face(&self, object: u32, face: u32) -> Option<&Face> {
        let place = *self.objects.get(object as usize)?;
        self.meshes[place].get(face as usize)
    }

    /// The radiance that a sample would have under its map's mean, and what its point is to remember. Nothing if the face
    /// has no map as far as the display knows.
    pub fn flatten(
        &self,
        object: u32,
        radiance: [f32; 3],
        texel: &Texel,
    ) -> Option<([f32; 3], PointTexel)> {
        let face = self.face(object, texel.face)?;
        let mean = self.means[face.map? as usize];
        let base = face.base;
        let mut flat = radiance;
        let mut share = [0.0; 3];
        for k in 0..3 {
            let rest = (radiance[k] - texel.reflectance[k] * texel.reflected[k]).max(0.0);
            let mapped = texel.reflected[k] * mean[k] * base[k];
            flat[k] = rest + mapped;
            share[k] = if flat[k] > 0.0 { mapped / flat[k] } else { 1.0 };
        }
        Some((
            flat,
            PointTexel {
                face: texel.face,
                share,
            },
        ))
    }
}

/// The faces of a mesh with their maps; empty if none has one.
fn faces(mesh: &Mesh, material: u32, scene: &Scene) -> Vec<Face> {
    let map_of = |face: usize| -> Option<(u32, &Material)> {
        let own = mesh.face_materials.get(face).copied().unwrap_or(material);
        let material = scene.materials.get(own as usize)?;
        let map = material.diffuse_map?;
        let here = (map as usize) < scene.textures.len() && face < mesh.face_uvs.len();
        here.then_some((map, material))
    };
    if (0..mesh.faces.len()).all(|face| map_of(face).is_none()) {
        return Vec::new();
    }
    let corner =
        |table: &[[f32; 3]], i: u32| table.get(i as usize).map_or(Vec3::ZERO, |p| Vec3::from(*p));
    mesh.faces
        .iter()
        .enumerate()
        .map(|(face, corners)| {
            let worn = map_of(face);
            let uvs = mesh.face_uvs.get(face).copied().unwrap_or_default();
            Face {
                corners: corners.map(|i| corner(&mesh.positions, i)),
                uvs: uvs.map(|i| mesh.uvs.get(i as usize).copied().unwrap_or_default()),
                map: worn.map(|(map, _)| map),
                base: worn.map_or(Vec3::ONE, |(_, material)| material.diffuse.into()),
            }
        })
        .collect()
}

#[cfg(test)]
#[path = "maps_tests.rs"]
mod tests;
