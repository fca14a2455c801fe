//! Pictures of a still camera from few samples, against pictures by an independent renderer.

use std::ffi::OsStr;

use system_tests::metrics;
use system_tests::picture::Picture;
use system_tests::report::cases;
use system_tests::{places, report::Places};

use crate::support::renderer;

/// Highest FLIP and FLIP near edges after so many frames of 2 % of the pixels.
struct Limit {
    case: &'static str,
    frames: usize,
    flip: f64,
    flip_edges: f64,
}

const LIMITS: [Limit; 4] = [
    Limit {
        case: "chains-reference",
        frames: 5,
        flip: 0.040,
        flip_edges: 0.095,
    },
    Limit {
        case: "chains-reference",
        frames: 10,
        flip: 0.025,
        flip_edges: 0.06,
    },
    Limit {
        case: "rooms-reference",
        frames: 5,
        flip: 0.020,
        flip_edges: 0.055,
    },
    Limit {
        case: "rooms-reference",
        frames: 10,
        flip: 0.014,
        flip_edges: 0.038,
    },
];

#[test]
fn still_pictures_from_few_samples_keep_their_limits() {
    let folder = tempfile::tempdir().unwrap();
    let places = Places {
        checkout: places::checkout(),
        shared: places::shared(),
    };
    let mut broken = Vec::new();
    for case in cases::find(&places, folder.path(), true).unwrap() {
        let Some(reference) = &case.picture else {
            println!(
                "skipped: no picture of {} by another renderer in ../shared",
                case.name
            );
            continue;
        };
        let reference = Picture::open(reference).unwrap();
        let out = folder.path().join(&case.name);
        let mut command = vec![
            "render".as_ref(),
            case.scene.as_os_str(),
            "--out".as_ref(),
            out.as_os_str(),
        ];
        let fixed = [
            "--size",
            "512x512",
            "--frames",
            "10",
            "--samples-per-frame",
            "5243",
            "--lockstep",
            "--exr",
        ];
        command.extend(fixed.map(OsStr::new));
        renderer(command).succeeded();
        for limit in LIMITS.iter().filter(|l| l.case == case.name) {
            let frame = out.join(format!("frame-{:04}.exr", limit.frames - 1));
            let (scores, _) = metrics::score(&Picture::open(&frame).unwrap(), &reference).unwrap();
            let edges = scores.flip_edges.unwrap();
            let line = format!(
                "{} after {} frames: FLIP {:.4} of {}, near edges {edges:.4} of {}",
                case.name, limit.frames, scores.flip, limit.flip, limit.flip_edges
            );
            println!("{line}");
            if scores.flip > limit.flip || edges > limit.flip_edges {
                broken.push(line);
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}
