//! How scenes travel.

use crate::encode;
use crate::messages::FaultCode::{Limit, Malformed, OutOfOrder, Value};
use crate::messages::{FaultCode, ToServer, flags};
use crate::scene::Scene;

use super::check::{At, Check, Needs, ensure, refused, skipped};
use super::judge::{judge, right};
use super::peer::Peer;
use super::requests::{LOOK, look_with};
use super::world::{World, camera, spread};
use super::{Bench, Checked};

const SCENE: &str = "2, Scene";
const BYTES: &str = "1, Bytes";

pub(super) fn checks() -> Vec<Check> {
    let sent = |name, codes: &'static [FaultCode], bytes: fn(Vec<u8>) -> Vec<u8>| {
        Check::new(name, BYTES, move |bench: &Bench| {
            let mut peer = Peer::greeted(bench)?;
            send_raw(&mut peer, &bytes(fresh(bench)));
            peer.expect_fault(codes)
        })
        .needing(Needs::Welcome)
    };
    vec![
        Check::new("scene.small-chunks", SCENE, small_chunks),
        Check::new("scene.held", SCENE, held),
        Check::new("scene.empty", "5, Scene", empty),
        Check::new("scene.degenerate-faces", "5, Scene", degenerate),
        wrong("scene.other-digest", &[Malformed], |peer, bytes| {
            let digest = blake3::hash(&bytes[1..]).into();
            begin(peer, digest, bytes.len() as u64);
            chunk(peer, bytes);
        }),
        wrong("scene.more-than-announced", &[Limit], |peer, bytes| {
            begin(peer, blake3::hash(bytes).into(), bytes.len() as u64 - 1);
            chunk(peer, bytes);
        }),
        wrong("scene.more-in-a-later-chunk", &[Limit], |peer, bytes| {
            begin(peer, blake3::hash(bytes).into(), bytes.len() as u64 - 1);
            let (first, last) = bytes.split_at(bytes.len() - 2);
            chunk(peer, first);
            chunk(peer, last);
        }),
        wrong("scene.too-large", &[Limit], |peer, bytes| {
            begin(peer, blake3::hash(bytes).into(), 1 << 40);
        }),
        wrong("scene.empty-chunk", &[Limit, Value], |peer, bytes| {
            begin(peer, blake3::hash(bytes).into(), bytes.len() as u64);
            chunk(peer, &[]);
        }),
        wrong("scene.chunk-unannounced", &[OutOfOrder], |peer, bytes| {
            chunk(peer, bytes);
        }),
        wrong("scene.begun-twice", &[OutOfOrder], |peer, bytes| {
            begin(peer, blake3::hash(bytes).into(), bytes.len() as u64);
            begin(peer, blake3::hash(bytes).into(), bytes.len() as u64);
        }),
        refused("scene.second", SCENE, At::Ready, &[OutOfOrder], |peer| {
            begin(peer, [7; 32], 100);
        }),
        refused(
            "scene.chunk-after-ready",
            SCENE,
            At::Ready,
            &[OutOfOrder],
            |peer| {
                chunk(peer, &[0; 8]);
            },
        ),
        refused(
            "scene.view-before",
            SCENE,
            At::Greeted,
            &[OutOfOrder],
            |peer| {
                peer.view(1, camera());
            },
        ),
        refused(
            "scene.edit-before",
            SCENE,
            At::Greeted,
            &[OutOfOrder],
            |peer| {
                peer.edit(1, Vec::new(), Vec::new());
            },
        ),
        refused(
            "scene.cancel-before",
            SCENE,
            At::Greeted,
            &[OutOfOrder],
            |peer| peer.cancel(1),
        ),
        sent("scene.bytes-after-its-end", &[Malformed], |bytes| {
            [&bytes[..], &[0]].concat()
        }),
        sent("scene.ends-early", &[Malformed], |bytes| {
            bytes[..bytes.len() - 1].to_vec()
        }),
        sent("scene.unknown-model", &[Malformed], |mut bytes| {
            bytes[0] = 3;
            bytes
        }),
        sent("scene.endless-list", &[Malformed], |mut bytes| {
            // The number of lights, after the model and two colours.
            bytes[28..36].copy_from_slice(&u64::MAX.to_le_bytes());
            bytes
        }),
        sent("scene.unknown-light", &[Malformed], |mut bytes| {
            bytes[36] = 3;
            bytes
        }),
    ]
}

