//! Files for tests to load.

#![allow(dead_code, reason = "no test program uses all of them")]
#![expect(
    clippy::unwrap_used,
    reason = "a helper of a test may fail as the test does"
)]

pub(crate) mod gltf;

use std::fs;
use std::path::PathBuf;

use scenes::{LoadedScene, SceneError, load};

/// A folder that goes when the test ends.
pub(crate) struct Dir(pub(crate) tempfile::TempDir);

impl Dir {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        fs::write(&path, content).unwrap();
        path
    }

    pub(crate) fn load(
        &self,
        name: &str,
        content: impl AsRef<[u8]>,
    ) -> Result<LoadedScene, SceneError> {
        load(&self.write(name, content))
    }
}

/// The one line of an error, without the folder.
pub(crate) fn line(result: Result<LoadedScene, SceneError>) -> String {
    let error = result.unwrap_err();
    let text = error.to_string();
    assert_eq!(text.lines().count(), 1, "{text}");
    let name = error
        .file
        .file_name()
        .unwrap()
        .to_string_lossy()
        .into_owned();
    text.replace(&error.file.display().to_string(), &name)
}

pub(crate) const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

/// A pyramid with a quad base, as PLY in each encoding.
pub(crate) fn ply(encoding: &str) -> Vec<u8> {
    let points: [[f32; 3]; 5] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 0.0, 1.0],
        [0.0, 0.0, 1.0],
        [0.5, 1.0, 0.5],
    ];
    let faces: [&[u32]; 5] = [
        &[0, 1, 2, 3],
        &[1, 0, 4],
        &[2, 1, 4],
        &[3, 2, 4],
        &[0, 3, 4],
    ];
    let mut out = format!(
        "ply\nformat {encoding} 1.0\ncomment made here\nelement vertex 5\nproperty float x\nproperty float y\n\
         property double z\nproperty uchar red\nelement face 5\nproperty list uchar uint vertex_indices\nend_header\n"
    )
    .into_bytes();
    for p in points {
        match encoding {
            "ascii" => out.extend(format!("{} {} {} 7\n", p[0], p[1], p[2]).bytes()),
            "binary_little_endian" => {
                out.extend([p[0].to_le_bytes(), p[1].to_le_bytes()].concat());
                out.extend(f64::from(p[2]).to_le_bytes());
                out.push(7);
            }
            _ => {
                out.extend([p[0].to_be_bytes(), p[1].to_be_bytes()].concat());
                out.extend(f64::from(p[2]).to_be_bytes());
                out.push(7);
            }
        }
    }
    for f in faces {
        if encoding == "ascii" {
            let words: Vec<String> = f.iter().map(u32::to_string).collect();
            out.extend(format!("{} {}\n", f.len(), words.join(" ")).bytes());
            continue;
        }
        out.push(f.len() as u8);
        for v in f {
            out.extend(if encoding == "binary_little_endian" {
                v.to_le_bytes()
            } else {
                v.to_be_bytes()
            });
        }
    }
    out
}
