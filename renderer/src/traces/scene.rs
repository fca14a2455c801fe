//! The scene's own bytes among the frames of a trace: there once, however many servers were sent them.

use std::collections::HashMap;
use std::sync::Arc;

use bytes::Bytes;
use protocol::trace::Event;
use protocol::transfer::EncodedScene;

/// Bytes of an encoded `SceneChunk` before the data: the message's number and the length.
const BEFORE: usize = 12;
/// The message's number.
const CHUNK: [u8; 4] = 2u32.to_le_bytes();

/// How far each connection has been sent the scene.
pub(super) struct SceneFrames {
    scene: Arc<EncodedScene>,
    sent: HashMap<u32, usize>,
}

impl SceneFrames {
    pub(super) fn new(scene: Arc<EncodedScene>) -> Self {
        Self {
            scene,
            sent: HashMap::new(),
        }
    }

    /// Takes the data of a `SceneChunk` out of an event where the scene has the same.
    pub(super) fn shorten(&mut self, event: &mut Event) {
        let Event::Sent { connection, frame } = event else {
            if let Event::Closed { connection, .. } = event {
                self.sent.remove(connection);
            }
            return;
        };
        let Some(data) = data(frame) else { return };
        let at = self.sent.entry(*connection).or_default();
        let end = *at + data.len();
        if self.scene.bytes().get(*at..end) == Some(data) {
            let (connection, start) = (*connection, std::mem::replace(at, end));
            *event = Event::SceneSent {
                connection,
                at: start as u64,
                bytes: (end - start) as u32,
            };
        }
    }
}

/// The data of a frame that is a `SceneChunk`.
fn data(frame: &Bytes) -> Option<&[u8]> {
    let data = frame.get(BEFORE..)?;
    let length = (data.len() as u64).to_le_bytes();
    (frame[..4] == CHUNK && frame[4..BEFORE] == length).then_some(data)
}

#[cfg(test)]
mod tests {
    use protocol::{ToServer, encode};

    use super::*;
    use crate::link::testing_scene;

    #[test]
    fn the_scene_s_own_chunks_are_told_by_their_place_and_others_kept() {
        let scene = Arc::new(EncodedScene::new(&testing_scene()).unwrap());
        let mut frames = SceneFrames::new(Arc::clone(&scene));
        let (head, tail) = scene.bytes().split_at(40);
        let sent = |data: &[u8]| Event::Sent {
            connection: 3,
            frame: encode(&ToServer::SceneChunk { data: data.into() })
                .unwrap()
                .into(),
        };
        let mut events = [sent(head), sent(b"another"), sent(tail), sent(head)];
        events.iter_mut().for_each(|event| frames.shorten(event));
        let own = |at, bytes| Event::SceneSent {
            connection: 3,
            at,
            bytes,
        };
        assert_eq!(events[0], own(0, 40));
        assert_eq!(events[1], sent(b"another"));
        assert_eq!(events[2], own(40, tail.len() as u32));
        assert_eq!(events[3], sent(head), "the scene has no more bytes");
    }
}
