//! Fills a scene's tables: each mesh, material and texture once, however often it is named.

mod materials;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use protocol::scene::{Affine, Mesh, Model, Object, Scene, Shading};
use toml::Spanned;

use crate::error::{ErrorKind, SceneError};
use crate::format::{NormalsMode, ObjectTable, Scale};
use crate::generate::Made;
use crate::geometry::examine;
use crate::lights::finite;
use crate::load::line_of;
use crate::loaders::{self, MeshFile, Part, PartCopy, Setting};
use crate::report::LoadReport;
use crate::{normals, transform};

const DEFAULT_CREASE_ANGLE: f32 = 85.0;

/// A mesh file as prepared once for one choice of normals.
struct Prepared {
    parts: Vec<PreparedPart>,
    /// Scene material of each of the file's.
    materials: Vec<u32>,
    setting: Setting,
}

struct PreparedPart {
    copies: Vec<PartCopy>,
    mesh: Mesh,
    face_materials: Vec<Option<usize>>,
    /// What is odd about it; counted for each object that shows it.
    report: LoadReport,
    /// Where it is in the scene, by the material of faces that name none (`None`: it has no such faces, or no others).
    placed: BTreeMap<Option<u32>, u32>,
}

/// The scene while it is put together.
pub(crate) struct Assembler<'a> {
    file: &'a Path,
    text: &'a str,
    scene: Scene,
    report: LoadReport,
    materials: BTreeMap<String, u32>,
    default_material: Option<u32>,
    textures: BTreeMap<PathBuf, u32>,
    files: BTreeMap<(PathBuf, NormalsMode, u32), Prepared>,
    names: BTreeSet<String>,
}

/// How an object stands in the scene.
struct Placement<'a> {
    name: &'a str,
    material: Option<u32>,
    transform: Affine,
    crease_angle: f32,
}

impl<'a> Assembler<'a> {
    pub(crate) fn new(file: &'a Path, text: &'a str) -> Self {
        let shading = Shading {
            model: Model::Direct,
            ambient: [0.0; 3],
            background: [0.0; 3],
        };
        Self {
            file,
            text,
            scene: Scene {
                shading,
                lights: Vec::new(),
                materials: Vec::new(),
                textures: Vec::new(),
                meshes: Vec::new(),
                objects: Vec::new(),
            },
            report: LoadReport::default(),
            materials: BTreeMap::new(),
            default_material: None,
            textures: BTreeMap::new(),
            files: BTreeMap::new(),
            names: BTreeSet::new(),
        }
    }

    pub(crate) fn finish(self) -> (Scene, LoadReport) {
        (self.scene, self.report)
    }

    pub(crate) fn add_object(&mut self, table: &Spanned<ObjectTable>) -> Result<(), SceneError> {
        let at = table.span().start;
        let table = table.get_ref();
        let name = table.name.get_ref();
        let name_at = table.name.span().start;
        if name.is_empty() || !self.names.insert(name.clone()) {
            let problem = format!("{name:?} is empty or taken");
            return Err(self.value(
                name_at,
                "object.name",
                problem,
                "give each object its own name",
            ));
        }
        let material = match &table.material {
            None => None,
            Some(m) => Some(*self.materials.get(m.get_ref()).ok_or_else(|| {
                let problem = format!("there is no material {:?}", m.get_ref());
                let remedy = format!("add [material.{}] or name another", m.get_ref());
                self.value(m.span().start, "object.material", problem, remedy)
            })?),
        };
        if !(0.0..=180.0).contains(&table.crease_angle) {
            let problem = format!("{} is out of range", table.crease_angle);
            let remedy = "write degrees from 0 to 180";
            return Err(self.value(at, "object.crease_angle", problem, remedy));
        }
        let placement = Placement {
            name,
            material,
            transform: self.ok(at, placement_matrix(table))?,
            crease_angle: table.crease_angle,
        };
        match (&table.mesh, &table.generate) {
            (Some(mesh), None) => {
                let path = self.beside(mesh.get_ref());
                self.prepare_file(&path, table.normals, table.crease_angle)
                    .map_err(|e| {
                        match e.kind {
                            // Only the scene file knows who asked for a file that is not there.
                            ErrorKind::Unreadable(_) | ErrorKind::UnknownFormat(_) => self.value(
                                mesh.span().start,
                                "object.mesh",
                                e.to_string(),
                                "paths are relative to the scene file",
                            ),
                            _ => e,
                        }
                    })?;
                self.place_file(&path, table.normals, &placement);
                Ok(())
            }
            (None, Some(generator)) => {
                let made = generator.get_ref().make().map_err(|problem| {
                    let remedy = "scenes/README.md lists every generator's parameters";
                    self.value(generator.span().start, "object.generate", problem, remedy)
                })?;
                self.add_made(made, table.normals, &placement)
            }
            _ => Err(self.value(
                at,
                "object.mesh",
                format!("object {name:?} must have either mesh or generate"),
                "write one of them",
            )),
        }
    }

