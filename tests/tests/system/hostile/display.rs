//! Servers that break rules, against the display: each hears which, and the picture is that of the servers that keep to them.

use std::path::Path;

use protocol::framing::Message;
use protocol::messages::{FaultCode, LightShadows, NO_OBJECT, Sample, ShadowMethod, Triple, flags};
use protocol::{ToDisplay, encode};

use super::fake::{Asked, Fake, answer, answer_with, asked, bytes, fault, glaring, greet, welcome};
use super::wire::Wire;
use super::wrong;
use crate::support::{ShaderServer, frames, render_args, renderer, small_scene};

/// Few credits: there are many fakes to be asked.
const CREDITS: u32 = 64;

type Script = Box<dyn FnOnce(&mut Wire) + Send>;

/// A server that misbehaves, and what it must hear.
struct Case {
    name: &'static str,
    script: Script,
    fault: FaultCode,
}

/// One that does so when it is asked for samples.
fn when_asked(
    name: &'static str,
    fault: FaultCode,
    what: impl FnOnce(&Asked) -> Vec<u8> + Send + 'static,
) -> Case {
    let script: Script = Box::new(move |wire| {
        if greet(wire, CREDITS)
            && let Some(asked) = asked(wire)
        {
            wire.send_bytes(&what(&asked));
        }
    });
    Case {
        name,
        script,
        fault,
    }
}

/// One whose first sample is wrong.
fn sample(name: &'static str, change: impl FnOnce(&mut Sample) + Send + 'static) -> Case {
    when_asked(name, FaultCode::Value, move |asked| {
        raw(&answer_with(asked, change))
    })
}

/// A frame of any message, good or not.
fn raw<M: Message>(message: &M) -> Vec<u8> {
    let payload = encode(message).unwrap();
    let mut bytes = (payload.len() as u32).to_le_bytes().to_vec();
    bytes.extend(payload);
    bytes
}

fn bad_samples() -> Vec<Case> {
    vec![
        sample("radiance that is no number", |s| s.radiance[1] = f32::NAN),
        sample("infinite radiance", |s| s.radiance[0] = f32::INFINITY),
        sample("radiance of 1e30", |s| s.radiance[2] = 1e30),
        sample("negative radiance", |s| s.radiance[0] = -1.0),
        sample("a position that is no number", |s| {
            (s.position[0], s.flags, s.object) = (f32::NAN, 0, 0);
        }),
        sample("a position at 1e30", |s| {
            (s.position, s.flags, s.object) = ([1e30; 3], 0, 0);
        }),
        sample("a direction that is none", |s| s.position = [0.0; 3]),
        sample("an object past the table", |s| {
            (s.flags, s.object) = (0, 99);
        }),
        sample("a light past the table", |s| {
            (s.flags, s.object) = (flags::LIGHT, 99);
        }),
        sample("a miss that hit", |s| s.object = 0),
        sample("a hit of nothing", |s| (s.flags, s.object) = (0, NO_OBJECT)),
        sample("flags without a meaning", |s| s.flags |= 1 << 9),
    ]
}

fn bad_answers() -> Vec<Case> {
    let samples = |view, epoch, samples| ToDisplay::Samples {
        view,
        epoch,
        samples,
    };
    vec![
        when_asked("an id never asked", FaultCode::OutOfOrder, move |asked| {
            bytes(&samples(asked.view, 0, vec![glaring(u64::MAX)]))
        }),
        when_asked(
            "an id twice in a message",
            FaultCode::OutOfOrder,
            move |a| bytes(&samples(a.view, 0, vec![glaring(a.samples[0].id); 2])),
        ),
        when_asked("another view", FaultCode::Value, move |asked| {
            bytes(&samples(
                asked.view + 1,
                0,
                vec![glaring(asked.samples[0].id)],
            ))
        }),
        when_asked("an epoch that is yet to come", FaultCode::Value, move |a| {
            bytes(&samples(a.view, 1, vec![glaring(a.samples[0].id)]))
        }),
        when_asked(
            "a count of samples that are not there",
            FaultCode::Malformed,
            |asked| {
                let mut frame = raw(&answer(asked));
                frame[16..24].copy_from_slice(&u64::from(u32::MAX).to_le_bytes());
                frame
            },
        ),
        when_asked("triples past the tables", FaultCode::Value, |_| {
            bytes(&ToDisplay::Triples {
                epoch: 0,
                triples: vec![Triple {
                    light: 0,
                    blocker: 9,
                    receiver: 0,
                }],
            })
        }),
        when_asked("a status that cancels unasked", FaultCode::Value, |_| {
            bytes(&ToDisplay::Status {
                queued: 0,
                traced: 0,
                rays: 0,
                cancelled_before: 7,
            })
        }),
        when_asked("a pong to no ping", FaultCode::Value, |_| {
            bytes(&ToDisplay::Pong { token: 1 << 60 })
        }),
        when_asked("a light past the table", FaultCode::Value, |_| {
            bytes(&ToDisplay::Shadows {
                lights: vec![LightShadows {
                    light: 9,
                    method: ShadowMethod::Rays,
                    why: String::new(),
                }],
            })
        }),
        when_asked("a second Welcome", FaultCode::OutOfOrder, |_| {
            bytes(&welcome(1))
        }),
        when_asked("a second SceneReady", FaultCode::OutOfOrder, |_| {
            bytes(&ToDisplay::SceneReady { digest: [0; 32] })
        }),
    ]
}

