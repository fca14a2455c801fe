//! What a check is, and how it ends.

use crate::messages::FaultCode;

use super::peer::Peer;
use super::{Bench, Checked};

/// Why a check did not pass.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The server did something else than the document says.
    Failed {
        /// What the document asks for.
        expected: String,
        /// What came instead.
        came: String,
    },
    /// The server does not offer what the check is about.
    Skipped(String),
}

/// A failure, in words.
pub(super) fn failed<T>(expected: impl Into<String>, came: impl Into<String>) -> Result<T, Stop> {
    Err(Stop::Failed {
        expected: expected.into(),
        came: came.into(),
    })
}

/// Nothing to check here.
pub(super) fn skipped<T>(why: impl Into<String>) -> Result<T, Stop> {
    Err(Stop::Skipped(why.into()))
}

/// Fails unless something holds.
pub(super) fn ensure(
    holds: bool,
    expected: impl FnOnce() -> String,
    came: impl FnOnce() -> String,
) -> Checked {
    if holds {
        return Ok(());
    }
    failed(expected(), came())
}

/// What a server must have done already for a check to make sense.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Needs {
    Nothing,
    Welcome,
    Samples,
}

type Run = Box<dyn Fn(&Bench) -> Checked>;

/// One thing that a server must do.
pub(super) struct Check {
    pub(super) name: String,
    /// Where the document says so.
    pub(super) section: &'static str,
    pub(super) needs: Needs,
    pub(super) run: Run,
}

impl Check {
    pub(super) fn new(
        name: &str,
        section: &'static str,
        run: impl Fn(&Bench) -> Checked + 'static,
    ) -> Self {
        Self {
            name: name.into(),
            section,
            needs: Needs::Samples,
            run: Box::new(run),
        }
    }

    pub(super) fn needing(mut self, needs: Needs) -> Self {
        self.needs = needs;
        self
    }
}

/// Where a connection stands when a rule is broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum At {
    /// Nothing was sent.
    Connected,
    /// `Welcome` has come.
    Greeted,
    /// The scene is built and view 1 was sent.
    Ready,
}

/// A check that breaks a rule and wants to be told so with one of these codes, and nothing after.
pub(super) fn refused(
    name: &str,
    section: &'static str,
    at: At,
    codes: &'static [FaultCode],
    break_it: impl Fn(&mut Peer) + 'static,
) -> Check {
    let needs = match at {
        At::Connected => Needs::Nothing,
        At::Greeted => Needs::Welcome,
        At::Ready => Needs::Samples,
    };
    let run = move |bench: &Bench| {
        let mut peer = match at {
            At::Connected => Peer::connect(bench)?,
            At::Greeted => Peer::greeted(bench)?,
            At::Ready => Peer::ready(bench, &bench.worlds.lit)?,
        };
        break_it(&mut peer);
        peer.expect_fault(codes)
    };
    Check::new(name, section, run).needing(needs)
}
