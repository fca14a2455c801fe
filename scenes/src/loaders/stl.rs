//! STL, ascii or binary: a soup of triangles, welded by exact position.

use std::path::Path;

use protocol::scene::Mesh;

use super::{MeshFile, Part, PartCopy, read_bytes, weld};
use crate::error::{ErrorKind, SceneError};
use crate::report::LoadReport;

/// Bytes before the first facet: 80 of any text, and how many facets there are.
const HEADER: usize = 84;
/// Normal, three corners and two bytes of attributes.
const FACET: usize = 50;

/// Reads an STL file. Its normals are those of its facets, so they are not kept; its colours (bytes that some writers use
/// so) are not read.
pub(crate) fn read(path: &Path) -> Result<MeshFile, SceneError> {
    let bytes = read_bytes(path)?;
    let mut parts = if is_text(&bytes) {
        read_text(&String::from_utf8_lossy(&bytes), path)?
    } else {
        vec![read_binary(&bytes, path)?]
    };
    parts.retain(|p| !p.mesh.faces.is_empty());
    for part in &mut parts {
        weld(&mut part.mesh);
    }
    if let [only] = parts.as_mut_slice() {
        only.copies = vec![PartCopy::in_place(None)];
    }
    Ok(MeshFile {
        parts,
        report: LoadReport::default(),
        ..MeshFile::default()
    })
}

/// Many binary files begin with `solid` too: what tells is a length that fits the count, or bytes that are no text.
fn is_text(bytes: &[u8]) -> bool {
    let count = facet_count(bytes).map_or(u64::MAX, u64::from);
    let fits = count
        .checked_mul(FACET as u64)
        .is_some_and(|n| n + HEADER as u64 == bytes.len() as u64);
    let start = bytes.trim_ascii_start();
    !fits
        && start
            .get(..5)
            .is_some_and(|w| w.eq_ignore_ascii_case(b"solid"))
        && !start.iter().take(512).any(|b| *b == 0)
}

fn facet_count(bytes: &[u8]) -> Option<u32> {
    let count = bytes.get(HEADER - 4..HEADER)?;
    Some(u32::from_le_bytes(count.try_into().ok()?))
}

fn read_binary(bytes: &[u8], path: &Path) -> Result<Part, SceneError> {
    let malformed = |what: String| SceneError::new(path, ErrorKind::Malformed(what));
    let Some(count) = facet_count(bytes) else {
        return Err(malformed(format!(
            "not an STL file: {} bytes, where a binary one has {HEADER} before its first facet and a text one begins \
             with \"solid\"",
            bytes.len()
        )));
    };
    let facets = bytes[HEADER..].chunks_exact(FACET);
    if facets.len() < count as usize {
        return Err(malformed(format!(
            "the file ends at byte {}, within facet {} of the {count} that it promises",
            bytes.len(),
            facets.len() + 1
        )));
    }
    let mut mesh = Mesh::default();
    for facet in facets.take(count as usize) {
        let (corners, _) = facet[12..48].as_chunks::<4>();
        let at = |i: usize| f32::from_le_bytes(corners[i]);
        push_facet(&mut mesh, [0, 3, 6].map(|c| [at(c), at(c + 1), at(c + 2)]));
    }
    Ok(Part {
        mesh,
        ..Part::default()
    })
}

/// One part for each `solid`.
fn read_text(text: &str, path: &Path) -> Result<Vec<Part>, SceneError> {
    let mut reader = TextReader {
        path,
        parts: Vec::new(),
        corners: Vec::new(),
        facet_line: None,
    };
    let mut last = 0;
    for (number, line) in text.lines().enumerate() {
        last = number + 1;
        reader.line(line, last)?;
    }
    if let Some(start) = reader.facet_line {
        let what = format!("the file ends within the facet of line {start}");
        return Err(SceneError::at(path, last, ErrorKind::Malformed(what)));
    }
    Ok(reader.parts)
}

struct TextReader<'a> {
    path: &'a Path,
    parts: Vec<Part>,
    /// Of the facet that is being read.
    corners: Vec<[f32; 3]>,
    /// Where that facet began.
    facet_line: Option<usize>,
}

impl TextReader<'_> {
    fn line(&mut self, line: &str, number: usize) -> Result<(), SceneError> {
        let bad = |what: String| {
            Err(SceneError::at(
                self.path,
                number,
                ErrorKind::Malformed(what),
            ))
        };
        let mut words = line.split_whitespace();
        let Some(keyword) = words.next() else {
            return Ok(());
        };
        match keyword.to_ascii_lowercase().as_str() {
            "solid" => {
                let name = words.collect::<Vec<_>>().join(" ");
                self.parts.push(Part {
                    copies: vec![PartCopy::in_place((!name.is_empty()).then_some(name))],
                    ..Part::default()
                });
            }
            "facet" if self.facet_line.is_none() => self.facet_line = Some(number),
            "vertex" if self.facet_line.is_some() => {
                let mut corner = [0.0; 3];
                for slot in &mut corner {
                    let word = words.next().unwrap_or("");
                    match word.parse() {
                        Ok(x) => *slot = x,
                        Err(_) => return bad(format!("vertex: {word:?} is not a number")),
                    }
                }
                self.corners.push(corner);
            }
            "endfacet" if self.facet_line.is_some() => {
                let corners: [[f32; 3]; 3] = match self.corners.as_slice().try_into() {
                    Ok(corners) => corners,
                    Err(_) => return bad(format!("a facet has {} corners", self.corners.len())),
                };
                let Some(part) = self.parts.last_mut() else {
                    return bad("a facet comes before any solid".into());
                };
                push_facet(&mut part.mesh, corners);
                self.corners.clear();
                self.facet_line = None;
            }
            "outer" | "endloop" | "endsolid" => {}
            _ => return bad(format!("{keyword:?} makes no sense here")),
        }
        Ok(())
    }
}

fn push_facet(mesh: &mut Mesh, corners: [[f32; 3]; 3]) {
    let first = mesh.positions.len() as u32;
    mesh.positions.extend(corners);
    mesh.faces.push([first, first + 1, first + 2]);
}
