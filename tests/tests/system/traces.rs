//! Session traces: recorded, drawn again, served and played.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use protocol::ToDisplay;
use protocol::trace::{Entry, Event, Step};

use crate::recorded::{Fate, Place, Proxy, read, received, redraw, steps, text, write};
use crate::support::{Outcome, ShaderServer, binaries, renderer};

const LOCKSTEP: &str = "--path all --frames 12 --lockstep";
/// Enough at once for two servers to share.
const TWO: &str = "--path all --frames 12 --lockstep --samples-per-frame 200";

/// A trace that is being served, ended when dropped.
pub(crate) struct Served {
    child: Child,
    pub(crate) address: String,
}

impl Served {
    pub(crate) fn start(trace: &Path, more: &[&str]) -> Self {
        let mut child = Command::new(&binaries().renderer)
            .args(["replay", text(trace), "--listen", "127.0.0.1:0", "--once"])
            .args(more)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let output = child.stdout.as_mut().unwrap();
        // One byte at a time, so that nothing of what follows is lost.
        let mut slow = BufReader::with_capacity(1, output);
        slow.read_line(&mut line).unwrap();
        let address = line
            .trim()
            .strip_prefix("listening on ")
            .unwrap()
            .to_owned();
        Self { child, address }
    }

    /// What it says when the display has left.
    pub(crate) fn finish(mut self) -> (Option<i32>, String) {
        let mut said = String::new();
        let output = self.child.stdout.as_mut().unwrap();
        std::io::Read::read_to_string(output, &mut said).unwrap();
        (self.child.wait().unwrap().code(), said)
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

pub(crate) fn play(trace: &Path, servers: &[&str]) -> Outcome {
    renderer(["replay", text(trace), "--connect"].iter().chain(servers))
}

#[track_caller]
pub(crate) fn assert_same(a: &[(String, Vec<u8>)], b: &[(String, Vec<u8>)]) {
    assert!(
        !a.is_empty() && a.len() == b.len(),
        "{} {}",
        a.len(),
        b.len()
    );
    for (a, b) in a.iter().zip(b) {
        assert!(a == b, "{} differs", a.0);
    }
}

#[test]
fn a_trace_gives_its_pictures_again_and_again() {
    let place = Place::new();
    let trace = place.record("first", LOCKSTEP);
    let recorded = place.pictures("first");
    assert_eq!(recorded.len(), 24);
    // Neither the scene's file nor a server is needed.
    std::fs::remove_file(&place.scene).unwrap();
    for again in ["a", "b", "c"] {
        let told = place.replay(&trace, again, &[]).succeeded().stdout;
        assert!(
            told.contains("12 pictures, 12 the same to the bit"),
            "{told}"
        );
        assert_same(&recorded, &place.pictures(again));
    }
    place
        .replay(&trace, "threads", &["--threads", "3"])
        .succeeded();
    assert_same(&recorded, &place.pictures("threads"));
}

#[test]
fn without_lockstep_too_pictures_are_the_same_to_the_bit() {
    let place = Place::new();
    let server = ShaderServer::start();
    let late = Proxy::start(&server.address, Fate::Late(Duration::from_millis(5)));
    let args = format!(
        "--path all --frames 80 --shadow-edges all --connect {} {}",
        late.address, server.address
    );
    let trace = place.record("first", &args);
    for again in ["a", "b", "c"] {
        let told = place.replay(&trace, again, &[]).succeeded().stdout;
        assert!(
            told.contains("80 pictures, 80 the same to the bit"),
            "{told}"
        );
        assert_same(&place.pictures("first"), &place.pictures(again));
    }
}

#[test]
fn a_picture_that_is_not_the_recorded_one_is_told() {
    let place = Place::new();
    let trace = place.record("first", LOCKSTEP);
    let (header, mut entries) = read(&trace);
    let (changed, _) = received(&entries)
        .into_iter()
        .find_map(|(at, _, m)| matches!(m, ToDisplay::Samples { .. }).then_some((at, m)))
        .unwrap();
    let brighter = |message: ToDisplay| match message {
        ToDisplay::Samples {
            view,
            epoch,
            mut samples,
        } => {
            samples.iter_mut().for_each(|s| s.radiance[1] += 0.25);
            ToDisplay::Samples {
                view,
                epoch,
                samples,
            }
        }
        other => other,
    };
    change(&mut entries[changed], brighter);
    let other = place.at("other.trace");
    write(&other, &header, &entries);
    let outcome = place.replay(&other, "other", &[]);
    assert_eq!(outcome.code, Some(1));
    assert!(
        outcome.stdout.contains("the first is 0"),
        "{}",
        outcome.stdout
    );
}

/// Changes the message of an entry that was received.
fn change(entry: &mut Entry, change: impl FnOnce(ToDisplay) -> ToDisplay) {
    if let Event::Received { frame, .. } = &mut entry.event {
        let message = protocol::decode(frame).unwrap();
        *frame = protocol::encode(&change(message)).unwrap().into();
    }
}

/// Samples by epoch and id, as they were received.
fn samples(trace: &Path) -> BTreeMap<(u32, u64), Vec<u8>> {
    let mut all = BTreeMap::new();
    for (_, _, message) in received(&read(trace).1) {
        if let ToDisplay::Samples { epoch, samples, .. } = message {
            for sample in samples {
                let bytes = protocol::encode(&sample).unwrap();
                assert!(all.insert((epoch, sample.id), bytes).is_none());
            }
        }
    }
    all
}

#[test]
fn one_and_eight_threads_record_the_same_samples() {
    let place = Place::new();
    let one = place.record("one", &format!("{LOCKSTEP} --shader-threads 1"));
    let eight = place.record("eight", &format!("{LOCKSTEP} --shader-threads 8"));
    let all = samples(&one);
    assert_eq!(all.len(), 12 * 60);
    assert!(all == samples(&eight));
    assert_same(&place.pictures("one"), &place.pictures("eight"));
}

#[test]
fn a_display_that_is_served_a_trace_draws_the_recorded_pictures() {
    let place = Place::new();
    let trace = place.record("first", &format!("{TWO} --shaders 2"));
    let both = received(&read(&trace).1);
    let from = both
        .iter()
        .filter(|(_, _, m)| matches!(m, ToDisplay::Samples { .. }));
    let connections: Vec<u32> = from.map(|r| r.1).collect();
    assert!(connections.contains(&1) && connections.contains(&2));
    let served = Served::start(&trace, &[]);
    let args = format!("{TWO} --connect {}", served.address);
    renderer(place.render(&place.at("again"), &args)).succeeded();
    assert_same(&place.pictures("first"), &place.pictures("again"));
    let (code, told) = served.finish();
    assert_eq!(code, Some(0), "{told}");
    assert!(
        told.contains("2400 requests, 2400 answered, 0 not in"),
        "{told}"
    );
}

#[test]
fn what_is_not_in_a_trace_is_counted_and_told() {
    let place = Place::new();
    let trace = place.record("first", LOCKSTEP);
    let served = Served::start(&trace, &[]);
    let args = format!("{LOCKSTEP} --seed 4 --connect {}", served.address);
    let args: Vec<_> = place.render(&place.at("other"), &args);
    // The second seed on a command line would be an error: the first one goes.
    let at = args.iter().position(|a| a == "--seed").unwrap();
    let args = [&args[..at], &args[at + 2..]].concat();
    let outcome = renderer(args);
    let (code, told) = served.finish();
    assert_eq!(code, Some(1), "{told} {}", outcome.stderr);
    assert!(told.contains("60 not in the trace"), "{told}");
    assert!(
        outcome.stderr.contains("not in the trace"),
        "{}",
        outcome.stderr
    );
}

#[test]
fn our_server_answers_a_recorded_display_as_it_did() {
    let place = Place::new();
    let trace = place.record("first", &format!("{TWO} --shaders 2"));
    let servers = [ShaderServer::start(), ShaderServer::start()];
    let both = servers.each_ref().map(|s| s.address.as_str());
    let told = play(&trace, &both).succeeded().stdout;
    let lines: Vec<&str> = told.lines().collect();
    assert_eq!(lines.len(), 2, "{told}");
    let counts = lines.iter().map(|line| {
        let end = line
            .strip_suffix(" answers as recorded to the bit")
            .unwrap();
        end.rsplit(' ').next().unwrap().parse::<usize>().unwrap()
    });
    assert_eq!(counts.sum::<usize>(), 2400, "{told}");
    // Once more, now that the server holds the scene.
    assert_eq!(
        play(&trace, &both[..1])
            .succeeded()
            .stdout
            .matches("as recorded")
            .count(),
        2
    );
}

#[test]
fn a_server_of_one_credit_is_asked_one_by_one() {
    let place = Place::new();
    let trace = place.record("first", LOCKSTEP);
    let (header, mut entries) = read(&trace);
    for (at, _, message) in received(&entries) {
        if matches!(message, ToDisplay::Welcome { .. }) {
            change(&mut entries[at], |mut welcome| {
                if let ToDisplay::Welcome { capabilities, .. } = &mut welcome {
                    (capabilities.credits, capabilities.max_batch) = (1, 1);
                }
                welcome
            });
        }
    }
    let other = place.at("other.trace");
    write(&other, &header, &entries);
    let served = Served::start(&other, &[]);
    let told = play(&trace, &[&served.address]).succeeded().stdout;
    assert!(
        told.contains("720 answers as recorded to the bit"),
        "{told}"
    );
    let (code, told) = served.finish();
    assert_eq!(code, Some(0), "{told}");
}

#[test]
fn a_server_that_breaks_a_rule_or_leaves_is_told_of() {
    let place = Place::new();
    let trace = place.record("first", LOCKSTEP);
    let server = ShaderServer::start();
    let cut = Proxy::start(&server.address, Fate::CutAfter(3000));
    let told = play(&trace, &[&cut.address.to_string()]);
    assert_eq!(told.code, Some(1), "{}", told.stdout);
    let ends = ["closed the connection", "ended inside a frame"];
    assert!(
        ends.iter().any(|end| told.stdout.contains(end)),
        "{}",
        told.stdout
    );

    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let liar = std::thread::spawn(move || {
        let (mut display, _) = listener.accept().unwrap();
        // A frame of a message that there is none of.
        std::io::Write::write_all(&mut display, &[4, 0, 0, 0, 255, 255, 0, 0]).unwrap();
        let _ = std::io::copy(&mut display, &mut std::io::sink());
    });
    let told = play(&trace, &[&address]);
    liar.join().unwrap();
    assert_eq!(told.code, Some(1), "{}", told.stdout);
    assert!(
        told.stdout.contains("it broke a rule after 0 answers"),
        "{}",
        told.stdout
    );
}

#[test]
fn real_time_keeps_the_timing() {
    let place = Place::new();
    let server = ShaderServer::start();
    let delay = Duration::from_millis(40);
    let late = Proxy::start(&server.address, Fate::Late(delay));
    let args = format!(
        "--path all --frames 6 --lockstep --connect {}",
        late.address
    );
    let trace = place.record("first", &args);
    let entries = read(&trace).1;
    let drawn = |(_, step): &(usize, &Step)| matches!(step, Step::Drawn { .. });
    let (last, _) = steps(&entries).into_iter().rfind(drawn).unwrap();
    let recorded = Duration::from_micros(entries[last].time_us);
    assert!(recorded > 5 * delay);
    let start = Instant::now();
    let redrawn = redraw(&trace, &place.at("again"), &["--real-time"]).unwrap();
    assert!(start.elapsed() >= recorded && redrawn.differing.is_empty());
    // Served, every answer takes as long as it did: six frames wait for one after another.
    for (more, least) in [(&["--real-time"][..], 6 * delay), (&[], Duration::ZERO)] {
        let served = Served::start(&trace, more);
        let args = format!(
            "--path all --frames 6 --lockstep --connect {}",
            served.address
        );
        let start = Instant::now();
        renderer(place.render(&place.at("served"), &args)).succeeded();
        assert!(start.elapsed() >= least, "{:?}", start.elapsed());
        assert_same(&place.pictures("first"), &place.pictures("served"));
    }
}
