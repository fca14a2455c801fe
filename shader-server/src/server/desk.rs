//! One display's requests on their way through the pool.

use std::{
    collections::{HashSet, VecDeque},
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU32, Ordering},
    },
};

use protocol::{
    messages::{
        FaultCode, SHADOWS_VERSION, Sample, SampleRequest, TEXTURED_VERSION, TexturedSample,
        ToDisplay, Triple,
    },
    session::{ServerSession, Violation},
};
use tokio::sync::Notify;

use super::Shared;
use crate::{
    camera::Pinhole,
    shading::{Shaded, Shader},
    shadows::{Chosen, Visibility, Wish},
    stage::Stage,
};

/// Requests traced together and samples sent together: at most, and at least while there are more.
const CHUNK: usize = 64;
const SMALL_CHUNK: usize = 8;

/// Shadows told in an epoch; of more, displays keep no account.
const MOST_TRIPLES: usize = 1 << 20;

/// Messages that may wait to be written before chunks are held back.
const ROOM: usize = 64;

/// Requests of one view, in order of priority.
struct Batch {
    view: u32,
    pinhole: Pinhole,
    requests: std::vec::IntoIter<SampleRequest>,
}

/// What is known of one display, behind one lock that is never held while anything is traced or awaited.
pub(super) struct State {
    pub(super) rules: ServerSession,
    pub(super) seed: u64,
    /// Protocol version that the display speaks.
    pub(super) version: u16,
    /// How the display wants the visibility of lights found.
    pub(super) wish: Wish,
    current: Option<Current>,
    batches: VecDeque<Batch>,
    queued: usize,
    chunks_in_flight: usize,
    records_in_flight: usize,
    outgoing: VecDeque<ToDisplay>,
    triples_sent: HashSet<Triple>,
    traced: u64,
    rays: u64,
    closing: bool,
}

/// The scene in the state that edits have brought it to.
#[derive(Clone)]
pub(super) struct Current {
    pub(super) stage: Arc<Stage>,
    pub(super) visibility: Arc<Chosen>,
    pub(super) epoch: u32,
}

/// Requests come in, messages go out; chunks of requests are traced on the pool in between.
pub(super) struct Desk {
    shared: Arc<Shared>,
    state: Mutex<State>,
    /// A copy of the rules' number that tracing looks at between samples.
    cancelled_before: AtomicU32,
    /// There is something to write, or nothing will come any more.
    pub(super) to_write: Notify,
    /// Messages were taken to be written.
    pub(super) room: Notify,
}

/// Requests taken to be traced, and what they are traced in.
struct Chunk {
    view: u32,
    pinhole: Pinhole,
    requests: Vec<SampleRequest>,
    current: Current,
    seed: u64,
    /// The display takes textured samples.
    textured: bool,
}

struct Traced {
    samples: Vec<Sample>,
    textured: Vec<TexturedSample>,
    triples: Vec<Triple>,
    rays: u64,
}

impl Desk {
    pub(super) fn new(shared: Arc<Shared>, rules: ServerSession) -> Arc<Self> {
        let state = State {
            rules,
            seed: 0,
            version: 0,
            wish: Wish::default(),
            current: None,
            batches: VecDeque::new(),
            queued: 0,
            chunks_in_flight: 0,
            records_in_flight: 0,
            outgoing: VecDeque::new(),
            triples_sent: HashSet::new(),
            traced: 0,
            rays: 0,
            closing: false,
        };
        Arc::new(Self {
            shared,
            state: Mutex::new(state),
            cancelled_before: AtomicU32::new(0),
            to_write: Notify::new(),
            room: Notify::new(),
        })
    }

    pub(super) fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Queues a message.
    pub(super) fn send(&self, message: ToDisplay) {
        self.state().outgoing.push_back(message);
        self.to_write.notify_one();
    }

    /// Whether so much waits to be written that no more should be read.
    pub(super) fn is_full(&self) -> bool {
        self.state().outgoing.len() > 2 * ROOM
    }

    /// Takes what is to be written; nothing if nothing will come any more.
    pub(super) fn take_outgoing(self: &Arc<Self>) -> Option<VecDeque<ToDisplay>> {
        let mut state = self.state();
        if state.outgoing.is_empty() {
            return (!state.closing).then(VecDeque::new);
        }
        let taken = std::mem::take(&mut state.outgoing);
        self.room.notify_one();
        self.start_chunks(&mut state);
        Some(taken)
    }

