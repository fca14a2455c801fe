//! The server: sockets on tokio, rays on a rayon pool, bounded queues in between.
//!
//! [`run`] accepts displays, or visits them, until told to stop. Each display is a `connection` (reads and writes messages) with a
//! `desk` (holds its requests, hands them to the pool in chunks, collects samples). Nothing that one
//! display does or leaves undone holds up another: a chunk is only begun when there is room for its result.

mod cache;
mod connection;
mod desk;

use std::{
    io, net::SocketAddr, num::NonZeroUsize, sync::Arc, thread::available_parallelism,
    time::Duration,
};

use protocol::{
    doorway::{Doorway, Guest},
    limits::{MAX_BATCH, MAX_GUESTS, MAX_SCENE},
    messages::Capabilities,
    secret::{self, Role, Secret, SecretError},
};
use tokio::{
    net::{TcpListener, TcpStream},
    sync::Semaphore,
    task::JoinSet,
};

use crate::{irradiance::Patience, shadows::ShadowOptions};
use cache::SceneCache;

/// Displays served at once; a further one is told so.
const MAX_DISPLAYS: usize = 64;
/// Pause after a connection failed before it was accepted, as when no more files can be opened.
const PAUSE_TO_ACCEPT: Duration = Duration::from_millis(50);
/// Between visits to a display: a display that comes back has its servers within a second.
const PAUSE_TO_DIAL: Duration = Duration::from_millis(500);

/// How a server works.
#[derive(Clone, Debug)]
pub struct ServerConfig {
    /// Threads that trace rays; all of the machine's if not given.
    pub threads: Option<NonZeroUsize>,
    /// How visibility of lights is found.
    pub shadows: ShadowOptions,
    /// Whether samples wait for the irradiance records that they need, in scenes with indirect light.
    pub patience: Patience,
    /// Requests that each display may have outstanding.
    pub credits: u32,
    /// Largest scene taken, encoded bytes.
    pub max_scene_bytes: u64,
    /// What displays must know, and this server proves to them.
    pub secret: Option<Secret>,
}

impl Default for ServerConfig {
    fn default() -> Self {
        Self {
            threads: None,
            shadows: ShadowOptions::default(),
            patience: Patience::AtOnce,
            credits: 1 << 16,
            max_scene_bytes: MAX_SCENE,
            secret: None,
        }
    }
}

/// A server cannot run.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// Its threads cannot be started.
    #[error("cannot start the threads that trace rays: {0}; try fewer --threads")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// What all connections share.
struct Shared {
    config: ServerConfig,
    threads: usize,
    pool: rayon::ThreadPool,
    cache: SceneCache,
    /// One for each display that may be served.
    places: Arc<Semaphore>,
}

impl Shared {
    fn new(config: ServerConfig) -> Result<Self, ServerError> {
        let threads = config.threads.or_else(|| available_parallelism().ok());
        let threads = threads.map_or(1, NonZeroUsize::get);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|index| format!("rays-{index}"))
            .build()?;
        Ok(Self {
            config,
            threads,
            pool,
            cache: SceneCache::default(),
            places: Arc::new(Semaphore::new(MAX_DISPLAYS)),
        })
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities {
            credits: self.config.credits,
            max_batch: MAX_BATCH.min(self.config.credits),
            triples: true,
            edits: true,
            threads: u32::try_from(self.threads).unwrap_or(u32::MAX),
        }
    }
}

/// Where displays come from.
#[derive(Debug)]
pub enum Entrance {
    /// They connect to this.
    Listen(TcpListener),
    /// They wait there, `HOST:PORT`, for this server to come: again and again, until told to stop.
    Dial(Vec<String>),
}

/// Serves displays until told to stop, then drops them all.
///
/// # Errors
/// [`ServerError::Threads`] if the pool cannot be started. What displays do is never an error.
pub async fn run(
    config: ServerConfig,
    entrance: Entrance,
    shutdown: impl Future<Output = ()>,
) -> Result<(), ServerError> {
    let shared = Arc::new(Shared::new(config)?);
    let serving = async {
        match entrance {
            Entrance::Listen(listener) => listen(&shared, listener).await,
            Entrance::Dial(places) => dial(&shared, places).await,
        }
    };
    tokio::select! {
        () = shutdown => {}
        () = serving => {}
    }
    Ok(())
}

async fn listen(shared: &Arc<Shared>, listener: TcpListener) {
    let doorway = Doorway::new(MAX_GUESTS);
    let mut connections = JoinSet::new();
    loop {
        let (stream, address) = match listener.accept().await {
            Ok(accepted) => accepted,
            Err(error) => {
                tracing::warn!("a connection failed before it was accepted: {error}");
                tokio::time::sleep(PAUSE_TO_ACCEPT).await;
                continue;
            }
        };
        while connections.try_join_next().is_some() {}
        let shared = Arc::clone(shared);
        let (guest, mut displaced) = doorway.enter();
        connections.spawn(async move {
            tokio::select! {
                () = welcome(&shared, stream, address, guest) => {}
                () = displaced.told() => {
                    tracing::info!("{address}: had to make room before it said who it is");
                }
            }
        });
    }
}

/// Serves whoever came in, if it knows the secret.
async fn welcome(shared: &Arc<Shared>, mut stream: TcpStream, address: SocketAddr, guest: Guest) {
    if let Err(error) = stream.set_nodelay(true) {
        tracing::debug!("{address}: no low-delay mode: {error}");
    }
    if let Some(secret) = &shared.config.secret
        && let Err(error) = secret::accepted(&mut stream, secret, Role::ShaderServer).await
    {
        tracing::warn!("{address}: kept out: {error}");
        return;
    }
    tracing::info!("{address}: connected");
    connection::serve(shared, stream, address, Some(guest)).await;
    tracing::info!("{address}: gone");
}

async fn dial(shared: &Arc<Shared>, places: Vec<String>) {
    let mut displays = JoinSet::new();
    for place in places {
        let shared = Arc::clone(shared);
        displays.spawn(async move {
            let mut told = false;
            loop {
                match visit(&shared, &place).await {
                    Ok(()) => told = false,
                    Err(error) => {
                        // Said once, not twice a second until there is a display.
                        if !std::mem::replace(&mut told, true) {
                            tracing::warn!("no display at {place} yet: {error}");
                        }
                    }
                }
                tokio::time::sleep(PAUSE_TO_DIAL).await;
            }
        });
    }
    displays.join_all().await;
}

/// Serves the display that waits at a place until it leaves.
async fn visit(shared: &Arc<Shared>, place: &str) -> Result<(), SecretError> {
    let found = tokio::net::lookup_host(place).await?;
    let allowed =
        |address: &SocketAddr| shared.config.secret.is_some() || address.ip().is_loopback();
    let found: Vec<SocketAddr> = found.filter(allowed).collect();
    if found.is_empty() {
        let text = "it has no loopback address; give --secret-file on both sides";
        return Err(io::Error::other(text).into());
    }
    let mut stream = TcpStream::connect(&found[..]).await?;
    stream.set_nodelay(true)?;
    let address = stream.peer_addr()?;
    if let Some(secret) = &shared.config.secret {
        secret::dialled(&mut stream, secret, Role::ShaderServer).await?;
    }
    tracing::info!("{address}: connected");
    connection::serve(shared, stream, address, None).await;
    tracing::info!("{address}: gone");
    Ok(())
}
