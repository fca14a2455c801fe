//! Scenes: the file format, mesh loaders and procedural generators.
//!
//! [`load()`] turns a scene file or a mesh file into a [`LoadedScene`]: the tables that shader servers are sent
//! ([`protocol::scene::Scene`]), where the camera starts, its paths, and a [`LoadReport`] of what was broken in the
//! geometry. `README.md` beside this crate gives every key of a scene file.

mod assemble;
mod builtin;
mod error;
mod format;
mod generate;
mod geometry;
mod lights;
mod load;
mod loaders;
mod motion;
mod normals;
mod path;
mod paths;
mod report;
mod textures;
mod transform;

pub use builtin::{DEFAULT, builtin, builtin_names, builtin_text, open};
pub use error::{ErrorKind, SceneError};
pub use load::{CameraSpec, LoadedScene, load};
pub use motion::{Motion, MotionKey, Moving};
pub use path::{CameraPath, PathKey, Timing};
pub use report::LoadReport;