fn bad_beginnings() -> Vec<Case> {
    let at_once = |name, fault, message: ToDisplay| Case {
        name,
        fault,
        script: Box::new(move |wire: &mut Wire| wire.send_bytes(&raw(&message))),
    };
    let mut version_0 = welcome(5);
    if let ToDisplay::Welcome { version, .. } = &mut version_0 {
        *version = 0;
    }
    let mut no_credit = welcome(5);
    if let ToDisplay::Welcome { capabilities, .. } = &mut no_credit {
        capabilities.credits = 0;
    }
    let scene = ToDisplay::SceneReady { digest: [3; 32] };
    vec![
        at_once("a version nobody asked for", FaultCode::Version, version_0),
        at_once("no credit at all", FaultCode::Value, no_credit),
        at_once("a scene before Welcome", FaultCode::OutOfOrder, scene),
        at_once(
            "a pong before Welcome",
            FaultCode::OutOfOrder,
            ToDisplay::Pong { token: 1 },
        ),
    ]
}

fn render(scene: &Path, out: &Path, servers: &[&str]) -> Vec<(String, Vec<u8>)> {
    let mut args = vec!["--path", "around", "--frames", "30", "--lockstep", "--exr"];
    args.extend(["--write", "every:29", "--connect"]);
    args.extend(servers);
    renderer(render_args(scene, out, &args)).succeeded();
    frames(out)
}

/// Renders with an honest server and these beside it; all must hear what they are to, and the pictures be as without.
fn beside_an_honest_server(cases: Vec<Case>) {
    let (folder, scene) = small_scene();
    let honest = ShaderServer::start();
    let quiet = render(&scene, &folder.path().join("quiet"), &[&honest.address]);
    let fakes: Vec<_> = cases
        .into_iter()
        .map(|case| {
            let script = case.script;
            let fake = Fake::start(move |mut wire| {
                script(&mut wire);
                fault(&mut wire)
            });
            (case.name, case.fault, fake)
        })
        .collect();
    let mut servers = vec![honest.address.as_str()];
    servers.extend(fakes.iter().map(|(_, _, fake)| fake.address.as_str()));
    let attacked = render(&scene, &folder.path().join("attacked"), &servers);
    let heard: Vec<_> = fakes
        .into_iter()
        .map(|(name, expected, fake)| (name, Some(expected), fake.end()))
        .filter(|(_, expected, heard)| expected != heard)
        .collect();
    assert!(
        heard.is_empty(),
        "case, what it is to hear, what it heard: {heard:?}"
    );
    assert_eq!(quiet.len(), 4, "two pictures as PNG and EXR");
    assert!(
        quiet == attacked,
        "what a bad server sent is in the picture"
    );
}

#[test]
fn servers_with_bad_samples_are_told_and_change_nothing() {
    beside_an_honest_server(bad_samples());
}

#[test]
fn servers_with_bad_answers_are_told_and_change_nothing() {
    beside_an_honest_server(bad_answers());
}

#[test]
fn servers_with_bad_frames_or_beginnings_are_told_and_change_nothing() {
    let frames = wrong::frames(9)
        .into_iter()
        .map(|(name, bytes, fault)| when_asked(name, fault, move |_| bytes));
    beside_an_honest_server(bad_beginnings().into_iter().chain(frames).collect());
}
