//! A ray-tracing shader server.
//!
//! [`run`] serves displays on a socket: scenes and requests come in, samples and shadows' triples go out. What it is
//! made of can be used without sockets: [`Stage`] is a scene ready for rays, [`Shader`] turns rays into samples,
//! [`shadows::Visibility`] is how much of a light a point sees. [`main_from_args`] is the whole program, for binaries that
//! start themselves as a server.

pub mod camera;
mod cli;
pub mod irradiance;
pub mod lights;
mod mapped;
pub mod random;
pub mod server;
pub mod shading;
pub mod shadows;
pub mod stage;

pub use cli::main_from_args;
pub use mapped::Beam;
pub use server::{Entrance, ServerConfig, ServerError, run};
pub use shading::Shader;
pub use stage::{Stage, StageError};
