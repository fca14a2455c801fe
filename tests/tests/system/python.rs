//! A display and a shader server in another language, written from the protocol's document alone, against the real ones.

use std::process::Command;

use system_tests::{metrics, picture::Picture, places};

use crate::support::{Running, ShaderServer, render_args, renderer, small_scene};

fn has_python() -> bool {
    let found = Command::new("python3").arg("--version").output().is_ok();
    if !found {
        println!("skipped: python3 is not installed");
    }
    found
}

fn client(argument: &str) {
    if !has_python() {
        return;
    }
    let script = places::checkout().join("tests/python/edge_point_client.py");
    let mut command = Command::new("python3");
    // Compiled modules would otherwise be left in the checkout.
    command.arg("-B").arg(script).arg(argument);
    Running::start(&mut command).finish().succeeded();
}

#[test]
fn the_python_client_gets_its_samples() {
    let server = ShaderServer::start();
    client(&server.address);
}

#[test]
fn the_python_client_packs_the_document_s_examples() {
    client("--self-test");
}

#[test]
fn the_display_draws_with_the_python_server() {
    if !has_python() {
        return;
    }
    let (folder, scene) = small_scene();
    let server = places::checkout().join("tests/python/edge_point_server.py");
    let along = ["--path", "around", "--frames", "3", "--lockstep", "--exr"];
    let pictures = ["own", "foreign"].map(|which| {
        let out = folder.path().join(which);
        let mut args = render_args(&scene, &out, &along);
        if which == "foreign" {
            args.extend(["--shader".to_owned(), server.display().to_string()]);
        }
        renderer(args).succeeded();
        Picture::open(&out.join("frame-0002.exr")).unwrap()
    });
    let (scores, _) = metrics::score(&pictures[1], &pictures[0]).unwrap();
    let ratio = scores.mean_test / scores.mean_reference;
    assert!((ratio - 1.0).abs() < 0.01, "mean off by {ratio}");
    assert!(
        scores.flip > 0.0 && scores.flip < 0.06,
        "FLIP {}",
        scores.flip
    );
}
