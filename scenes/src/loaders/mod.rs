//! Mesh files, each read into the same [`MeshFile`].

mod mtl;
mod obj;
mod obj_text;
mod ply;

use std::path::{Path, PathBuf};

use protocol::scene::Mesh;

use crate::error::{ErrorKind, SceneError};
use crate::report::LoadReport;

/// What a mesh file holds.
#[derive(Debug, Default)]
pub(crate) struct MeshFile {
    /// At least one; each has at least one face.
    pub(crate) parts: Vec<Part>,
    pub(crate) materials: Vec<FileMaterial>,
    /// Counts of what only the reader sees; geometry is examined later.
    pub(crate) report: LoadReport,
}

/// One group of a mesh file.
#[derive(Debug, Default, Clone)]
pub(crate) struct Part {
    /// `None` for faces outside any group.
    pub(crate) name: Option<String>,
    /// Its `face_materials` stay empty.
    pub(crate) mesh: Mesh,
    /// Index into [`MeshFile::materials`] a face, or empty: no face has one.
    pub(crate) face_materials: Vec<Option<usize>>,
}

/// A material that a mesh file brings along.
#[derive(Debug, Clone)]
pub(crate) struct FileMaterial {
    pub(crate) name: String,
    pub(crate) diffuse: [f32; 3],
    pub(crate) diffuse_map: Option<PathBuf>,
    pub(crate) specular: [f32; 3],
    pub(crate) roughness: f32,
}

/// True for an extension that [`read`] knows.
pub(crate) fn is_mesh(path: &Path) -> bool {
    matches!(extension(path).as_str(), "obj" | "ply")
}

/// Reads a mesh file by its extension.
pub(crate) fn read(path: &Path) -> Result<MeshFile, SceneError> {
    let file = match extension(path).as_str() {
        "obj" => obj::read(path)?,
        "ply" => ply::read(path)?,
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
