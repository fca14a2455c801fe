//! Checks whether a shader server keeps to `PROTOCOL.md`: plays a display, a wicked one too, and says what the server does wrong.
//!
//! [`check_server`] runs every check on connections of its own and reports each as a [`Line`]. What samples should hold is
//! worked out by plain geometry on small scenes (`world`). Nothing waits longer than [`Options::timeout`] for a sign of life, so a
//! server that hangs fails check after check but never holds up the command.

mod cancels;
mod check;
mod edits;
mod handshake;
mod judge;
mod launch;
mod limits;
mod liveness;
mod malformed;
mod means;
mod peer;
mod requests;
mod scene;
mod scene_values;
mod shading;
mod streams;
mod triples;
mod views;
mod world;

use std::fmt;
use std::io;
use std::net::SocketAddr;
use std::time::Duration;

pub use check::Stop;
pub use launch::{LaunchError, Launched};

use crate::secret::Secret;
use check::{Check, Needs};
use world::Worlds;

/// Time for any answer, unless told otherwise: what a `Ping` may take.
pub const DEFAULT_TIMEOUT: Duration = Duration::from_secs(crate::limits::PING_TIMEOUT_S);

/// Which server, and how patient to be with it.
#[derive(Debug)]
pub struct Options {
    /// Where it listens.
    pub address: SocketAddr,
    /// Longest wait for a sign of life.
    pub timeout: Duration,
    /// What both sides know, if the server asks for it.
    pub secret: Option<Secret>,
    /// Runs only checks whose name contains this.
    pub only: Option<String>,
}

/// The checks cannot be run.
#[derive(Debug, thiserror::Error)]
pub enum ConformanceError {
    /// Nobody answers there.
    #[error("cannot reach a server at {address}: {source}")]
    Unreachable {
        /// Where it should be.
        address: SocketAddr,
        /// Why not.
        source: io::Error,
    },
    /// A scene of the checks' own cannot be encoded: a defect of this command.
    #[error("a scene of the checks is no scene: {0}")]
    World(#[from] crate::transfer::TransferError),
}

/// How a check ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line {
    /// Which one.
    pub name: String,
    /// Section of `PROTOCOL.md` that asks for it.
    pub section: &'static str,
    /// Whether the server passed.
    pub result: Result<(), Stop>,
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.result {
            Ok(()) => write!(f, "pass {}", self.name),
            Err(Stop::Skipped(why)) => write!(f, "skip {}: {why}", self.name),
            Err(Stop::Failed { expected, came }) => write!(
                f,
                "FAIL {}: expected {expected}; came {came} (PROTOCOL.md, section {})",
                self.name, self.section
            ),
        }
    }
}

/// How many checks ended how.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Passed.
    pub passed: usize,
    /// Failed.
    pub failed: usize,
    /// Skipped.
    pub skipped: usize,
}

type Checked = Result<(), Stop>;

/// What checks work with.
struct Bench {
    options: Options,
    worlds: Worlds,
}

/// Runs all checks against a server, one after another, and reports each as soon as it is done.
///
/// # Errors
/// [`ConformanceError::Unreachable`] if nothing listens at the address.
pub fn check_server(
    options: Options,
    mut report: impl FnMut(&Line),
) -> Result<Count, ConformanceError> {
    let bench = Bench {
        worlds: Worlds::new()?,
        options,
    };
    peer::reach(&bench).map_err(|source| ConformanceError::Unreachable {
        address: bench.options.address,
        source,
    })?;
    let mut count = Count::default();
    let mut reached = Needs::Samples;
    for check in all() {
        let only = bench.options.only.as_deref().unwrap_or_default();
        if !check.name.contains(only) {
            continue;
        }
        let result = if check.needs > reached {
            check::skipped("the server does not get that far")
        } else {
            (check.run)(&bench)
        };
        if result.is_err() && check.name == handshake::GATE {
            reached = Needs::Nothing;
        } else if result.is_err() && check.name == requests::GATE {
            reached = reached.min(Needs::Welcome);
        }
        let field = match result {
            Ok(()) => &mut count.passed,
            Err(Stop::Failed { .. }) => &mut count.failed,
            Err(Stop::Skipped(_)) => &mut count.skipped,
        };
        *field += 1;
        report(&Line {
            name: check.name,
            section: check.section,
            result,
        });
    }
    Ok(count)
}

/// In an order in which the first failure is the most telling.
fn all() -> Vec<Check> {
    let groups = [
        handshake::checks,
        requests::checks,
        scene::checks,
        scene_values::checks,
        views::checks,
        shading::checks,
        means::checks,
        triples::checks,
        edits::checks,
        cancels::checks,
        limits::checks,
        malformed::checks,
        streams::checks,
        liveness::checks,
    ];
    groups.into_iter().flat_map(|group| group()).collect()
}
