//! A trace and its scene.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use protocol::limits::MAX_SCENE;
use protocol::scene::Scene;
use protocol::trace::{Ending, Entry, Event, Header, OpenError, TraceReader};
use protocol::transfer::{Assembler, TransferError};

/// A trace cannot be replayed.
#[derive(Debug, thiserror::Error)]
#[error("cannot replay `{}`: {why}", path.display())]
pub struct ReplayError {
    path: PathBuf,
    why: Trouble,
}

impl ReplayError {
    pub(super) fn new(path: &Path, why: impl Into<Trouble>) -> Self {
        Self {
            path: path.to_owned(),
            why: why.into(),
        }
    }
}

/// Why not.
#[derive(Debug, thiserror::Error)]
pub enum Trouble {
    /// It is no trace that is read here.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The file cannot be read, or a socket not be used.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The scene is not there.
    #[error("it is cut off inside the scene, before anything was drawn: nothing can be replayed")]
    NoScene,
    /// The scene is none.
    #[error("its scene cannot be used: {0}")]
    Scene(#[from] TransferError),
    /// An entry makes no sense after those before it.
    #[error("after picture {frame}, {what}: it was not recorded so, or is damaged")]
    Step {
        /// Pictures drawn before.
        frame: usize,
        /// What is wrong.
        what: String,
    },
    /// No picture can be drawn.
    #[error(
        "it holds no picture: it is cut off before the first, or every pixel was shaded (`--method full` and \
         `reference`); it can be served and played (--listen, --connect)"
    )]
    NoPicture,
    /// There is nothing that could be served or played.
    #[error("no server ever answered in it")]
    NoAnswers,
    /// An address is not on this machine.
    #[error("{0} is not a loopback address: traces are served and played on this machine alone")]
    NotLoopback(String),
    /// The display cannot work as it is told.
    #[error(transparent)]
    Output(#[from] crate::headless::OutputError),
    /// The display's own threads cannot be started.
    #[error("cannot start the display's threads: {0}; try fewer with --threads")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// A trace whose scene has been read.
pub(super) struct Trace {
    pub(super) header: Header,
    pub(super) scene: Arc<Scene>,
    /// The scene as it was sent.
    pub(super) encoded: Vec<u8>,
    reader: TraceReader<File>,
}

impl Trace {
    pub(super) fn open(path: &Path) -> Result<Self, Trouble> {
        let mut reader = TraceReader::new(File::open(path)?)?;
        let header = reader.header().clone();
        let mut assembler = Assembler::new(header.digest, header.scene_bytes, MAX_SCENE)?;
        let mut encoded = Vec::new();
        while !assembler.is_complete() {
            match reader.next_entry()?.map(|entry| entry.event) {
                Some(Event::Scene(data)) => {
                    assembler.add(&data)?;
                    encoded.extend_from_slice(&data);
                }
                _ => return Err(Trouble::NoScene),
            }
        }
        Ok(Self {
            scene: Arc::new(assembler.finish()?),
            header,
            encoded,
            reader,
        })
    }

    /// The next entry after the scene.
    pub(super) fn next(&mut self) -> Result<Option<Entry>, Trouble> {
        Ok(self.reader.next_entry()?)
    }

    /// How the trace ends, once there is no next entry; a warning if it does before its time.
    pub(super) fn warn_of_ending(&self, frames: usize) -> bool {
        match self.reader.ending() {
            Some(Ending::Cut { at }) => {
                tracing::warn!(
                    "the trace is cut off at byte {at}, after {frames} pictures: replayed up to there"
                );
                true
            }
            Some(Ending::Damaged { at }) => {
                tracing::warn!(
                    "the trace is damaged at byte {at}, after {frames} pictures: replayed up to there"
                );
                true
            }
            Some(Ending::Complete) | None => false,
        }
    }
}
