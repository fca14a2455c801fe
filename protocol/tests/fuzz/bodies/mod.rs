//! What is tried with any bytes at all, by `cargo test` for a while and by cargo-fuzz for as long as one likes.
//!
//! Each function takes an input and panics if something does not hold of it. They use nothing but the crate's public face.
#![allow(dead_code, reason = "a cargo-fuzz target uses one of them")]

mod conversation;
mod decoding;
mod display;
mod framing;
mod secret;
mod server;
mod source;
mod trace;
mod transfer;
mod world;

use crate::counting::peak_during;

/// Something to be tried.
pub(crate) struct Target {
    /// Its name, which is also that of its folder of inputs.
    pub(crate) name: &'static str,
    /// Tries one input.
    pub(crate) run: fn(&[u8]),
}

/// Everything that is tried.
pub(crate) const TARGETS: [Target; 11] = [
    target("to_server", decoding::to_server),
    target("to_display", decoding::to_display),
    target("scene", decoding::scene),
    target("stream", framing::stream),
    target("transfer", transfer::transfer),
    target("server_session", server::server_session),
    target("display_session", display::display_session),
    target("conversation", conversation::conversation),
    target("secret", secret::secret),
    target("trace", trace::trace),
    target("trace_checked", trace::trace_checked),
];

const fn target(name: &'static str, run: fn(&[u8])) -> Target {
    Target { name, run }
}

/// Memory that any input may take beside what is proportional to it: a frame, and what it is decoded to.
const ALLOWED: usize = 6 << 20;
/// Bytes of memory that a byte of input may take: the codec's promise, and a copy or two.
const PER_BYTE: usize = 20;

/// Tries an input and counts the memory in use meanwhile.
pub(crate) fn bounded(target: &Target, data: &[u8]) {
    let cap = ALLOWED + PER_BYTE * data.len();
    let peak = peak_during(|| (target.run)(data));
    assert!(
        peak <= cap,
        "{}: {peak} bytes of memory for {} bytes of input",
        target.name,
        data.len()
    );
}

/// Tries an input of the target with this name.
pub(crate) fn run(name: &str, data: &[u8]) {
    match TARGETS.iter().find(|target| target.name == name) {
        Some(target) => bounded(target, data),
        None => panic!("there is no target {name}"),
    }
}
