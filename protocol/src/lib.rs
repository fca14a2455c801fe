//! What a display and a shader server say to each other.
//!
//! [`ToServer`] and [`ToDisplay`] are the messages, [`scene::Scene`] is what the display sends before it asks for
//! anything. [`codec::encode`] and [`codec::decode`] turn either into bytes and back, [`framing`] puts those on a byte
//! stream, [`validate`] checks what came, [`transfer`] cuts scenes up and puts them together, and [`session`] says what
//! may be said when. [`secret`] says who may
//! come in at all, [`doorway`] keeps strangers few. [`limits`] holds every bound. `PROTOCOL.md` beside this crate gives every message to the byte.

pub mod codec;
#[cfg(feature = "conformance")]
pub mod conformance;
pub mod doorway;
pub mod framing;
pub mod handshake;
pub mod limits;
pub mod messages;
pub mod scene;
pub mod secret;
pub mod session;
pub mod trace;
pub mod transfer;
pub mod validate;

pub use codec::{decode, encode};
pub use messages::{ToDisplay, ToServer};
