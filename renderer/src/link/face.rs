//! What the display sees of the link.

use std::ffi::OsString;
use std::io;
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use protocol::ToServer;
use protocol::messages::{
    Camera, LightMove, ObjectMove, SHADOW_ERROR, Sample, SampleRequest, ShadowMethod, Texel, Triple,
};
use protocol::scene::Scene;
use protocol::secret::Secret;
use protocol::trace::Step;
use protocol::transfer::{EncodedScene, TransferError};
use protocol::validate::{ValueError, validate_camera};
use tokio::sync::watch;

use super::plan::{Plan, plan};
use super::server::Shared;
use super::state::State;
use super::status::{LinkStatus, ServerStatus};
use crate::traces::Recorder;

/// A sample that came, and what it belongs to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReceivedSample {
    /// The view that it was asked of.
    pub view: u32,
    /// The epoch in which it was traced, by the link's count.
    pub epoch: u32,
    /// The connection that it came on, as traces count them; 0 where nothing is recorded.
    pub connection: u32,
    /// The sample; its id is that of the request.
    pub sample: Sample,
    /// What a diffuse map did to it, if the server said so.
    pub texel: Option<Texel>,
}

/// Where a server comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ServerSource {
    /// One that runs already, as `HOST:PORT`; if the host is a name all servers that it leads to. On this machine, unless
    /// there is a secret.
    Connect(String),
    /// Any number that dial in here.
    Accept(SocketAddr),
    /// One to be started, and ended with the link. It is given `--listen 127.0.0.1:0 --parent-stdin` after its own
    /// arguments, prints `listening on ADDRESS` as its first line, and ends when its standard input does.
    Spawn {
        /// The program.
        program: PathBuf,
        /// Its own arguments.
        args: Vec<OsString>,
    },
}

/// Finds the addresses of `HOST:PORT`.
pub type LookUp = dyn Fn(&str) -> io::Result<Vec<SocketAddr>> + Send + Sync;

/// How to work with servers.
pub struct LinkConfig {
    /// The servers.
    pub servers: Vec<ServerSource>,
    /// Seeds the servers' random numbers.
    pub seed: u64,
    /// The display's name and version, for people.
    pub name: String,
    /// Most requests waiting or held and samples not yet drained, together.
    pub capacity: usize,
    /// A server that failed so often in a row counts as gone for [`Link::wait`], although it is tried on.
    pub attempts: u32,
    /// A server that answers nothing for so long is lost.
    pub timeout: Duration,
    /// What servers must know, and the display proves to them. Without it they are on this machine alone.
    pub secret: Option<Secret>,
    /// How host names, each with a port, are looked up: by the system unless told otherwise. May block.
    pub look_up: Arc<LookUp>,
    /// How the visibility of lights is wanted.
    pub shadows: ShadowWish,
    /// Called from the link's thread when samples came and none were waiting to be drained.
    pub waker: Option<Box<dyn Fn() + Send + Sync>>,
    /// Told of every frame and edit.
    pub recorder: Option<Recorder>,
}

impl LinkConfig {
    /// These servers, and what suits most uses: room for 2^18 requests, three attempts, the protocol's time-out.
    pub fn new(servers: Vec<ServerSource>, seed: u64) -> Self {
        Self {
            servers,
            seed,
            name: concat!("edge-point ", env!("CARGO_PKG_VERSION")).into(),
            capacity: 1 << 18,
            attempts: 3,
            timeout: Duration::from_secs(protocol::limits::PING_TIMEOUT_S),
            secret: None,
            look_up: Arc::new(|host| Ok(host.to_socket_addrs()?.collect())),
            shadows: ShadowWish::default(),
            waker: None,
            recorder: None,
        }
    }
}

/// How samples and the visibility of lights are wanted; servers that have no choice do as they do.
#[derive(Clone, Debug, PartialEq)]
pub struct ShadowWish {
    /// Samples are to be the same on every machine and in every run.
    pub steady: bool,
    /// Error that an automatic choice may make: root mean square over a light's penumbrae, as a share of the light in full
    /// view. In [0, 1].
    pub error: f32,
    /// By index of the light; those past the end are chosen automatically.
    pub methods: Vec<ShadowMethod>,
}

impl Default for ShadowWish {
    fn default() -> Self {
        Self {
            steady: false,
            error: SHADOW_ERROR,
            methods: Vec::new(),
        }
    }
}

