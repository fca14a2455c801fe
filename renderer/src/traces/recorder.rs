//! Writes a session's trace while it goes on. Nothing that is recorded waits for the file: a thread of the recorder's own
//! writes, and if it cannot keep up the recording ends there.

use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use bytes::Bytes;
use protocol::trace::{Entry, Event, Header, Run, Step, TraceWriter, WriteError};
use protocol::transfer::EncodedScene;

use super::scene::SceneFrames;
use crate::link::ReceivedSample;

/// Most bytes that may wait to be written.
const MOST_WAITING: usize = 256 << 20;
/// What an entry takes besides its payload, bytes, about.
const ENTRY: usize = 64;
/// Longest that an entry is kept from the file.
const FLUSH: Duration = Duration::from_millis(500);
/// Bytes of the scene in an entry.
const SCENE_PIECE: usize = 1 << 20;
/// Runs of samples in a step, at most.
const MOST_RUNS: usize = 1 << 16;

/// A session could not be recorded, or not to its end.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file cannot be written.
    #[error("cannot write the trace `{}`: {source}; check that the folder can be written to and the disk has room", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: WriteError,
    },
    /// The file could not be written as fast as the session went on.
    #[error("the trace `{}` ends before the session: it could not be written fast enough; use a faster disk", path.display())]
    Overrun {
        /// The file.
        path: PathBuf,
    },
}

/// What a recording came to.
#[derive(Clone, Copy, Debug)]
pub struct Recorded {
    /// Length of the trace, bytes.
    pub bytes: u64,
    /// Pictures drawn.
    pub frames: u32,
}

enum Item {
    Begin(Box<Header>, Arc<EncodedScene>),
    Entry(Entry),
    Finish,
}

struct Shared {
    start: Instant,
    queue: Sender<Item>,
    waiting: AtomicUsize,
    overrun: AtomicBool,
    connections: AtomicU32,
    frames: AtomicU32,
    options: String,
}

/// A recording under way. Dropped without [`Recording::finish`] it leaves a trace without an end, as a crash does.
pub struct Recording {
    path: PathBuf,
    recorder: Recorder,
    thread: JoinHandle<Result<u64, WriteError>>,
}

impl Recording {
    /// Makes the file. `options` says as JSON what is recorded, for people.
    ///
    /// # Errors
    /// [`RecordError::Write`].
    pub fn create(path: &Path, options: String) -> Result<Self, RecordError> {
        let failed = |source: io::Error| RecordError::Write {
            path: path.to_owned(),
            source: source.into(),
        };
        let file = File::create(path).map_err(failed)?;
        let (queue, items) = channel();
        let shared = Arc::new(Shared {
            start: Instant::now(),
            queue,
            waiting: AtomicUsize::new(0),
            overrun: AtomicBool::new(false),
            connections: AtomicU32::new(0),
            frames: AtomicU32::new(0),
            options,
        });
        let for_thread = Arc::clone(&shared);
        let thread = std::thread::Builder::new()
            .name("trace".into())
            .spawn(move || write(file, &items, &for_thread))
            .map_err(failed)?;
        Ok(Self {
            path: path.to_owned(),
            recorder: Recorder(shared),
            thread,
        })
    }

    /// What is to be told of everything.
    pub fn recorder(&self) -> Recorder {
        self.recorder.clone()
    }

    /// Writes what waits, and the end. Whatever was recorded must be over.
    ///
    /// # Errors
    /// Every [`RecordError`].
    pub fn finish(self) -> Result<Recorded, RecordError> {
        let shared = &self.recorder.0;
        let frames = shared.frames.load(Ordering::Relaxed);
        self.recorder.put(Event::End { frames });
        // The thread may have ended by itself: then it says why.
        let _ = shared.queue.send(Item::Finish);
        let path = self.path;
        match self.thread.join() {
            Ok(Ok(_)) if shared.overrun.load(Ordering::Relaxed) => {
                Err(RecordError::Overrun { path })
            }
            Ok(Ok(bytes)) => Ok(Recorded { bytes, frames }),
            Ok(Err(source)) => Err(RecordError::Write { path, source }),
            Err(_) => Err(RecordError::Write {
                path,
                source: io::Error::other("the thread that writes it panicked").into(),
            }),
        }
    }
}

/// Takes down what happens; clones write the same trace.
#[derive(Clone)]
pub struct Recorder(Arc<Shared>);

impl std::fmt::Debug for Recorder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Recorder").finish()
    }
}

impl Recorder {
    /// Which scene the session is about; once, before everything else.
    pub fn begin(&self, seed: u64, scene: &Arc<EncodedScene>) {
        let header = Header {
            seed,
            digest: scene.digest(),
            scene_bytes: scene.bytes().len() as u64,
            program: concat!("edge-point ", env!("CARGO_PKG_VERSION")).into(),
            options: self.0.options.clone(),
        };
        // If the thread has ended, it says why at the end.
        let _ = self
            .0
            .queue
            .send(Item::Begin(Box::new(header), Arc::clone(scene)));
    }

    /// The display does something.
    pub fn step(&self, step: Step) {
        if matches!(step, Step::Drawn { .. }) {
            self.0.frames.fetch_add(1, Ordering::Relaxed);
        }
        self.put(Event::Step(step));
    }

    /// The display takes samples in, for the next picture of this view.
    pub fn took(&self, view: u32, runs: &[Run]) {
        let mut pieces = runs.chunks(MOST_RUNS);
        let first = pieces.next().unwrap_or(&[]);
        for piece in std::iter::once(first).chain(pieces) {
            let samples = piece.to_vec();
            self.step(Step::Took { view, samples });
        }
    }

