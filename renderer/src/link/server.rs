//! One server: started or found, used until it is lost, and tried again.

use std::ffi::OsString;
use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use protocol::ToServer;
use protocol::framing::FrameError;
use protocol::scene::Scene;
use protocol::session::Violation;
use protocol::transfer::EncodedScene;
use tokio::net::TcpStream;
use tokio::sync::{Notify, watch};

use super::connection::{self, End};
use super::face::ServerSource;
use super::process::Process;
use super::state::State;
use super::status::ServerPhase;
use crate::traces::Recorder;

/// First pause before a server is tried again; it doubles with each failure.
const FIRST_PAUSE: Duration = Duration::from_millis(50);
/// Longest pause.
const LONGEST_PAUSE: Duration = Duration::from_secs(5);
/// A server that lasted so long has not failed before.
const HEALTHY: Duration = Duration::from_secs(10);

/// Why a server was lost or refused.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// The program cannot be started, or its output not be read.
    #[error("cannot start {}: {source}; name a shader server that can be run", program.display())]
    Spawn {
        /// The program.
        program: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// The program did not say where it listens.
    #[error("{} did not print `listening on ADDRESS`; is it a shader server?", program.display())]
    Silent {
        /// The program.
        program: PathBuf,
    },
    /// The address does not exist or nobody listens there.
    #[error("cannot connect to {address}: {source}")]
    Connect {
        /// The address.
        address: String,
        /// Why not.
        source: io::Error,
    },
    /// The address is not on this machine, which the protocol does not allow.
    #[error("{address} is not a loopback address; run the shader server on this machine")]
    NotLoopback {
        /// The address.
        address: String,
    },
    /// The connection or a frame on it is broken.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// The server broke a rule.
    #[error("the server broke a rule: {0}")]
    Violation(Violation),
    /// The server says that it cannot go on.
    #[error("the server reports {:?}: {}", .0.code, .0.text)]
    Fault(Violation),
    /// The server closed the connection.
    #[error("the server closed the connection")]
    Closed,
    /// The server did not answer in time.
    #[error("the server did not answer for {} s", .0.as_secs_f32())]
    TimedOut(Duration),
    /// The scene as edited cannot be sent.
    #[error("the edited scene cannot be sent: {0}")]
    Scene(#[from] protocol::transfer::TransferError),
}

/// What the display's thread and all connections share.
pub(super) struct Shared {
    pub(super) state: Mutex<State>,
    /// Told of every change that a waiting display may be waiting for.
    pub(super) changed: Condvar,
    /// One for each server, told when there may be something to send.
    pub(super) wake: Vec<Notify>,
    pub(super) waker: Option<Box<dyn Fn() + Send + Sync>>,
    pub(super) closing: watch::Receiver<bool>,
    pub(super) scene: Arc<Scene>,
    pub(super) encoded: Arc<EncodedScene>,
    pub(super) name: String,
    /// How the visibility of lights is wanted.
    pub(super) shadows: ToServer,
    pub(super) seed: u64,
    pub(super) timeout: Duration,
    pub(super) recorder: Option<Recorder>,
}

impl Shared {
    pub(super) fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// There may be something to send to any server.
    pub(super) fn wake_servers(&self) {
        self.wake.iter().for_each(Notify::notify_one);
    }

    /// Completes when the link is being closed.
    pub(super) async fn closed(&self) {
        // An error means that the link is gone already.
        let _ = self.closing.clone().wait_for(|closing| *closing).await;
    }
}

/// Keeps one server in use until the link closes.
pub(super) async fn supervise(server: usize, source: ServerSource, shared: Arc<Shared>) {
    let mut failures = 0u32;
    while !*shared.closing.borrow() {
        shared.lock().servers[server].phase = ServerPhase::Connecting;
        shared.changed.notify_all();
        let started = Instant::now();
        match attempt(server, &source, &shared).await {
            Ok(End::Closing) => break,
            Ok(End::Restart) => continue,
            Err(error) => {
                failures = if started.elapsed() >= HEALTHY {
                    1
                } else {
                    failures.saturating_add(1)
                };
                tracing::warn!(server, failures, %error, "lost a shader server");
                shared.lock().lost(server, failures, &error.to_string());
            }
        }
        shared.changed.notify_all();
        shared.wake_servers();
        tokio::select! {
            () = tokio::time::sleep(pause(failures)) => {}
            () = shared.closed() => {}
        }
    }
}

fn pause(failures: u32) -> Duration {
    let doublings = failures.saturating_sub(1).min(16);
    FIRST_PAUSE
        .saturating_mul(1 << doublings)
        .min(LONGEST_PAUSE)
}

async fn attempt(
    server: usize,
    source: &ServerSource,
    shared: &Shared,
) -> Result<End, ServerError> {
    match source {
        ServerSource::Connect(address) => {
            let stream = tokio::select! {
                stream = connect(address, shared.timeout) => stream?,
                () = shared.closed() => return Ok(End::Closing),
            };
            connection::run(stream, server, shared).await
        }
        ServerSource::Spawn { program, args } => spawned(server, program, args, shared).await,
    }
}

async fn spawned(
    server: usize,
    program: &std::path::Path,
    args: &[OsString],
    shared: &Shared,
) -> Result<End, ServerError> {
    let process = tokio::select! {
        process = Process::spawn(program, args, shared.timeout) => process?,
        () = shared.closed() => return Ok(End::Closing),
    };
    let end = match connect(&process.address().to_string(), shared.timeout).await {
        Ok(stream) => connection::run(stream, server, shared).await,
        Err(error) => Err(error),
    };
    process.stop().await;
    end
}

async fn connect(address: &str, timeout: Duration) -> Result<TcpStream, ServerError> {
    let failed = |source| ServerError::Connect {
        address: address.to_owned(),
        source,
    };
    let found: Vec<SocketAddr> = tokio::net::lookup_host(address)
        .await
        .map_err(failed)?
        .collect();
    let local: Vec<_> = found
        .iter()
        .copied()
        .filter(|a| a.ip().is_loopback())
        .collect();
    if local.is_empty() {
        return Err(ServerError::NotLoopback {
            address: address.to_owned(),
        });
    }
    let connecting = TcpStream::connect(&local[..]);
    let stream = tokio::time::timeout(timeout, connecting)
        .await
        .map_err(|_| failed(io::ErrorKind::TimedOut.into()))?
        .map_err(failed)?;
    stream.set_nodelay(true).map_err(failed)?;
    Ok(stream)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_double_up_to_a_bound() {
        let millis: Vec<_> = [1, 2, 3, 7, 8, 40, u32::MAX]
            .map(|n| pause(n).as_millis())
            .into();
        assert_eq!(millis, [50, 100, 200, 3200, 5000, 5000, 5000]);
    }
}
