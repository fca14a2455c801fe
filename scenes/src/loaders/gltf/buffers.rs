//! The bytes that a glTF file refers to: beside it, in it, or in its text.

use std::path::{Path, PathBuf};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use gltf::accessor::{DataType, Dimensions};
use gltf::buffer::{Source, View};
use gltf::{Accessor, Buffer, Gltf};

use crate::error::{ErrorKind, SceneError};
use crate::loaders::read_bytes;

/// Most elements of an accessor that no bytes stand behind (sparse ones count from zeros).
const MAX_ZEROS: usize = 1 << 26;

/// All buffers of a file, each at least as long as it says.
pub(super) struct Buffers {
    data: Vec<Vec<u8>>,
}

impl Buffers {
    /// Reads them all; takes the file's own binary chunk.
    pub(super) fn read(file: &mut Gltf, path: &Path) -> Result<Self, SceneError> {
        let mut blob = file.blob.take();
        let mut data = Vec::new();
        for buffer in file.document.buffers() {
            let bytes = match buffer.source() {
                Source::Bin => blob.take().ok_or_else(|| {
                    malformed(
                        path,
                        format!(
                            "buffer {} has no uri and the file no binary chunk",
                            buffer.index()
                        ),
                    )
                })?,
                Source::Uri(uri) => read_uri(uri, path)?,
            };
            if bytes.len() < buffer.length() {
                return Err(malformed(
                    path,
                    format!(
                        "buffer {} ends at byte {} of the {} that it promises",
                        buffer.index(),
                        bytes.len(),
                        buffer.length()
                    ),
                ));
            }
            data.push(bytes);
        }
        Ok(Self { data })
    }

    /// A whole buffer.
    pub(super) fn get(&self, buffer: &Buffer<'_>) -> Option<&[u8]> {
        self.data.get(buffer.index()).map(Vec::as_slice)
    }

    /// The bytes of a view, or which of them are not there.
    pub(super) fn view(&self, view: &View<'_>) -> Result<&[u8], String> {
        let bytes = self.get(&view.buffer()).unwrap_or_default();
        let end = view.offset().checked_add(view.length());
        end.and_then(|end| bytes.get(view.offset()..end))
            .ok_or_else(|| {
                format!(
                    "buffer view {} goes from byte {} on for {} bytes, but buffer {} has {}",
                    view.index(),
                    view.offset(),
                    view.length(),
                    view.buffer().index(),
                    bytes.len()
                )
            })
    }

    /// Checks that an accessor has that shape and that all its bytes are there, so that the crate's readers, which trust
    /// the file, can be used.
    pub(super) fn check(
        &self,
        accessor: &Accessor<'_>,
        dimensions: Dimensions,
        types: &[DataType],
    ) -> Result<(), String> {
        let bad = |what: &str| Err(format!("accessor {} {what}", accessor.index()));
        if accessor.dimensions() != dimensions || !types.contains(&accessor.data_type()) {
            return bad(&format!(
                "holds {:?} of {:?}, not {dimensions:?} of {types:?}",
                accessor.dimensions(),
                accessor.data_type()
            ));
        }
        if accessor.count() == 0 {
            return bad("is empty");
        }
        if let Some(view) = accessor.view() {
            let span = Span {
                offset: accessor.offset(),
                size: accessor.size(),
                count: accessor.count(),
            };
            self.check_span(&view, span)
                .map_err(|e| format!("accessor {}: {e}", accessor.index()))?;
        } else if accessor.sparse().is_none() {
            return bad("has no data");
        } else if accessor.count() > MAX_ZEROS {
            return bad(&format!("has {} elements and no data", accessor.count()));
        }
        let Some(sparse) = accessor.sparse() else {
            return Ok(());
        };
        let (count, indices, values) = (sparse.count(), sparse.indices(), sparse.values());
        if count == 0 || count > accessor.count() {
            return bad(&format!(
                "has {count} sparse elements of {}",
                accessor.count()
            ));
        }
        let index_span = Span {
            offset: indices.offset(),
            size: indices.index_type().size(),
            count,
        };
        let value_span = Span {
            offset: values.offset(),
            size: accessor.size(),
            count,
        };
        self.check_span(&indices.view(), index_span)
            .and_then(|()| self.check_span(&values.view(), value_span))
            .map_err(|e| format!("accessor {}, sparse: {e}", accessor.index()))
    }

    fn check_span(&self, view: &View<'_>, span: Span) -> Result<(), String> {
        self.view(view)?;
        let stride = view.stride().unwrap_or(span.size);
        if stride < span.size {
            return Err(format!(
                "buffer view {} has a stride of {stride} bytes for elements of {}",
                view.index(),
                span.size
            ));
        }
        let end = (span.count - 1)
            .checked_mul(stride)
            .and_then(|n| n.checked_add(span.size))
            .and_then(|n| n.checked_add(span.offset));
        match end {
            Some(end) if end <= view.length() => Ok(()),
            _ => Err(format!(
                "{} elements from byte {} on do not fit buffer view {} of {} bytes",
                span.count,
                span.offset,
                view.index(),
                view.length()
            )),
        }
    }
}

/// Elements of an accessor within a buffer view, bytes.
#[derive(Clone, Copy)]
struct Span {
    offset: usize,
    size: usize,
    count: usize,
}

/// Bytes that a URI names or holds.
pub(super) fn read_uri(uri: &str, gltf: &Path) -> Result<Vec<u8>, SceneError> {
    match uri.strip_prefix("data:") {
        None => read_bytes(&beside(uri, gltf)?),
        Some(data) => {
            let shown: String = uri.chars().take(40).collect();
            let (head, body) = data
                .split_once(',')
                .ok_or_else(|| malformed(gltf, format!("{shown:?} is no data URI")))?;
            if !head.ends_with(";base64") {
                return Ok(decode_percent(body));
            }
            STANDARD
                .decode(body.trim())
                .map_err(|e| malformed(gltf, format!("{shown:?} is not base64: {e}")))
        }
    }
}

/// The file that a relative URI names.
pub(super) fn beside(uri: &str, gltf: &Path) -> Result<PathBuf, SceneError> {
    if uri.contains("://") {
        return Err(malformed(
            gltf,
            format!("{uri:?} is not beside the file; download it and name it by its path"),
        ));
    }
    let name = String::from_utf8_lossy(&decode_percent(uri)).into_owned();
    Ok(gltf.parent().unwrap_or(Path::new("")).join(name))
}

fn decode_percent(text: &str) -> Vec<u8> {
    percent_encoding::percent_decode_str(text).collect()
}

pub(super) fn malformed(path: &Path, what: String) -> SceneError {
    SceneError::new(path, ErrorKind::Malformed(what))
}
