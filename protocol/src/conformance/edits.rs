//! Things that move.

use crate::messages::FaultCode::{OutOfOrder, Unsupported, Value};
use crate::messages::{FaultCode, LightMove, ObjectMove};
use crate::scene::{Light, Scene};

use super::check::{Check, ensure, skipped};
use super::judge::{judge, right};
use super::peer::{Answer, Peer};
use super::world::{V, block_at, camera, spread};
use super::{Bench, Checked};

const EPOCHS: &str = "2, Epochs";
const EDIT: &str = "3, Edit";

type Moves = (Vec<ObjectMove>, Vec<LightMove>);

pub(super) fn checks() -> Vec<Check> {
    let bad = |name, codes: &'static [FaultCode], epoch, moves: fn() -> Moves| {
        Check::new(name, EDIT, move |bench| {
            let mut peer = editable(bench)?;
            let (objects, lights) = moves();
            peer.edit(epoch, objects, lights);
            peer.expect_fault(codes)
        })
    };
    vec![
        Check::new("edits.unsupported", EDIT, unsupported),
        Check::new("edits.object-moved", EPOCHS, object_moved),
        Check::new("edits.light-moved", EPOCHS, light_moved),
        Check::new("edits.epoch-of-samples", EPOCHS, epochs),
        Check::new("edits.while-busy", EPOCHS, while_busy),
        Check::new("edits.of-nothing", EDIT, of_nothing),
        bad("edits.epoch-skipped", &[OutOfOrder], 2, || {
            (vec![block([1.0; 3])], Vec::new())
        }),
        bad("edits.epoch-0", &[OutOfOrder], 0, || {
            (vec![block([1.0; 3])], Vec::new())
        }),
        bad("edits.object-past-table", &[Value], 1, || {
            let mut moved = block([1.0; 3]);
            moved.object = 3;
            (vec![moved], Vec::new())
        }),
        bad("edits.light-past-table", &[Value], 1, || {
            (Vec::new(), vec![light(1, [1.0; 3])])
        }),
        bad("edits.light-of-other-kind", &[Value], 1, || {
            let value = Light::Linear {
                from: [0.0; 3],
                to: [1.0; 3],
                intensity: [1.0; 3],
            };
            (Vec::new(), vec![LightMove { light: 0, value }])
        }),
        bad("edits.light-nan", &[Value], 1, || {
            (Vec::new(), vec![light(0, [0.0, f32::NAN, 0.0])])
        }),
        bad("edits.transform-singular", &[Value], 1, || {
            let mut moved = block([1.0; 3]);
            moved.transform[0] = moved.transform[2];
            (vec![moved], Vec::new())
        }),
        bad("edits.transform-nan", &[Value], 1, || {
            let mut moved = block([1.0; 3]);
            moved.transform[1][1] = f32::NAN;
            (vec![moved], Vec::new())
        }),
    ]
}

fn block(middle: V) -> ObjectMove {
    ObjectMove {
        object: 1,
        transform: block_at(middle),
    }
}

fn light(light: u32, position: [f32; 3]) -> LightMove {
    let intensity = [20.0, 30.0, 40.0];
    let value = Light::Point {
        position,
        intensity,
    };
    LightMove { light, value }
}

/// Moves the block of the lit scene.
pub(super) fn move_block(peer: &mut Peer, epoch: u32, middle: V) {
    peer.edit(epoch, vec![block(middle)], Vec::new());
}

/// The scene as it is after these moves.
fn after(scene: &Scene, (objects, lights): &Moves) -> Scene {
    let mut scene = scene.clone();
    for moved in objects {
        scene.objects[moved.object as usize].transform = moved.transform;
    }
    for moved in lights {
        scene.lights[moved.light as usize] = moved.value.clone();
    }
    scene
}

fn editable(bench: &Bench) -> Result<Peer, super::Stop> {
    let peer = Peer::ready(bench, &bench.worlds.lit)?;
    if peer.welcome()?.capabilities.edits {
        return Ok(peer);
    }
    skipped("the server does not offer edits")
}