/// Bytes of a scene that no server holds yet: its background is not that of others.
fn fresh(bench: &Bench) -> Vec<u8> {
    let mut scene = bench.worlds.lit.scene.clone();
    scene.shading.background[0] = 0.375;
    encode(&scene).unwrap_or_default()
}

fn begin(peer: &mut Peer, digest: crate::messages::Digest, bytes: u64) {
    peer.send(&ToServer::SceneBegin { digest, bytes });
}

fn chunk(peer: &mut Peer, data: &[u8]) {
    let data = data.to_vec();
    peer.send(&ToServer::SceneChunk { data });
}

/// Sends bytes as a scene.
pub(super) fn send_raw(peer: &mut Peer, bytes: &[u8]) {
    begin(peer, blake3::hash(bytes).into(), bytes.len() as u64);
    chunk(peer, bytes);
}

fn wrong(name: &str, codes: &'static [FaultCode], send: fn(&mut Peer, &[u8])) -> Check {
    Check::new(name, SCENE, move |bench: &Bench| {
        let mut peer = Peer::greeted(bench)?;
        send(&mut peer, &fresh(bench));
        peer.expect_fault(codes)
    })
    .needing(Needs::Welcome)
}

fn world_of(scene: Scene) -> Result<World, super::Stop> {
    match World::new(scene) {
        Ok(world) => Ok(world),
        Err(error) => super::check::failed("a scene of the checks", error.to_string()),
    }
}

fn small_chunks(bench: &Bench) -> Checked {
    let mut scene = bench.worlds.lit.scene.clone();
    scene.shading.background[1] = 0.375;
    let world = world_of(scene)?;
    let mut peer = Peer::greeted(bench)?;
    if !peer.announce(&world.encoded) {
        peer.send(&world.encoded.begin());
        for data in world.encoded.bytes().chunks(11) {
            chunk(&mut peer, data);
        }
    } else {
        peer.send(&world.encoded.begin());
    }
    peer.expect_ready()?;
    peer.view(1, camera());
    judge(
        &world.scene,
        &peer.ask_all(1, &spread(&camera(), 0..100))?,
        right,
    )
}

/// A scene that is held is built with no chunk sent, as it was before an earlier display's edits.
fn held(bench: &Bench) -> Checked {
    let world = &bench.worlds.lit;
    let mut first = Peer::ready(bench, world)?;
    if first.welcome()?.capabilities.edits {
        super::edits::move_block(&mut first, 1, [3.0, 1.0, 0.0]);
        first.ask_all(1, &spread(&camera(), 0..10))?;
    }
    drop(first);
    let mut peer = Peer::greeted(bench)?;
    if !peer.welcome()?.holds.contains(&world.encoded.digest()) {
        return skipped("the server does not list the scene that it was just sent");
    }
    peer.send_scene(&world.encoded);
    peer.expect_ready()?;
    peer.view(1, camera());
    judge(&world.scene, &look_with(&mut peer)?, right)
}

fn empty(bench: &Bench) -> Checked {
    let mut peer = Peer::ready(bench, &bench.worlds.empty)?;
    for answer in peer.ask_all(1, &spread(&camera(), 0..50))? {
        ensure(
            answer.sample.flags & flags::MISS != 0,
            || "nothing but misses".into(),
            || format!("{:?}", answer.sample),
        )?;
    }
    Ok(())
}

/// Faces without an area, and a mesh without faces, are allowed.
fn degenerate(bench: &Bench) -> Checked {
    let mut scene = bench.worlds.lit.scene.clone();
    scene.meshes[0].faces.extend([[1, 1, 2], [0, 0, 0]]);
    let mut nothing = scene.meshes[0].clone();
    nothing.faces.clear();
    scene.meshes.push(nothing);
    let mut bare = scene.objects[1].clone();
    (bare.name, bare.mesh) = ("nothing".into(), 1);
    let world = world_of(scene.clone())?;
    let mut peer = Peer::ready(bench, &world)?;
    judge(
        &scene,
        &peer.ask_all(1, &spread(&camera(), 0..LOOK / 4))?,
        right,
    )?;
    scene.objects.push(bare);
    let mut peer = Peer::ready(bench, &world_of(scene)?)?;
    let answers = peer.ask_all(1, &spread(&camera(), 0..LOOK / 4))?;
    judge(&world.scene, &answers, right)
}
