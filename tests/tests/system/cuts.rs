//! Traces that are cut off, damaged, or of another version.

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use protocol::trace::Step;

use crate::recorded::{Place, read, redraw, steps, text, write};
use crate::support::{Running, binaries, render_args, wait_for_frames};
use crate::traces::assert_same;

#[test]
fn a_trace_that_is_cut_anywhere_replays_up_to_there() {
    let place = Place::new();
    let trace = place.record("first", "--path all --frames 5 --lockstep");
    let bytes = std::fs::read(&trace).unwrap();
    let (header, entries) = read(&trace);
    let cut = place.at("cut.trace");
    let mut lengths = vec![0, 3, 15, 30];
    for n in 0..=entries.len() {
        write(&cut, &header, &entries[..n]);
        let border = std::fs::metadata(&cut).unwrap().len() as usize;
        lengths.extend([border - 1, border, border + 9, border + 40]);
    }
    lengths.retain(|length| *length < bytes.len());
    assert!(lengths.len() > 200, "{}", lengths.len());
    let mut most = 0;
    for length in lengths {
        std::fs::write(&cut, &bytes[..length]).unwrap();
        match redraw(&cut, &place.at("cut"), &["--write", "none"]) {
            Ok(redrawn) => {
                assert!(redrawn.cut && redrawn.differing.is_empty(), "at {length}");
                assert!(
                    redrawn.frames >= most,
                    "at {length}: {} of {most}",
                    redrawn.frames
                );
                most = redrawn.frames;
            }
            Err(error) => assert_eq!(most, 0, "at {length}: {error}"),
        }
    }
    assert_eq!(most, 5);
    std::fs::write(&cut, &bytes[..bytes.len() - 30]).unwrap();
    let outcome = place.replay(&cut, "told", &[]).succeeded();
    assert!(
        outcome.stderr.contains("cut off at byte"),
        "{}",
        outcome.stderr
    );
    assert_same(&place.pictures("first"), &place.pictures("told"));
}

#[test]
fn traces_of_other_versions_and_other_files_are_refused() {
    let place = Place::new();
    let trace = place.record("first", "--frames 1 --lockstep");
    let mut bytes = std::fs::read(&trace).unwrap();
    for (at, version, wanted) in [
        (8, 2u16, "trace format 2, which is newer"),
        (8, 0, "trace format 0, which is older"),
        (10, 99, "protocol version 99, which is newer"),
    ] {
        let mut other = bytes.clone();
        other[at..at + 2].copy_from_slice(&version.to_le_bytes());
        let path = place.at("other.trace");
        std::fs::write(&path, other).unwrap();
        let outcome = place.replay(&path, "other", &[]);
        assert_eq!(outcome.code, Some(2));
        assert!(outcome.stderr.contains(wanted), "{}", outcome.stderr);
        assert_eq!(outcome.stderr.lines().count(), 1, "{}", outcome.stderr);
    }
    bytes[20] ^= 1;
    std::fs::write(&trace, bytes).unwrap();
    let damaged = place.replay(&trace, "damaged", &[]);
    assert!(
        damaged.stderr.contains("header is damaged"),
        "{}",
        damaged.stderr
    );
    let none = place.replay(&place.scene, "none", &[]);
    assert!(none.stderr.contains("it is no trace"), "{}", none.stderr);
}

#[test]
fn a_display_that_is_killed_leaves_a_trace_up_to_then() {
    let place = Place::new();
    let (trace, out) = (place.at("killed.trace"), place.at("out"));
    let mut args = vec!["record".to_owned(), text(&trace).to_owned()];
    let long = ["--path", "around", "--frames", "100000", "--write", "none"];
    args.extend(render_args(&place.scene, &out, &long));
    let mut display = Running::start(Command::new(&binaries().renderer).args(args));
    let start = Instant::now();
    // A second after it was drawn a picture is in the file.
    while start.elapsed() < Duration::from_secs(2) {
        wait_for_frames(&mut display, &out, 1);
        std::thread::yield_now();
        if read_frames(&trace) > 20 {
            break;
        }
    }
    drop(display);
    let redrawn = redraw(&trace, &place.at("again"), &["--write", "none"]).unwrap();
    assert!(redrawn.cut && redrawn.frames > 20, "{redrawn:?}");
    assert!(redrawn.differing.is_empty());
}

/// Pictures in a trace so far; none while it has no header.
fn read_frames(trace: &Path) -> usize {
    if std::fs::metadata(trace).unwrap().len() < 1000 {
        return 0;
    }
    let drawn = |(_, step): &(usize, &Step)| matches!(step, Step::Drawn { .. });
    steps(&read(trace).1).iter().filter(|s| drawn(s)).count()
}
