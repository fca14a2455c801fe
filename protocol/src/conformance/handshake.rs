//! Greetings, versions and farewells.

use crate::limits::MAX_NAME;
use crate::messages::FaultCode::{Limit, Malformed, OutOfOrder, Value, Version};
use crate::messages::{FaultCode, SHADOWS_VERSION, ShadowMethod, ToServer, VERSION};

use super::check::{At, Check, Needs, ensure, refused, skipped};
use super::judge::{judge, right};
use super::peer::{Peer, SEED};
use super::world::{camera, spread};
use super::{Bench, Checked};

/// The check without which none but a few make sense.
pub(super) const GATE: &str = "handshake.welcome";

const HELLO: &str = "3, Hello";
const ORDER: &str = "2, Order";
const VERSIONS: &str = "2, Versions";
const SHADOWS: &str = "2, Shadows";

pub(super) fn checks() -> Vec<Check> {
    let greeting = |name, codes: &'static [FaultCode], versions: (u16, u16), length: usize| {
        refused(name, HELLO, At::Connected, codes, move |peer| {
            peer.send(&ToServer::Hello {
                min_version: versions.0,
                max_version: versions.1,
                name: "n".repeat(length),
                seed: SEED,
            });
        })
    };
    let nothing = |check: Check| check.needing(Needs::Nothing);
    vec![
        nothing(Check::new(GATE, ORDER, |bench| {
            Peer::greeted(bench).map(drop)
        })),
        nothing(Check::new("handshake.version-1-alone", VERSIONS, |bench| {
            offered(bench, (1, 1))
        })),
        nothing(Check::new("handshake.versions-1-to-3", VERSIONS, |bench| {
            offered(bench, (1, VERSION))
        })),
        greeting(
            "handshake.future-versions-only",
            &[Version],
            (60_000, 60_001),
            4,
        ),
        greeting("handshake.no-versions", &[Value, Version], (3, 1), 4),
        greeting("handshake.version-0", &[Value, Version], (0, 3), 4),
        greeting("handshake.long-name", &[Limit], (1, VERSION), MAX_NAME + 1),
        refused(
            "handshake.hello-twice",
            ORDER,
            At::Greeted,
            &[OutOfOrder],
            |peer| {
                peer.hello(1, VERSION);
            },
        ),
        refused(
            "handshake.ping-first",
            ORDER,
            At::Connected,
            &[OutOfOrder],
            |peer| {
                peer.send(&ToServer::Ping { token: 1 });
            },
        ),
        refused(
            "handshake.request-first",
            ORDER,
            At::Connected,
            &[OutOfOrder],
            |peer| {
                peer.send(&ToServer::Request {
                    view: 1,
                    samples: spread(&camera(), 0..1),
                });
            },
        ),
        Check::new("handshake.goodbye", "3, Goodbye", |bench| {
            left(bench, &ToServer::Goodbye)
        }),
        Check::new("handshake.display-faults", "2, Faults", |bench| {
            let (code, text) = (FaultCode::Internal, "just a check".into());
            left(bench, &ToServer::Fault { code, text })
        }),
        Check::new("shadows.taken", SHADOWS, shadows_taken),
        refused(
            "shadows.twice",
            SHADOWS,
            At::Greeted,
            &[OutOfOrder, Malformed],
            |peer| {
                peer.send(&wish(0.01));
                peer.send(&wish(0.01));
            },
        ),
        refused(
            "shadows.after-scene",
            SHADOWS,
            At::Ready,
            &[OutOfOrder, Malformed],
            |peer| {
                peer.send(&wish(0.01));
            },
        ),
        Check::new("shadows.in-version-1", SHADOWS, |bench| {
            let mut peer = Peer::connect(bench)?;
            peer.hello(1, 1);
            peer.expect_welcome()?;
            peer.send(&wish(0.01));
            peer.expect_fault(&[OutOfOrder, Malformed])
        }),
        Check::new("shadows.bad-error", SHADOWS, |bench| {
            let mut peer = speaking_shadows(bench)?;
            peer.send(&wish(f32::NAN));
            peer.expect_fault(&[Value])
        }),
    ]
}

fn offered(bench: &Bench, (least, most): (u16, u16)) -> Checked {
    let mut peer = Peer::connect(bench)?;
    peer.hello(least, most);
    let welcome = peer.expect_welcome()?;
    ensure(
        (least..=most).contains(&welcome.version),
        || format!("a version from {least} to {most}"),
        || welcome.version.to_string(),
    )?;
    ensure(
        !welcome.shader.is_empty(),
        || "a line on what it shades with".into(),
        || "an empty text".into(),
    )
}

fn left(bench: &Bench, last: &ToServer) -> Checked {
    let mut peer = Peer::greeted(bench)?;
    peer.send(last);
    peer.expect_left("the display's last message")?;
    let mut peer = Peer::ready(bench, &bench.worlds.lit)?;
    peer.ask(1, &spread(&camera(), 0..64));
    peer.send(last);
    peer.expect_left("the display's last message")
}

fn wish(error: f32) -> ToServer {
    ToServer::Shadows {
        steady: true,
        error,
        // One light has none, and there are more methods than lights: both are allowed.
        methods: vec![
            ShadowMethod::Rays,
            ShadowMethod::Penumbra,
            ShadowMethod::SoftMap,
        ],
    }
}

fn speaking_shadows(bench: &Bench) -> Result<Peer, super::Stop> {
    let peer = Peer::greeted(bench)?;
    let version = peer.welcome()?.version;
    if version < SHADOWS_VERSION {
        return skipped(format!("the server speaks version {version}"));
    }
    Ok(peer)
}

fn shadows_taken(bench: &Bench) -> Checked {
    let world = &bench.worlds.lit;
    let mut peer = speaking_shadows(bench)?;
    peer.send(&wish(0.01));
    peer.send_scene(&world.encoded);
    peer.expect_ready()?;
    peer.view(1, camera());
    let answers = peer.ask_all(1, &spread(&camera(), 0..50))?;
    let provisional = answers
        .iter()
        .find(|a| a.sample.flags & crate::messages::flags::PROVISIONAL != 0);
    ensure(
        provisional.is_none(),
        || "no provisional sample, which the display wished".into(),
        || "one".into(),
    )?;
    judge(&world.scene, &answers, right)
}