    /// A mesh file alone; what it says of cameras and lights is handed back.
    pub(crate) fn add_mesh_file(&mut self, path: &Path) -> Result<Setting, SceneError> {
        let normals = NormalsMode::File;
        self.prepare_file(path, normals, DEFAULT_CREASE_ANGLE)?;
        let stem = path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        let placement = Placement {
            name: &stem,
            material: None,
            transform: transform::affine([0.0; 3], [0.0; 3], [1.0; 3]),
            crease_angle: DEFAULT_CREASE_ANGLE,
        };
        self.names.insert(stem.clone());
        self.place_file(path, normals, &placement);
        let key = file_key(path, normals, DEFAULT_CREASE_ANGLE);
        let file = self.files.remove(&key);
        Ok(file.map(|f| f.setting).unwrap_or_default())
    }

    fn add_made(
        &mut self,
        made: Made,
        normals: NormalsMode,
        placement: &Placement<'_>,
    ) -> Result<(), SceneError> {
        let material = self.object_material(placement.material);
        let mut meshes = Vec::with_capacity(made.meshes.len());
        for mesh in made.meshes {
            let part = Part {
                mesh,
                ..Part::default()
            };
            let crease = placement.crease_angle;
            let part = prepare_part(part, normals, crease, self.file)?;
            // Equal meshes are sent once: a row of chairs is one chair.
            let known = self.scene.meshes.iter().position(|m| *m == part.mesh);
            let index = known.unwrap_or(self.scene.meshes.len());
            if known.is_none() {
                self.scene.meshes.push(part.mesh);
            }
            meshes.push((index as u32, part.report));
        }
        for copy in made.copies {
            let name = match &copy.name {
                Some(group) => self.unique_name(&format!("{}/{group}", placement.name)),
                None => placement.name.into(),
            };
            let placement = Placement {
                transform: transform::product(&placement.transform, &copy.transform),
                ..*placement
            };
            let (mesh, report) = &meshes[copy.mesh];
            self.report.add(report);
            self.push_object(name, *mesh, material, &placement);
        }
        Ok(())
    }

    fn prepare_file(
        &mut self,
        path: &Path,
        normals: NormalsMode,
        crease_angle: f32,
    ) -> Result<(), SceneError> {
        let key = file_key(path, normals, crease_angle);
        if self.files.contains_key(&key) {
            return Ok(());
        }
        let MeshFile {
            parts,
            materials,
            setting,
            report,
        } = loaders::read(path)?;
        self.report.add(&report);
        let mut prepared = Vec::with_capacity(parts.len());
        for part in parts {
            prepared.push(prepare_part(part, normals, crease_angle, path)?);
        }
        let used: BTreeSet<usize> = prepared
            .iter()
            .flat_map(|p| p.face_materials.iter().flatten().copied())
            .collect();
        let materials = materials
            .iter()
            .enumerate()
            .map(|(i, m)| {
                if used.contains(&i) {
                    self.push_file_material(m)
                } else {
                    0
                }
            })
            .collect();
        self.files.insert(
            key,
            Prepared {
                parts: prepared,
                materials,
                setting,
            },
        );
        Ok(())
    }

