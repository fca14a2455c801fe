//! Mesh files, each read into the same [`MeshFile`].

mod gltf;
mod mtl;
mod obj;
mod obj_text;
mod ply;
mod stl;

use std::path::{Path, PathBuf};
use std::rc::Rc;

use protocol::scene::{Affine, Light, Mesh};

use crate::error::{ErrorKind, SceneError};
use crate::geometry::Weld;
use crate::load::CameraSpec;
use crate::report::LoadReport;
use crate::transform::IDENTITY;

/// What a mesh file holds.
#[derive(Debug, Default)]
pub(crate) struct MeshFile {
    /// At least one; each has at least one face.
    pub(crate) parts: Vec<Part>,
    pub(crate) materials: Vec<FileMaterial>,
    pub(crate) setting: Setting,
    /// Counts of what only the reader sees; geometry is examined later.
    pub(crate) report: LoadReport,
}

/// One group of a mesh file.
#[derive(Debug, Default, Clone)]
pub(crate) struct Part {
    /// Where it is shown, at least once.
    pub(crate) copies: Vec<PartCopy>,
    /// Its `face_materials` stay empty.
    pub(crate) mesh: Mesh,
    /// Index into [`MeshFile::materials`] a face, or empty: no face has one.
    pub(crate) face_materials: Vec<Option<usize>>,
}

/// A place where a part is shown.
#[derive(Debug, Clone)]
pub(crate) struct PartCopy {
    /// `None` for faces outside any group.
    pub(crate) name: Option<String>,
    /// From the part to the file's own space.
    pub(crate) transform: Affine,
}

impl PartCopy {
    pub(crate) fn in_place(name: Option<String>) -> Self {
        Self {
            name,
            transform: IDENTITY,
        }
    }
}

/// What a mesh file says of cameras and lights; used if it is opened as a scene of its own.
#[derive(Debug, Default, Clone)]
pub(crate) struct Setting {
    pub(crate) cameras: Vec<CameraSpec>,
    pub(crate) lights: Vec<Light>,
    /// True if a material would be black without glossy reflection.
    pub(crate) has_metal: bool,
}

/// A material that a mesh file brings along.
#[derive(Debug, Clone)]
pub(crate) struct FileMaterial {
    pub(crate) name: String,
    pub(crate) diffuse: [f32; 3],
    pub(crate) diffuse_map: Option<Picture>,
    pub(crate) specular: [f32; 3],
    pub(crate) roughness: f32,
}

/// A PNG or JPEG picture that a mesh file names or holds.
#[derive(Debug, Clone)]
pub(crate) enum Picture {
    File(PathBuf),
    Held {
        /// Its own among all pictures of all files, for people.
        name: PathBuf,
        bytes: Rc<[u8]>,
    },
}

/// True for an extension that [`read`] knows.
pub(crate) fn is_mesh(path: &Path) -> bool {
    matches!(
        extension(path).as_str(),
        "obj" | "ply" | "stl" | "gltf" | "glb"
    )
}

/// Reads a mesh file by its extension.
pub(crate) fn read(path: &Path) -> Result<MeshFile, SceneError> {
    let mut file = match extension(path).as_str() {
        "obj" => obj::read(path)?,
        "ply" => ply::read(path)?,
        "stl" => stl::read(path)?,
        "gltf" | "glb" => gltf::read(path)?,
        other => {
            return Err(SceneError::new(
                path,
                ErrorKind::UnknownFormat(other.into()),
            ));
        }
    };
    if file.parts.is_empty() {
        return Err(SceneError::new(path, ErrorKind::Empty));
    }
    leave_out_not_finite(&mut file, path)?;
    Ok(file)
}

fn extension(path: &Path) -> String {
    path.extension()
        .map(|e| e.to_string_lossy().to_ascii_lowercase())
        .unwrap_or_default()
}

/// A file's bytes, or why not.
pub(crate) fn read_bytes(path: &Path) -> Result<Vec<u8>, SceneError> {
    std::fs::read(path).map_err(|e| SceneError::new(path, ErrorKind::Unreadable(e.to_string())))
}

/// Joins bit-equal positions of a mesh, in order of first appearance.
fn weld(mesh: &mut Mesh) {
    let weld = Weld::new(&mesh.positions);
    let mut kept = Vec::with_capacity(weld.count);
    for (p, &id) in mesh.positions.iter().zip(&weld.ids) {
        if id as usize == kept.len() {
            // Adding zero turns -0 into 0, which other places compare by bits.
            kept.push(p.map(|x| x + 0.0));
        }
    }
    mesh.positions = kept;
    for face in &mut mesh.faces {
        *face = weld.face(*face);
    }
}

/// Faces without normals among others that have some get flat ones; without texture coordinates, (0, 0).
fn fill_in(mesh: &mut Mesh, without_normals: &[u32], without_uvs: &[u32], report: &mut LoadReport) {
    if without_normals.len() == mesh.faces.len() {
        mesh.normals.clear();
        mesh.face_normals.clear();
    } else {
        report.faces_without_normals += without_normals.len();
        for &f in without_normals {
            let n = crate::normals::face_normal(mesh, f as usize);
            mesh.face_normals[f as usize] = [mesh.normals.len() as u32; 3];
            mesh.normals.push(n);
        }
    }
    if without_uvs.len() == mesh.faces.len() {
        mesh.uvs.clear();
        mesh.face_uvs.clear();
    } else if !without_uvs.is_empty() {
        let zero = mesh.uvs.len() as u32;
        mesh.uvs.push([0.0; 2]);
        for &f in without_uvs {
            mesh.face_uvs[f as usize] = [zero; 3];
        }
    }
}

/// A face with a corner that is not finite cannot be drawn: it is left out and counted, unless nothing would be left.
fn leave_out_not_finite(file: &mut MeshFile, path: &Path) -> Result<(), SceneError> {
    let mut first = None;
    for part in &mut file.parts {
        let mesh = &mut part.mesh;
        if mesh.positions.iter().flatten().all(|x| x.is_finite()) {
            continue;
        }
        let keep: Vec<bool> = mesh
            .faces
            .iter()
            .map(|face| {
                let lost = face
                    .iter()
                    .find(|v| !mesh.positions[**v as usize].iter().all(|x| x.is_finite()));
                first = first.or(lost.copied());
                lost.is_none()
            })
            .collect();
        file.report.faces_not_finite += keep.iter().filter(|k| !**k).count();
        retain(&mut mesh.faces, &keep);
        retain(&mut mesh.face_normals, &keep);
        retain(&mut mesh.face_uvs, &keep);
        retain(&mut part.face_materials, &keep);
    }
    file.parts.retain(|p| !p.mesh.faces.is_empty());
    match first {
        Some(vertex) if file.parts.is_empty() => {
            let vertex = vertex as usize + 1;
            Err(SceneError::new(path, ErrorKind::NotFinite { vertex }))
        }
        _ => Ok(()),
    }
}

/// Keeps the entries marked; tables that are not kept for each face stay empty.
fn retain<T>(table: &mut Vec<T>, keep: &[bool]) {
    let mut marks = keep.iter();
    table.retain(|_| marks.next().copied().unwrap_or(true));
}
