//! Wavefront OBJ, read by tobj.

use std::cell::RefCell;
use std::collections::HashMap;
use std::io::{self, BufRead, Read};
use std::path::Path;

use super::obj_text::{CleanObj, clean};
use super::{FileMaterial, MeshFile, Part, PartCopy, fill_in, mtl, read_bytes};
use crate::error::{ErrorKind, SceneError};
use crate::report::LoadReport;

/// Positions stay shared across normal and texture seams; polygons are cut into fans.
const OPTIONS: tobj::LoadOptions = tobj::LoadOptions {
    single_index: false,
    triangulate: true,
    ignore_points: true,
    ignore_lines: true,
};

/// Reads an OBJ file and the MTL files that it names.
pub(crate) fn read(path: &Path) -> Result<MeshFile, SceneError> {
    let mut report = LoadReport::default();
    let clean = clean(&read_bytes(path)?, path, &mut report)?;
    let library = RefCell::new(Library::default());
    let mut reader = CountingReader {
        rest: clean.text.as_bytes(),
        line: 0,
    };
    let loaded = tobj::load_obj_buf(&mut reader, &OPTIONS, |name| {
        library.borrow_mut().load(path, name)
    });
    let library = library.into_inner();
    if let Some(error) = library.error {
        return Err(error);
    }
    let (models, materials) = loaded.map_err(|e| {
        SceneError::at(
            path,
            reader.line.max(1),
            ErrorKind::Malformed(format!("tobj says: {e}")),
        )
    })?;
    let materials = materials.unwrap_or_default();
    report.notes.extend(library.notes);
    for name in &clean.materials {
        if !materials.iter().any(|m| &m.name == name) {
            report.notes.push(format!(
                "{}: material {name:?} is not defined; its faces get the object's",
                path.display()
            ));
        }
    }
    let parts = parts(models, &clean, &mut report);
    let directory = path.parent().unwrap_or(Path::new(""));
    let materials: Vec<FileMaterial> = materials
        .into_iter()
        .map(|m| mtl::convert(m, directory, path, &mut report))
        .collect();
    Ok(MeshFile {
        parts,
        materials,
        report,
        ..MeshFile::default()
    })
}

/// The MTL files met while tobj reads; its callback can only say that one failed, not how.
#[derive(Default)]
struct Library {
    error: Option<SceneError>,
    notes: Vec<String>,
}

impl Library {
    fn load(&mut self, obj: &Path, name: &Path) -> tobj::MTLLoadResult {
        let path = obj.parent().unwrap_or(Path::new("")).join(name);
        match mtl::clean(&path) {
            Ok(Some(text)) => tobj::load_mtl_buf(&mut text.as_bytes()),
            Ok(None) => {
                self.notes.push(format!(
                    "{}: cannot be read; faces get the object's material",
                    path.display()
                ));
                Err(tobj::LoadError::OpenFileFailed)
            }
            Err(error) => {
                self.error.get_or_insert(error);
                Err(tobj::LoadError::MaterialParseError)
            }
        }
    }
}

/// Groups of one name, wherever their faces are, make one part.
fn parts(models: Vec<tobj::Model>, clean: &CleanObj, report: &mut LoadReport) -> Vec<Part> {
    let mut names: HashMap<String, usize> = HashMap::new();
    let mut merged: Vec<Merge> = Vec::new();
    let mut faces = clean.faces.iter();
    for model in models.into_iter().filter(|m| !m.mesh.indices.is_empty()) {
        let index = *names.entry(model.name.clone()).or_insert_with(|| {
            merged.push(Merge::new(&model.name));
            merged.len() - 1
        });
        merged[index].append(&model.mesh, &mut faces);
    }
    merged.into_iter().map(|m| m.finish(report)).collect()
}

/// One part while models are added to it.
struct Merge {
    part: Part,
    /// Position bits to index. tobj cuts a group into models where its material changes and gives each its own
    /// positions; this joins them again.
    seen: HashMap<[u32; 3], u32>,
    models: usize,
    without_normals: Vec<u32>,
    without_uvs: Vec<u32>,
}

