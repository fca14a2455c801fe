//! glTF's metallic-roughness materials as diffuse, specular and roughness.

use std::path::{Path, PathBuf};

use gltf::Document;
use gltf::image::Source;
use gltf::material::Material;
use gltf::texture::{Info, Texture};

use super::buffers::{Buffers, beside, read_uri};
use crate::error::SceneError;
use crate::loaders::{FileMaterial, Picture};
use crate::report::LoadReport;
use crate::textures;

/// Reflectance at normal incidence of what is no metal, where no index of refraction is given (glTF 2.0, appendix B.3.2).
const DIELECTRIC: f32 = 0.04;

/// A material, and how the texture coordinates of what wears it are made.
pub(super) struct Converted {
    pub(super) material: FileMaterial,
    pub(super) uv: UvChoice,
    /// Between 0 and 1.
    pub(super) metallic: f32,
}

/// Which texture coordinates a picture is laid by, and how (`KHR_texture_transform`).
#[derive(Debug, Clone, Copy)]
pub(super) struct UvChoice {
    /// Number of the set, or none: no picture.
    pub(super) set: Option<u32>,
    offset: [f32; 2],
    rotation: f32,
    scale: [f32; 2],
}

impl UvChoice {
    pub(super) const NONE: Self = Self {
        set: None,
        offset: [0.0; 2],
        rotation: 0.0,
        scale: [1.0; 2],
    };

    fn new(info: &Info<'_>) -> Self {
        let set = info.tex_coord();
        match info.texture_transform() {
            None => Self {
                set: Some(set),
                ..Self::NONE
            },
            Some(t) => Self {
                set: Some(t.tex_coord().unwrap_or(set)),
                offset: t.offset(),
                rotation: t.rotation(),
                scale: t.scale(),
            },
        }
    }

    /// From glTF's coordinates, v down, to this project's, v up.
    pub(super) fn apply(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        let (u, v) = (u * self.scale[0], v * self.scale[1]);
        // Without a turn the numbers stay what they are, to the bit.
        let (u, v) = if self.rotation == 0.0 {
            (u, v)
        } else {
            let (sin, cos) = self.rotation.sin_cos();
            (cos * u + sin * v, cos * v - sin * u)
        };
        [u + self.offset[0], 1.0 - (v + self.offset[1])]
    }
}

/// Turns a material into this project's: diffuse = base · (1 - metallic); specular = dielectric · (1 - metallic) +
/// base · metallic; GGX alpha = roughness² (glTF 2.0, appendix B). Where a texture gives metallic and roughness, its means
/// stand for it.
pub(super) fn convert(
    m: &Material<'_>,
    document: &Document,
    buffers: &Buffers,
    path: &Path,
    report: &mut LoadReport,
) -> Result<Converted, SceneError> {
    let name = match (m.name(), m.index()) {
        (Some(name), _) => name.to_string(),
        (None, index) => format!("material {}", index.unwrap_or(0)),
    };
    let pbr = m.pbr_metallic_roughness();
    let mut note = |what: String| {
        report
            .notes
            .push(format!("{}: material {name:?} {what}", path.display()));
    };
    let picture = |texture: &Texture<'_>| picture(texture, document, buffers, path);
    let mut mean = |texture: &Texture<'_>| -> Result<[f32; 3], SceneError> {
        let Some(picture) = picture(texture)? else {
            return Ok([1.0; 3]);
        };
        Ok(textures::open(&picture).map_or_else(
            |e| {
                note(format!("has a texture that is not used: {e}"));
                [1.0; 3]
            },
            |t| textures::mean(&t),
        ))
    };
    let [r, g, b, _] = pbr.base_color_factor();
    let factor = [r, g, b].map(unit);
    let (mut metallic, mut roughness) = (unit(pbr.metallic_factor()), unit(pbr.roughness_factor()));
    if let Some(info) = pbr.metallic_roughness_texture() {
        let mean = mean(&info.texture())?;
        roughness *= mean[1];
        metallic *= mean[2];
    }
    let map = pbr.base_color_texture();
    let (mut base, mut diffuse_map, mut uv) = (factor, None, UvChoice::NONE);
    if let Some(info) = &map {
        diffuse_map = picture(&info.texture())?;
        uv = UvChoice::new(info);
        if metallic > 0.0
            && let Some(picture) = &diffuse_map
            && let Ok(texture) = textures::open(picture)
        {
            let mean = textures::mean_color(&texture);
            base = std::array::from_fn(|i| factor[i] * mean[i]);
        }
    }
    if m.emissive_factor().iter().any(|e| *e > 0.0) {
        note("glows; it is a plain surface here, so add a [[light]]".into());
    }
    if m.alpha_mode() != gltf::material::AlphaMode::Opaque {
        note("is transparent in places; it is opaque here".into());
    }
    let dielectric = dielectric(m);
    Ok(Converted {
        material: FileMaterial {
            name,
            diffuse: factor.map(|c| c * (1.0 - metallic)),
            diffuse_map,
            specular: std::array::from_fn(|i| {
                unit(dielectric[i] * (1.0 - metallic) + base[i] * metallic)
            }),
            roughness: (roughness * roughness).clamp(0.01, 1.0),
        },
        uv,
        metallic,
    })
}

/// `KHR_materials_ior` and `KHR_materials_specular`, where they are given.
fn dielectric(m: &Material<'_>) -> [f32; 3] {
    let normal = m.ior().map_or(DIELECTRIC, |n| {
        let r = (n - 1.0) / (n + 1.0);
        unit(r * r)
    });
    match m.specular() {
        None => [normal; 3],
        Some(s) => s
            .specular_color_factor()
            .map(|c| unit(normal * c * s.specular_factor())),
    }
}

fn unit(x: f32) -> f32 {
    // A NaN becomes 0, which clamping would keep.
    if x > 0.0 { x.min(1.0) } else { 0.0 }
}

/// Where a texture's picture is; `None` where the file names none.
fn picture(
    texture: &Texture<'_>,
    document: &Document,
    buffers: &Buffers,
    path: &Path,
) -> Result<Option<Picture>, SceneError> {
    let image = texture.source();
    let json = &document.as_json().images[image.index()];
    // The crate's `source` panics where neither is given.
    if json.uri.is_none() && (json.buffer_view.is_none() || json.mime_type.is_none()) {
        return Ok(None);
    }
    let held = |bytes: &[u8]| Picture::Held {
        name: PathBuf::from(format!("{}#image {}", path.display(), image.index())),
        bytes: bytes.into(),
    };
    Ok(Some(match image.source() {
        Source::Uri { uri, .. } if uri.starts_with("data:") => held(&read_uri(uri, path)?),
        Source::Uri { uri, .. } => Picture::File(beside(uri, path)?),
        Source::View { view, .. } => held(
            buffers
                .view(&view)
                .map_err(|e| super::malformed(path, format!("image {}: {e}", image.index())))?,
        ),
    }))
}
