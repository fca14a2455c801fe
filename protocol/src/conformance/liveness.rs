//! Answers in time, and several displays at once.

use std::time::{Duration, Instant};

use crate::framing::frame;
use crate::messages::{ToDisplay, ToServer};

use super::check::{Check, Needs, ensure, failed, skipped};
use super::edits::move_block;
use super::judge::{judge, right};
use super::peer::{Came, Peer, describe};
use super::requests::{LOOK, look_with};
use super::world::{World, camera, spread};
use super::{Bench, Checked};

const HEARTBEAT: &str = "2, Heartbeat";
const DISPLAYS: &str = "2, Displays";

/// Share of the patience with a server within which a ping has to be answered however busy it is.
const AT_ONCE: u32 = 5;
/// A ping that is answered sooner may have waited for its turn.
const NO_TIME: Duration = Duration::from_millis(100);

pub(super) fn checks() -> Vec<Check> {
    vec![
        Check::new("pings.before-scene", HEARTBEAT, |bench| {
            let mut peer = Peer::greeted(bench)?;
            peer.round_trip(u64::MAX).map(drop)
        })
        .needing(Needs::Welcome),
        Check::new("pings.in-turn", HEARTBEAT, in_turn),
        Check::new("pings.while-busy", HEARTBEAT, while_busy),
        Check::new("pings.while-building", HEARTBEAT, while_building),
        Check::new("displays.two", DISPLAYS, two),
        Check::new("displays.edits-apart", DISPLAYS, apart),
        Check::new("displays.silent", DISPLAYS, silent),
        Check::new("displays.unread", DISPLAYS, unread),
        Check::new("displays.after-all-of-it", DISPLAYS, |bench| {
            let world = &bench.worlds.lit;
            let mut peer = Peer::ready(bench, world)?;
            judge(&world.scene, &look_with(&mut peer)?, right)
        }),
    ]
}

fn in_turn(bench: &Bench) -> Checked {
    let mut peer = Peer::ready(bench, &bench.worlds.lit)?;
    for token in 0..50 {
        peer.ping(token);
    }
    for token in 0..50 {
        peer.pong(token)?;
    }
    Ok(())
}

/// Time in which a server that is busy answers a ping.
fn at_once(bench: &Bench) -> Duration {
    bench.options.timeout / AT_ONCE
}

fn while_busy(bench: &Bench) -> Checked {
    let mut peer = Peer::ready(bench, &bench.worlds.lit)?;
    let credits = peer.credits()?.min(1 << 16) as u64;
    peer.ask(1, &spread(&camera(), 0..credits));
    let took = peer.round_trip(1)?;
    ensure(
        took <= at_once(bench),
        || format!("Pong within {:?} while requests are queued", at_once(bench)),
        || format!("{took:?}"),
    )?;
    let answered = peer.answered();
    ensure(
        took <= NO_TIME || answered < credits as usize,
        || "Pong before the samples of all that was asked for before".into(),
        || format!("it after all {answered}, {took:?} after Ping"),
    )?;
    peer.answers(answered.max(credits as usize)).map(drop)
}

fn while_building(bench: &Bench) -> Checked {
    let world = &bench.worlds.large;
    let mut peer = Peer::greeted(bench)?;
    if peer.announce(&world.encoded) {
        return skipped("the server holds the scene already");
    }
    peer.send(&world.encoded.begin());
    world.encoded.chunks().for_each(|chunk| peer.send(&chunk));
    let start = Instant::now();
    peer.ping(1);
    let (mut pong, mut ready) = (None, None);
    while pong.is_none() || ready.is_none() {
        match peer.next()? {
            Came::Message(ToDisplay::Pong { .. }) => pong = Some(start.elapsed()),
            Came::Message(ToDisplay::SceneReady { .. }) => ready = Some(start.elapsed()),
            Came::Message(message) if !matches!(message, ToDisplay::Fault { .. }) => {}
            came => {
                return failed(
                    "Pong and SceneReady",
                    describe(&came, bench.options.timeout),
                );
            }
        }
    }
    let took = pong.unwrap_or_default();
    ensure(
        took <= at_once(bench),
        || format!("Pong within {:?} while a scene is built", at_once(bench)),
        || format!("{took:?}"),
    )?;
    peer.view(1, camera());
    judge(
        &world.scene,
        &peer.ask_all(1, &spread(&camera(), 0..LOOK))?,
        right,
    )
}

fn part(peer: &mut Peer, world: &World, from: u64) -> Checked {
    let answers = peer.ask_all(1, &spread(&camera(), from..from + 40))?;
    judge(&world.scene, &answers, right)
}

/// Two displays with different scenes, in turns and both at once.
fn two(bench: &Bench) -> Checked {
    let worlds = [&bench.worlds.lit, &bench.worlds.dim];
    let mut first = Peer::ready(bench, worlds[0])?;
    let mut second = Peer::ready(bench, worlds[1])?;
    for from in [0, 40, 80] {
        part(&mut first, worlds[0], from)?;
        part(&mut second, worlds[1], from)?;
    }
    let many = first.credits()?.min(2000) as u64;
    let requests = spread(&camera(), 1000..1000 + many);
    first.ask(1, &requests);
    second.ask(1, &requests);
    let answers = [
        first.answers(requests.len())?,
        second.answers(requests.len())?,
    ];
    judge(&worlds[0].scene, &answers[0], right)?;
    judge(&worlds[1].scene, &answers[1], right)
}

/// What one display moves stays where it was for another.
fn apart(bench: &Bench) -> Checked {
    let world = &bench.worlds.lit;
    let mut first = Peer::ready(bench, world)?;
    if !first.welcome()?.capabilities.edits {
        return skipped("the server does not offer edits");
    }
    let mut second = Peer::ready(bench, world)?;
    move_block(&mut first, 1, [1.6, 0.7, 0.9]);
    first.ask_all(1, &spread(&camera(), 0..40))?;
    part(&mut second, world, 0)?;
    let mut third = Peer::ready(bench, world)?;
    part(&mut third, world, 0)
}

/// Displays that connect and say nothing hold nobody up.
fn silent(bench: &Bench) -> Checked {
    let mut quiet = Vec::new();
    for _ in 0..8 {
        quiet.push(Peer::connect(bench)?);
    }
    let world = &bench.worlds.lit;
    let mut peer = Peer::ready(bench, world)?;
    judge(&world.scene, &look_with(&mut peer)?, right)?;
    drop(quiet);
    Ok(())
}

/// Most bytes sent without reading any.
const FLOOD: usize = 24 << 20;
/// A write that is held up for so long shows that the server has stopped reading.
const HELD_UP: Duration = Duration::from_millis(500);

/// A display that asks for much and reads nothing for seconds holds up only itself.
fn unread(bench: &Bench) -> Checked {
    let world = &bench.worlds.lit;
    let mut deaf = Peer::ready(bench, world)?;
    let many = deaf.credits()?.min(1 << 16) as u64;
    deaf.ask(1, &spread(&camera(), 0..many));
    deaf.set_write_timeout(HELD_UP);
    let pings = frame(&ToServer::Ping { token: 0 })
        .unwrap_or_default()
        .repeat(4096);
    for _ in 0..FLOOD / pings.len() {
        if !deaf.send_bytes(&pings) {
            break;
        }
    }
    let end = Instant::now() + Duration::from_secs(2);
    let mut peer = Peer::ready(bench, world)?;
    let mut from = 0;
    while Instant::now() < end {
        part(&mut peer, world, from)?;
        from += 40;
    }
    drop(deaf);
    part(&mut peer, world, from)
}
