//! A first pass over OBJ text: finds bad lines by number and hands on the rest in the form that tobj reads.
//!
//! tobj names no lines, stops at comments behind a face and fills in the normals that some faces lack from others, so
//! what it is given here has none of that, and who lacked what is written down.

use std::fmt::Write as _;
use std::path::Path;

use crate::error::{ErrorKind, SceneError};
use crate::report::LoadReport;

/// OBJ text that tobj reads without loss, and what it cannot carry.
pub(crate) struct CleanObj {
    /// One line for each line of the file, so that line numbers hold.
    pub(crate) text: String,
    /// One entry a face, in file order.
    pub(crate) faces: Vec<FaceKind>,
    /// Names that `usemtl` asked for, each once, in file order.
    pub(crate) materials: Vec<String>,
}

/// What tobj's triangles do not tell of the polygon they were cut from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct FaceKind {
    /// Triangles that it was cut into.
    pub(crate) triangles: u32,
    pub(crate) has_uvs: bool,
    pub(crate) has_normals: bool,
}

/// Highest index asked for, and where, of one of the three tables.
#[derive(Default, Clone, Copy)]
struct Highest {
    index: i64,
    line: usize,
}

const TABLES: [&str; 3] = ["vertex", "texture coordinate", "normal"];

struct Scan<'a> {
    file: &'a Path,
    line: usize,
    counts: [usize; 3],
    highest: [Highest; 3],
    out: CleanObj,
}

/// Checks and cleans `bytes`, which came from `file`.
pub(crate) fn clean(
    bytes: &[u8],
    file: &Path,
    report: &mut LoadReport,
) -> Result<CleanObj, SceneError> {
    let text = String::from_utf8_lossy(bytes);
    let mut scan = Scan {
        file,
        line: 0,
        counts: [0; 3],
        highest: [Highest::default(); 3],
        out: CleanObj {
            text: String::with_capacity(text.len() + 16),
            faces: Vec::new(),
            materials: Vec::new(),
        },
    };
    let mut joined = String::new();
    let mut held = 0;
    for (number, line) in text.lines().enumerate() {
        if let Some(start) = line.trim_end().strip_suffix('\\') {
            joined.push_str(start);
            joined.push(' ');
            held += 1;
            continue;
        }
        scan.line = number + 1 - held;
        if held == 0 {
            scan.statement(line, report)?;
        } else {
            joined.push_str(line);
            scan.statement(&joined, report)?;
            joined.clear();
        }
        for _ in 0..=std::mem::take(&mut held) {
            scan.out.text.push('\n');
        }
    }
    if held > 0 {
        scan.line += 1;
        scan.statement(&joined, report)?;
    }
    scan.check_ranges()?;
    Ok(scan.out)
}

impl Scan<'_> {
    fn statement(&mut self, line: &str, report: &mut LoadReport) -> Result<(), SceneError> {
        let line = line.trim();
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        match keyword {
            "v" => self.numbers("v", 0, rest, 3),
            "vt" => self.numbers("vt", 1, rest, 2),
            "vn" => self.numbers("vn", 2, rest, 3),
            "f" | "fo" => self.face(without_comment(rest), report),
            "l" | "p" => {
                report.points_and_lines += 1;
                Ok(())
            }
            "usemtl" => {
                let name = rest.trim();
                if !name.is_empty() {
                    let _ = write!(self.out.text, "usemtl {name}");
                    if !self.out.materials.iter().any(|m| m == name) {
                        self.out.materials.push(name.into());
                    }
                }
                Ok(())
            }
            "o" | "g" | "mtllib" => {
                let _ = write!(self.out.text, "{keyword} {}", rest.trim());
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// A line of numbers: colours behind a position are left out, a missing v coordinate is 0.
    fn numbers(
        &mut self,
        keyword: &str,
        table: usize,
        rest: &str,
        wanted: usize,
    ) -> Result<(), SceneError> {
        let words: Vec<&str> = without_comment(rest).split_whitespace().collect();
        let enough = if table == 1 { 1 } else { wanted };
        if words.len() < enough {
            return Err(self.malformed(format!(
                "{keyword} has {} numbers where {wanted} are needed",
                words.len()
            )));
        }
        let kept = if table == 0 && words.len() == 4 {
            4
        } else {
            wanted
        };
        self.out.text.push_str(keyword);
        for i in 0..kept {
            let word = words.get(i).copied().unwrap_or("0");
            let number: f32 = word
                .parse()
                .map_err(|_| self.malformed(format!("{word:?} is not a number")))?;
            if i == 3 && number == 0.0 {
                return Err(self.malformed("a vertex has weight 0".into()));
            }
            self.out.text.push(' ');
            self.out.text.push_str(word);
        }
        self.counts[table] += 1;
        Ok(())
    }

    fn face(&mut self, rest: &str, report: &mut LoadReport) -> Result<(), SceneError> {
        let mut corners = 0;
        let mut has = [true; 3];
        for corner in rest.split_whitespace() {
            corners += 1;
            let mut fields = corner.split('/');
            for (table, has_one) in has.iter_mut().enumerate() {
                match fields.next() {
                    Some("") | None if table > 0 => *has_one = false,
                    field => self.index(table, field.unwrap_or(""))?,
                }
            }
            if fields.next().is_some() {
                return Err(self.malformed(format!("{corner:?} is not vertex/texture/normal")));
            }
        }
        if corners < 3 {
            report.points_and_lines += 1;
            return Ok(());
        }
        report.polygons += usize::from(corners > 3);
        self.out.text.push_str("f ");
        self.out.text.push_str(rest.trim());
        self.out.faces.push(FaceKind {
            triangles: corners - 2,
            has_uvs: has[1],
            has_normals: has[2],
        });
        Ok(())
    }

    fn index(&mut self, table: usize, word: &str) -> Result<(), SceneError> {
        let index: i64 = word
            .parse()
            .map_err(|_| self.malformed(format!("{word:?} is not an index")))?;
        let count = self.counts[table];
        let out_of_range = index == 0 || index < 0 && index.unsigned_abs() > count as u64;
        if out_of_range {
            return Err(self.error(ErrorKind::IndexOutOfRange {
                what: TABLES[table],
                index,
                count,
            }));
        }
        if index > self.highest[table].index {
            self.highest[table] = Highest {
                index,
                line: self.line,
            };
        }
        Ok(())
    }

    /// Some writers put vertices behind the faces that use them, so this waits for the end of the file.
    fn check_ranges(&self) -> Result<(), SceneError> {
        for (table, highest) in self.highest.iter().enumerate() {
            if highest.index > self.counts[table] as i64 {
                return Err(SceneError::at(
                    self.file,
                    highest.line,
                    ErrorKind::IndexOutOfRange {
                        what: TABLES[table],
                        index: highest.index,
                        count: self.counts[table],
                    },
                ));
            }
        }
        Ok(())
    }

    fn malformed(&self, what: String) -> SceneError {
        self.error(ErrorKind::Malformed(what))
    }

    fn error(&self, kind: ErrorKind) -> SceneError {
        SceneError::at(self.file, self.line, kind)
    }
}

fn without_comment(s: &str) -> &str {
    s.split_once('#').map_or(s, |(before, _)| before)
}
