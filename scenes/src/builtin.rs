//! Scenes that are part of the program.

use std::path::Path;

use crate::error::{ErrorKind, SceneError};
use crate::load::{LoadedScene, load, load_text};

/// The scene to show if none is asked for.
pub const DEFAULT: &str = "chains";

const FILES: [(&str, &str); 14] = [
    ("chains", include_str!("../chains.toml")),
    ("rooms", include_str!("../rooms.toml")),
    ("torus", include_str!("../torus.toml")),
    ("grid", include_str!("../grid.toml")),
    ("mack", include_str!("../mack.toml")),
    ("head", include_str!("../head.toml")),
    ("dragon", include_str!("../dragon.toml")),
    ("grids", include_str!("../grids.toml")),
    ("flowers", include_str!("../flowers.toml")),
    ("court", include_str!("../court.toml")),
    ("soft2", include_str!("../soft2.toml")),
    ("soft6", include_str!("../soft6.toml")),
    ("soft8", include_str!("../soft8.toml")),
    ("soft9", include_str!("../soft9.toml")),
];

/// Names that [`builtin`] knows.
pub fn builtin_names() -> impl Iterator<Item = &'static str> {
    FILES.iter().map(|(name, _)| *name)
}

/// A scene that is part of the program, by name; needs no files.
///
/// # Errors
/// There is no such name.
pub fn builtin(name: &str) -> Result<LoadedScene, SceneError> {
    match FILES.iter().find(|(n, _)| *n == name) {
        Some((_, text)) => load_text(text, Path::new(&format!("{name}.toml"))),
        None => {
            let names = builtin_names().collect::<Vec<_>>().join(", ");
            Err(SceneError::new(name, ErrorKind::UnknownBuiltin(names)))
        }
    }
}

/// The scene file of a built-in scene, to make variants of; needs no other files.
pub fn builtin_text(name: &str) -> Option<&'static str> {
    FILES
        .iter()
        .find(|(n, _)| *n == name)
        .map(|(_, text)| *text)
}

/// What a person may type: the path of a scene or mesh file, or the name of a built-in scene if no such file exists.
///
/// # Errors
/// Those of [`load`].
pub fn open(path_or_name: &str) -> Result<LoadedScene, SceneError> {
    let path = Path::new(path_or_name);
    if !path.exists() && builtin_names().any(|n| n == path_or_name) {
        return builtin(path_or_name);
    }
    load(path)
}
