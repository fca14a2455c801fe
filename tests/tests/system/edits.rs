//! Things that move: the same pictures from run to run, no ghosts, and in the end the picture of a scene in which
//! everything stood there from the start.

use std::fs;
use std::path::{Path, PathBuf};

use system_tests::metrics::{self, temporal::ghost_share};
use system_tests::picture::Picture;
use system_tests::report::stats;

use crate::support::{ALL_MOVE, ShaderServer, frames, render_args, renderer, small_scene};

/// The cube is pushed aside for ten frames and stays there; the lamp is turned down.
const PATHS: &str = "
[[path]]
name = 'push'
object = 'cube'
seconds = 0.33333
open = true
keys = [{}, { translate = [1.5, 0, 1] }]

[[path]]
name = 'off'
light = 0
seconds = 0.66666
open = true
step = true
keys = [{}, { power = 0.1 }]
";

struct Scenes {
    folder: tempfile::TempDir,
    moving: PathBuf,
    pushed: PathBuf,
}

fn scenes() -> Scenes {
    let (folder, moving) = small_scene();
    let text = fs::read_to_string(&moving).unwrap();
    fs::write(&moving, text.clone() + PATHS + ALL_MOVE).unwrap();
    let there = "mesh = \"cube.obj\"\n";
    assert!(text.contains(there));
    let pushed = folder.path().join("pushed.toml");
    let text = text.replace(there, &format!("{there}translate = [1.5, 0, 1]\n"));
    fs::write(&pushed, text).unwrap();
    Scenes {
        folder,
        moving,
        pushed,
    }
}

impl Scenes {
    fn render(&self, name: &str, scene: &Path, more: &str) -> Vec<(String, Vec<u8>)> {
        let out = self.folder.path().join(name);
        let args: Vec<&str> = more.split(' ').collect();
        renderer(render_args(scene, &out, &args)).succeeded();
        frames(&out)
    }

    fn picture(&self, name: &str, frame: usize) -> Picture {
        let file = format!("{name}/frame-{frame:04}.exr");
        Picture::open(&self.folder.path().join(file)).unwrap()
    }

    fn reference(&self, name: &str, scene: &Path) -> Picture {
        self.render(name, scene, "--method reference --spp 32 --exr");
        self.picture(name, 0)
    }
}

const ALL: &str = "--path all --frames 12 --lockstep --exr --seed 3";

#[test]
fn what_moves_does_so_in_the_same_way_in_every_run_and_with_any_servers() {
    let scenes = scenes();
    let first = scenes.render("first", &scenes.moving, ALL);
    assert_eq!(first.len(), 24);
    assert!(first == scenes.render("second", &scenes.moving, ALL));
    let servers = [ShaderServer::start(), ShaderServer::start()];
    let connect = servers.each_ref().map(|s| s.address.as_str()).join(" ");
    let two = scenes.render("two", &scenes.moving, &format!("{ALL} --connect {connect}"));
    assert!(first == two, "with two servers");
    let still = ALL.replace("all", "around");
    assert!(first != scenes.render("still", &scenes.moving, &still));
}

#[test]
fn every_shadow_edge_is_the_same_in_every_run_and_with_any_servers() {
    let scenes = scenes();
    let all = format!("{ALL} --shadow-edges all");
    let first = scenes.render("first", &scenes.moving, &all);
    assert!(first == scenes.render("second", &scenes.moving, &all));
    let servers = [ShaderServer::start(), ShaderServer::start()];
    let [a, b] = servers.each_ref().map(|s| s.address.as_str());
    let one = scenes.render("one", &scenes.moving, &format!("{all} --connect {a}"));
    assert!(first == one, "with one server");
    let two = scenes.render("two", &scenes.moving, &format!("{all} --connect {a} {b}"));
    assert!(first == two, "with two servers");
    let stats = fs::read_to_string(scenes.folder.path().join("first/stats.jsonl")).unwrap();
    let drawn = stats::parse(&stats).unwrap();
    let drawn: Vec<u64> = drawn.iter().map(|f| f.shadow_edges).collect();
    println!("shadow edges: {drawn:?}");
    assert!(drawn[2..].iter().all(|n| *n > 0), "{drawn:?}");
    let off = scenes.render("off", &scenes.moving, &format!("{ALL} --shadow-edges off"));
    assert!(first != off);
}

#[test]
fn a_pushed_object_leaves_no_ghost_and_the_picture_settles() {
    let scenes = scenes();
    let old = scenes.reference("old", &scenes.moving);
    let new = scenes.reference("new", &scenes.pushed);
    scenes.render(
        "push",
        &scenes.moving,
        "--path push --frames 60 --lockstep --exr",
    );
    scenes.render("there", &scenes.pushed, "--frames 50 --lockstep --exr");
    let mut line = String::new();
    for frame in [12, 20, 30, 59] {
        let picture = scenes.picture("push", frame);
        let (scores, _) = metrics::score(&picture, &new).unwrap();
        let ghosts = ghost_share(&picture, &old, &new).unwrap();
        line += &format!(
            "frame {frame}: FLIP {:.4}, ghosts {ghosts:.5}; ",
            scores.flip
        );
    }
    let (there, _) = metrics::score(&scenes.picture("there", 49), &new).unwrap();
    println!("{line}from the start: FLIP {:.4}", there.flip);
    let settled = scenes.picture("push", 59);
    let (scores, _) = metrics::score(&settled, &new).unwrap();
    assert!(scores.flip <= 1.1 * there.flip + 0.001, "{line}");
    // What is left is where the references differ by less than noise.
    let ghosts = |name, frame| ghost_share(&scenes.picture(name, frame), &old, &new).unwrap();
    let noise = ghosts("there", 49);
    assert!(
        ghosts("push", 20) < noise + 0.002 && ghosts("push", 59) < noise + 0.001,
        "{line} {noise}"
    );
}

#[test]
fn a_light_that_is_turned_down_is_forgotten() {
    let scenes = scenes();
    scenes.render(
        "off",
        &scenes.moving,
        "--path off --frames 40 --lockstep --exr",
    );
    let dim = scenes.folder.path().join("dim.toml");
    let text = fs::read_to_string(&scenes.moving).unwrap();
    let bright = "radiance = [9, 9, 9]";
    assert!(text.contains(bright));
    fs::write(&dim, text.replace(bright, "radiance = [0.9, 0.9, 0.9]")).unwrap();
    let (old, new) = (
        scenes.reference("old", &scenes.moving),
        scenes.reference("new", &dim),
    );
    let share = |frame| ghost_share(&scenes.picture("off", frame), &old, &new).unwrap();
    let shares = [9, 12, 15, 20, 39].map(share);
    println!("ghosts after 0, 3, 6, 11 and 30 frames of a dim light: {shares:?}");
    // Half of the picture is background, which no light changes.
    assert!(shares[0] > 0.45, "{shares:?}");
    assert!(shares[3] < 0.01 && shares[4] < 0.001, "{shares:?}");
}

#[test]
fn a_path_that_is_not_there_is_named_with_those_that_are() {
    let scenes = scenes();
    let out = scenes.folder.path().join("none");
    let outcome = renderer(render_args(&scenes.moving, &out, &["--path", "none"]));
    assert_eq!(outcome.code, Some(2));
    let known = "no path named `none`; it has around, all, push, off";
    assert!(outcome.stderr.contains(known), "{}", outcome.stderr);
}
