//! Requests and their answers.

use std::collections::HashSet;
use std::time::{Duration, Instant};

use crate::messages::FaultCode::{Limit, OutOfOrder, Value};
use crate::messages::{SampleRequest, ToServer, flags};

use super::check::{At, Check, Needs, ensure, failed, refused};
use super::judge::{self, Aspect, judge};
use super::peer::{Answer, Came, Peer, describe};
use super::world::{World, camera, camera_from_below, spread};
use super::{Bench, Checked};

/// The check without which none that needs samples makes sense.
pub(super) const GATE: &str = "requests.answered-once";

const ANSWERS: &str = "2, Answers";
const SAMPLES: &str = "4, Samples";
const REQUEST: &str = "3, Request";

/// Requests of a look at the scene.
pub(super) const LOOK: u64 = 400;

pub(super) fn checks() -> Vec<Check> {
    let looks = |name, aspect: Aspect| {
        Check::new(name, SAMPLES, move |bench| {
            look(bench, &bench.worlds.lit, aspect)
        })
    };
    let asked = |name, codes, change: fn(&mut Vec<SampleRequest>)| {
        refused(name, REQUEST, At::Ready, codes, move |peer| {
            let mut samples = spread(&camera(), 0..20);
            change(&mut samples);
            peer.send(&ToServer::Request { view: 1, samples });
        })
    };
    vec![
        Check::new(GATE, ANSWERS, answered_once).needing(Needs::Welcome),
        looks("requests.position-on-the-ray", judge::on_the_ray),
        looks("requests.position-on-the-surface", judge::on_the_surface),
        looks("requests.object", judge::named),
        looks("requests.flags", judge::flagged),
        Check::new("requests.lights-seen", SAMPLES, |bench| {
            look(bench, &bench.worlds.lamp, judge::flagged)?;
            look(bench, &bench.worlds.lamp, judge::named)
        }),
        Check::new("requests.many-batches", ANSWERS, many_batches),
        Check::new("requests.largest-ids", REQUEST, largest_ids),
        Check::new("requests.image-corners", REQUEST, corners),
        Check::new("requests.same-twice", ANSWERS, same_twice),
        asked("requests.none", &[Limit, Value], Vec::clear),
        asked("requests.outside-image", &[Value], |samples| {
            samples[19].x = 64;
        }),
        asked("requests.below-image", &[Value], |samples| {
            samples[19].y = 48;
        }),
        asked("requests.offset-1", &[Value], |samples| {
            samples[3].offset[0] = 1.0;
        }),
        asked("requests.offset-negative", &[Value], |samples| {
            samples[3].offset[1] = -1e-6;
        }),
        asked("requests.offset-nan", &[Value], |samples| {
            samples[3].offset[1] = f32::NAN;
        }),
        asked("requests.id-twice", &[Value], |samples| {
            samples[3].id = samples[4].id;
        }),
        refused(
            "requests.before-scene",
            "2, Scene",
            At::Greeted,
            &[OutOfOrder],
            |peer| {
                peer.send(&ToServer::Request {
                    view: 1,
                    samples: spread(&camera(), 0..1),
                });
            },
        ),
    ]
}

/// Asks for samples from both cameras, and judges them.
pub(super) fn look(bench: &Bench, world: &World, aspect: Aspect) -> Checked {
    let mut peer = Peer::ready(bench, world)?;
    judge(&world.scene, &look_with(&mut peer)?, aspect)
}

/// Samples from both cameras.
pub(super) fn look_with(peer: &mut Peer) -> Result<Vec<Answer>, super::Stop> {
    let below = camera_from_below();
    peer.view(2, below);
    let mut answers = ask_in_turns(peer, 1, &spread(&camera(), 0..LOOK))?;
    answers.extend(ask_in_turns(peer, 2, &spread(&below, LOOK..2 * LOOK))?);
    Ok(answers)
}

