//! Servers that die: the display goes on.

use std::fs;
use std::process::Command;

use system_tests::report::stats;

use crate::support::{
    Running, ShaderServer, binaries, frames, render_args, small_scene, stats_lines, wait_for_frames,
};

/// Renders frames while one of the servers at `servers` is killed, and gives the statistics' last line's server count.
fn servers_left(frame_count: usize, more: &[&str], servers: &mut [ShaderServer]) -> u64 {
    let (folder, scene) = small_scene();
    let out = folder.path().join("out");
    let count = frame_count.to_string();
    let addresses: Vec<String> = servers.iter().map(|s| s.address.clone()).collect();
    let mut args = vec![
        "--path",
        "around",
        "--frames",
        &count,
        "--write",
        "last",
        "--connect",
    ];
    args.extend(addresses.iter().map(String::as_str));
    args.extend(more);
    let mut command = Command::new(&binaries().renderer);
    let mut display = Running::start(command.args(render_args(&scene, &out, &args)));
    wait_for_frames(&mut display, &out, 5);
    servers[0].kill();
    let at_kill = stats_lines(&out);
    assert!(
        at_kill < frame_count,
        "the run was over before the server was killed"
    );
    display.finish().succeeded();
    let text = fs::read_to_string(out.join("stats.jsonl")).unwrap();
    let lines = stats::parse(&text).unwrap();
    assert_eq!(lines.len(), frame_count);
    assert_eq!(frames(&out).len(), 1);
    lines.last().unwrap().servers
}

#[test]
fn with_one_of_two_servers_killed_the_other_takes_over() {
    let mut servers = [ShaderServer::start(), ShaderServer::start()];
    assert_eq!(servers_left(300, &["--lockstep"], &mut servers), 1);
}

#[test]
fn with_no_server_left_the_display_draws_what_it_has() {
    let mut servers = [ShaderServer::start()];
    assert_eq!(servers_left(2000, &[], &mut servers), 0);
}

#[test]
fn a_server_outlives_its_displays() {
    let (folder, scene) = small_scene();
    let server = ShaderServer::start();
    for name in ["a", "b"] {
        let out = folder.path().join(name);
        let args = ["--frames", "2", "--lockstep", "--connect", &server.address];
        let mut command = Command::new(&binaries().renderer);
        Running::start(command.args(render_args(&scene, &out, &args)))
            .finish()
            .succeeded();
        assert_eq!(frames(&out).len(), 2);
    }
}
