//! Bytes that come in unusual portions, and connections that end in unusual places.

use std::time::Duration;

use crate::framing::frame;
use crate::messages::ToServer;

use super::check::{Check, Needs};
use super::judge::{judge, right};
use super::peer::Peer;
use super::requests::{LOOK, look_with};
use super::world::{camera, spread};
use super::{Bench, Checked};

const BYTES: &str = "1, Bytes";
const ORDER: &str = "2, Order";

pub(super) fn checks() -> Vec<Check> {
    vec![
        Check::new("streams.byte-by-byte", BYTES, dripping),
        Check::new("streams.many-messages-at-once", BYTES, at_once),
        Check::new("streams.half-closed", BYTES, half_closed),
        Check::new(
            "streams.half-closed-in-a-frame",
            BYTES,
            half_closed_in_a_frame,
        )
        .needing(Needs::Welcome),
        Check::new("streams.gone-in-a-frame", ORDER, gone),
        Check::new("streams.gone-while-busy", ORDER, gone_while_busy),
        Check::new("streams.gone-in-a-scene", ORDER, gone_in_a_scene),
    ]
}

fn bytes_of(messages: &[ToServer]) -> Vec<u8> {
    messages
        .iter()
        .flat_map(|message| frame(message).unwrap_or_default())
        .collect()
}

fn drip(peer: &mut Peer, messages: &[ToServer]) {
    for byte in bytes_of(messages) {
        peer.send_bytes(&[byte]);
    }
}

fn dripping(bench: &Bench) -> Checked {
    let world = &bench.worlds.lit;
    let mut peer = Peer::connect(bench)?;
    drip(&mut peer, &[crate::handshake::hello("conformance", 1)]);
    peer.expect_welcome()?;
    let mut scene = vec![world.encoded.begin()];
    if !peer.announce(&world.encoded) {
        scene.extend(world.encoded.chunks());
    }
    drip(&mut peer, &scene);
    peer.expect_ready()?;
    peer.view(1, camera());
    let requests = peer.requests(1, &spread(&camera(), 0..20));
    drip(&mut peer, &requests);
    judge(&world.scene, &peer.answers(20)?, right)
}

fn at_once(bench: &Bench) -> Checked {
    let world = &bench.worlds.lit;
    let mut peer = Peer::ready(bench, world)?;
    let mut bytes = Vec::new();
    let per_view = (peer.credits()?.min(300) / 30).max(1) as u64;
    let views = 2..32u32;
    for view in views.clone() {
        let camera = camera();
        peer.view(view, camera);
        let from = u64::from(view) * per_view;
        let requests = peer.requests(view, &spread(&camera, from..from + per_view));
        bytes.extend(bytes_of(&requests));
    }
    peer.send_bytes(&bytes);
    peer.ping(3);
    let answers = peer.answers(views.len() * per_view as usize)?;
    judge(&world.scene, &answers, right)
}

/// A display that says it will send nothing more has ended well: it is left in peace and closed.
fn half_closed(bench: &Bench) -> Checked {
    let mut peer = Peer::ready(bench, &bench.worlds.lit)?;
    peer.ask(1, &spread(&camera(), 0..20));
    peer.shut_down_writing();
    peer.expect_left("the display's end")
}

fn half_closed_in_a_frame(bench: &Bench) -> Checked {
    let mut peer = Peer::greeted(bench)?;
    peer.send_bytes(&[44, 0, 0, 0, 1, 0]);
    peer.shut_down_writing();
    // It may be told that this was no end, or not.
    let deadline = std::time::Instant::now() + bench.options.timeout;
    loop {
        match peer.next_by(deadline)? {
            super::peer::Came::Message(_) => {}
            super::peer::Came::Closed => return Ok(()),
            came @ super::peer::Came::Nothing => {
                let came = super::peer::describe(&came, bench.options.timeout);
                return super::check::failed("the end of the connection", came);
            }
        }
    }
}

/// Whether a new display is served.
fn served(bench: &Bench) -> Checked {
    let world = &bench.worlds.lit;
    let mut peer = Peer::ready(bench, world)?;
    judge(&world.scene, &look_with(&mut peer)?, right)
}

fn gone(bench: &Bench) -> Checked {
    for length in [1, 3, 4, 9] {
        let mut peer = Peer::ready(bench, &bench.worlds.lit)?;
        peer.send_bytes(&[200, 0, 0, 0, 4, 0, 0, 0, 1][..length]);
        drop(peer);
    }
    served(bench)
}

fn gone_while_busy(bench: &Bench) -> Checked {
    for _ in 0..5 {
        let mut peer = Peer::ready(bench, &bench.worlds.lit)?;
        let many = peer.credits()?.min(20_000) as u64;
        peer.ask(1, &spread(&camera(), 0..many));
        // What has come is not read, so that the connection is reset.
        std::thread::sleep(Duration::from_millis(20));
        drop(peer);
    }
    served(bench)
}

fn gone_in_a_scene(bench: &Bench) -> Checked {
    for _ in 0..3 {
        let mut peer = Peer::greeted(bench)?;
        peer.send(&ToServer::SceneBegin {
            digest: [1; 32],
            bytes: LOOK * 1000,
        });
        let data = vec![0; 1000];
        peer.send(&ToServer::SceneChunk { data });
        drop(peer);
    }
    served(bench)
}