    fn put(&self, event: Event) {
        if self.0.overrun.load(Ordering::Relaxed) {
            return;
        }
        let entry = Entry {
            time_us: self.0.start.elapsed().as_micros() as u64,
            event,
        };
        let size = size(&entry.event);
        if self.0.waiting.fetch_add(size, Ordering::Relaxed) + size > MOST_WAITING {
            self.0.overrun.store(true, Ordering::Relaxed);
            tracing::warn!("the trace cannot be written fast enough: it ends here");
            return;
        }
        // If the thread has ended, it says why at the end.
        let _ = self.0.queue.send(Item::Entry(entry));
    }
}

/// Runs of consecutive ids in samples.
pub(crate) fn runs_of<'a>(
    samples: impl IntoIterator<Item = &'a ReceivedSample>,
    runs: &mut Vec<Run>,
) {
    for received in samples {
        let (id, connection) = (received.sample.id, received.connection);
        match runs.last_mut() {
            Some(run)
                if run.connection == connection
                    && run.count < u32::MAX
                    && run.first.checked_add(u64::from(run.count)) == Some(id) =>
            {
                run.count += 1;
            }
            _ => runs.push(Run {
                first: id,
                count: 1,
                connection,
            }),
        }
    }
}

/// Takes down what goes through one connection; does nothing where nothing is recorded.
#[derive(Debug)]
pub struct Tap {
    recorder: Option<Recorder>,
    connection: u32,
}

impl Tap {
    /// A connection to a server has been made.
    pub fn open(recorder: Option<&Recorder>, server: usize) -> Self {
        let Some(recorder) = recorder.cloned() else {
            return Self {
                recorder: None,
                connection: 0,
            };
        };
        let connection = recorder.0.connections.fetch_add(1, Ordering::Relaxed) + 1;
        let server = u32::try_from(server).unwrap_or(u32::MAX);
        recorder.put(Event::Opened { connection, server });
        Self {
            recorder: Some(recorder),
            connection,
        }
    }

    /// The connection's number in the trace.
    pub fn connection(&self) -> u32 {
        self.connection
    }

    /// A frame with this payload is sent.
    pub fn sent(&self, payload: &Bytes) {
        let (connection, frame) = (self.connection, payload);
        self.put(|| Event::Sent {
            connection,
            frame: frame.clone(),
        });
    }

    /// A frame with this payload has been received.
    pub fn received(&self, payload: &Bytes) {
        let (connection, frame) = (self.connection, payload);
        self.put(|| Event::Received {
            connection,
            frame: frame.clone(),
        });
    }

    /// The connection has ended.
    pub fn closed(&self, why: &str) {
        let connection = self.connection;
        self.put(|| Event::Closed {
            connection,
            why: why.into(),
        });
    }

    fn put(&self, event: impl FnOnce() -> Event) {
        if let Some(recorder) = &self.recorder {
            recorder.put(event());
        }
    }
}

/// What an event takes while it waits, bytes, about.
fn size(event: &Event) -> usize {
    ENTRY
        + match event {
            Event::Sent { frame, .. } | Event::Received { frame, .. } => frame.len(),
            Event::Step(Step::Took { samples, .. }) => size_of_val(&samples[..]),
            Event::Step(Step::Learned { triples }) => size_of_val(&triples[..]),
            Event::Step(Step::Edited {
                objects, lights, ..
            }) => size_of_val(&objects[..]) + size_of_val(&lights[..]),
            _ => 0,
        }
}

/// Writes items until the last. Returns the trace's length, bytes.
fn write(file: File, items: &Receiver<Item>, shared: &Shared) -> Result<u64, WriteError> {
    let mut output = Some(BufWriter::with_capacity(1 << 20, file));
    let mut writer: Option<(TraceWriter<_>, SceneFrames)> = None;
    let mut flushed = Instant::now();
    loop {
        match items.recv_timeout(FLUSH) {
            Ok(Item::Begin(header, scene)) => {
                if let Some(output) = output.take() {
                    let mut trace = TraceWriter::new(output, &header)?;
                    write_scene(&mut trace, scene.bytes())?;
                    writer = Some((trace, SceneFrames::new(scene)));
                }
            }
            Ok(Item::Entry(mut entry)) => {
                shared
                    .waiting
                    .fetch_sub(size(&entry.event), Ordering::Relaxed);
                if let Some((trace, frames)) = &mut writer {
                    frames.shorten(&mut entry.event);
                    trace.write(entry)?;
                }
            }
            Ok(Item::Finish) | Err(RecvTimeoutError::Disconnected) => break,
            Err(RecvTimeoutError::Timeout) => {}
        }
        if flushed.elapsed() >= FLUSH
            && let Some((trace, _)) = &mut writer
        {
            trace.flush()?;
            flushed = Instant::now();
        }
    }
    let Some((mut trace, _)) = writer else {
        return Ok(0);
    };
    trace.flush()?;
    Ok(trace.written())
}

fn write_scene<W: io::Write>(trace: &mut TraceWriter<W>, bytes: &[u8]) -> Result<(), WriteError> {
    for piece in bytes.chunks(SCENE_PIECE) {
        let event = Event::Scene(Bytes::copy_from_slice(piece));
        trace.write(Entry { time_us: 0, event })?;
    }
    Ok(())
}