fn unsupported(bench: &Bench) -> Checked {
    let mut peer = Peer::ready(bench, &bench.worlds.lit)?;
    if peer.welcome()?.capabilities.edits {
        return skipped("the server offers edits");
    }
    move_block(&mut peer, 1, [1.0; 3]);
    peer.expect_fault(&[Unsupported])
}

fn all_of(answers: &[Answer], epoch: u32) -> Checked {
    let other = answers.iter().find(|a| a.epoch != epoch);
    ensure(
        other.is_none(),
        || format!("samples of epoch {epoch}"),
        || other.map_or(String::new(), |a| format!("one of epoch {}", a.epoch)),
    )
}

fn moved(bench: &Bench, moves: Moves) -> Checked {
    let scene = &bench.worlds.lit.scene;
    let mut peer = editable(bench)?;
    judge(scene, &peer.ask_all(1, &spread(&camera(), 0..100))?, right)?;
    let now = after(scene, &moves);
    peer.edit(1, moves.0, moves.1);
    // Of a view from before, and of a new one.
    peer.ask(1, &spread(&camera(), 100..300));
    peer.view(2, camera());
    peer.ask(2, &spread(&camera(), 300..500));
    let answers = peer.answers(400)?;
    judge(&now, &answers, right)?;
    all_of(&answers, 1)
}

fn object_moved(bench: &Bench) -> Checked {
    moved(bench, (vec![block([1.6, 0.7, 0.9])], Vec::new()))
}

fn light_moved(bench: &Bench) -> Checked {
    moved(bench, (Vec::new(), vec![light(0, [1.0, 2.5, -0.6])]))
}

fn of_nothing(bench: &Bench) -> Checked {
    moved(bench, (Vec::new(), Vec::new()))
}

/// Each edit is on top of the last, and samples carry their epoch.
fn epochs(bench: &Bench) -> Checked {
    let mut scene = bench.worlds.lit.scene.clone();
    let mut peer = editable(bench)?;
    for epoch in 1..6 {
        let share = epoch as f32 / 5.0;
        let moves: Moves = if epoch % 2 == 0 {
            (Vec::new(), vec![light(0, [share, 3.0, -share])])
        } else {
            (vec![block([share.into(), 1.0, 0.5])], Vec::new())
        };
        scene = after(&scene, &moves);
        peer.edit(epoch, moves.0, moves.1);
        let from = u64::from(epoch) * 100;
        let answers = peer.ask_all(1, &spread(&camera(), from..from + 60))?;
        all_of(&answers, epoch)?;
        judge(&scene, &answers, right)?;
    }
    Ok(())
}

/// Samples asked for before an edit may be of either epoch, and are what they say.
fn while_busy(bench: &Bench) -> Checked {
    let before = &bench.worlds.lit.scene;
    let mut peer = editable(bench)?;
    let many = peer.credits()?.min(2000) as u64 / 2;
    let moves: Moves = (vec![block([1.6, 0.7, 0.9])], Vec::new());
    let now = after(before, &moves);
    peer.ask(1, &spread(&camera(), 0..many));
    peer.edit(1, moves.0, moves.1);
    peer.ask(1, &spread(&camera(), many..2 * many));
    let answers = peer.answers(2 * many as usize)?;
    let (old, new): (Vec<Answer>, Vec<Answer>) = answers.into_iter().partition(|a| a.epoch == 0);
    let late = old.iter().find(|a| a.request.id >= many);
    ensure(
        late.is_none(),
        || "samples asked for after an edit in its epoch".into(),
        || {
            late.map_or(String::new(), |a| {
                format!("sample {} in epoch 0", a.request.id)
            })
        },
    )?;
    if !old.is_empty() {
        judge(before, &old, right)?;
    }
    judge(&now, &new, right)
}
