//! Views that are not wanted any more.

use crate::messages::FaultCode::OutOfOrder;
use crate::messages::ToDisplay;

use super::check::{At, Check, ensure, failed, refused, skipped};
use super::judge::{judge, right};
use super::peer::Peer;
use super::world::{camera, spread};
use super::{Bench, Checked};

const CANCEL: &str = "2, Cancel";
const CREDITS: &str = "2, Credits";

/// Servers that hold more are not filled.
const MOST: usize = 1 << 18;

pub(super) fn checks() -> Vec<Check> {
    vec![
        Check::new("cancels.confirmed", CANCEL, confirmed),
        Check::new("cancels.nothing-older-after", CANCEL, nothing_older),
        Check::new("cancels.credits-back", CREDITS, credits_back),
        Check::new("cancels.smaller-again", CANCEL, smaller),
        refused(
            "cancels.request-after",
            CANCEL,
            At::Ready,
            &[OutOfOrder],
            |peer| {
                peer.view(2, camera());
                peer.cancel(2);
                peer.ask(1, &spread(&camera(), 0..1));
            },
        ),
    ]
}

fn status(peer: &mut Peer, cancelled_before: u32) -> Checked {
    let what = format!("Status with cancelled_before {cancelled_before}");
    peer.until(
        &what,
        |m| matches!(m, ToDisplay::Status { cancelled_before: c, .. } if *c == cancelled_before),
    )
    .map(drop)
}

fn confirmed(bench: &Bench) -> Checked {
    let mut peer = Peer::ready(bench, &bench.worlds.lit)?;
    // Also with nothing to cancel, and for views that are yet to come.
    for before in [1, 2, 1000] {
        peer.cancel(before);
        status(&mut peer, before)?;
    }
    peer.view(1000, camera());
    judge(
        &bench.worlds.lit.scene,
        &peer.ask_all(1000, &spread(&camera(), 0..50))?,
        right,
    )
}

/// After a `Cancel` that was asked for while much was under way, none of it comes any more.
fn nothing_older(bench: &Bench) -> Checked {
    let mut peer = Peer::ready(bench, &bench.worlds.lit)?;
    let many = peer.credits()?.min(20_000) as u64 / 2;
    peer.ask(1, &spread(&camera(), 0..many));
    peer.view(2, camera());
    peer.ask(2, &spread(&camera(), many..2 * many));
    peer.cancel(2);
    status(&mut peer, 2)?;
    // The account of the connection knows that samples of view 1 are not outstanding any more.
    let so_far = peer.answered();
    let old = so_far.min(many as usize);
    let rest = peer.answers(so_far.max(many as usize))?;
    let mut new = rest.iter().filter(|a| a.request.id >= many).count();
    while new < many as usize {
        new += peer.answers(1)?.len();
    }
    peer.round_trip(5)?;
    ensure(
        peer.answered() == 0,
        || format!("{many} samples of view 2 and at most those {old} of view 1 before the Status"),
        || format!("{} more", peer.answered()),
    )
}

/// All credits are used, cancelled, and used again.
fn credits_back(bench: &Bench) -> Checked {
    let mut peer = Peer::ready(bench, &bench.worlds.lit)?;
    let credits = peer.credits()?;
    if credits > MOST {
        return skipped(format!("{credits} credits are too many to use up"));
    }
    let credits = credits as u64;
    peer.ask(1, &spread(&camera(), 0..credits));
    peer.view(2, camera());
    peer.cancel(2);
    status(&mut peer, 2)?;
    let before = peer.answered();
    peer.ask(2, &spread(&camera(), credits..2 * credits));
    let answers = peer.answers(before + credits as usize)?;
    let new = answers.iter().filter(|a| a.request.id >= credits).count();
    if new as u64 == credits {
        return Ok(());
    }
    failed(format!("{credits} samples"), new.to_string())
}

/// A `Cancel` of less than before takes nothing back.
fn smaller(bench: &Bench) -> Checked {
    let mut peer = Peer::ready(bench, &bench.worlds.lit)?;
    peer.view(9, camera());
    peer.cancel(5);
    status(&mut peer, 5)?;
    peer.cancel(3);
    peer.until("Status", |m| matches!(m, ToDisplay::Status { .. }))?;
    ensure(
        peer.cancelled_before == 5,
        || "Status with cancelled_before 5, the largest so far".into(),
        || peer.cancelled_before.to_string(),
    )
}
