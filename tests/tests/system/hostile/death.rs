//! Processes that are killed, and connections that break in the middle of a message.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::fake::{Fake, answer, asked, bytes, greet};
use crate::support::{
    LIMIT, Running, ShaderServer, binaries, frames, render_args, renderer, small_scene,
    stats_lines, wait_for_frames,
};

const ALONG: [&str; 7] = [
    "--path",
    "around",
    "--frames",
    "10",
    "--lockstep",
    "--exr",
    "--connect",
];

fn render(scene: &Path, out: &Path, servers: &[&str]) -> Vec<(String, Vec<u8>)> {
    let args = [&ALONG[..], servers].concat();
    renderer(render_args(scene, out, &args)).succeeded();
    frames(out)
}

/// How much of a frame of this length is sent, bytes.
type Cut = fn(usize) -> usize;

#[test]
fn nothing_of_half_a_message_is_used() {
    let (folder, scene) = small_scene();
    let honest = ShaderServer::start();
    let alone = render(&scene, &folder.path().join("alone"), &[&honest.address]);
    // All but the last byte; half; the header; half of the header.
    let cuts: [(&str, Cut); 4] = [
        ("a", |n| n - 1),
        ("b", |n| n / 2),
        ("c", |_| 4),
        ("d", |_| 2),
    ];
    for (name, cut) in cuts {
        let dying = Fake::start(move |mut wire| {
            greet(&mut wire, 64);
            let frame = bytes(&answer(&asked(&mut wire).unwrap()));
            wire.send_bytes(&frame[..cut(frame.len())]);
        });
        let servers = [honest.address.as_str(), &dying.address];
        let beside = render(&scene, &folder.path().join(name), &servers);
        dying.end();
        assert!(beside == alone, "half a message is in the picture");
    }
}

/// Processes that this one started and that are still there.
fn children(parent: u32) -> Vec<u32> {
    let processes = fs::read_dir("/proc").unwrap().filter_map(|entry| {
        let id = entry.ok()?.file_name().to_str()?.parse::<u32>().ok()?;
        let stat = fs::read_to_string(format!("/proc/{id}/stat")).ok()?;
        // The name in parentheses may hold anything.
        let mut fields = stat.rsplit_once(')')?.1.split_whitespace();
        let (state, of) = (fields.next()?, fields.next()?);
        (of == parent.to_string() && state != "Z").then_some(id)
    });
    processes.collect()
}

fn is_there(id: u32) -> bool {
    let status = fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
    status
        .rsplit_once(')')
        .is_some_and(|(_, rest)| !rest.trim_start().starts_with('Z'))
}

#[track_caller]
fn wait_until(what: &str, mut done: impl FnMut() -> bool) {
    let start = Instant::now();
    while !done() {
        assert!(start.elapsed() < LIMIT, "{what}");
        sleep(Duration::from_millis(5));
    }
}

#[test]
#[cfg(target_os = "linux")]
fn servers_that_a_display_started_end_when_it_is_killed() {
    let (folder, scene) = small_scene();
    let out = folder.path().join("out");
    let args = [
        "--path",
        "around",
        "--frames",
        "100000",
        "--write",
        "none",
        "--shaders",
        "2",
    ];
    let mut command = Command::new(&binaries().renderer);
    let mut display = Running::start(command.args(render_args(&scene, &out, &args)));
    wait_for_frames(&mut display, &out, 3);
    let servers = children(display.id());
    assert_eq!(servers.len(), 2, "it started its servers");
    // As `kill -9` does: nothing of it runs any more.
    drop(display);
    wait_until("its servers are orphans", || {
        !servers.iter().any(|id| is_there(*id))
    });
}

#[test]
fn a_server_survives_its_killed_display_and_serves_the_next() {
    let (folder, scene) = small_scene();
    let mut server = ShaderServer::start();
    let first = render(&scene, &folder.path().join("first"), &[&server.address]);
    for round in 0..3 {
        let out = folder.path().join(format!("killed-{round}"));
        let args = [
            "--path",
            "around",
            "--frames",
            "100000",
            "--write",
            "none",
            "--connect",
        ];
        let args = [&args[..], &[&server.address]].concat();
        let mut command = Command::new(&binaries().renderer);
        let mut display = Running::start(command.args(render_args(&scene, &out, &args)));
        wait_for_frames(&mut display, &out, 3 + round);
        drop(display);
    }
    assert!(server.is_running());
    let next = render(&scene, &folder.path().join("next"), &[&server.address]);
    assert!(first == next, "the next display gets another picture");
}

#[test]
fn two_displays_at_once_get_the_pictures_of_each_alone() {
    let (folder, scene) = small_scene();
    let server = ShaderServer::start();
    let alone = render(&scene, &folder.path().join("alone"), &[&server.address]);
    let running = ["a", "b"].map(|name| {
        let out = folder.path().join(name);
        let args = [&ALONG[..], &[&server.address]].concat();
        let mut command = Command::new(&binaries().renderer);
        (
            Running::start(command.args(render_args(&scene, &out, &args))),
            out,
        )
    });
    for (display, out) in running {
        display.finish().succeeded();
        assert!(frames(&out) == alone);
    }
}

#[test]
fn a_display_uses_a_server_again_that_was_killed_and_restarted() {
    let (folder, scene) = small_scene();
    let out = folder.path().join("out");
    let mut server = ShaderServer::start();
    let args = [
        "--path",
        "around",
        "--frames",
        "1000000",
        "--write",
        "none",
        "--connect",
    ];
    let args = [&args[..], &[&server.address]].concat();
    let mut command = Command::new(&binaries().renderer);
    let mut display = Running::start(command.args(render_args(&scene, &out, &args)));
    let samples = || -> u64 {
        let text = fs::read_to_string(out.join("stats.jsonl")).unwrap_or_default();
        // A line that is being written is not counted yet.
        let whole = text.rsplit_once('\n').map_or("", |(whole, _)| whole);
        system_tests::report::stats::parse(whole)
            .unwrap()
            .iter()
            .map(|line| line.samples_new)
            .sum()
    };
    wait_until("no samples came", || samples() > 0);
    server.kill();
    let at_kill = stats_lines(&out);
    wait_for_frames(&mut display, &out, at_kill + 5);
    let before = samples();
    let server = ShaderServer::start_at(&server.address);
    wait_until("no samples come from the restarted server", || {
        samples() > before
    });
    assert!(display.is_running());
    drop((display, server));
}
