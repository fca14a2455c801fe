//! Small traces of real sessions, in `tests/traces`: replayed, served and played as they are.
//!
//! `UPDATE_FIXTURES=1 cargo test --release -p system-tests --test system sessions_like_them_are_recorded` records them anew,
//! which is only needed when the format changes, or the display says other things.

use std::path::PathBuf;
use std::time::Duration;

use protocol::ToDisplay;
use protocol::trace::{Event, Step};
use system_tests::places;

use crate::recorded::{Fate, Place, Proxy, read, received, redraw, steps, text, write};
use crate::support::{ShaderServer, frames, renderer};
use crate::traces::{Served, assert_same, play};

const NAMES: [&str; 5] = ["move", "edit", "lost", "slow", "two"];
/// Longest that a fixture may be, bytes.
const MOST: u64 = 200_000;

fn fixture(name: &str) -> PathBuf {
    places::checkout().join(format!("tests/traces/{name}.trace"))
}

/// Without `UPDATE_FIXTURES` what is recorded is drawn again and forgotten.
#[test]
fn sessions_like_them_are_recorded() {
    let keep = std::env::var_os("UPDATE_FIXTURES").is_some();
    let servers = [ShaderServer::start(), ShaderServer::start()];
    let [a, b] = servers.each_ref().map(|s| s.address.as_str());
    let cut = Proxy::start(a, Fate::CutAfter(9000)).address;
    let slow = Proxy::start(a, Fate::Late(Duration::from_millis(4))).address;
    let record = |name: &str, args: &str| {
        let place = Place::new();
        let (mut header, entries) = read(&place.record(name, args));
        // Where it was recorded is of no use to anybody.
        let folder = format!("{}/", text(place.folder.path()));
        header.options = header.options.replace(&folder, "");
        let trace = if keep {
            fixture(name)
        } else {
            place.at("fixture.trace")
        };
        write(&trace, &header, &entries);
        let redrawn = redraw(&trace, &place.at("again"), &[]).unwrap();
        assert!(redrawn.differing.is_empty(), "{name}");
    };
    record(
        "move",
        &format!("--path around --frames 16 --lockstep --connect {a}"),
    );
    record(
        "edit",
        &format!("--path all --frames 16 --lockstep --connect {a}"),
    );
    record(
        "lost",
        &format!("--path around --frames 16 --lockstep --connect {cut} {b}"),
    );
    record("slow", &format!("--path push --frames 40 --connect {slow}"));
    record(
        "two",
        &format!("--path all --frames 12 --lockstep --samples-per-frame 160 --connect {a} {b}"),
    );
}

#[test]
fn they_are_what_they_are_meant_to_be() {
    for name in NAMES {
        let path = fixture(name);
        assert!(std::fs::metadata(&path).unwrap().len() < MOST, "{name}");
        let (_, entries) = read(&path);
        let events = || entries.iter().map(|entry| &entry.event);
        let opened = events()
            .filter(|e| matches!(e, Event::Opened { .. }))
            .count();
        let drawn = |step: &Step| matches!(step, Step::Drawn { .. });
        let drawn = steps(&entries).iter().filter(|(_, s)| drawn(s)).count();
        assert_eq!(
            events().last(),
            Some(&Event::End {
                frames: drawn as u32
            }),
            "{name}"
        );
        let edits = steps(&entries)
            .iter()
            .filter(|(_, s)| matches!(s, Step::Edited { .. }))
            .count();
        let lost = events().any(|e| matches!(e, Event::Closed { why, .. } if why.contains("closed the connection") || why.contains("inside a frame")));
        let mut epoch = 0;
        let mut late = 0;
        let samples: Vec<_> = received(&entries);
        let of = |at: usize| samples.iter().find(|(place, ..)| *place == at);
        for (at, entry) in entries.iter().enumerate() {
            match (&entry.event, of(at)) {
                (Event::Step(Step::Edited { epoch: now, .. }), _) => epoch = *now,
                (_, Some((_, _, ToDisplay::Samples { epoch: traced, .. }))) => {
                    late += usize::from(*traced < epoch);
                }
                _ => {}
            }
        }
        let told = (name, opened, edits > 0, lost, late > 0);
        let wanted = match name {
            "move" => (name, 1, false, false, false),
            "edit" => (name, 1, true, false, false),
            "lost" => (name, opened.max(2), false, true, false),
            "slow" => (name, 1, true, false, true),
            _ => (name, 2, true, false, false),
        };
        assert_eq!(told, wanted);
    }
}

/// Every way to replay one gives the same pictures; whether they are those that were drawn when it was recorded depends on
/// whether the display draws as it did then, so that this is left to traces that are recorded here and now.
#[test]
fn they_are_drawn_the_same_in_every_way() {
    let place = Place::new();
    for name in NAMES {
        let (first, path) = (place.at(name), fixture(name));
        let drawn = redraw(&fixture(name), &first, &["--exr"]).unwrap();
        assert!(drawn.frames >= 12 && !drawn.cut, "{name}: {drawn:?}");
        for (k, more) in [&[][..], &["--threads", "3"], &["--real-time"]]
            .iter()
            .enumerate()
        {
            let again = place.at(&format!("{name}-{k}"));
            let args = ["replay", text(&path), "--exr", "--out", text(&again)];
            // What differs from the recorded pictures is told, and no failure here.
            renderer(args.iter().chain(*more));
            assert_same(&frames(&first), &frames(&again));
        }
    }
}

/// A recorded server and a recorded display understand each other, whatever has become of ours since.
#[test]
fn they_can_be_played_to_one_another() {
    for name in NAMES {
        let path = fixture(name);
        let (_, entries) = read(&path);
        let connections = entries
            .iter()
            .filter(|e| matches!(e.event, Event::Opened { .. }));
        let served: Vec<Served> = connections.map(|_| Served::start(&path, &[])).collect();
        let addresses: Vec<&str> = served.iter().map(|s| &*s.address).collect();
        let told = play(&path, &addresses);
        assert_eq!(told.code, Some(0), "{name}: {}{}", told.stdout, told.stderr);
        let lines = told.stdout.lines();
        for line in lines {
            assert!(line.ends_with("as recorded to the bit"), "{name}: {line}");
        }
    }
}

#[test]
fn our_server_still_answers_them() {
    let server = ShaderServer::start();
    for name in NAMES {
        let told = play(&fixture(name), &[&server.address]);
        assert_eq!(told.code, Some(0), "{name}: {}{}", told.stdout, told.stderr);
        assert!(
            told.stdout.contains("as recorded to the bit"),
            "{name}: {}",
            told.stdout
        );
        print!("{name}: {}", told.stdout);
        for line in told.stdout.lines().filter(|line| line.contains("differ")) {
            // Other machines' arithmetic may differ in the last bits.
            assert!(line.contains(" 0 on another object"), "{name}: {line}");
        }
    }
}

/// A display of today may ask for other things than that of the trace; it is told so, and nothing breaks.
#[test]
fn a_display_is_served_each_of_them() {
    for name in NAMES {
        let place = Place::new();
        let served = Served::start(&fixture(name), &[]);
        let scene_of_the_trace = "--path around --frames 3";
        let args = format!("{scene_of_the_trace} --connect {}", served.address);
        let outcome = renderer(place.render(&place.at("served"), &args));
        // With no answer at all there is nothing to draw, which it says.
        assert!(
            matches!(outcome.code, Some(0 | 2)),
            "{name}: {}",
            outcome.stderr
        );
        let (_, told) = served.finish();
        assert!(told.contains("display 1: "), "{name}: {told}");
    }
}
