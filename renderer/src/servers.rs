//! The shader servers as the frame loops use them: the link, and what becomes of its troubles.

use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use protocol::limits::MAX_TRIPLES;
use protocol::messages::{Camera, LightShadows, SampleRequest, ShadowMethod, Triple};
use protocol::scene::Scene;
use protocol::secret::{Secret, SecretFileError};
use protocol::trace::{Run, Step};

use crate::cli::ServerArgs;
use crate::frame::{Edit, Received};
use crate::link::{
    Link, LinkConfig, LinkError, LinkStatus, ReceivedSample, ServerSource, ShadowWish, WaitOutcome,
};
use crate::traces::{Recorder, runs_of};

/// Longest that a lockstep frame waits for its samples.
const PATIENCE: Duration = Duration::from_secs(600);

/// Why there are no samples.
#[derive(Debug, thiserror::Error)]
pub enum ServersError {
    /// The link refused something.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The program cannot find itself, to start it as a shader server.
    #[error(
        "cannot start a shader server: the path of this program is not known ({0}); use --shader or --connect"
    )]
    OwnPath(std::io::Error),
    /// The secret cannot be read.
    #[error(transparent)]
    Secret(#[from] SecretFileError),
    /// No server ever answered.
    #[error("no shader server can be reached: {0}")]
    Unreachable(String),
    /// A frame waited too long.
    #[error("the shader servers did not deliver a frame's samples within {} s", PATIENCE.as_secs())]
    Stalled,
}

/// Strata a side of an area light where each is asked one ray. Adaptive rays stop where the first all agree, which leaves
/// out up to 1.4 % of a light beside its penumbra: too much for the mean of a thousand samples.
const EVEN_STRATA: usize = 4;

/// All shader servers of a run.
pub struct Servers {
    link: Link,
    samples: Vec<ReceivedSample>,
    met: Vec<Triple>,
    triples: std::collections::BTreeSet<Triple>,
    news: Vec<Triple>,
    warned: bool,
    recorder: Option<Recorder>,
    /// The samples given last, for the recorder.
    given: Vec<Run>,
}

impl Servers {
    /// Starts or connects to the servers that the arguments name; by default this program, run again as one. `pixels` is
    /// the size of the pictures, `shadows` how the scene wants the visibility of its lights found, `waker` is called from another thread when samples come.
    ///
    /// # Errors
    /// If the arguments or the scene cannot be used; a server that cannot be reached is none.
    pub fn start(
        args: &ServerArgs,
        scene: &Arc<Scene>,
        shadows: &[ShadowMethod],
        seed: u64,
        pixels: usize,
        waker: Option<Box<dyn Fn() + Send + Sync>>,
    ) -> Result<Self, ServersError> {
        let mut config = LinkConfig::new(sources(args)?, seed);
        config.secret = secret(args)?;
        config.capacity = config.capacity.max(2 * pixels);
        config.waker = waker;
        config.recorder.clone_from(&args.recorder);
        config.shadows = ShadowWish {
            steady: args.steady,
            error: args.shadow_error,
            methods: match args.shadows {
                Some(method) => vec![method.into(); scene.lights.len()],
                None => shadows.to_vec(),
            },
        };
        let link = Link::start(config, Arc::clone(scene))?;
        for address in link.listening() {
            eprintln!("waiting for shader servers on {address}");
        }
        Ok(Self {
            link,
            samples: Vec::new(),
            met: Vec::new(),
            triples: std::collections::BTreeSet::new(),
            news: Vec::new(),
            warned: false,
            recorder: args.recorder.clone(),
            given: Vec::new(),
        })
    }

    /// Names a camera; samples can then be asked for in it.
    ///
    /// # Errors
    /// If the camera's values make no picture.
    pub fn set_view(&mut self, camera: &Camera) -> Result<u32, ServersError> {
        Ok(self.link.set_view(*camera)?)
    }

    /// Asks for samples of a view, most wanted first; ids must grow from call to call.
    ///
    /// # Errors
    /// If they do not.
    pub fn request(&mut self, view: u32, requests: &[SampleRequest]) -> Result<(), ServersError> {
        if !requests.is_empty() {
            self.link.request(view, requests)?;
        }
        Ok(())
    }

    /// Moves objects and lights; gives the epoch that begins with it. Samples of older ones come no more, and triples that
    /// hold anything that moved are forgotten.
    ///
    /// # Errors
    /// If the edit names what is not there or holds a value that is not allowed: nothing was changed.
    pub fn edit(&mut self, edit: &Edit) -> Result<u32, ServersError> {
        let epoch = self.link.edit(&edit.objects, &edit.lights)?;
        let moved = |object: u32| edit.objects.iter().any(|m| m.object == object);
        let changed = |light: u32| edit.lights.iter().any(|m| m.light == light);
        self.triples
            .retain(|t| !(changed(t.light) || moved(t.blocker) || moved(t.receiver)));
        Ok(epoch)
    }

    /// Drops what is still wanted of views before this one.
    pub fn cancel_before(&mut self, view: u32) {
        self.link.cancel_before(view);
    }

