//! Peers that send without end, or do not read what is sent to them. Memory in use is counted; times are printed, since other
//! work on the machine changes them.

use std::io::{ErrorKind, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use protocol::messages::{FaultCode, LightShadows, ShadowMethod, Triple};
use protocol::{ToDisplay, ToServer};
use system_tests::report::stats;

use super::fake::{Fake, answer, asked, bytes, fault, greet};
use super::wire::{Wire, request};
use crate::support::{
    Running, ShaderServer, binaries, frames, open_files, peak_kib, render_args, small_scene,
};

/// Memory that a display or a server may take for what a flood leaves behind, KiB.
const ALLOWED: u64 = 48 << 10;

/// What a display's run was like.
struct Run {
    pictures: Vec<(String, Vec<u8>)>,
    peak: u64,
    /// Median, milliseconds.
    frame: f64,
}

fn run(scene: &Path, out: &Path, samples: &str, more: &[&str]) -> Run {
    let args = ["--path", "around", "--write", "last", "--exr"];
    let mut args = render_args(scene, out, &[&args[..], more].concat());
    let place = args.iter().position(|arg| arg == "--samples-per-frame");
    args[place.unwrap() + 1] = samples.to_owned();
    let mut command = Command::new(&binaries().renderer);
    let display = Running::start(command.args(args));
    let (outcome, peak) = display.finish_with_peak();
    outcome.succeeded();
    let text = std::fs::read_to_string(out.join("stats.jsonl")).unwrap();
    let mut times: Vec<f64> = stats::parse(&text)
        .unwrap()
        .iter()
        .map(|line| line.total_ms)
        .collect();
    times.sort_by(f64::total_cmp);
    Run {
        pictures: frames(out),
        peak,
        frame: times[times.len() / 2],
    }
}

/// A server that says this over and over and traces nothing. Gives what it sent, bytes, and what it heard at last.
fn flooding(message: ToDisplay) -> Fake<(u64, Option<FaultCode>)> {
    Fake::start(move |mut wire| {
        greet(&mut wire, 64);
        let frame = bytes(&message);
        let many = frame.repeat((1 << 16) / frame.len() + 1);
        let mut sent = 0;
        let mut writing = wire.stream.try_clone().unwrap();
        // It reads as well, as it must to hear of its fault.
        let hearing = std::thread::spawn(move || fault(&mut wire));
        while writing.write_all(&many).is_ok() {
            sent += many.len() as u64;
        }
        (sent, hearing.join().unwrap())
    })
}

fn floods() -> Vec<(&'static str, ToDisplay)> {
    let triple = Triple {
        light: 0,
        blocker: 0,
        receiver: 1,
    };
    let shadows = LightShadows {
        light: 0,
        method: ShadowMethod::Rays,
        why: "w".repeat(1000),
    };
    vec![
        (
            "status",
            ToDisplay::Status {
                queued: 0,
                traced: 0,
                rays: 0,
                cancelled_before: 0,
            },
        ),
        (
            "triples",
            ToDisplay::Triples {
                epoch: 0,
                triples: vec![triple; 1000],
            },
        ),
        (
            "shadows",
            ToDisplay::Shadows {
                lights: vec![shadows],
            },
        ),
    ]
}

#[test]
fn a_server_that_floods_costs_a_display_neither_memory_nor_its_picture() {
    let (folder, scene) = small_scene();
    let honest = ShaderServer::start();
    let address = honest.address.as_str();
    let with = ["--frames", "40", "--lockstep", "--connect", address];
    let quiet = run(&scene, &folder.path().join("quiet"), "400", &with);
    for (name, message) in floods() {
        let fake = flooding(message);
        let with = [&with[..], &[&fake.address]].concat();
        let flooded = run(&scene, &folder.path().join(name), "400", &with);
        let (sent, heard) = fake.end();
        assert_eq!(heard, Some(FaultCode::Limit), "{name}");
        println!(
            "{name}: {sent} bytes; frames {:.2} ms, {:.2} in quiet; memory {} KiB, {} in quiet",
            flooded.frame, quiet.frame, flooded.peak, quiet.peak
        );
        assert!(
            flooded.pictures == quiet.pictures,
            "{name}: another picture"
        );
        assert!(
            flooded.peak < quiet.peak + ALLOWED,
            "{name}: {} KiB, {} in quiet",
            flooded.peak,
            quiet.peak
        );
    }
}

#[test]
fn a_server_that_does_not_read_costs_a_display_no_memory() {
    let (folder, scene) = small_scene();
    let honest = ShaderServer::start();
    // About a million requests: every pixel in every frame.
    let with = ["--frames", "60", "--connect"];
    let run = |name: &str, server: &str| {
        run(
            &scene,
            &folder.path().join(name),
            "19200",
            &[&with[..], &[server]].concat(),
        )
    };
    let quiet = run("quiet", &honest.address);
    let (over, wait) = std::sync::mpsc::channel::<()>();
    let deaf = Fake::start(move |mut wire| {
        greet(&mut wire, 1 << 20);
        // The first frame waits for its samples.
        let mut answered = 0;
        while answered < 19_200
            && let Some(asked) = asked(&mut wire)
        {
            answered += asked.samples.len();
            wire.send(&answer(&asked));
        }
        // The connection stays open, and nobody reads, until the display is gone.
        let _ = wait.recv();
    });
    let stalled = run("stalled", &deaf.address);
    drop(over);
    deaf.end();
    println!(
        "frames {:.2} ms, {:.2} with a good server; memory {} KiB, {} in quiet",
        stalled.frame, quiet.frame, stalled.peak, quiet.peak
    );
    assert!(stalled.peak < quiet.peak + ALLOWED);
}

/// Writes until the peer takes no more, or so much was taken; gives how much.
fn press(stream: &mut TcpStream, bytes: &[u8], most: usize) -> usize {
    stream
        .set_write_timeout(Some(Duration::from_millis(300)))
        .unwrap();
    let mut sent = 0;
    while sent < most {
        match stream.write(bytes) {
            Ok(count) => sent += count,
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                break;
            }
            Err(error) => panic!("{error}"),
        }
    }
    sent
}

