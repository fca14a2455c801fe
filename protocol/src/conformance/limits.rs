//! Lengths and counts above what was agreed.

use std::time::Duration;

use crate::limits::{MAX_FRAME, MAX_MOVES, MAX_TEXT};
use crate::messages::FaultCode::{Limit, Malformed, Value};
use crate::messages::{FaultCode, ObjectMove, ToServer};

use super::check::{At, Check, refused, skipped};
use super::peer::Peer;
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

/// Four times the credits at once: more than a server can answer before it has read them.
fn credits(bench: &Bench) -> Checked {
    let mut peer = Peer::ready(bench, &bench.worlds.lit)?;
    let credits = peer.credits()?;
    if credits > MOST {
        return skipped(format!("{credits} credits are too many to use up"));
    }
    // A server that has faulted need not read the rest.
    peer.set_write_timeout(Duration::from_secs(2));
    let requests = spread(&camera(), 0..4 * credits as u64);
    let mut bytes = Vec::new();
    for message in peer.requests(1, &requests) {
        bytes.extend(crate::framing::frame(&message).unwrap_or_default());
    }
    peer.send_bytes(&bytes);
    peer.expect_fault(&[Limit])
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
