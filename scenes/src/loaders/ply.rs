//! PLY, ascii or binary, read by ply-rs-bw one element at a time so that only the mesh itself stays in memory.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    BeginList, ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult,
};
use protocol::scene::Mesh;

use super::{MeshFile, Part, PartCopy};
use crate::error::{ErrorKind, SceneError};
use crate::report::LoadReport;

/// One row of any element; what it does not know is dropped.
#[derive(Default)]
struct Row {
    position: [f32; 3],
    normal: [f32; 3],
    uv: [f32; 2],
    ints: Vec<i32>,
    uints: Vec<u32>,
    bad_list: bool,
}

impl Row {
    fn set(&mut self, name: &str, value: f32) -> PropertyAccessResult {
        let slot = match name {
            "x" => &mut self.position[0],
            "y" => &mut self.position[1],
            "z" => &mut self.position[2],
            "nx" => &mut self.normal[0],
            "ny" => &mut self.normal[1],
            "nz" => &mut self.normal[2],
            "u" | "s" | "texture_u" => &mut self.uv[0],
            "v" | "t" | "texture_v" => &mut self.uv[1],
            _ => return PropertyAccessResult::Ignored,
        };
        // Adding zero turns -0 into 0, which other places compare by bits.
        *slot = value + 0.0;
        PropertyAccessResult::Set
    }
}

fn is_face_list(name: &str) -> bool {
    matches!(name, "vertex_indices" | "vertex_index")
}

impl PropertyAccess for Row {
    fn new() -> Self {
        Self::default()
    }

    fn set_float(&mut self, name: &str, value: f32) -> PropertyAccessResult {
        self.set(name, value)
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if is_face_list(name) {
            match property.to_u32_list() {
                Some(list) => self.uints = list,
                None => self.bad_list = true,
            }
            return PropertyAccessResult::Set;
        }
        match property.to_f32_lossy() {
            Some(value) => self.set(name, value),
            None => PropertyAccessResult::Ignored,
        }
    }

    fn begin_list_int(&mut self, name: &str, _len: usize) -> BeginList<'_, i32> {
        if is_face_list(name) {
            BeginList::Fill(&mut self.ints)
        } else {
            BeginList::UseSetter
        }
    }

    fn begin_list_uint(&mut self, name: &str, _len: usize) -> BeginList<'_, u32> {
        if is_face_list(name) {
            BeginList::Fill(&mut self.uints)
        } else {
            BeginList::UseSetter
        }
    }
}

/// Reads a PLY file.
pub(crate) fn read(path: &Path) -> Result<MeshFile, SceneError> {
    let file = File::open(path)
        .map_err(|e| SceneError::new(path, ErrorKind::Unreadable(e.to_string())))?;
    let mut reader = Reader::new(BufReader::with_capacity(1 << 18, file));
    let header = Parser::<Row>::new()
        .read_header(&mut reader)
        .map_err(|e| malformed(path, None, &e))?;
    let line = header_lines(&header);
    let mut rows = Rows {
        path,
        parser: Parser::new(),
        encoding: header.encoding,
        source: reader.into_inner(),
        line,
        text: String::new(),
    };
    let mut report = LoadReport::default();
    let mut mesh = Mesh::default();
    for (_, element) in &header.elements {
        match element.name.as_str() {
            "vertex" => read_vertices(&mut rows, element, &mut mesh)?,
            "face" => read_faces(&mut rows, element, &mut mesh, &mut report)?,
            _ => rows.for_each(element, |_, _| Ok(()))?,
        }
    }
    check_indices(&mesh, path)?;
    if !mesh.normals.is_empty() {
        mesh.face_normals.clone_from(&mesh.faces);
    }
    if !mesh.uvs.is_empty() {
        mesh.face_uvs.clone_from(&mesh.faces);
    }
    let part = Part {
        mesh,
        copies: vec![PartCopy::in_place(None)],
        ..Part::default()
    };
    Ok(MeshFile {
        parts: Vec::from_iter((!part.mesh.faces.is_empty()).then_some(part)),
        report,
        ..MeshFile::default()
    })
}

fn read_vertices(
    rows: &mut Rows<'_>,
    element: &ElementDef,
    mesh: &mut Mesh,
) -> Result<(), SceneError> {
    let has = |names: &[&str]| names.iter().any(|n| element.properties.contains_key(*n));
    let normals = has(&["nx"]) && has(&["ny"]) && has(&["nz"]);
    let uvs = has(&["u", "s", "texture_u"]) && has(&["v", "t", "texture_v"]);
    if !(has(&["x"]) && has(&["y"]) && has(&["z"])) {
        return Err(SceneError::new(
            rows.path,
            ErrorKind::Malformed("vertices have no x, y and z".into()),
        ));
    }
    rows.for_each(element, |row, _| {
        mesh.positions.push(row.position);
        if normals {
            mesh.normals.push(row.normal);
        }
        if uvs {
            mesh.uvs.push(row.uv);
        }
        Ok(())
    })
}

