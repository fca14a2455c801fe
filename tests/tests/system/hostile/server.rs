//! Displays that break rules, against the shader server: each hears which, and an honest one beside them gets its samples.

use std::net::Shutdown;
use std::time::Instant;

use protocol::framing::Message;
use protocol::messages::{FaultCode, LightMove, ObjectMove, SampleRequest};
use protocol::scene::Light;
use protocol::transfer::EncodedScene;
use protocol::{ToServer, encode};

use super::wire::{Wire, camera, request, scene, view};
use super::wrong;
use crate::support::{LIMIT, ShaderServer, peak_kib};

/// Memory that a server may take for bad displays, KiB.
const ALLOWED: u64 = 24 << 10;

/// What a display sends in place of something good.
type Bad = (&'static str, Vec<u8>, FaultCode);

fn raw<M: Message>(message: &M) -> Vec<u8> {
    let payload = encode(message).unwrap();
    let mut bytes = (payload.len() as u32).to_le_bytes().to_vec();
    bytes.extend(payload);
    bytes
}

fn hello(min_version: u16, max_version: u16) -> ToServer {
    ToServer::Hello {
        min_version,
        max_version,
        name: "hostile".into(),
        seed: 7,
    }
}

fn ask(view: u32, samples: Vec<SampleRequest>) -> Vec<u8> {
    raw(&ToServer::Request { view, samples })
}

/// Before anything else was said.
fn beginnings() -> Vec<Bad> {
    use FaultCode::{Malformed, OutOfOrder, Version};
    let no_version = raw(&hello(4, 9));
    let backwards = raw(&hello(3, 1));
    let ping = raw(&ToServer::Ping { token: 1 });
    vec![
        ("versions to come", no_version, Version),
        ("versions the wrong way round", backwards, FaultCode::Value),
        ("a ping before Hello", ping, OutOfOrder),
        (
            "a web browser",
            b"GET / HTTP/1.1\r\n\r\n".to_vec(),
            FaultCode::Limit,
        ),
        ("a view before Hello", raw(&view(1)), OutOfOrder),
        ("an empty frame", vec![0; 4], Malformed),
    ]
}

/// After `Welcome`.
fn before_a_scene() -> Vec<Bad> {
    use FaultCode::{Limit, Malformed, OutOfOrder};
    let encoded = EncodedScene::new(&scene()).unwrap();
    let begin = |digest, bytes| raw(&ToServer::SceneBegin { digest, bytes });
    let chunk = |data: &[u8]| {
        raw(&ToServer::SceneChunk {
            data: data.to_vec(),
        })
    };
    let other = [7; 32];
    let whole = encoded.bytes();
    let length = whole.len() as u64;
    let more = [begin(other, 3), chunk(&[0; 4])].concat();
    let lie = [begin(other, length), chunk(whole)].concat();
    let none = [begin(blake3(b"none"), 4), chunk(b"none")].concat();
    vec![
        ("Hello twice", raw(&hello(1, 3)), OutOfOrder),
        ("a view before the scene", raw(&view(1)), OutOfOrder),
        (
            "a request before the scene",
            ask(1, vec![request(1)]),
            OutOfOrder,
        ),
        ("a piece of no scene", chunk(&[1]), OutOfOrder),
        ("a scene of 2^60 bytes", begin(other, 1 << 60), Limit),
        ("more than was announced", more, Limit),
        ("another scene than announced", lie, Malformed),
        ("bytes that are no scene", none, Malformed),
        (
            "a piece of nothing",
            raw(&ToServer::SceneChunk { data: vec![] }),
            Limit,
        ),
    ]
}

fn blake3(bytes: &[u8]) -> [u8; 32] {
    blake3::hash(bytes).into()
}

/// After `SceneReady` and view 1.
fn in_a_session() -> Vec<Bad> {
    use FaultCode::{Limit, OutOfOrder, Value};
    let with_camera = |change: fn(&mut protocol::messages::Camera)| {
        let mut camera = camera();
        change(&mut camera);
        raw(&ToServer::View { view: 2, camera })
    };
    let with_request = |change: fn(&mut SampleRequest)| {
        let mut request = request(1);
        change(&mut request);
        ask(1, vec![request])
    };
    let edit = |epoch, object, transform, lights| {
        let objects = vec![ObjectMove { object, transform }];
        raw(&ToServer::Edit {
            epoch,
            objects,
            lights,
        })
    };
    let stays = scene().objects[0].transform;
    let mut singular = stays;
    singular[1] = [0.0; 4];
    let other_kind = LightMove {
        light: 0,
        value: Light::Linear {
            from: [0.0; 3],
            to: [1.0; 3],
            intensity: [1.0; 3],
        },
    };
    let cancelled = [
        raw(&ToServer::Cancel { views_before: 2 }),
        ask(1, vec![request(1)]),
    ];
    let too_many = (0..32_769).map(request).collect();
    vec![
        (
            "an eye that is no number",
            with_camera(|c| c.eye[1] = f32::NAN),
            Value,
        ),
        ("an eye at 1e30", with_camera(|c| c.eye[0] = 1e30), Value),
        (
            "a field of view of 180",
            with_camera(|c| c.fov_y = 180.0),
            Value,
        ),
        (
            "an image without pixels",
            with_camera(|c| c.width = 0),
            Value,
        ),
        (
            "an image of 2^31 pixels",
            with_camera(|c| c.height = 1 << 31),
            Value,
        ),
        ("a view twice", raw(&view(1)), OutOfOrder),
        (
            "a request outside the image",
            with_request(|r| r.x = 64),
            Value,
        ),
        (
            "an offset that is no number",
            with_request(|r| r.offset[0] = f32::NAN),
            Value,
        ),
        ("an offset of 1", with_request(|r| r.offset[1] = 1.0), Value),
        ("a view never sent", ask(9, vec![request(1)]), OutOfOrder),
        ("a request of nothing", ask(1, vec![]), Limit),
        ("an id twice", ask(1, vec![request(1), request(1)]), Value),
        ("too many at once", ask(1, too_many), Limit),
        ("a cancelled view", cancelled.concat(), OutOfOrder),
        (
            "an epoch that is left out",
            edit(2, 0, stays, vec![]),
            OutOfOrder,
        ),
        ("an object past the table", edit(1, 9, stays, vec![]), Value),
        (
            "an object that is pressed flat",
            edit(1, 0, singular, vec![]),
            Value,
        ),
        (
            "a light of another kind",
            edit(1, 0, stays, vec![other_kind]),
            Value,
        ),
    ]
}

/// An honest display's samples are the same before, during and after.
fn attack(open: impl Fn(&str) -> Wire, bad: Vec<Bad>) {
    let server = ShaderServer::start();
    let mut honest = Wire::opened(&server.address);
    let before = honest.ask(1, 0..500);
    let quiet = peak_kib(server.id());
    let mut wrong = Vec::new();
    let mut ids = 500;
    for (name, bytes, expected) in bad {
        let mut hostile = open(&server.address);
        hostile.send_bytes(&bytes);
        let heard = hostile.fault();
        if heard != Some(expected) {
            wrong.push((name, expected, heard));
        }
        assert_eq!(honest.ask(1, ids..ids + 10).len(), 10, "after {name}");
        ids += 10;
    }
    assert!(
        wrong.is_empty(),
        "case, what it is to hear, what it heard: {wrong:?}"
    );
    let mut next = Wire::opened(&server.address);
    assert!(
        next.ask(1, 0..500) == before,
        "samples are others than before"
    );
    let peak = peak_kib(server.id());
    assert!(peak < quiet + ALLOWED, "{peak} KiB, {quiet} before");
}

#[test]
fn bad_beginnings_are_told() {
    attack(Wire::connect, beginnings());
    attack(Wire::connect, wrong::frames(11));
}

#[test]
fn bad_scenes_are_told() {
    attack(Wire::greeted, before_a_scene());
    attack(Wire::greeted, wrong::frames(11));
}

#[test]
fn bad_sessions_are_told() {
    attack(Wire::opened, in_a_session());
    attack(Wire::opened, wrong::frames(11));
}

#[test]
fn displays_that_vanish_or_stop_in_the_middle_are_forgotten() {
    let server = ShaderServer::start();
    let mut honest = Wire::opened(&server.address);
    let before = honest.ask(1, 0..100);
    let request = ask(1, (0..60_000 / 2).map(request).collect());
    let start = Instant::now();
    // Half of Hello, half of a scene, half of a request; one leaves while its requests are traced; none says Goodbye.
    let hello = raw(&hello(1, 3));
    let mut half_hello = Wire::connect(&server.address);
    half_hello.send_bytes(&hello[..hello.len() / 2]);
    let mut half_scene = Wire::greeted(&server.address);
    half_scene.send_bytes(&raw(&EncodedScene::new(&scene()).unwrap().begin()));
    let mut half_request = Wire::opened(&server.address);
    half_request.send_bytes(&request[..request.len() / 2]);
    let mut leaving = Wire::opened(&server.address);
    leaving.send_bytes(&request);
    drop(leaving);
    let silent = Wire::connect(&server.address);
    let mut shut = Wire::opened(&server.address);
    shut.stream.shutdown(Shutdown::Write).unwrap();
    assert_eq!(shut.fault(), None, "its end is an end, not a fault");
    let mut next = Wire::opened(&server.address);
    assert!(next.ask(1, 0..100) == before);
    // Those that never said Hello are dropped, and told why if they can still hear.
    for mut half_open in [half_hello, silent] {
        assert_eq!(half_open.fault(), Some(FaultCode::OutOfOrder), "no Hello");
    }
    assert!(start.elapsed() < LIMIT);
    assert_eq!(honest.ask(1, 200..300).len(), 100);
    drop((half_scene, half_request));
}