impl Merge {
    fn new(name: &str) -> Self {
        let part = Part {
            copies: vec![PartCopy::in_place(
                (name != "unnamed_object").then(|| name.to_string()),
            )],
            ..Part::default()
        };
        Self {
            part,
            seen: HashMap::new(),
            models: 0,
            without_normals: Vec::new(),
            without_uvs: Vec::new(),
        }
    }

    fn append<'a>(
        &mut self,
        from: &tobj::Mesh,
        polygons: &mut impl Iterator<Item = &'a super::obj_text::FaceKind>,
    ) {
        self.models += 1;
        if self.models == 2 {
            for (i, p) in self.part.mesh.positions.iter().enumerate() {
                self.seen.entry(p.map(f32::to_bits)).or_insert(i as u32);
            }
        }
        let mesh = &mut self.part.mesh;
        let position_ids: Vec<u32> = from
            .positions
            .as_chunks::<3>()
            .0
            .iter()
            .map(|p| {
                // Adding zero turns -0 into 0, which other places compare by bits.
                let p = p.map(|x| x + 0.0);
                let new = mesh.positions.len() as u32;
                let id = match self.models {
                    1 => new,
                    _ => *self.seen.entry(p.map(f32::to_bits)).or_insert(new),
                };
                if id == new {
                    mesh.positions.push(p);
                }
                id
            })
            .collect();
        let first_face = mesh.faces.len() as u32;
        let first_normal = mesh.normals.len() as u32;
        let first_uv = mesh.uvs.len() as u32;
        mesh.normals.extend_from_slice(from.normals.as_chunks().0);
        mesh.uvs.extend_from_slice(from.texcoords.as_chunks().0);
        let triples = |indices: &[u32]| indices.as_chunks::<3>().0.to_vec();
        let faces = triples(&from.indices);
        let normals = triples(&from.normal_indices);
        let uvs = triples(&from.texcoord_indices);
        let mut left = 0;
        let mut kind = None;
        for (f, corners) in faces.iter().enumerate() {
            if left == 0 {
                kind = polygons.next();
                left = kind.map_or(1, |k| k.triangles);
            }
            left -= 1;
            let number = first_face + f as u32;
            mesh.faces.push(corners.map(|c| position_ids[c as usize]));
            match normals.get(f) {
                Some(n) if kind.is_none_or(|k| k.has_normals) => {
                    mesh.face_normals.push(n.map(|i| i + first_normal));
                }
                _ => {
                    self.without_normals.push(number);
                    mesh.face_normals.push([0; 3]);
                }
            }
            match uvs.get(f) {
                Some(t) if kind.is_none_or(|k| k.has_uvs) => {
                    mesh.face_uvs.push(t.map(|i| i + first_uv));
                }
                _ => {
                    self.without_uvs.push(number);
                    mesh.face_uvs.push([0; 3]);
                }
            }
            self.part.face_materials.push(from.material_id);
        }
    }

    fn finish(mut self, report: &mut LoadReport) -> Part {
        let mesh = &mut self.part.mesh;
        fill_in(mesh, &self.without_normals, &self.without_uvs, report);
        if self.part.face_materials.iter().all(Option::is_none) {
            self.part.face_materials.clear();
        }
        self.part
    }
}

/// Counts the lines that were handed out, so that an error can name one.
struct CountingReader<'a> {
    rest: &'a [u8],
    line: usize,
}

impl Read for CountingReader<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.rest.read(buffer)
    }
}

impl BufRead for CountingReader<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        let end = self
            .rest
            .iter()
            .position(|&b| b == b'\n')
            .map_or(self.rest.len(), |i| i + 1);
        Ok(&self.rest[..end])
    }

    fn consume(&mut self, n: usize) {
        self.rest = &self.rest[n..];
        self.line += 1;
    }
}
