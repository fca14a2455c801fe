//! Tests of the real binaries as processes, talking over loopback.

#![expect(
    clippy::unwrap_used,
    reason = "a failed step of a test is a failed test, in its helpers too"
)]

mod bad_input;
mod conformance;
mod edits;
mod independent;
mod lockstep;
mod many;
mod mitsuba;
mod no_display;
mod python;
mod references;
mod servers;
mod support;
mod window;
