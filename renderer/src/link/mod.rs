//! The display's side of the sockets: one [`Link`] to any number of shader servers.
//!
//! The display's thread asks and drains; a thread of the link's own runs the connections. Between them stands one
//! `state` behind a mutex that is never held while anything is waited for. Requests wait in a bounded queue, most
//! wanted first; each server takes its share of them as its credit allows. A server that is lost, or breaks a rule,
//! costs nothing but time: what it held is handed to the others, and it is tried again with growing pauses.

mod connection;
mod edits;
mod face;
mod process;
mod server;
mod state;
mod status;
#[cfg(test)]
mod testing;

pub use face::{
    Link, LinkConfig, LinkError, ReceivedSample, ServerSource, ShadowWish, WaitOutcome,
};
pub use server::ServerError;
#[cfg(test)]
pub(crate) fn testing_scene() -> protocol::scene::Scene {
    testing::scene(2)
}

pub use status::{LinkStatus, ServerPhase, ServerStatus};
