//! Who stands in whose light.

use std::collections::HashSet;

use crate::messages::Triple;

use super::check::{Check, ensure, skipped};
use super::edits::move_block;
use super::judge::seen;
use super::peer::{Answer, Peer};
use super::requests::look_with;
use super::world::{Thing, between, camera, spread, wide};
use super::{Bench, Checked};
use crate::scene::{Light, Scene};

const TRIPLES: &str = "2, Triples";

pub(super) fn checks() -> Vec<Check> {
    vec![
        Check::new("triples.before-their-samples", TRIPLES, in_time),
        Check::new("triples.true", TRIPLES, right),
        Check::new("triples.once", TRIPLES, once),
        Check::new("triples.again-after-edit", TRIPLES, again),
    ]
}

fn telling(bench: &Bench) -> Result<Peer, super::Stop> {
    let peer = Peer::ready(bench, &bench.worlds.lit)?;
    if peer.welcome()?.capabilities.triples {
        return Ok(peer);
    }
    skipped("the server does not offer triples")
}

/// Blocker and receiver of an answer that is surely in shadow.
fn met(scene: &Scene, answer: &Answer) -> Option<Triple> {
    let (_, hit) = seen(scene, &answer.camera, &answer.request)?;
    let hit = hit?;
    let (Thing::Object(receiver), Some(Light::Point { position, .. })) =
        (hit.thing, scene.lights.first())
    else {
        return None;
    };
    let to = super::world::sub(wide(*position), hit.at);
    if super::world::dot(to, hit.normal) <= 0.0 {
        return None;
    }
    match between(scene, hit.at, wide(*position))? {
        Thing::Object(blocker) => Some(Triple {
            light: 0,
            blocker,
            receiver,
        }),
        _ => None,
    }
}

fn in_time(bench: &Bench) -> Checked {
    let scene = &bench.worlds.lit.scene;
    let mut peer = telling(bench)?;
    let answers = look_with(&mut peer)?;
    let mut shadows = 0;
    for answer in &answers {
        let Some(triple) = met(scene, answer) else {
            continue;
        };
        shadows += 1;
        let told = peer.told.iter().find(|t| t.triple == triple);
        ensure(
            told.is_some_and(|t| t.message < answer.message),
            || {
                format!(
                    "{triple:?} before sample {}, which met it",
                    answer.sample.id
                )
            },
            || told.map_or("nothing".into(), |_| "it after the sample".into()),
        )?;
    }
    ensure(
        shadows > 10,
        || "shadows: a defect of these checks".into(),
        || shadows.to_string(),
    )
}

/// No triple that geometry does not allow: block and wall hide the light from the floor, and nothing else from anything. A surface may
/// be said to hide a light behind it from itself.
fn right(bench: &Bench) -> Checked {
    let mut peer = telling(bench)?;
    look_with(&mut peer)?;
    for told in &peer.told {
        let Triple {
            light,
            blocker,
            receiver,
        } = told.triple;
        let possible = light == 0 && receiver == 0 && matches!(blocker, 1 | 2);
        ensure(
            possible || blocker == receiver,
            || "triples of light 0, blockers 1 and 2 and receiver 0".into(),
            || format!("{:?}", told.triple),
        )?;
    }
    Ok(())
}

fn unrepeated(peer: &Peer) -> Checked {
    let mut seen = HashSet::new();
    for told in &peer.told {
        ensure(
            seen.insert((told.epoch, told.triple)),
            || "each triple once an epoch".into(),
            || format!("{:?} again in epoch {}", told.triple, told.epoch),
        )?;
    }
    Ok(())
}

fn once(bench: &Bench) -> Checked {
    let mut peer = telling(bench)?;
    look_with(&mut peer)?;
    peer.ask_all(1, &spread(&camera(), 2000..2200))?;
    unrepeated(&peer)
}

/// What is met in a new epoch is told in it, also if it was met before.
fn again(bench: &Bench) -> Checked {
    let mut peer = telling(bench)?;
    if !peer.welcome()?.capabilities.edits {
        return skipped("the server takes no edits");
    }
    peer.ask_all(1, &spread(&camera(), 0..200))?;
    move_block(&mut peer, 1, [0.05, 1.0, 0.0]);
    peer.ask_all(1, &spread(&camera(), 200..400))?;
    unrepeated(&peer)?;
    let triple = Triple {
        light: 0,
        blocker: 1,
        receiver: 0,
    };
    let told = peer.told.iter().any(|t| t.epoch == 1 && t.triple == triple);
    ensure(
        told,
        || format!("{triple:?} in epoch 1"),
        || "nothing".into(),
    )
}
