//! Lockstep gives the same pictures to the bit, whatever computes the samples.

use std::path::Path;

use system_tests::report::stats;

use crate::support::{ShaderServer, frames, render_args, renderer, small_scene};

const ALONG: [&str; 8] = [
    "--path",
    "around",
    "--frames",
    "10",
    "--lockstep",
    "--exr",
    "--seed",
    "5",
];

fn render(scene: &Path, out: &Path, more: &[&str]) -> Vec<(String, Vec<u8>)> {
    let args = [ALONG.as_slice(), more].concat();
    renderer(render_args(scene, out, &args)).succeeded();
    frames(out)
}

#[track_caller]
fn assert_same(a: &[(String, Vec<u8>)], b: &[(String, Vec<u8>)]) {
    assert_eq!(a.len(), 20, "10 frames as PNG and EXR");
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(b) {
        assert_eq!(a.0, b.0);
        assert!(a.1 == b.1, "{} differs", a.0);
    }
}

#[test]
fn two_runs_are_identical() {
    let (folder, scene) = small_scene();
    let first = render(&scene, &folder.path().join("a"), &[]);
    let second = render(&scene, &folder.path().join("b"), &[]);
    assert_same(&first, &second);
}

#[test]
fn one_server_two_servers_and_the_embedded_one_agree() {
    let (folder, scene) = small_scene();
    let embedded = render(&scene, &folder.path().join("embedded"), &[]);
    let servers = [ShaderServer::start(), ShaderServer::start()];
    let [a, b] = servers.each_ref().map(|s| s.address.as_str());
    let one = render(&scene, &folder.path().join("one"), &["--connect", a]);
    let two = render(&scene, &folder.path().join("two"), &["--connect", a, b]);
    assert_same(&embedded, &one);
    assert_same(&embedded, &two);
}

#[test]
fn the_display_s_threads_change_nothing() {
    let (folder, scene) = small_scene();
    let one = render(&scene, &folder.path().join("one"), &["--threads", "1"]);
    let three = render(&scene, &folder.path().join("three"), &["--threads", "3"]);
    assert_same(&one, &three);
}

#[test]
fn indirect_light_depends_on_no_server_or_thread() {
    let (folder, scene) = small_scene();
    let text = std::fs::read_to_string(&scene).unwrap();
    let global = text.replace("model = \"direct\"", "model = \"global\"");
    assert_ne!(global, text, "the scene asks for direct light");
    std::fs::write(&scene, global).unwrap();
    let one = render(&scene, &folder.path().join("one"), &[]);
    let more = ["--shaders", "2", "--shader-threads", "3"];
    let more = render(&scene, &folder.path().join("more"), &more);
    assert_same(&one, &more);
    // A server of its own is asked for answers that are final.
    let other = ShaderServer::start();
    let apart = ["--connect", other.address.as_str()];
    assert_same(&one, &render(&scene, &folder.path().join("apart"), &apart));
    std::fs::write(&scene, text).unwrap();
    assert_ne!(one, render(&scene, &folder.path().join("direct"), &[]));
}

#[test]
fn every_way_to_find_visibility_depends_on_no_server_or_thread() {
    let (folder, scene) = small_scene();
    let mut pictures = Vec::new();
    for method in ["auto", "penumbra", "soft-map"] {
        let out = |run: &str| folder.path().join(format!("{method}-{run}"));
        let forced = ["--shadows", method];
        let one = render(&scene, &out("one"), &forced);
        let two = ["--shaders", "2", "--shader-threads", "3"];
        let two = render(&scene, &out("two"), &[&forced[..], &two].concat());
        assert_same(&one, &two);
        pictures.push(one);
    }
    assert_ne!(pictures[1], pictures[2], "the methods are different ones");
}

#[test]
fn another_seed_gives_another_picture() {
    let (folder, scene) = small_scene();
    let first = render(&scene, &folder.path().join("a"), &[]);
    let out = folder.path().join("b");
    let args = [
        "--path",
        "around",
        "--frames",
        "10",
        "--lockstep",
        "--exr",
        "--seed",
        "6",
    ];
    renderer(render_args(&scene, &out, &args)).succeeded();
    assert_ne!(first, frames(&out));
}

#[test]
fn statistics_have_a_line_a_frame() {
    let (folder, scene) = small_scene();
    let out = folder.path().join("a");
    render(&scene, &out, &[]);
    let text = std::fs::read_to_string(out.join("stats.jsonl")).unwrap();
    let frames = stats::parse(&text).unwrap();
    assert_eq!(
        frames.iter().map(|f| f.frame).collect::<Vec<_>>(),
        (0..10).collect::<Vec<_>>()
    );
    for frame in &frames {
        let pixels = frame.pixels;
        assert_eq!(
            pixels.empty + pixels.simple + pixels.complex,
            160 * 120,
            "{frame:?}"
        );
        let stages: f64 = frame.stage_ms.values().sum();
        assert!(
            (stages - frame.total_ms).abs() < 0.05 * frame.total_ms + 0.01,
            "{frame:?}"
        );
        assert!(frame.stage_ms.len() == stats::STAGES.len());
        assert!(
            frame.silhouette_edges > 0 && frame.servers == 1,
            "{frame:?}"
        );
    }
    assert!(frames.iter().map(|f| f.samples_new).sum::<u64>() >= 400);
}