/// Asks for as many at once as the server takes, until all are answered.
pub(super) fn ask_in_turns(
    peer: &mut Peer,
    view: u32,
    requests: &[SampleRequest],
) -> Result<Vec<Answer>, super::Stop> {
    let mut answers = Vec::new();
    for some in requests.chunks(peer.credits()?.max(1)) {
        answers.extend(peer.ask_all(view, some)?);
    }
    Ok(answers)
}

fn answered_once(bench: &Bench) -> Checked {
    let mut peer = Peer::ready(bench, &bench.worlds.lit)?;
    let requests = spread(&camera(), 0..LOOK);
    let answers = ask_in_turns(&mut peer, 1, &requests)?;
    let ids: HashSet<u64> = answers.iter().map(|a| a.sample.id).collect();
    ensure(
        ids.len() == requests.len(),
        || format!("{} ids", requests.len()),
        || ids.len().to_string(),
    )?;
    // Anything that is sent twice comes before the answer to this or soon after; the account of the connection finds it.
    peer.round_trip(1)?;
    let end = Instant::now() + Duration::from_millis(200);
    loop {
        match peer.next_by(end)? {
            Came::Nothing => return Ok(()),
            Came::Message(crate::ToDisplay::Status { .. }) => {}
            came => return failed("nothing more", describe(&came, bench.options.timeout)),
        }
    }
}

fn many_batches(bench: &Bench) -> Checked {
    let mut peer = Peer::ready(bench, &bench.worlds.lit)?;
    let count = peer.credits()?.min(256) as u64;
    let requests = spread(&camera(), 0..count);
    for one in requests.chunks(3) {
        peer.ask(1, one);
    }
    let answers = peer.answers(requests.len())?;
    judge(&bench.worlds.lit.scene, &answers, judge::right)
}

fn largest_ids(bench: &Bench) -> Checked {
    let mut peer = Peer::ready(bench, &bench.worlds.lit)?;
    let mut requests = spread(&camera(), 0..3);
    let ids = [u64::MAX, 1 << 63, u64::from(u32::MAX) + 1];
    for (request, id) in requests.iter_mut().zip(ids) {
        request.id = id;
    }
    peer.ask_all(1, &requests).map(drop)
}

fn corners(bench: &Bench) -> Checked {
    let mut peer = Peer::ready(bench, &bench.worlds.lit)?;
    let camera = crate::messages::Camera {
        width: 16_384,
        height: 16_384,
        ..camera()
    };
    peer.view(2, camera);
    let (most, almost) = (16_383, 1.0f32.next_down());
    let places = [
        (0, 0, 0.0),
        (most, 0, 0.0),
        (0, most, almost),
        (most, most, almost),
    ];
    let requests: Vec<SampleRequest> = places
        .iter()
        .zip(0..)
        .map(|(&(x, y, offset), id)| SampleRequest {
            id,
            x,
            y,
            offset: [offset; 2],
        })
        .collect();
    let answers = peer.ask_all(2, &requests)?;
    judge(&bench.worlds.lit.scene, &answers, judge::on_the_ray)
}

/// The same requests in another order, in other messages and among others, on another connection, are the same samples.
fn same_twice(bench: &Bench) -> Checked {
    let requests = spread(&camera(), 0..100);
    let mut samples: Vec<Vec<Answer>> = Vec::new();
    for again in [false, true] {
        let mut peer = Peer::ready(bench, &bench.worlds.lamp)?;
        let mut asked = requests.clone();
        if again {
            peer.ask_all(1, &spread(&camera(), 1000..1032))?;
            asked.reverse();
        }
        let step = if again { 7 } else { 50 };
        let mut answers = Vec::new();
        for some in asked.chunks(step) {
            answers.extend(ask_in_turns(&mut peer, 1, some)?);
        }
        answers.sort_by_key(|a| a.sample.id);
        samples.push(answers);
    }
    for (first, second) in samples[0].iter().zip(&samples[1]) {
        let provisional = (first.sample.flags | second.sample.flags) & flags::PROVISIONAL != 0;
        ensure(
            provisional || first.sample == second.sample,
            || format!("{:?} again", first.sample),
            || format!("{:?}", second.sample),
        )?;
    }
    Ok(())
}
