//! Session traces: every frame of a session both ways with its time, and what the display did with them.
//!
//! [`TraceWriter`] writes entries, [`TraceReader`] reads them: an [`Entry`] is a time and an [`Event`], of which the display's
//! own [`Step`]s are those that make its pictures. A trace needs no other file: it holds the scene. What follows a cut or
//! a damaged entry is not read, what stands before it is as good as ever. `PROTOCOL.md` gives every byte.

mod format;
mod reader;
mod writer;

pub use format::{Entry, Event, FORMAT, Header, Run, Shadowed, Step};
pub use reader::{Ending, OpenError, TraceReader};
pub use writer::{TraceWriter, WriteError};

#[cfg(test)]
mod tests;
