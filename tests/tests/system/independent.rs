//! The shaders' own averages against small pictures by an independent renderer, kept beside the script that makes them.

use std::fs;
use std::path::PathBuf;

use system_tests::picture::Picture;
use system_tests::places;

use crate::support::renderer;

/// Side of the blocks in which pictures are compared, pixels.
const BLOCK: usize = 8;

/// A picture by the independent renderer, and how far ours may be from it: both limits are shares of its mean. Two to ten times
/// what was measured; the noise of both is below that.
struct Case {
    scene: &'static str,
    model: &'static str,
    /// Samples a pixel of ours.
    spp: u32,
    mean: f64,
    blocks: f64,
}

const fn case(scene: &'static str, model: &'static str, spp: u32, mean: f64, blocks: f64) -> Case {
    Case {
        scene,
        model,
        spp,
        mean,
        blocks,
    }
}

fn pictures() -> PathBuf {
    places::checkout().join("tests/mitsuba")
}

/// A scene that asks for this model, whatever its file says.
fn with_model(case: &Case) -> String {
    let file = pictures().join(format!("{}.toml", case.scene));
    let text = match scenes::builtin_text(case.scene) {
        Some(text) => text.to_owned(),
        None => fs::read_to_string(file).unwrap(),
    };
    let asks = text.lines().find(|line| line.starts_with("model = "));
    text.replace(asks.unwrap(), &format!("model = \"{}\"", case.model))
}

/// Mean of each channel in each block.
fn blocks(picture: &Picture) -> Vec<f64> {
    let [width, height] = picture.size_px().map(|n| n as usize);
    let across = width / BLOCK;
    let mut sums = vec![0.0; across * (height / BLOCK) * 3];
    for (i, rgb) in picture.rgb().iter().enumerate() {
        let block = i / width / BLOCK * across + i % width / BLOCK;
        for (k, value) in rgb.iter().enumerate() {
            sums[block * 3 + k] += f64::from(*value) / (BLOCK * BLOCK) as f64;
        }
    }
    sums
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Renders a case; says what is too far off.
fn disagreement(case: &Case) -> Option<String> {
    let folder = tempfile::tempdir().unwrap();
    let name = format!("{}-{}", case.scene, case.model);
    let scene = folder.path().join(format!("{name}.toml"));
    fs::write(&scene, with_model(case)).unwrap();
    let (scene, out) = (scene.to_str().unwrap(), folder.path().to_str().unwrap());
    let spp = case.spp.to_string();
    let mut command = vec!["render", scene, "--out", out, "--spp", &spp];
    command.extend("--frames 1 --size 128x128 --method reference --write last --exr".split(' '));
    renderer(command).succeeded();
    let own = blocks(&Picture::open(&folder.path().join("frame-0000.exr")).unwrap());
    let reference = pictures().join(format!("{name}.exr"));
    let reference = blocks(&Picture::open(&reference).unwrap());
    assert_eq!(own.len(), reference.len());
    let level = mean(&reference);
    let off = mean(&own) / level - 1.0;
    let squares: Vec<f64> = own
        .iter()
        .zip(&reference)
        .map(|(a, b)| (a - b) * (a - b))
        .collect();
    let rms = mean(&squares).sqrt() / level;
    let line = format!(
        "{name}: mean off by {off:+.5} of {}, blocks by {rms:.5} of {}",
        case.mean, case.blocks
    );
    println!("{line}");
    (off.abs() > case.mean || rms > case.blocks).then_some(line)
}

fn agree(cases: &[Case]) {
    let broken: Vec<String> = cases.iter().filter_map(disagreement).collect();
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn direct_light_agrees_with_an_independent_renderer() {
    agree(&[
        case("box", "direct", 64, 0.003, 0.016),
        case("torus", "direct", 64, 0.002, 0.003),
        case("rooms", "direct", 64, 0.002, 0.006),
        case("gloss", "direct", 64, 0.002, 0.004),
    ]);
}

#[test]
fn glossy_reflection_agrees_with_an_independent_renderer() {
    agree(&[
        case("gloss", "glossy", 32, 0.002, 0.006),
        case("head", "glossy", 16, 0.002, 0.011),
    ]);
}

#[test]
fn indirect_light_agrees_with_an_independent_renderer() {
    agree(&[
        case("box", "global", 16, 0.005, 0.024),
        case("gloss", "global", 32, 0.003, 0.012),
        case("rooms", "global", 16, 0.004, 0.016),
    ]);
}

#[test]
fn indirect_light_agrees_in_a_room_of_the_paper_s_size() {
    agree(&[case("mack", "global", 16, 0.005, 0.03)]);
}
