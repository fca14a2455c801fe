//! The scene as it is sent: plain tables that refer to each other by index.

use serde::{Deserialize, Serialize};

/// Most bytes in one [`crate::ToServer::SceneChunk`].
pub const MAX_CHUNK: usize = 1 << 20;

/// Affine map as three rows of four, row-major: `p' = m[0..3]·p + m[3]` for each row.
pub type Affine = [[f32; 4]; 3];

/// How surfaces are shaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Model {
    /// Light straight from the lights, diffuse reflection.
    Direct,
    /// [`Model::Direct`] and glossy reflection.
    Glossy,
    /// [`Model::Glossy`] and diffuse interreflection.
    Global,
}

/// What holds for the whole scene.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shading {
    /// The shading model.
    pub model: Model,
    /// Adds `diffuse · ambient` to every surface's radiance, W/(m² sr).
    pub ambient: [f32; 3],
    /// Radiance of rays that hit nothing, W/(m² sr).
    pub background: [f32; 3],
}

/// A light, in world space.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Light {
    /// Shines from a point.
    Point {
        /// Metres.
        position: [f32; 3],
        /// W/sr.
        intensity: [f32; 3],
    },
    /// Shines from a segment, isotropically from each piece of it.
    Linear {
        /// One end, metres.
        from: [f32; 3],
        /// The other end, metres.
        to: [f32; 3],
        /// W/(m sr).
        intensity: [f32; 3],
    },
    /// A planar convex polygon that emits on the side from which its vertices run anticlockwise. The camera sees it
    /// (black from behind) and it blocks light.
    Area {
        /// At least three, metres.
        vertices: Vec<[f32; 3]>,
        /// W/(m² sr).
        radiance: [f32; 3],
    },
}

/// A surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// For people.
    pub name: String,
    /// Diffuse reflectance, linear; multiplies the map where there is one.
    pub diffuse: [f32; 3],
    /// Index of a texture.
    pub diffuse_map: Option<u32>,
    /// Reflectance at normal incidence, linear.
    pub specular: [f32; 3],
    /// GGX roughness in (0, 1].
    pub roughness: f32,
}

/// An image, 8 bits a channel, sRGB-encoded, row 0 on top (v = 1), repeating.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Texture {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width · height` red, green, blue.
    pub rgb: Vec<[u8; 3]>,
}

/// Triangles in object space. Normals and texture coordinates have their own tables, so that positions stay shared.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Mesh {
    /// Object space.
    pub positions: Vec<[f32; 3]>,
    /// Three indices into `positions` a face.
    pub faces: Vec<[u32; 3]>,
    /// Unit shading normals.
    pub normals: Vec<[f32; 3]>,
    /// Three indices into `normals` a face, or empty: flat.
    pub face_normals: Vec<[u32; 3]>,
    /// Texture coordinates, v up.
    pub uvs: Vec<[f32; 2]>,
    /// Three indices into `uvs` a face, or empty.
    pub face_uvs: Vec<[u32; 3]>,
    /// A material a face, or empty: the object's for all.
    pub face_materials: Vec<u32>,
}

/// A mesh somewhere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Object {
    /// Unique in the scene.
    pub name: String,
    /// Index of its mesh.
    pub mesh: u32,
    /// Index of the material of faces that name none.
    pub material: u32,
    /// Object to world.
    pub transform: Affine,
    /// Edges sharper than this are discontinuities, degrees.
    pub crease_angle: f32,
}

/// All that a shader needs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scene {
    /// For the whole scene.
    pub shading: Shading,
    /// Lights.
    pub lights: Vec<Light>,
    /// Materials; at least one if there are objects.
    pub materials: Vec<Material>,
    /// Textures.
    pub textures: Vec<Texture>,
    /// Meshes.
    pub meshes: Vec<Mesh>,
    /// Objects.
    pub objects: Vec<Object>,
}
