//! Where the checkout, its binaries and the shared test geometry are.

use std::path::{Path, PathBuf};

use crate::report::Places;

/// The repository that this crate was built from.
pub fn checkout() -> PathBuf {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    own.parent().unwrap_or(own).to_owned()
}

/// Real scenes with pictures by an independent renderer: the folder that the variable `EDGE_POINT_SHARED` names, or
/// `../shared` beside the checkout; none where it has no `references`.
pub fn shared() -> Option<PathBuf> {
    let beside = || checkout().parent().map(|parent| parent.join("shared"));
    let folder = std::env::var_os("EDGE_POINT_SHARED")
        .map(PathBuf::from)
        .or_else(beside)?;
    folder.join("references").is_dir().then_some(folder)
}

/// Both, for the report.
pub fn find() -> Places {
    Places {
        checkout: checkout(),
        shared: shared(),
    }
}
