//! What a user can get wrong gives one clear line and exit code 2.

use std::fs;
use std::path::Path;

use crate::support::{Outcome, render_args, renderer, small_scene};

/// Renders the small scene after `spoil` has changed its folder.
fn render_spoiled(spoil: impl FnOnce(&Path)) -> Outcome {
    let (folder, scene) = small_scene();
    spoil(folder.path());
    renderer(render_args(
        &scene,
        &folder.path().join("out"),
        &["--frames", "1", "--lockstep"],
    ))
}

#[track_caller]
fn assert_one_line(outcome: &Outcome, parts: &[&str]) {
    let text = outcome.stderr.trim();
    assert_eq!(outcome.code, Some(2), "{text}");
    assert_eq!(
        text.lines().count(),
        1,
        "more or less than one line:\n{text}"
    );
    for part in parts {
        assert!(text.contains(part), "{part:?} is not in: {text}");
    }
    assert!(!text.contains("panicked"), "{text}");
}

#[test]
fn a_missing_scene() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("nowhere.toml");
    let outcome = renderer(render_args(&scene, &folder.path().join("out"), &[]));
    assert_one_line(&outcome, &["nowhere.toml"]);
}

#[test]
fn a_missing_mesh() {
    let outcome = render_spoiled(|folder| fs::remove_file(folder.join("cube.obj")).unwrap());
    assert_one_line(&outcome, &["cube.obj"]);
}

#[test]
fn bad_toml() {
    let outcome =
        render_spoiled(|folder| fs::write(folder.join("scene.toml"), "[camera\neye = 3").unwrap());
    assert_one_line(&outcome, &["scene.toml:1"]);
}

#[test]
fn a_key_that_no_scene_has() {
    let outcome = render_spoiled(|folder| {
        let text = fs::read_to_string(folder.join("scene.toml")).unwrap();
        fs::write(folder.join("scene.toml"), text.replace("fov_y", "fovy")).unwrap();
    });
    assert_one_line(&outcome, &["scene.toml", "fovy"]);
}

#[test]
fn a_vertex_that_is_not_a_number() {
    let outcome = render_spoiled(|folder| {
        fs::write(
            folder.join("cube.obj"),
            "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        )
        .unwrap();
    });
    assert_one_line(&outcome, &["cube.obj", "finite"]);
}

#[test]
fn an_index_out_of_range() {
    let outcome = render_spoiled(|folder| {
        fs::write(
            folder.join("cube.obj"),
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
        )
        .unwrap();
    });
    assert_one_line(&outcome, &["cube.obj", "9"]);
}

#[test]
fn an_empty_mesh() {
    let outcome = render_spoiled(|folder| fs::write(folder.join("cube.obj"), "").unwrap());
    assert_one_line(&outcome, &["cube.obj"]);
}

#[test]
fn an_unknown_path() {
    let (folder, scene) = small_scene();
    let args = ["--path", "nowhere", "--lockstep"];
    let outcome = renderer(render_args(&scene, &folder.path().join("out"), &args));
    assert_one_line(&outcome, &["nowhere", "around"]);
}

#[test]
fn a_folder_that_cannot_be_written() {
    let (folder, scene) = small_scene();
    let file = folder.path().join("file");
    fs::write(&file, "").unwrap();
    let out = file.join("out");
    let args = [
        "render",
        scene.to_str().unwrap(),
        "--lockstep",
        "--out",
        out.to_str().unwrap(),
    ];
    assert_one_line(&renderer(args), &["file"]);
}

#[test]
fn nobody_listening() {
    // A port that was free a moment ago, and that nothing listens on.
    let port = std::net::TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    let (folder, scene) = small_scene();
    let address = port.to_string();
    let args = ["--lockstep", "--connect", &address];
    let outcome = renderer(render_args(&scene, &folder.path().join("out"), &args));
    // Warnings tell of each attempt; the last line says what became of them.
    let last = outcome.stderr.lines().last().unwrap_or_default();
    assert_eq!(outcome.code, Some(2), "{}", outcome.stderr);
    assert!(
        last.starts_with("error:") && last.contains("server"),
        "{}",
        outcome.stderr
    );
}

#[test]
fn a_wrong_argument() {
    for args in [
        ["--size", "0x0"],
        ["--frames", "many"],
        ["--method", "magic"],
        ["--nonsense", "1"],
    ] {
        let (folder, scene) = small_scene();
        let outcome = renderer(
            render_args(&scene, &folder.path().join("out"), &[])
                .into_iter()
                .chain(args.map(str::to_owned)),
        );
        assert_eq!(outcome.code, Some(2), "{args:?}: {}", outcome.stderr);
        let first = outcome.stderr.lines().next().unwrap_or_default();
        assert!(
            first.contains(args[0]) || first.contains("--size"),
            "{args:?}: {}",
            outcome.stderr
        );
    }
}
