//! One server: started or found, used until it is lost, and tried again.

use std::ffi::OsString;
use std::io;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use protocol::ToServer;
use protocol::framing::FrameError;
use protocol::scene::Scene;
use protocol::secret::{self, Role, Secret, SecretError};
use protocol::session::Violation;
use protocol::transfer::EncodedScene;
use tokio::net::TcpStream;
use tokio::sync::watch;

use super::connection::{self, End};
use super::face::LookUp;
use super::named::Named;
use super::process::Process;
use super::state::State;
use super::status::ServerPhase;
use crate::traces::Recorder;

/// First pause before a server is tried again; it doubles with each failure.
const FIRST_PAUSE: Duration = Duration::from_millis(50);
/// Longest pause before an address is tried: a server that comes back is fed within a second.
const LONGEST_PAUSE: Duration = Duration::from_millis(250);
/// Longest pause before a program that ends again and again is started: each start costs more than an attempt to connect.
const LONGEST_PAUSE_TO_START: Duration = Duration::from_secs(2);
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
    /// The address is not on this machine, and there is no secret.
    #[error("{address} is not a loopback address; give --secret-file on both sides")]
    NotLoopback {
        /// The address.
        address: String,
    },
    /// The host name leads nowhere.
    #[error("no address is known for {host}: {source}")]
    Name {
        /// Host and port.
        host: String,
        /// Why not.
        source: io::Error,
    },
    /// It did not prove that it knows the secret.
    #[error(transparent)]
    Secret(#[from] SecretError),
    /// It came by itself, did not say who it is, and others came after it.
    #[error("it had to make room before it said who it is")]
    Crowded,
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
    pub(super) waker: Option<Box<dyn Fn() + Send + Sync>>,
    pub(super) closing: watch::Receiver<bool>,
    pub(super) scene: Arc<Scene>,
    pub(super) encoded: Arc<EncodedScene>,
    pub(super) name: String,
    /// How the visibility of lights is wanted.
    pub(super) shadows: ToServer,
    pub(super) seed: u64,
    pub(super) timeout: Duration,
    /// What both sides must know.
    pub(super) secret: Option<Secret>,
    /// How host names are looked up.
    pub(super) look_up: Arc<LookUp>,
    /// Told of every frame.
    pub(super) recorder: Option<Recorder>,
}

impl Shared {
    pub(super) fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// There may be something to send to any server.
    pub(super) fn wake_servers(&self) {
        self.lock().slots.wake_all();
    }

    /// Completes when the link is being closed.
    pub(super) async fn closed(&self) {
        // An error means that the link is gone already.
        let _ = self.closing.clone().wait_for(|closing| *closing).await;
    }
}

/// What a server is reached by.
#[derive(Clone, Debug)]
pub(super) enum Target {
    /// A program that is started, and ended with the connection.
    Program {
        /// The program.
        program: PathBuf,
        /// Its own arguments.
        args: Vec<OsString>,
    },
    /// Somebody who listens there.
    Address {
        /// Where.
        address: SocketAddr,
        /// The host name that led there, if one did.
        named: Option<Arc<Named>>,
    },
}

impl Target {
    fn named(&self) -> Option<&Named> {
        match self {
            Self::Address { named, .. } => named.as_deref(),
            Self::Program { .. } => None,
        }
    }

    /// Longest pause before it is tried again.
    fn longest_pause(&self) -> Duration {
        match self {
            Self::Address { .. } => LONGEST_PAUSE,
            Self::Program { .. } => LONGEST_PAUSE_TO_START,
        }
    }

    /// Whether it is still wanted after a failure.
    fn is_wanted(&self) -> bool {
        match self {
            Self::Address {
                address,
                named: Some(named),
            } => named.has(*address),
            _ => true,
        }
    }
}

/// Keeps one server in use, in a slot that is open, until the link closes or its host name leads there no more.
pub(super) async fn supervise(server: usize, target: Target, shared: Arc<Shared>) {
    let mut failures = 0u32;
    while !*shared.closing.borrow() {
        if let Some(slot) = shared.lock().slots.get_mut(server) {
            slot.status.phase = ServerPhase::Connecting;
        }
        shared.changed.notify_all();
        let started = Instant::now();
        match attempt(server, &target, &shared).await {
            Ok(End::Closing) => break,
            Ok(End::Restart) => continue,
            Err(error) => {
                failures = if started.elapsed() >= HEALTHY {
                    1
                } else {
                    failures.saturating_add(1)
                };
                if failures == 1 {
                    tracing::warn!(server, %error, "lost a shader server");
                } else {
                    tracing::debug!(server, failures, %error, "cannot have a shader server");
                }
                shared.lock().lost(server, failures, &error.to_string());
                if let Some(named) = target.named() {
                    named.failed();
                }
            }
        }
        shared.wake_servers();
        shared.changed.notify_all();
        if !target.is_wanted() {
            break;
        }
        tokio::select! {
            () = tokio::time::sleep(pause(failures, target.longest_pause())) => {}
            () = shared.closed() => {}
        }
    }
    shared.lock().slots.close(server);
    shared.changed.notify_all();
}

fn pause(failures: u32, longest: Duration) -> Duration {
    let doublings = failures.saturating_sub(1).min(16);
    FIRST_PAUSE.saturating_mul(1 << doublings).min(longest)
}

async fn attempt(server: usize, target: &Target, shared: &Shared) -> Result<End, ServerError> {
    match target {
        Target::Address { address, named } => {
            let stream = tokio::select! {
                stream = connect(*address, shared) => stream?,
                () = shared.closed() => return Ok(End::Closing),
            };
            if let Some(named) = named {
                named.reached(*address);
            }
            connection::run(stream, server, shared, None).await
        }
        Target::Program { program, args } => spawned(server, program, args, shared).await,
    }
}

async fn spawned(
    server: usize,
    program: &Path,
    args: &[OsString],
    shared: &Shared,
) -> Result<End, ServerError> {
    let process = tokio::select! {
        process = Process::spawn(program, args, shared.timeout) => process?,
        () = shared.closed() => return Ok(End::Closing),
    };
    let end = match connect(process.address(), shared).await {
        Ok(stream) => connection::run(stream, server, shared, None).await,
        Err(error) => Err(error),
    };
    process.stop().await;
    end
}

async fn connect(address: SocketAddr, shared: &Shared) -> Result<TcpStream, ServerError> {
    if shared.secret.is_none() && !address.ip().is_loopback() {
        return Err(ServerError::NotLoopback {
            address: address.to_string(),
        });
    }
    let failed = |source| ServerError::Connect {
        address: address.to_string(),
        source,
    };
    let connecting = TcpStream::connect(address);
    let mut stream = tokio::time::timeout(shared.timeout, connecting)
        .await
        .map_err(|_| failed(io::ErrorKind::TimedOut.into()))?
        .map_err(failed)?;
    stream.set_nodelay(true).map_err(failed)?;
    if let Some(secret) = &shared.secret {
        secret::dialled(&mut stream, secret, Role::Display).await?;
    }
    Ok(stream)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_double_up_to_a_bound() {
        let millis: Vec<_> = [1, 2, 3, 4, 40, u32::MAX]
            .map(|n| pause(n, LONGEST_PAUSE).as_millis())
            .into();
        assert_eq!(millis, [50, 100, 200, 250, 250, 250]);
    }
}
