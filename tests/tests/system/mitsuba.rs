//! The display with the path tracer of Mitsuba 3 behind it, where that is installed.

use std::path::PathBuf;
use std::process::Command;

use system_tests::{metrics, picture::Picture, places};

use crate::support::{Running, binaries, render_args, renderer, small_scene};

fn server() -> PathBuf {
    places::checkout().join("tests/mitsuba_shader.py")
}

/// Whether the server says that it can run: with no place to listen on it goes no further than that.
fn has_mitsuba() -> bool {
    let mut command = Command::new("python3");
    command
        .arg("-B")
        .arg(server())
        .args(["--listen", "nowhere"]);
    if command.output().is_err() {
        println!("skipped: python3 is not installed");
        return false;
    }
    let outcome = Running::start(&mut command).finish();
    assert_eq!(outcome.code, Some(2), "{}", outcome.stderr);
    if outcome.stderr.contains("pip install mitsuba") {
        println!("skipped: {}", outcome.stderr.trim());
        return false;
    }
    true
}

#[test]
fn the_mitsuba_server_conforms() {
    if !has_mitsuba() {
        return;
    }
    let mut command = Command::new(&binaries().conformance);
    command
        .args(["--quiet", "--timeout", "60", "--shader"])
        .arg(server());
    let outcome = Running::start(&mut command).finish().succeeded();
    assert!(!outcome.stdout.contains("FAIL"), "{}", outcome.stdout);
}

/// Pictures of the same scene by both shaders agree in the mean, the small scene having light of one kind alone.
#[test]
fn the_display_draws_with_mitsuba() {
    if !has_mitsuba() {
        return;
    }
    let (folder, scene) = small_scene();
    let along = ["--frames", "16", "--lockstep", "--write", "last", "--exr"];
    let pictures = ["own", "foreign"].map(|which| {
        let out = folder.path().join(which);
        let mut args = render_args(&scene, &out, &along);
        if which == "foreign" {
            args.extend(["--shader".to_owned(), server().display().to_string()]);
        }
        renderer(args).succeeded();
        Picture::open(&out.join("frame-0015.exr")).unwrap()
    });
    let (scores, _) = metrics::score(&pictures[1], &pictures[0]).unwrap();
    let ratio = scores.mean_test / scores.mean_reference;
    assert!((ratio - 1.0).abs() < 0.01, "mean off by {ratio}");
    assert!(scores.flip < 0.08, "FLIP {}", scores.flip);
}
