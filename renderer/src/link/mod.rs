//! The display's side of the sockets: one [`Link`] to any number of shader servers.
//!
//! The display's thread asks and drains; a thread of the link's own runs the connections. Between them stands one
//! `state` behind a mutex that is never held while anything is waited for. Requests wait in a bounded queue, most
//! wanted first; each server takes its share of them as its credit and its speed allow (`flow`, `slots`). A server that is
//! lost, or breaks a rule, costs nothing but time: what it held is handed to the others, and it is tried again. One that is
//! too slow keeps what it holds, but others are asked for it `again`, and the first answer counts.

mod accept;
mod again;
mod connection;
mod edits;
mod face;
mod flow;
#[cfg(test)]
mod many_tests;
mod named;
mod plan;
mod process;
mod sending;
mod server;
mod slots;
mod state;
mod status;
#[cfg(test)]
mod testing;

pub use face::{
    Link, LinkConfig, LinkError, LookUp, ReceivedSample, ServerSource, ShadowWish, WaitOutcome,
};
pub use server::ServerError;
#[cfg(test)]
pub(crate) fn testing_scene() -> protocol::scene::Scene {
    testing::scene(2)
}

pub use status::{LinkStatus, ServerPhase, ServerStatus};
