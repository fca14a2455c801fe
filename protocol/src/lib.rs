//! What a display and a shader server say to each other.
//!
//! [`ToServer`] and [`ToDisplay`] are the messages, [`scene::Scene`] is what the display sends before it asks for
//! anything, [`encode`] and [`decode`] turn either into bytes and back, and [`framing`] puts those on a byte stream.
//! `PROTOCOL.md` beside this crate gives every message to the byte.

pub mod messages;
pub mod scene;

pub use messages::{ToDisplay, ToServer};
