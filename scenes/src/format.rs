//! The scene file as it is written, before anything in it is looked up.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::Spanned;

use crate::generate::Generator;
use crate::textures::TextureGenerator;

/// A whole scene file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SceneFile {
    pub(crate) camera: Option<Spanned<CameraTable>>,
    #[serde(default)]
    pub(crate) shading: ShadingTable,
    #[serde(default)]
    pub(crate) light: Vec<Spanned<LightTable>>,
    #[serde(default)]
    pub(crate) material: BTreeMap<String, Spanned<MaterialTable>>,
    #[serde(default)]
    pub(crate) object: Vec<Spanned<ObjectTable>>,
    #[serde(default)]
    pub(crate) path: Vec<Spanned<PathTable>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CameraTable {
    pub(crate) eye: [f32; 3],
    pub(crate) target: [f32; 3],
    #[serde(default = "up")]
    pub(crate) up: [f32; 3],
    #[serde(default = "fov_y")]
    pub(crate) fov_y: f32,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ShadingTable {
    #[serde(default)]
    pub(crate) model: ModelName,
    #[serde(default)]
    pub(crate) ambient: Option<Spanned<[f32; 3]>>,
    #[serde(default)]
    pub(crate) background: Option<Spanned<[f32; 3]>>,
}

#[derive(Debug, Default, Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum ModelName {
    #[default]
    Direct,
    Glossy,
    Global,
}

/// All keys of all kinds: serde's tagged enums would lose the place of an error.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LightTable {
    pub(crate) name: Option<String>,
    pub(crate) kind: LightKind,
    pub(crate) position: Option<[f32; 3]>,
    pub(crate) from: Option<[f32; 3]>,
    pub(crate) to: Option<[f32; 3]>,
    pub(crate) intensity: Option<[f32; 3]>,
    pub(crate) vertices: Option<Vec<[f32; 3]>>,
    pub(crate) radiance: Option<[f32; 3]>,
    #[serde(default)]
    pub(crate) shadows: ShadowsName,
}

/// How the visibility of a light is wanted to be found.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum ShadowsName {
    #[default]
    Auto,
    Rays,
    Penumbra,
    SoftMap,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum LightKind {
    Point,
    Linear,
    Area,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MaterialTable {
    pub(crate) diffuse: Option<[f32; 3]>,
    pub(crate) diffuse_map: Option<Spanned<MapValue>>,
    pub(crate) specular: Option<[f32; 3]>,
    pub(crate) roughness: Option<f32>,
}

/// A texture: an image file, or one that is made.
#[derive(Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "expected an image file's path or { generate = { kind = ... } }"
)]
pub(crate) enum MapValue {
    File(String),
    Made(MadeMap),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MadeMap {
    pub(crate) generate: TextureGenerator,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ObjectTable {
    pub(crate) name: Spanned<String>,
    pub(crate) mesh: Option<Spanned<String>>,
    pub(crate) generate: Option<Spanned<Generator>>,
    pub(crate) material: Option<Spanned<String>>,
    #[serde(default)]
    pub(crate) translate: [f32; 3],
    #[serde(default)]
    pub(crate) rotate: [f32; 3],
    #[serde(default)]
    pub(crate) scale: Scale,
    #[serde(default)]
    pub(crate) normals: NormalsMode,
    #[serde(default = "crease_angle")]
    pub(crate) crease_angle: f32,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(untagged, expecting = "expected a number or three numbers")]
pub(crate) enum Scale {
    Uniform(f32),
    Axes([f32; 3]),
}

impl Default for Scale {
    fn default() -> Self {
        Self::Uniform(1.0)
    }
}

/// Where an object's shading normals come from.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum NormalsMode {
    #[default]
    File,
    Flat,
    Smooth,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PathTable {
    pub(crate) name: String,
    pub(crate) seconds: f32,
    #[serde(default)]
    pub(crate) open: bool,
    #[serde(default)]
    pub(crate) step: bool,
    pub(crate) object: Option<String>,
    pub(crate) light: Option<LightRef>,
    pub(crate) keys: Vec<KeyTable>,
}

/// Which light moves.
#[derive(Debug, Deserialize)]
#[serde(untagged, expecting = "expected a light's name or its number, from 0")]
pub(crate) enum LightRef {
    Number(u32),
    Name(String),
}

/// A key of the camera's path, or of an object's, or of a light's.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct KeyTable {
    pub(crate) eye: Option<[f32; 3]>,
    pub(crate) target: Option<[f32; 3]>,
    pub(crate) translate: Option<[f32; 3]>,
    pub(crate) rotate: Option<[f32; 3]>,
    pub(crate) scale: Option<Scale>,
    pub(crate) power: Option<f32>,
}

fn up() -> [f32; 3] {
    [0.0, 1.0, 0.0]
}

fn fov_y() -> f32 {
    45.0
}

fn crease_angle() -> f32 {
    85.0
}
