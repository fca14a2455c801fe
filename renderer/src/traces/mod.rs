//! Session traces: recorded while a session goes on, and replayed.

mod marks;
mod recorder;
mod scene;

pub use marks::{picture_digest, planned, shaped};
pub(crate) use recorder::runs_of;
pub use recorder::{RecordError, Recorded, Recorder, Recording, Tap};
