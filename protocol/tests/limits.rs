//! The limits in `PROTOCOL.md` are those that the code keeps.
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use protocol::limits::*;
use protocol::scene::MAX_CHUNK;

#[test]
fn the_document_states_the_limits() {
    let document =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/PROTOCOL.md")).unwrap();
    let rows = [
        ("frame payload", MAX_FRAME as u64),
        ("scene", MAX_SCENE),
        ("scene chunk", MAX_CHUNK as u64),
        ("requests or samples in a message", u64::from(MAX_BATCH)),
        ("triples in a message", MAX_TRIPLES as u64),
        ("objects, and lights, in an edit", MAX_MOVES as u64),
        ("credits", u64::from(MAX_CREDITS)),
        ("name", MAX_NAME as u64),
        ("fault text", MAX_TEXT as u64),
        ("digests in a welcome", MAX_HOLDS as u64),
        ("views remembered", MAX_VIEWS as u64),
        ("image or texture side", u64::from(MAX_SIDE)),
        ("coordinate", MAX_COORDINATE as u64),
        ("radiance", MAX_RADIANCE as u64),
        ("intensity", MAX_INTENSITY as u64),
        ("lights", MAX_LIGHTS as u64),
        ("vertices of an area light", MAX_LIGHT_VERTICES as u64),
        ("materials", MAX_MATERIALS as u64),
        ("textures", MAX_TEXTURES as u64),
        ("meshes, and objects", MAX_OBJECTS as u64),
        ("seconds for a Pong", PING_TIMEOUT_S),
    ];
    for (what, limit) in rows {
        let found = document
            .lines()
            .filter_map(|line| line.strip_prefix(&format!("| {what} | ")))
            .any(|rest| rest.split(' ').next() == Some(&limit.to_string()));
        assert!(found, "no row for {what}: {limit}");
    }
}
