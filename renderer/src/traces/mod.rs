//! Session traces: recorded while a session goes on, and replayed.

mod answers;
mod compare;
mod desk;
mod draw;
mod follow;
mod marks;
mod open;
mod play;
mod recorder;
mod scene;
mod script;
mod serve;

pub use compare::Compared;
pub use desk::Served;
pub use draw::{Redrawn, draw};
pub use marks::{picture_digest, planned, shaped};
pub use open::{ReplayError, Trouble};
pub use play::play;
pub(crate) use recorder::runs_of;
pub use recorder::{RecordError, Recorded, Recorder, Recording, Tap};
pub use serve::serve;