fn read_faces(
    rows: &mut Rows<'_>,
    element: &ElementDef,
    mesh: &mut Mesh,
    report: &mut LoadReport,
) -> Result<(), SceneError> {
    let path = rows.path;
    let mut corners: Vec<u32> = Vec::new();
    rows.for_each(element, |row, line| {
        corners.clear();
        corners.extend_from_slice(&row.uints);
        for &i in &row.ints {
            let index = u32::try_from(i).map_err(|_| {
                located(
                    path,
                    line,
                    ErrorKind::IndexOutOfRange {
                        what: "vertex",
                        index: i.into(),
                        count: mesh.positions.len(),
                    },
                )
            })?;
            corners.push(index);
        }
        if row.bad_list {
            let what = "a face's vertex list holds something other than indices";
            return Err(located(path, line, ErrorKind::Malformed(what.into())));
        }
        match corners[..] {
            [] | [_] | [_, _] => report.points_and_lines += 1,
            [a, b, c] => mesh.faces.push([a, b, c]),
            [first, ref rest @ ..] => {
                report.polygons += 1;
                mesh.faces
                    .extend(rest.windows(2).map(|w| [first, w[0], w[1]]));
            }
        }
        Ok(())
    })
}

/// The vertices may come after the faces, so this waits for both.
fn check_indices(mesh: &Mesh, path: &Path) -> Result<(), SceneError> {
    let count = mesh.positions.len();
    let highest = mesh.faces.iter().flatten().copied().max();
    match highest {
        Some(index) if index as usize >= count => Err(SceneError::new(
            path,
            ErrorKind::IndexOutOfRange {
                what: "vertex",
                index: index.into(),
                count,
            },
        )),
        _ => Ok(()),
    }
}

/// The rows of each element in turn.
struct Rows<'a> {
    path: &'a Path,
    parser: Parser<Row>,
    encoding: Encoding,
    source: BufReader<File>,
    /// Lines read so far.
    line: usize,
    text: String,
}

impl Rows<'_> {
    /// Calls `f` with each row and, in ascii files, its line.
    fn for_each(
        &mut self,
        element: &ElementDef,
        mut f: impl FnMut(&Row, Option<usize>) -> Result<(), SceneError>,
    ) -> Result<(), SceneError> {
        if element.properties.is_empty() {
            return Ok(());
        }
        for _ in 0..element.count {
            let (row, line) = self.next(element)?;
            f(&row, line)?;
        }
        Ok(())
    }

    fn next(&mut self, element: &ElementDef) -> Result<(Row, Option<usize>), SceneError> {
        let (row, line) = match self.encoding {
            Encoding::BinaryLittleEndian => (
                self.parser
                    .read_little_endian_element(&mut self.source, element),
                None,
            ),
            Encoding::BinaryBigEndian => (
                self.parser
                    .read_big_endian_element(&mut self.source, element),
                None,
            ),
            Encoding::Ascii => {
                self.text.clear();
                self.line += 1;
                let read = self.source.read_line(&mut self.text);
                let row = match read {
                    Ok(0) => Err(ParseError::from(std::io::Error::other(
                        "the file ends too early",
                    ))),
                    Ok(_) => self.parser.read_ascii_element(&self.text, element),
                    Err(e) => Err(ParseError::from(e)),
                };
                (row, Some(self.line))
            }
        };
        match row {
            Ok(row) => Ok((row, line)),
            Err(e) => Err(malformed(self.path, line, &e)),
        }
    }
}

/// How many lines the header took, comments included.
fn header_lines(header: &Header) -> usize {
    let elements: usize = header
        .elements
        .iter()
        .map(|(_, e)| 1 + e.properties.len())
        .sum();
    3 + elements + header.comments.len() + header.obj_infos.len()
}

fn located(path: &Path, line: Option<usize>, kind: ErrorKind) -> SceneError {
    SceneError {
        line,
        ..SceneError::new(path, kind)
    }
}

fn malformed(path: &Path, line: Option<usize>, error: &ParseError) -> SceneError {
    located(
        path,
        line.or(error.line()),
        ErrorKind::Malformed(format!("not a whole PLY file: {error}")),
    )
}