/// The link cannot be made, or was asked for something that it cannot do.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The scene cannot be sent.
    #[error("the scene cannot be sent to a shader server: {0}")]
    Scene(#[from] TransferError),
    /// A camera or an edit holds a value that is not allowed.
    #[error(transparent)]
    Value(#[from] ValueError),
    /// No server was named.
    #[error("no shader server was named; name at least one")]
    NoServers,
    /// An address is not on this machine.
    #[error(
        "{0} is not a loopback address, where anybody may come or answer; give --secret-file on both sides"
    )]
    NotLoopback(SocketAddr),
    /// Servers cannot be waited for at an address.
    #[error("cannot listen for shader servers on {address}: {source}; is the port taken?")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// Why not.
        source: io::Error,
    },
    /// Too many servers were named.
    #[error("too many shader servers were named")]
    TooMany,
    /// Ids of requests do not grow.
    #[error("request {id} follows {newest}; ids must grow from one request to the next")]
    Ids {
        /// The id that is too small.
        id: u64,
        /// The largest so far.
        newest: u64,
    },
    /// The thread or its event loop cannot be started.
    #[error("cannot start the thread that talks to shader servers: {0}")]
    Thread(#[from] io::Error),
}

/// How a [`Link::wait`] ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaitOutcome {
    /// Every request was answered, cancelled or dropped.
    Complete,
    /// Time is up; the rest may still come.
    TimedOut,
    /// No server is left that could answer the rest.
    NoServer,
}

/// The display's link to all its servers. Nothing but [`Link::wait`] and the drop, which ends the servers that the link
/// started, waits for anything.
pub struct Link {
    shared: Arc<Shared>,
    closing: watch::Sender<bool>,
    thread: Option<JoinHandle<()>>,
    listening: Vec<SocketAddr>,
    attempts: u32,
    newest_id: Option<u64>,
}

impl Link {
    /// Checks and encodes the scene, and starts to connect.
    ///
    /// # Errors
    /// All but [`LinkError::Value`] and [`LinkError::Ids`]; servers that cannot be reached are no error but in
    /// [`Link::status`].
    pub fn start(config: LinkConfig, scene: Arc<Scene>) -> Result<Self, LinkError> {
        if config.servers.is_empty() {
            return Err(LinkError::NoServers);
        }
        let encoded = Arc::new(EncodedScene::new(&scene)?);
        if let Some(recorder) = &config.recorder {
            recorder.begin(config.seed, &encoded);
        }
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()?;
        let mut state = State::new(&scene, config.capacity);
        let plans = plan(&config, &mut state, &runtime)?;
        let listening = plans.iter().filter_map(Plan::listens).collect();
        let (closing, told) = watch::channel(false);
        let shared = Arc::new(Shared {
            state: Mutex::new(state),
            changed: Condvar::new(),
            waker: config.waker,
            closing: told,
            scene,
            encoded,
            name: config.name,
            shadows: ToServer::Shadows {
                steady: config.shadows.steady,
                error: config.shadows.error,
                methods: config.shadows.methods,
            },
            seed: config.seed,
            timeout: config.timeout,
            secret: config.secret,
            look_up: config.look_up,
            recorder: config.recorder,
        });
        let for_thread = Arc::clone(&shared);
        let thread = std::thread::Builder::new()
            .name("link".into())
            .spawn(move || {
                runtime.block_on(async move {
                    let mut all = tokio::task::JoinSet::new();
                    for plan in plans {
                        all.spawn(plan.run(Arc::clone(&for_thread)));
                    }
                    all.join_all().await;
                });
                // A name that is still being looked up must not hold up the display's end.
                runtime.shutdown_background();
            })?;
        let attempts = config.attempts;
        Ok(Self {
            shared,
            closing,
            thread: Some(thread),
            listening,
            attempts,
            newest_id: None,
        })
    }

    /// Where servers may dial in.
    pub fn listening(&self) -> &[SocketAddr] {
        &self.listening
    }

    /// Makes a camera known and returns the number of its view; numbers start at 1 and grow by one.
    ///
    /// # Errors
    /// [`LinkError::Value`].
    pub fn set_view(&mut self, camera: Camera) -> Result<u32, LinkError> {
        validate_camera(&camera)?;
        Ok(self.shared.lock().set_view(camera))
    }

