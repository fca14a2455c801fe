//! What can be wrong with a scene, said in one line.

use std::fmt;
use std::path::{Path, PathBuf};

/// A scene, or a file that it names, cannot be used. [`fmt::Display`] is one line: file, line where there is one, what
/// is wrong and what to do about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SceneError {
    /// The file at fault.
    pub file: PathBuf,
    /// Line in it, counted from 1, where one can be named.
    pub line: Option<usize>,
    /// What is wrong.
    pub kind: ErrorKind,
}

/// What is wrong with a file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ErrorKind {
    /// It is not there, or may not be read.
    #[error("cannot be read ({0}); check the path and its permissions")]
    Unreadable(String),
    /// It is not TOML, or has a key that no scene has, or a value of the wrong type.
    #[error("is not a scene file: {0}; scenes/README.md lists every key")]
    Syntax(String),
    /// A key has a value that makes no sense.
    #[error("{key}: {problem}; {remedy}")]
    Value {
        /// The key, with its table.
        key: String,
        /// What is wrong with its value.
        problem: String,
        /// What to write instead.
        remedy: String,
    },
    /// Every face uses a vertex whose coordinates are not all finite.
    #[error(
        "every face has a corner that is not finite, vertex {vertex} to begin with; correct the numbers or export the \
         mesh again"
    )]
    NotFinite {
        /// Counted from 1 among those of the file's first such group.
        vertex: usize,
    },
    /// A face names a vertex, normal or texture coordinate that is not there.
    #[error(
        "face uses {what} {index}, but there are {count}; correct the index or export the mesh again"
    )]
    IndexOutOfRange {
        /// Vertex, normal or texture coordinate.
        what: &'static str,
        /// The index as written.
        index: i64,
        /// How many there are.
        count: usize,
    },
    /// A mesh without a single face.
    #[error("has no faces, so there is nothing to draw; export it with faces")]
    Empty,
    /// A mesh, material or image file that breaks its format's rules.
    #[error("{0}; export it again or correct it by hand")]
    Malformed(String),
    /// A format that is not read.
    #[error(
        "format {0:?} is not read; convert it to .obj, .ply, .stl or .glb, or name a .toml scene"
    )]
    UnknownFormat(String),
    /// No built-in scene has that name.
    #[error("no built-in scene has this name; there are {0}")]
    UnknownBuiltin(String),
}

impl SceneError {
    /// An error in `file`, no line known.
    pub(crate) fn new(file: impl AsRef<Path>, kind: ErrorKind) -> Self {
        Self {
            file: file.as_ref().to_path_buf(),
            line: None,
            kind,
        }
    }

    /// An error in `file` at `line`, counted from 1.
    pub(crate) fn at(file: impl AsRef<Path>, line: usize, kind: ErrorKind) -> Self {
        Self {
            line: Some(line),
            ..Self::new(file, kind)
        }
    }
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = match self.line {
            Some(line) => format!("{}:{line}: {}", self.file.display(), self.kind),
            None => format!("{}: {}", self.file.display(), self.kind),
        };
        for (i, word) in place
            .lines()
            .map(str::trim)
            .filter(|w| !w.is_empty())
            .enumerate()
        {
            write!(f, "{}{word}", if i == 0 { "" } else { " " })?;
        }
        Ok(())
    }
}

impl std::error::Error for SceneError {}

impl ErrorKind {
    /// A [`ErrorKind::Value`].
    pub(crate) fn value(
        key: impl Into<String>,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self::Value {
            key: key.into(),
            problem: problem.into(),
            remedy: remedy.into(),
        }
    }
}
