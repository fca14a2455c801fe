//! glTF 2.0, as text or binary, read by the `gltf` crate; what the crate takes for granted is checked first.

mod buffers;
mod materials;
mod nodes;
mod primitives;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

use gltf::json::Root;
use gltf::{Document, Glb, Gltf};

use self::buffers::{Buffers, malformed};
use self::materials::{Converted, convert};
use self::primitives::Gather;
use super::{MeshFile, Part, PartCopy, read_bytes};
use crate::error::{ErrorKind, SceneError};
use crate::report::LoadReport;

/// Reads a glTF file: of its scene, each mesh once, with a copy for each node that shows it.
pub(crate) fn read(path: &Path) -> Result<MeshFile, SceneError> {
    let bytes = read_bytes(path)?;
    let mut file = parse(&bytes).map_err(|e| explain(path, e))?;
    let buffers = Buffers::read(&mut file, path)?;
    let document = &file.document;
    let mut report = LoadReport::default();
    let placed = nodes::walk(document, path, &mut report)?;
    let mut materials = Vec::new();
    for m in document.materials() {
        materials.push(convert(&m, document, &buffers, path, &mut report)?);
    }
    let parts = parts(
        document,
        placed.meshes,
        &buffers,
        &materials,
        path,
        &mut report,
    )?;
    let mut setting = placed.setting;
    setting.has_metal = parts
        .iter()
        .flat_map(|p| p.face_materials.iter().flatten())
        .any(|m| materials[*m].metallic > 0.0);
    Ok(MeshFile {
        parts,
        materials: materials.into_iter().map(|c| c.material).collect(),
        setting,
        report,
    })
}

fn parse(bytes: &[u8]) -> Result<Gltf, gltf::Error> {
    let (words, blob) = if bytes.starts_with(b"glTF") {
        let glb = Glb::from_slice(bytes)?;
        (glb.json, glb.bin.map(Cow::into_owned))
    } else {
        (Cow::Borrowed(bytes), None)
    };
    let root = match Root::from_slice(&words) {
        Ok(root) => root,
        Err(e) => without_animations(&words).ok_or(gltf::Error::Deserialize(e))?,
    };
    let document = Document::from_json(root)?;
    Ok(Gltf { document, blob })
}

/// Animations by extensions, `KHR_animation_pointer` among them, are more than the crate reads, and nothing moves here.
fn without_animations(words: &[u8]) -> Option<Root> {
    let mut value: serde_json::Value = serde_json::from_slice(words).ok()?;
    value.as_object_mut()?.remove("animations")?;
    serde_json::from_value(value).ok()
}

fn parts(
    document: &Document,
    placed: BTreeMap<usize, Vec<PartCopy>>,
    buffers: &Buffers,
    materials: &[Converted],
    path: &Path,
    report: &mut LoadReport,
) -> Result<Vec<Part>, SceneError> {
    let mut parts = Vec::new();
    let mut placed = placed;
    for mesh in document.meshes() {
        let Some(copies) = placed.remove(&mesh.index()) else {
            continue;
        };
        let mut gather = Gather::default();
        for primitive in mesh.primitives() {
            let material = primitive.material().index();
            let uv = match material {
                Some(m) => materials[m].uv,
                None => materials::UvChoice::NONE,
            };
            gather.add(&primitive, buffers, material, uv).map_err(|e| {
                let (m, p) = (mesh.index(), primitive.index());
                malformed(path, format!("mesh {m}, primitive {p}: {e}"))
            })?;
        }
        if mesh.weights().is_some_and(|w| w.iter().any(|w| *w != 0.0)) {
            report.notes.push(format!(
                "{}: mesh {} has morph targets; it is shown without",
                path.display(),
                mesh.index()
            ));
        }
        let part = gather.finish(report);
        if !part.mesh.faces.is_empty() {
            parts.push(Part { copies, ..part });
        }
    }
    Ok(parts)
}

/// The crate's errors with the place that they name, if any.
fn explain(path: &Path, error: gltf::Error) -> SceneError {
    match error {
        gltf::Error::Deserialize(e) if e.line() > 0 => {
            let what = format!("not a glTF file: {e}");
            SceneError::at(path, e.line(), ErrorKind::Malformed(what))
        }
        gltf::Error::Validation(errors) => match errors.first() {
            Some((place, e)) => {
                malformed(path, format!("{place}: {e} ({} such in all)", errors.len()))
            }
            None => malformed(path, "not a valid glTF file".into()),
        },
        gltf::Error::Binary(e) => malformed(path, format!("not a whole binary glTF file: {e}")),
        e => malformed(path, format!("not a glTF file: {e}")),
    }
}
