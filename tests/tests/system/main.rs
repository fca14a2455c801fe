//! Tests of the real binaries as processes, talking over loopback.

#![expect(
    clippy::unwrap_used,
    reason = "a failed step of a test is a failed test, in its helpers too"
)]

mod bad_input;
mod conformance;
mod cuts;
mod edits;
mod fixtures;
mod hostile;
mod independent;
mod lockstep;
mod logs;
mod many;
mod mitsuba;
mod no_display;
mod python;
mod recorded;
mod references;
mod servers;
mod soak;
mod support;
mod traces;
mod window;
