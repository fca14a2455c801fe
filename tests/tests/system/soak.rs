//! A short form of the soak: what must hold of it on any machine, however busy.

use clap::Parser;
use system_tests::soak::{self, Args};

use crate::support::binaries;

#[test]
fn nothing_is_lost_while_servers_are_killed_and_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let plot = folder.path().join("soak.svg");
    let mut args = Args::parse_from(["soak", "--minutes", "0.3", "--kill-every", "4"]);
    args.shader_server = Some(binaries().shader_server.clone());
    args.plot = Some(plot.clone());
    let mut line = Vec::new();
    let report = soak::run(&args, &mut line).unwrap();
    println!("{}", String::from_utf8_lossy(&line));
    let soak = report.soak;
    assert_eq!(soak.lost, 0, "{soak:?}");
    assert!(
        soak.kills >= 2 && soak.edits >= 10 && soak.samples > 10_000,
        "{soak:?}"
    );
    assert!(
        soak.slowest_return_ms > 0.0,
        "no server came back: {soak:?}"
    );
    let plot = std::fs::read_to_string(plot).unwrap();
    assert!(plot.starts_with("<svg") && plot.contains("Resident memory"));
}
