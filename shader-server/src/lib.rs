//! A ray-tracing shader server.
//!
//! [`Stage`] is a scene ready for rays, [`Shader`] turns rays into samples.

pub mod camera;
pub mod lights;
pub mod random;
pub mod shading;
pub mod shadows;
pub mod stage;
pub mod texture;

pub use shading::Shader;
pub use stage::{Stage, StageError};
