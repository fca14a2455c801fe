//! What holds for any message, any scene and any bytes.
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

mod common;

use common::{any_scene, config, scene, to_display, to_server};
use proptest::collection::vec;
use proptest::prelude::*;
use protocol::codec::{decode, encode};
use protocol::framing::Message;
use protocol::scene::Scene;
use protocol::session::{DisplaySession, SceneSize, ServerSession};
use protocol::transfer::{Assembler, EncodedScene, TransferError};
use protocol::validate::validate_scene;
use protocol::{ToDisplay, ToServer};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Compares bytes, since a NaN differs from itself.
fn round_trip<T: Serialize + DeserializeOwned>(value: &T, cut: usize) {
    let bytes = encode(value).unwrap();
    let back: T = decode(&bytes).unwrap();
    assert_eq!(encode(&back).unwrap(), bytes);
    assert!(
        decode::<T>(&bytes[..cut % bytes.len()]).is_err(),
        "a truncated value was taken"
    );
    let longer = [&bytes[..], &[0]].concat();
    assert!(decode::<T>(&longer).is_err(), "an extended value was taken");
}

fn mutate(mut bytes: Vec<u8>, changes: &[(usize, u8)]) -> Vec<u8> {
    for &(place, value) in changes {
        let len = bytes.len();
        bytes[place % len] = value;
    }
    bytes
}

/// Decodes, checks and hands to a session: none of it may panic.
fn feed(bytes: &[u8]) {
    if let Ok(message) = decode::<ToServer>(bytes)
        && message.validate().is_ok()
    {
        let offer = protocol::messages::Capabilities {
            credits: 9,
            max_batch: 9,
            triples: true,
            edits: true,
            threads: 1,
        };
        let mut session = ServerSession::new(offer, vec![], 1 << 20);
        let _ = session.receive(protocol::handshake::hello("", 0));
        session.scene_built(&scene());
        let _ = session.receive(message);
    }
    if let Ok(message) = decode::<ToDisplay>(bytes)
        && message.validate().is_ok()
    {
        let mut session = DisplaySession::new(SceneSize {
            lights: 1,
            objects: 1,
            faces: 1,
        });
        let _ = session.receive(&message);
    }
    if let Ok(scene) = decode::<Scene>(bytes) {
        let _ = validate_scene(&scene);
    }
}

proptest! {
    #![proptest_config(config(400))]

    #[test]
    fn messages_to_servers_come_back(message in to_server(), cut in any::<usize>()) {
        round_trip(&message, cut);
    }

    #[test]
    fn messages_to_displays_come_back(message in to_display(), cut in any::<usize>()) {
        round_trip(&message, cut);
    }

    #[test]
    fn scenes_come_back(scene in any_scene(), cut in any::<usize>()) {
        round_trip(&scene, cut);
    }

    #[test]
    fn random_values_never_panic(a in to_server(), b in to_display(), c in any_scene()) {
        feed(&encode(&a).unwrap());
        feed(&encode(&b).unwrap());
        feed(&encode(&c).unwrap());
    }

    #[test]
    fn mutated_messages_never_panic(
        a in to_server(),
        b in to_display(),
        changes in vec(any::<(usize, u8)>(), 1..4),
    ) {
        feed(&mutate(encode(&a).unwrap(), &changes));
        feed(&mutate(encode(&b).unwrap(), &changes));
    }
}

proptest! {
    #![proptest_config(config(4000))]

    #[test]
    fn random_bytes_never_panic(tag in 0u8..12, bytes in vec(any::<u8>(), 0..200)) {
        feed(&bytes);
        feed(&[&[tag, 0, 0, 0], &bytes[..]].concat());
    }

    #[test]
    fn mutated_scenes_never_panic(changes in vec(any::<(usize, u8)>(), 1..4)) {
        feed(&mutate(encode(&scene()).unwrap(), &changes));
    }
}

proptest! {
    #![proptest_config(config(64))]

    #[test]
    fn scenes_survive_any_cutting(pieces in vec(1usize..100, 1..200)) {
        let encoded = EncodedScene::new(&scene()).unwrap();
        let all = encoded.bytes();
        let mut assembler = Assembler::new(encoded.digest(), all.len() as u64, 1 << 20).unwrap();
        let mut rest = all;
        for piece in pieces.iter().cycle() {
            let (now, later) = rest.split_at((*piece).min(rest.len()));
            rest = later;
            if assembler.add(now).unwrap() {
                break;
            }
        }
        prop_assert_eq!(assembler.finish().unwrap(), scene());
    }
}

#[test]
fn changed_missing_and_extra_scene_bytes_are_refused() {
    let encoded = EncodedScene::new(&scene()).unwrap();
    let len = encoded.bytes().len() as u64;
    let start = |bytes| Assembler::new(encoded.digest(), bytes, 1 << 20).unwrap();

    let mut changed = start(len);
    let mut bytes = encoded.bytes().to_vec();
    bytes[20] ^= 1;
    changed.add(&bytes).unwrap();
    assert!(matches!(changed.finish(), Err(TransferError::Digest)));

    let mut short = start(len);
    assert!(!short.add(&encoded.bytes()[1..]).unwrap());
    assert!(matches!(short.finish(), Err(TransferError::Digest)));

    let mut long = start(len);
    assert!(long.add(encoded.bytes()).unwrap());
    assert!(matches!(long.add(&[0]), Err(TransferError::Overrun { .. })));

    assert!(matches!(
        Assembler::new(encoded.digest(), 2 << 20, 1 << 20),
        Err(TransferError::TooLong {
            bytes: 0x20_0000,
            limit: 0x10_0000
        })
    ));
    let no_scene = b"no scene at all";
    let mut assembler = Assembler::new(blake3::hash(no_scene).into(), 15, 1 << 20).unwrap();
    assembler.add(no_scene).unwrap();
    assert!(matches!(assembler.finish(), Err(TransferError::Decode(_))));
}