    /// Puts a scene in place, as it is from now on, and tells the display how its lights' visibility is found.
    pub(super) fn set(&self, current: Current) {
        let mut state = self.state();
        if state.version >= SHADOWS_VERSION {
            state.outgoing.extend(current.visibility.told());
            self.to_write.notify_one();
        }
        state.current = Some(current);
        state.triples_sent.clear();
    }

    /// The scene as it is now.
    pub(super) fn current(&self) -> Option<Current> {
        self.state().current.clone()
    }

    /// Queues requests, most wanted first.
    pub(super) fn request(
        self: &Arc<Self>,
        view: u32,
        pinhole: Pinhole,
        requests: Vec<SampleRequest>,
    ) {
        let mut state = self.state();
        state.queued += requests.len();
        state.batches.push_back(Batch {
            view,
            pinhole,
            requests: requests.into_iter(),
        });
        self.start_chunks(&mut state);
    }

    /// Drops what is queued of older views and says so; chunks being traced stop at their next sample, and what they
    /// have done is dropped.
    pub(super) fn cancel(&self, views_before: u32) {
        self.cancelled_before
            .fetch_max(views_before, Ordering::Relaxed);
        let mut state = self.state();
        state.batches.retain(|batch| batch.view >= views_before);
        state.queued = state.batches.iter().map(|batch| batch.requests.len()).sum();
        let status = state.status();
        state.outgoing.push_back(status);
        self.to_write.notify_one();
    }

    /// Queues a status if the display has a scene.
    pub(super) fn report(&self) {
        let mut state = self.state();
        if state.current.is_some() && !state.closing && state.outgoing.len() < ROOM {
            let status = state.status();
            state.outgoing.push_back(status);
            self.to_write.notify_one();
        }
    }

    /// Says what rule the display broke, if it did, and takes nothing more.
    pub(super) fn close(&self, violation: Option<&Violation>) {
        self.cancelled_before.store(u32::MAX, Ordering::Relaxed);
        let mut state = self.state();
        if !state.closing {
            state.closing = true;
            state.batches.clear();
            state.queued = 0;
            state.outgoing.extend(violation.map(Violation::to_display));
        }
        self.to_write.notify_one();
        self.room.notify_one();
    }

    /// Gives the pool as much as there is room for.
    fn start_chunks(self: &Arc<Self>, state: &mut State) {
        let most = 2 * self.shared.threads;
        let wanted = state.queued.div_ceil(SMALL_CHUNK).min(most);
        while !state.closing
            && state.chunks_in_flight < wanted
            && state.outgoing.len() + state.chunks_in_flight < ROOM
        {
            state.chunks_in_flight += 1;
            let desk = Arc::clone(self);
            // First in, first out, so that displays take turns.
            self.shared.pool.spawn_fifo(move || desk.work());
        }
    }

    fn work(self: &Arc<Self>) {
        let chunk = self.state().take_chunk(self.shared.threads);
        let traced = chunk.map(|chunk| {
            let traced = catch_unwind(AssertUnwindSafe(|| self.trace(&chunk)));
            (chunk, traced)
        });
        let mut state = self.state();
        state.chunks_in_flight -= 1;
        match traced {
            Some((chunk, Ok(traced))) => {
                state.finish(chunk.view, chunk.current.epoch, traced);
                self.to_write.notify_one();
            }
            Some((_, Err(_))) => {
                drop(state);
                self.close(Some(&defect()));
                return;
            }
            None => {}
        }
        self.start_records(&mut state);
        self.start_chunks(&mut state);
    }

    /// Gives the pool what samples found missing, beside the samples: each thread takes turns.
    fn start_records(self: &Arc<Self>, state: &mut State) {
        let Some(Current { stage, .. }) = &state.current else {
            return;
        };
        let Some(cache) = stage.irradiance() else {
            return;
        };
        let wanted = cache.waiting().min(self.shared.threads);
        while !state.closing && state.records_in_flight < wanted {
            state.records_in_flight += 1;
            let (desk, stage) = (Arc::clone(self), Arc::clone(stage));
            self.shared.pool.spawn_fifo(move || desk.gather(&stage));
        }
    }