    /// Waits for every sample asked for and gives them in the order of their ids. With no server left, gives what came.
    ///
    /// # Errors
    /// If no server ever answered, or none does in ten minutes.
    pub fn wait_all(&mut self, received: &mut Vec<Received>) -> Result<(), ServersError> {
        let outcome = self.link.wait(PATIENCE, &mut self.samples, &mut self.met);
        self.hand_over(received);
        match outcome {
            WaitOutcome::Complete => Ok(()),
            WaitOutcome::TimedOut => Err(ServersError::Stalled),
            WaitOutcome::NoServer => {
                let status = self.link.status();
                let why = status
                    .last_fault
                    .as_deref()
                    .unwrap_or("it gave no reason")
                    .to_owned();
                if status.samples == 0 {
                    return Err(ServersError::Unreachable(why));
                }
                if !std::mem::replace(&mut self.warned, true) {
                    tracing::warn!(
                        "no shader server is left ({why}); going on with the samples there are"
                    );
                }
                Ok(())
            }
        }
    }

    /// Gives what came since the last time, without waiting.
    pub fn drain(&mut self, received: &mut Vec<Received>) {
        self.link.drain(&mut self.samples, &mut self.met);
        self.hand_over(received);
    }

    fn hand_over(&mut self, received: &mut Vec<Received>) {
        if self.recorder.is_some() {
            self.given.clear();
            runs_of(&self.samples, &mut self.given);
        }
        let samples = self.samples.drain(..);
        received.extend(samples.map(|r| Received {
            view: r.view,
            epoch: r.epoch,
            sample: r.sample,
            texel: r.texel,
        }));
        for triple in self.met.drain(..) {
            if self.triples.insert(triple) {
                self.news.push(triple);
            }
        }
    }

    /// Servers that take requests.
    pub fn connected(&self) -> usize {
        self.link.status().connected
    }

    /// Triples that have come since this was called last, in their order.
    pub fn new_triples(&mut self) -> Vec<Triple> {
        let mut news = std::mem::take(&mut self.news);
        news.sort_unstable();
        for triples in news.chunks(MAX_TRIPLES) {
            let triples = || triples.to_vec();
            self.note(|| Step::Learned { triples: triples() });
        }
        news
    }

    /// Takes down what the display does, if the session is recorded.
    pub fn note(&self, step: impl FnOnce() -> Step) {
        if let Some(recorder) = &self.recorder {
            recorder.step(step());
        }
    }

    /// Takes down that the display takes in the samples given last, for the next picture of this view.
    pub fn note_taken(&self, view: u32) {
        if let Some(recorder) = &self.recorder {
            recorder.took(view, &self.given);
        }
    }

    /// Whether the session is recorded.
    pub fn recorded(&self) -> bool {
        self.recorder.is_some()
    }

    /// Light-blocker-receiver triples that servers have met.
    pub fn triples(&self) -> usize {
        self.triples.len()
    }

    /// How a server finds the visibility of lights, if one said so.
    pub fn shadows(&self) -> Vec<LightShadows> {
        let servers = self.link.servers();
        let told = servers.iter().find(|server| !server.shadows.is_empty());
        told.map_or_else(Vec::new, |server| server.shadows.to_vec())
    }

    /// How the link is doing.
    pub fn status(&self) -> LinkStatus {
        self.link.status()
    }
}

/// The secret that the arguments name. One that others on this machine can read is taken, with a warning.
fn secret(args: &ServerArgs) -> Result<Option<Secret>, ServersError> {
    let Some(path) = &args.secret_file else {
        return Ok(None);
    };
    let secret = Secret::read(path)?;
    if secret.is_readable_by_others() {
        tracing::warn!(
            "every user of this machine can read {}; `chmod 600` it",
            path.display()
        );
    }
    Ok(Some(secret))
}

fn sources(args: &ServerArgs) -> Result<Vec<ServerSource>, ServersError> {
    let connect = args.connect.iter().cloned().map(ServerSource::Connect);
    let accept = args.accept.map(ServerSource::Accept);
    let found: Vec<ServerSource> = connect.chain(accept).collect();
    if !found.is_empty() {
        return Ok(found);
    }
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let threads = args
        .shader_threads
        .map_or_else(|| (cores / usize::from(args.shaders)).max(1), usize::from);
    let (program, mut own): (PathBuf, Vec<OsString>) = match &args.shader {
        Some(program) => (program.clone(), Vec::new()),
        None => (
            std::env::current_exe().map_err(ServersError::OwnPath)?,
            vec!["shader-server".into()],
        ),
    };
    // A foreign program is only told its threads if they were asked for: it need not know the option.
    if args.shader.is_none() || args.shader_threads.is_some() {
        own.extend(["--threads".into(), threads.to_string().into()]);
    }
    if args.shader.is_none()
        && let Some(path) = &args.secret_file
    {
        own.extend(["--secret-file".into(), path.into()]);
    }
    if args.shader.is_none() && args.even_shadow_rays {
        let strata = EVEN_STRATA.to_string();
        own.extend(
            [
                "--shadows",
                "rays",
                "--shadow-rays",
                "1",
                "--light-strata",
                &strata,
            ]
            .map(OsString::from),
        );
    }
    let source = ServerSource::Spawn { program, args: own };
    Ok(vec![source; usize::from(args.shaders)])
}
