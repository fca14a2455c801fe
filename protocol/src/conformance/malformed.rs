//! Bytes that are no message.

use crate::encode;
use crate::messages::FaultCode::Malformed;
use crate::messages::{LightMove, ToServer};
use crate::scene::Light;

use super::check::{At, Check, Needs, refused};
use super::peer::Peer;
use super::{Bench, Checked};

const BYTES: &str = "1, Bytes";

pub(super) fn checks() -> Vec<Check> {
    let payload = |name, at, make: fn() -> Vec<u8>| {
        refused(name, BYTES, at, &[Malformed], move |peer| {
            peer.send_payload(&make());
        })
    };
    vec![
        payload("malformed.empty-frame", At::Connected, Vec::new),
        payload("malformed.unknown-message", At::Connected, || {
            vec![99, 0, 0, 0]
        }),
        payload("malformed.half-a-number", At::Greeted, || vec![7, 0]),
        payload("malformed.unknown-message-later", At::Ready, || {
            vec![0xff; 4]
        }),
        payload("malformed.bytes-after", At::Greeted, || {
            changed(&ToServer::Ping { token: 1 }, |bytes| bytes.push(0))
        }),
        payload("malformed.bytes-missing", At::Ready, || {
            changed(&ToServer::Ping { token: 1 }, |bytes| bytes.truncate(11))
        }),
        payload("malformed.bool-2", At::Greeted, || {
            let shadows = ToServer::Shadows {
                steady: true,
                error: 0.0,
                methods: Vec::new(),
            };
            changed(&shadows, |bytes| bytes[4] = 2)
        }),
        payload("malformed.text-not-utf-8", At::Connected, || {
            let hello = ToServer::Hello {
                min_version: 1,
                max_version: 1,
                name: "name".into(),
                seed: 0,
            };
            changed(&hello, |bytes| bytes[17] = 0xff)
        }),
        payload("malformed.endless-list", At::Ready, || {
            let mut bytes = vec![4, 0, 0, 0, 1, 0, 0, 0];
            bytes.extend(u64::MAX.to_le_bytes());
            bytes
        }),
        payload("malformed.long-list", At::Ready, || {
            let mut bytes = vec![4, 0, 0, 0, 1, 0, 0, 0];
            bytes.extend((1u64 << 40).to_le_bytes());
            bytes.extend([0; 40]);
            bytes
        }),
        Check::new("malformed.light-of-no-kind", BYTES, light).needing(Needs::Samples),
    ]
}

fn changed(message: &ToServer, change: impl Fn(&mut Vec<u8>)) -> Vec<u8> {
    let mut bytes = encode(message).unwrap_or_default();
    change(&mut bytes);
    bytes
}

fn light(bench: &Bench) -> Checked {
    let mut peer = Peer::ready(bench, &bench.worlds.lit)?;
    let value = Light::Point {
        position: [0.0; 3],
        intensity: [0.0; 3],
    };
    let edit = ToServer::Edit {
        epoch: 1,
        objects: Vec::new(),
        lights: vec![LightMove { light: 0, value }],
    };
    // Variant, epoch, two counts and the light's index come before its kind.
    peer.send_payload(&changed(&edit, |bytes| bytes[28] = 7));
    peer.expect_fault(&[Malformed])
}
