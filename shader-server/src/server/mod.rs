//! The server: sockets on tokio, rays on a rayon pool, bounded queues in between.
//!
//! [`run`] accepts displays until told to stop. Each display is a `connection` (reads and writes messages) with a
//! `desk` (holds its requests, hands them to the pool in chunks, collects samples). Nothing that one
//! display does or leaves undone holds up another: a chunk is only begun when there is room for its result.

mod cache;
mod connection;
mod desk;

use std::{io, num::NonZeroUsize, sync::Arc, thread::available_parallelism};

use protocol::{
    limits::{MAX_BATCH, MAX_SCENE},
    messages::Capabilities,
};
use tokio::{net::TcpListener, sync::Semaphore, task::JoinSet};

use crate::{irradiance::Patience, shadows::ShadowOptions};
use cache::SceneCache;

/// Displays served at once; more wait to be accepted.
const MAX_DISPLAYS: usize = 64;

/// How a server works.
#[derive(Clone, Debug, PartialEq, Eq)]
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
}

impl Default for ServerConfig {
    fn default() -> Self {
        Self {
            threads: None,
            shadows: ShadowOptions::default(),
            patience: Patience::AtOnce,
            credits: 1 << 16,
            max_scene_bytes: MAX_SCENE,
        }
    }
}

/// A server cannot run.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// Its threads cannot be started.
    #[error("cannot start the threads that trace rays: {0}; try fewer --threads")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// Connections cannot be accepted.
    #[error("cannot accept connections: {0}")]
    Accept(#[from] io::Error),
}

/// What all connections share.
struct Shared {
    config: ServerConfig,
    threads: usize,
    pool: rayon::ThreadPool,
    cache: SceneCache,
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

/// Serves displays that connect to `listener` until `shutdown` is done, then drops them all.
///
/// # Errors
/// [`ServerError::Threads`] if the pool cannot be started. What displays do is never an error.
pub async fn run(
    config: ServerConfig,
    listener: TcpListener,
    shutdown: impl Future<Output = ()>,
) -> Result<(), ServerError> {
    let shared = Arc::new(Shared::new(config)?);
    let places = Arc::new(Semaphore::new(MAX_DISPLAYS));
    let mut connections = JoinSet::new();
    tokio::pin!(shutdown);
    loop {
        let place = tokio::select! {
            () = &mut shutdown => return Ok(()),
            place = Arc::clone(&places).acquire_owned() => place,
        };
        let (stream, address) = tokio::select! {
            () = &mut shutdown => return Ok(()),
            accepted = listener.accept() => match accepted {
                Ok(accepted) => accepted,
                Err(error) => {
                    tracing::warn!("a connection failed before it was accepted: {error}");
                    tokio::time::sleep(std::time::Duration::from_millis(50)).await;
                    continue;
                }
            },
        };
        while connections.try_join_next().is_some() {}
        let shared = Arc::clone(&shared);
        connections.spawn(async move {
            let _place = place;
            if let Err(error) = stream.set_nodelay(true) {
                tracing::debug!("{address}: no low-delay mode: {error}");
            }
            tracing::info!("{address}: connected");
            connection::serve(&shared, stream, address).await;
            tracing::info!("{address}: gone");
        });
    }
}