    fn place_file(&mut self, path: &Path, normals: NormalsMode, placement: &Placement<'_>) {
        let key = file_key(path, normals, placement.crease_angle);
        let Some(mut file) = self.files.remove(&key) else {
            return;
        };
        for part in &mut file.parts {
            let own = part.face_materials.first().copied().flatten();
            let uniform = part.face_materials.iter().all(|m| *m == own);
            let own = own.map(|m| file.materials[m]);
            let mixed = !uniform && part.face_materials.iter().any(Option::is_none);
            let material = match own {
                Some(own) if uniform => own,
                _ if part.face_materials.is_empty() || mixed => {
                    self.object_material(placement.material)
                }
                // Every face names its own; the object's is never asked for.
                _ => {
                    file.materials[part
                        .face_materials
                        .iter()
                        .flatten()
                        .copied()
                        .next()
                        .unwrap_or(0)]
                }
            };
            let variant = mixed.then_some(material);
            let mesh = match part.placed.get(&variant) {
                Some(&index) => index,
                None => {
                    // Without mixed faces this is the only time that the mesh is asked for.
                    let mut mesh = match variant {
                        Some(_) => part.mesh.clone(),
                        None => std::mem::take(&mut part.mesh),
                    };
                    if !uniform {
                        let resolve = |m: &Option<usize>| m.map_or(material, |m| file.materials[m]);
                        mesh.face_materials = part.face_materials.iter().map(resolve).collect();
                    }
                    self.scene.meshes.push(mesh);
                    let index = self.scene.meshes.len() as u32 - 1;
                    part.placed.insert(variant, index);
                    index
                }
            };
            for copy in &part.copies {
                self.report.add(&part.report);
                let name = match &copy.name {
                    Some(group) => self.unique_name(&format!("{}/{group}", placement.name)),
                    None => placement.name.into(),
                };
                let placement = Placement {
                    transform: transform::product(&placement.transform, &copy.transform),
                    ..*placement
                };
                self.push_object(name, mesh, material, &placement);
            }
        }
        self.files.insert(key, file);
    }

    fn push_object(&mut self, name: String, mesh: u32, material: u32, placement: &Placement<'_>) {
        self.scene.objects.push(Object {
            name,
            mesh,
            material,
            transform: placement.transform,
            crease_angle: placement.crease_angle,
        });
    }

    /// The name itself, or with the first number behind it that makes it new.
    fn unique_name(&mut self, name: &str) -> String {
        let mut unique = name.to_string();
        let mut n = 1;
        while !self.names.insert(unique.clone()) {
            n += 1;
            unique = format!("{name}#{n}");
        }
        unique
    }

    /// A path that the scene file names.
    fn beside(&self, name: &str) -> PathBuf {
        self.file.parent().unwrap_or(Path::new("")).join(name)
    }

    fn ok<T>(&self, offset: usize, result: Result<T, ErrorKind>) -> Result<T, SceneError> {
        result.map_err(|kind| SceneError::at(self.file, line_of(self.text, offset), kind))
    }

    fn value(
        &self,
        offset: usize,
        key: impl Into<String>,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> SceneError {
        let kind = ErrorKind::value(key, problem, remedy);
        SceneError::at(self.file, line_of(self.text, offset), kind)
    }
}

/// The crease angle matters to smooth normals alone.
fn file_key(path: &Path, normals: NormalsMode, crease_angle: f32) -> (PathBuf, NormalsMode, u32) {
    let crease = if normals == NormalsMode::Smooth {
        crease_angle.to_bits()
    } else {
        0
    };
    (path.into(), normals, crease)
}

fn prepare_part(
    mut part: Part,
    mode: NormalsMode,
    crease_angle: f32,
    file: &Path,
) -> Result<PreparedPart, SceneError> {
    if mode != NormalsMode::File {
        part.mesh.normals.clear();
        part.mesh.face_normals.clear();
    }
    let report = examine(&mut part.mesh, file)?;
    if mode == NormalsMode::Smooth {
        normals::smooth(&mut part.mesh, crease_angle);
    }
    Ok(PreparedPart {
        copies: part.copies,
        mesh: part.mesh,
        face_materials: part.face_materials,
        report,
        placed: BTreeMap::new(),
    })
}

fn placement_matrix(table: &ObjectTable) -> Result<Affine, ErrorKind> {
    let scale = match table.scale {
        Scale::Uniform(s) => [s; 3],
        Scale::Axes(s) => s,
    };
    let scale = finite("object.scale", scale)?;
    if scale.contains(&0.0) {
        let problem = "a scale of 0 leaves nothing";
        return Err(ErrorKind::value(
            "object.scale",
            problem,
            "write a number other than 0",
        ));
    }
    let translate = finite("object.translate", table.translate)?;
    Ok(transform::affine(
        translate,
        finite("object.rotate", table.rotate)?,
        scale,
    ))
}
