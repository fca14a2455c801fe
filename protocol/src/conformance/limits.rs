//! Lengths and counts above what was agreed.

use std::time::Instant;

use crate::framing::frame;
use crate::limits::{MAX_FRAME, MAX_MOVES, MAX_TEXT};
use crate::messages::FaultCode::{Limit, Malformed, Value};
use crate::messages::{FaultCode, ObjectMove, ToDisplay, ToServer};

use super::check::{At, Check, failed, refused, skipped};
use super::peer::{Came, Peer, describe};
use super::world::{block_at, camera, spread};
use super::{Bench, Checked};

const CREDITS: &str = "2, Credits";
const BYTES: &str = "1, Bytes";
const LIMITS: &str = "7, Limits";

/// Credits above which a server is not filled.
const MOST: usize = 1 << 18;

pub(super) fn checks() -> Vec<Check> {
    let header = |name, length: u32| {
        refused(name, BYTES, At::Connected, &[Limit], move |peer| {
            peer.send_bytes(&length.to_le_bytes());
        })
    };
    vec![
        header("limits.frame-of-4-gib", u32::MAX),
        header("limits.frame-one-byte-too-long", MAX_FRAME as u32 + 1),
        refused(
            "limits.frame-too-long-later",
            BYTES,
            At::Ready,
            &[Limit],
            |peer| {
                peer.send_bytes(&u32::MAX.to_le_bytes());
            },
        ),
        Check::new("limits.max-batch", CREDITS, batch),
        Check::new("limits.credits", CREDITS, credits),
        Check::new("limits.all-credits-used", CREDITS, all_credits),
        Check::new("limits.moves", LIMITS, moves),
        refused("limits.fault-text", LIMITS, At::Greeted, &[Limit], |peer| {
            peer.send(&ToServer::Fault {
                code: FaultCode::Internal,
                text: "t".repeat(MAX_TEXT + 1),
            });
        }),
    ]
}

fn batch(bench: &Bench) -> Checked {
    let mut peer = Peer::ready(bench, &bench.worlds.lit)?;
    let most = u64::from(peer.welcome()?.capabilities.max_batch);
    let samples = spread(&camera(), 0..most + 1);
    peer.send(&ToServer::Request { view: 1, samples });
    peer.expect_fault(&[Limit])
}

/// Four times the credits at once, and a ping. A server that answers it while it still holds more than its credits has let that pass.
fn credits(bench: &Bench) -> Checked {
    let mut peer = Peer::ready(bench, &bench.worlds.lit)?;
    let credits = peer.credits()?;
    if credits > MOST {
        return skipped(format!("{credits} credits are too many to use up"));
    }
    let requests = spread(&camera(), 0..4 * credits as u64);
    let mut messages = peer.requests(1, &requests);
    peer.expecting_pong(1);
    messages.push(ToServer::Ping { token: 1 });
    let bytes = messages
        .iter()
        .flat_map(|message| frame(message).unwrap_or_default())
        .collect();
    peer.send_in_background(bytes);
    let deadline = Instant::now() + bench.options.timeout;
    loop {
        match peer.next_by(deadline)? {
            Came::Message(ToDisplay::Fault { code: Limit, .. }) => return Ok(()),
            Came::Message(ToDisplay::Pong { .. }) => break,
            Came::Message(message) if !matches!(message, ToDisplay::Fault { .. }) => {}
            came => return failed("Fault Limit", describe(&came, bench.options.timeout)),
        }
    }
    let held = requests.len() - peer.answered();
    if held > credits {
        let came = format!("nothing with {held} requests outstanding");
        return failed(format!("Fault Limit at more than {credits}"), came);
    }
    skipped("the server answers as fast as it reads, and never holds too many")
}

/// As many as there are credits are taken and answered, twice.
fn all_credits(bench: &Bench) -> Checked {
    let mut peer = Peer::ready(bench, &bench.worlds.lit)?;
    let credits = peer.credits()?.min(MOST) as u64;
    peer.ask_all(1, &spread(&camera(), 0..credits))?;
    peer.ask_all(1, &spread(&camera(), credits..2 * credits))?;
    Ok(())
}

fn moves(bench: &Bench) -> Checked {
    let mut peer = Peer::ready(bench, &bench.worlds.lit)?;
    if !peer.welcome()?.capabilities.edits {
        return skipped("the server does not offer edits");
    }
    let moved = ObjectMove {
        object: 1,
        transform: block_at([0.0, 1.0, 0.0]),
    };
    peer.edit(1, vec![moved; MAX_MOVES + 1], Vec::new());
    peer.expect_fault(&[Limit, Value, Malformed])
}