    fn gather(self: &Arc<Self>, stage: &Stage) {
        let gathered = catch_unwind(AssertUnwindSafe(|| {
            stage.irradiance().is_some_and(|cache| cache.work(stage))
        }));
        let mut state = self.state();
        state.records_in_flight -= 1;
        if gathered.is_err() {
            drop(state);
            self.close(Some(&defect()));
            return;
        }
        self.start_records(&mut state);
    }

    fn trace(&self, chunk: &Chunk) -> Traced {
        let Current {
            stage, visibility, ..
        } = &chunk.current;
        let mut shader =
            Shader::new(stage, &**visibility, chunk.seed).with_pixel(chunk.pinhole.pixel_slope());
        let mut samples = Vec::with_capacity(chunk.requests.len());
        let mut textured = Vec::new();
        let (mut rays, mut shaded) = (Vec::new(), Vec::new());
        for requests in chunk.requests.chunks(shader.batch()) {
            if chunk.view < self.cancelled_before.load(Ordering::Relaxed) {
                break;
            }
            rays.clear();
            rays.extend(requests.iter().map(|r| (r.id, chunk.pinhole.ray(r))));
            shader.shade_each(&rays, &mut shaded);
            for Shaded { sample, texel } in &shaded {
                match texel.filter(|_| chunk.textured) {
                    Some(texel) => textured.push(TexturedSample {
                        sample: *sample,
                        texel,
                    }),
                    None => samples.push(*sample),
                }
            }
        }
        Traced {
            samples,
            textured,
            rays: shader.rays(),
            triples: shader.take_triples(),
        }
    }
}

fn defect() -> Violation {
    let text = "shading failed; this is a defect of the server";
    Violation::new(FaultCode::Internal, text)
}

impl State {
    fn status(&self) -> ToDisplay {
        ToDisplay::Status {
            queued: u32::try_from(self.rules.held()).unwrap_or(u32::MAX),
            traced: self.traced,
            rays: self.rays,
            cancelled_before: self.rules.cancelled_before(),
        }
    }

    /// The next requests of the first batch: fewer where few are left, so that all threads end together.
    fn take_chunk(&mut self, threads: usize) -> Option<Chunk> {
        let current = self.current.clone()?;
        let most = CHUNK.max(current.visibility.batch());
        let count = (self.queued / (2 * threads)).clamp(SMALL_CHUNK, most);
        while let Some(batch) = self.batches.front_mut() {
            let requests: Vec<SampleRequest> = batch.requests.by_ref().take(count).collect();
            let (view, pinhole) = (batch.view, batch.pinhole);
            if batch.requests.len() == 0 {
                self.batches.pop_front();
            }
            if !requests.is_empty() {
                self.queued -= requests.len();
                return Some(Chunk {
                    view,
                    pinhole,
                    requests,
                    current,
                    seed: self.seed,
                    textured: self.version >= TEXTURED_VERSION,
                });
            }
        }
        None
    }

    fn finish(&mut self, view: u32, epoch: u32, mut traced: Traced) {
        self.traced += (traced.samples.len() + traced.textured.len()) as u64;
        self.rays += traced.rays;
        if self.closing {
            return;
        }
        // What was cancelled meanwhile is no longer held.
        traced
            .samples
            .retain(|sample| self.rules.release(sample.id));
        traced
            .textured
            .retain(|textured| self.rules.release(textured.sample.id));
        // Before the samples whose tracing met them.
        if self.current.as_ref().is_some_and(|now| now.epoch == epoch) {
            traced.triples.retain(|triple| {
                self.triples_sent.len() < MOST_TRIPLES && self.triples_sent.insert(*triple)
            });
            if !traced.triples.is_empty() {
                self.outgoing.push_back(ToDisplay::Triples {
                    epoch,
                    triples: traced.triples,
                });
            }
        }
        if !traced.samples.is_empty() {
            self.outgoing.push_back(ToDisplay::Samples {
                view,
                epoch,
                samples: traced.samples,
            });
        }
        if !traced.textured.is_empty() {
            self.outgoing.push_back(ToDisplay::Textured {
                view,
                epoch,
                samples: traced.textured,
            });
        }
    }
}
