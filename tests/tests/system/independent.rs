//! The shaders' own averages against small pictures by an independent renderer, kept beside the script that makes them.

use std::fs;
use std::path::PathBuf;

use system_tests::picture::Picture;
use system_tests::places;

use crate::support::renderer;

/// Side of the blocks in which pictures are compared, pixels.
const BLOCK: usize = 8;

/// How far a picture may be from its reference, both as shares of the reference's mean. Ten times what was measured for
/// the mean, twice for the blocks: with 64 samples a pixel the noise of both is below that.
struct Limit {
    name: &'static str,
    mean: f64,
    blocks: f64,
}

const LIMITS: [Limit; 3] = [
    Limit {
        name: "box",
        mean: 0.003,
        blocks: 0.016,
    },
    Limit {
        name: "torus",
        mean: 0.002,
        blocks: 0.003,
    },
    Limit {
        name: "rooms",
        mean: 0.002,
        blocks: 0.006,
    },
];

fn pictures() -> PathBuf {
    places::checkout().join("tests/mitsuba")
}

/// A scene with direct light alone, whatever it asks for.
fn with_direct_light(name: &str) -> String {
    let file = pictures().join(format!("{name}.toml"));
    let text = match scenes::builtin_text(name) {
        Some(text) => text.to_owned(),
        None => fs::read_to_string(file).unwrap(),
    };
    text.replace("model = \"global\"", "model = \"direct\"")
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

#[test]
fn direct_light_agrees_with_an_independent_renderer() {
    let folder = tempfile::tempdir().unwrap();
    let mut broken = Vec::new();
    for limit in &LIMITS {
        let scene = folder.path().join(format!("{}.toml", limit.name));
        fs::write(&scene, with_direct_light(limit.name)).unwrap();
        let out = folder.path().join(limit.name);
        let (scene, out_name) = (scene.to_str().unwrap(), out.to_str().unwrap());
        let fixed = "--frames 1 --size 128x128 --method reference --spp 64 --write last --exr";
        let mut command = vec!["render", scene, "--out", out_name];
        command.extend(fixed.split(' '));
        renderer(command).succeeded();
        let own = blocks(&Picture::open(&out.join("frame-0000.exr")).unwrap());
        let reference = pictures().join(format!("{}-direct.exr", limit.name));
        let reference = blocks(&Picture::open(&reference).unwrap());
        assert_eq!(own.len(), reference.len());
        let level = mean(&reference);
        let off = (mean(&own) / level - 1.0).abs();
        let squares: Vec<f64> = own
            .iter()
            .zip(&reference)
            .map(|(a, b)| (a - b) * (a - b))
            .collect();
        let rms = mean(&squares).sqrt() / level;
        let line = format!(
            "{}: mean off by {off:.5} of {}, blocks by {rms:.5} of {}",
            limit.name, limit.mean, limit.blocks
        );
        println!("{line}");
        if off > limit.mean || rms > limit.blocks {
            broken.push(line);
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}