#[test]
fn displays_that_do_not_read_cost_a_server_no_memory() {
    let server = ShaderServer::start();
    let mut honest = Wire::opened(&server.address);
    let before = honest.ask(1, 0..300);
    let quiet = peak_kib(server.id());
    // Pings without end; then one that takes all its credits and reads nothing for a while.
    let pings: Vec<u8> = bytes(&ToServer::Ping { token: 1 }).repeat(4096);
    let mut pinging = Wire::opened(&server.address);
    let taken = press(&mut pinging.stream, &pings, 256 << 20);
    assert!(taken < 256 << 20, "a server reads on without end");
    let mut slow = Wire::opened(&server.address);
    for part in 0..2u64 {
        let ids = part * 32_768..(part + 1) * 32_768;
        slow.send(&ToServer::Request {
            view: 1,
            samples: ids.map(request).collect(),
        });
    }
    assert_eq!(honest.ask(1, 1000..2000).len(), 1000);
    let mut next = Wire::opened(&server.address);
    assert!(next.ask(1, 0..300) == before);
    let peak = peak_kib(server.id());
    println!("{taken} bytes of pings were taken; memory {peak} KiB, {quiet} in quiet");
    assert!(peak < quiet + ALLOWED, "{peak} KiB, {quiet} in quiet");
    assert_eq!(
        slow.gather(65_536).len(),
        65_536,
        "nothing is lost meanwhile"
    );
}

#[test]
fn connections_without_end_leave_room_for_a_display() {
    let server = ShaderServer::start();
    let mut honest = Wire::opened(&server.address);
    let before = honest.ask(1, 0..300);
    let quiet = (peak_kib(server.id()), open_files(server.id()));
    let start = Instant::now();
    // Half of them are dropped at once, half stay open as long as the server lets them and say nothing.
    let mut open = Vec::new();
    for round in 0..3000 {
        let stream = TcpStream::connect(&server.address).unwrap();
        if round % 2 == 0 {
            open.push(stream);
        }
        if open.len() > 500 {
            open.remove(0);
        }
    }
    let mut next = Wire::opened(&server.address);
    let served = start.elapsed();
    assert!(next.ask(1, 0..300) == before);
    assert_eq!(honest.ask(1, 1000..1300).len(), 300);
    let (peak, files) = (peak_kib(server.id()), open_files(server.id()));
    println!(
        "a display is served {served:?} after the first of them; memory {peak} KiB, {} in quiet; {files} files",
        quiet.0
    );
    assert!(peak < quiet.0 + ALLOWED, "{peak} KiB, {} in quiet", quiet.0);
    assert!(
        files < quiet.1 + 100,
        "{files} files are open, {} in quiet",
        quiet.1
    );
}