    /// Asks for samples of a view, most wanted first, and before all that was asked earlier. Returns how many of them,
    /// from the front, there was room for; older requests give way to newer ones.
    ///
    /// # Errors
    /// [`LinkError::Ids`]: nothing was asked. Ids must grow throughout the life of the link.
    pub fn request(&mut self, view: u32, requests: &[SampleRequest]) -> Result<usize, LinkError> {
        let mut newest = self.newest_id;
        for request in requests {
            match newest {
                Some(newest) if request.id <= newest => {
                    return Err(LinkError::Ids {
                        id: request.id,
                        newest,
                    });
                }
                _ => newest = Some(request.id),
            }
        }
        self.newest_id = newest;
        let taken = self.shared.lock().request(view, requests);
        self.shared.wake_servers();
        Ok(taken)
    }

    /// Drops every request of views before this one; samples of them that are on their way may still come.
    pub fn cancel_before(&mut self, view: u32) {
        self.shared.lock().cancel(view);
        self.shared.wake_servers();
    }

    /// Moves objects and changes lights. Requests made from now on are traced in the new epoch, which is returned;
    /// samples and triples of older ones are counted and dropped.
    ///
    /// # Errors
    /// [`LinkError::Value`]: nothing was changed.
    pub fn edit(&mut self, objects: &[ObjectMove], lights: &[LightMove]) -> Result<u32, LinkError> {
        let mut state = self.shared.lock();
        let epoch = state.edits.add(objects, lights)?;
        state.forget_answers();
        if let Some(recorder) = &self.shared.recorder {
            // Before any connection can tell a server of it.
            recorder.step(Step::Edited {
                epoch,
                objects: objects.to_vec(),
                lights: lights.to_vec(),
            });
        }
        drop(state);
        self.shared.wake_servers();
        Ok(epoch)
    }

    /// Moves what came since the last time to the ends of these: samples by id, triples in their order, so that it makes no
    /// difference which server answered first.
    pub fn drain(&mut self, samples: &mut Vec<ReceivedSample>, triples: &mut Vec<Triple>) {
        let (first_sample, first_triple) = (samples.len(), triples.len());
        self.shared.lock().drain(samples, triples);
        samples[first_sample..].sort_unstable_by_key(|received| received.sample.id);
        triples[first_triple..].sort_unstable();
    }

    /// Waits until every request is answered, then moves all that came to the ends of these: samples by id, triples in
    /// their order, so that it makes no difference which server answered, and when.
    pub fn wait(
        &mut self,
        timeout: Duration,
        samples: &mut Vec<ReceivedSample>,
        triples: &mut Vec<Triple>,
    ) -> WaitOutcome {
        let (first_sample, first_triple) = (samples.len(), triples.len());
        let attempts = self.attempts;
        let mut state = self.shared.lock();
        let deadline = Instant::now() + timeout;
        let outcome = loop {
            if state.pending() == 0 {
                break WaitOutcome::Complete;
            }
            if !state.any_left(attempts) {
                break WaitOutcome::NoServer;
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                break WaitOutcome::TimedOut;
            }
            let woken = self.shared.changed.wait_timeout(state, left);
            state = woken.unwrap_or_else(PoisonError::into_inner).0;
        };
        state.drain(samples, triples);
        drop(state);
        samples[first_sample..].sort_unstable_by_key(|received| received.sample.id);
        triples[first_triple..].sort_unstable();
        outcome
    }

    /// Most requests that may be waiting or held, and samples that may be undrained, together.
    pub fn capacity(&self) -> usize {
        self.shared.lock().capacity()
    }

    /// The scene's epoch; 0 before the first edit.
    pub fn epoch(&self) -> u32 {
        self.shared.lock().edits.epoch()
    }

    /// How the link is doing.
    pub fn status(&self) -> LinkStatus {
        self.shared.lock().status()
    }

    /// How each server is doing.
    pub fn servers(&self) -> Vec<ServerStatus> {
        let state = self.shared.lock();
        state.slots.iter().map(|slot| slot.status.clone()).collect()
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        self.closing.send_replace(true);
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the thread that talks to shader servers panicked");
        }
    }
}

#[cfg(test)]
#[path = "face_tests.rs"]
mod tests;
