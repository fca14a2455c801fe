//! The material and texture tables.

use protocol::scene::{Material, Texture};
use toml::Spanned;

use super::Assembler;
use crate::error::{ErrorKind, SceneError};
use crate::format::{MapValue, MaterialTable};
use crate::loaders::{FileMaterial, Picture};
use crate::textures;

const DEFAULT_DIFFUSE: [f32; 3] = [0.7; 3];

impl Assembler<'_> {
    /// Adds a `[material.NAME]`.
    pub(crate) fn add_material(
        &mut self,
        name: &str,
        table: &Spanned<MaterialTable>,
    ) -> Result<(), SceneError> {
        let at = table.span().start;
        let table = table.get_ref();
        let key = |k: &str| format!("material.{name}.{k}");
        let given = table.diffuse.unwrap_or(match table.diffuse_map {
            Some(_) => [1.0; 3],
            None => DEFAULT_DIFFUSE,
        });
        let diffuse = self.ok(at, reflectance(&key("diffuse"), given))?;
        let specular = self.ok(
            at,
            reflectance(&key("specular"), table.specular.unwrap_or_default()),
        )?;
        let roughness = table.roughness.unwrap_or(1.0);
        if !(roughness > 0.0 && roughness <= 1.0) {
            let problem = format!("{roughness} is out of range");
            let remedy = "write a number greater than 0, at most 1";
            return Err(self.value(at, key("roughness"), problem, remedy));
        }
        let diffuse_map = match &table.diffuse_map {
            None => None,
            Some(map) => Some(match map.get_ref() {
                MapValue::Made(made) => self.push_texture(textures::generate(&made.generate)),
                MapValue::File(name) => {
                    let path = self.beside(name);
                    self.picture(&Picture::File(path)).map_err(|e| {
                        let problem = e.to_string();
                        let remedy = "name a PNG or JPEG file, by its path from the scene file";
                        self.value(map.span().start, key("diffuse_map"), problem, remedy)
                    })?
                }
            }),
        };
        self.scene.materials.push(Material {
            name: name.into(),
            diffuse,
            diffuse_map,
            specular,
            roughness,
        });
        let index = self.scene.materials.len() as u32 - 1;
        self.materials.insert(name.into(), index);
        Ok(())
    }

    pub(super) fn object_material(&mut self, given: Option<u32>) -> u32 {
        if let Some(index) = given.or(self.default_material) {
            return index;
        }
        self.scene.materials.push(Material {
            name: "default".into(),
            diffuse: DEFAULT_DIFFUSE,
            diffuse_map: None,
            specular: [0.0; 3],
            roughness: 1.0,
        });
        let index = self.scene.materials.len() as u32 - 1;
        self.default_material = Some(index);
        index
    }

    /// A material of a mesh file; a picture that it names and that cannot be read is left out with a note.
    pub(super) fn push_file_material(&mut self, m: &FileMaterial) -> u32 {
        let diffuse_map = m.diffuse_map.as_ref().and_then(|picture| {
            self.picture(picture)
                .inspect_err(|e| {
                    self.report
                        .notes
                        .push(format!("material {:?} has no texture: {e}", m.name));
                })
                .ok()
        });
        self.scene.materials.push(Material {
            name: m.name.clone(),
            diffuse: m.diffuse,
            diffuse_map,
            specular: m.specular,
            roughness: m.roughness,
        });
        self.scene.materials.len() as u32 - 1
    }

    /// The texture of a picture, which is read once.
    fn picture(&mut self, picture: &Picture) -> Result<u32, SceneError> {
        let (Picture::File(name) | Picture::Held { name, .. }) = picture;
        if let Some(&index) = self.textures.get(name) {
            return Ok(index);
        }
        let texture = textures::open(picture)?;
        let index = self.push_texture(texture);
        self.textures.insert(name.clone(), index);
        Ok(index)
    }

    fn push_texture(&mut self, texture: Texture) -> u32 {
        self.scene.textures.push(texture);
        self.scene.textures.len() as u32 - 1
    }
}

/// A colour of at most 1.
fn reflectance(key: &str, v: [f32; 3]) -> Result<[f32; 3], ErrorKind> {
    if v.iter().all(|x| (0.0..=1.0).contains(x)) {
        Ok(v)
    } else {
        let problem = format!("{v:?} is no reflectance");
        Err(ErrorKind::value(
            key,
            problem,
            "write three numbers from 0 to 1",
        ))
    }
}
