//! Bytes that may be a message or a scene.

use protocol::framing::{HEADER, Message, frame};
use protocol::limits::MAX_FRAME;
use protocol::scene::Scene;
use protocol::transfer::EncodedScene;
use protocol::validate::validate_scene;
use protocol::{ToDisplay, ToServer, decode, encode};

pub(super) fn to_server(data: &[u8]) {
    message::<ToServer>(data);
}

pub(super) fn to_display(data: &[u8]) {
    message::<ToDisplay>(data);
}

/// What decodes encodes to the same bytes; what is accepted fits a frame, and is accepted as it comes out of it.
fn message<M: Message>(data: &[u8]) {
    let Ok(message) = decode::<M>(data) else {
        return;
    };
    assert_eq!(encode(&message).expect("what was decoded encodes"), data);
    if message.validate().is_err() || data.len() > MAX_FRAME {
        return;
    }
    let framed = frame(&message).expect("a good message fits a frame");
    assert_eq!(&framed[HEADER..], data);
    let again: M = decode(&framed[HEADER..]).expect("a frame's payload is a message");
    assert!(again.validate().is_ok(), "a message was accepted once");
}

pub(super) fn scene(data: &[u8]) {
    let Ok(scene) = decode::<Scene>(data) else {
        return;
    };
    assert_eq!(encode(&scene).expect("what was decoded encodes"), data);
    let sendable = EncodedScene::new(&scene);
    assert_eq!(sendable.is_ok(), validate_scene(&scene).is_ok());
    if let Ok(encoded) = sendable {
        assert_eq!(encoded.bytes(), data);
    }
}
