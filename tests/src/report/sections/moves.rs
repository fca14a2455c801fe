//! What happens after a step: an object jumps, the camera is elsewhere at once, a light goes out.

use std::fs;
use std::rc::Rc;

use super::{Lab, Section, cell};
use crate::metrics::temporal::{flicker, ghost_share, recovery_frames};
use crate::metrics::{self, FlipMap};
use crate::picture::{Picture, PictureError};
use crate::report::chart::{Chart, Series};
use crate::report::lab::{MeasureError, budget, or_missing};
use crate::report::page::Block;
use crate::report::runner::{Job, Method, Run, RunError, Shadows, Write};
use crate::report::table::Table;

pub(super) const SECTION: Section = Section {
    name: "moves",
    title: "After a step: moved objects, a teleport, a light switched",
    share: 10,
    measure,
};

/// A step in a built-in scene.
struct Step {
    name: &'static str,
    what: &'static str,
    scene: &'static str,
    /// What moves, as a line of the path; the camera without.
    subject: &'static str,
    /// The keys before and after.
    keys: [&'static str; 2],
}

const STEPS: [Step; 4] = [
    Step {
        name: "link",
        what: "A link of the hanging chain jumps",
        scene: "chains",
        subject: "object = \"green/6\"\n",
        keys: [
            "{}",
            "{ translate = [-1.6, 0.5, 1.5], rotate = [0, 60, 20] }",
        ],
    },
    Step {
        name: "switch",
        what: "A light of chains goes out",
        scene: "chains",
        subject: "light = \"left\"\n",
        keys: ["{}", "{ power = 0 }"],
    },
    Step {
        name: "grid",
        what: "The grid over the dragon of tubes jumps",
        scene: "grid",
        subject: "object = \"grid\"\n",
        keys: ["{}", "{ translate = [0.05, -0.1, 0], rotate = [0, 30, 0] }"],
    },
    Step {
        name: "teleport",
        what: "The camera of chains is at another place at once",
        scene: "chains",
        subject: "",
        keys: [
            "{ eye = [0.6, 4.2, 7.4], target = [-0.1, 1.05, 0.2] }",
            "{ eye = [7.0, 3.0, -2.8], target = [-0.1, 1.05, 0.1] }",
        ],
    },
];

const METHODS: [(&str, Method, Shadows); 3] = [
    ("edge-and-point", Method::EdgeAndPoint, Shadows::Chosen),
    ("without shadow edges", Method::EdgeAndPoint, Shadows::Off),
    ("points-only", Method::PointsOnly, Shadows::Chosen),
];

/// Times for which a path holds its first and its second key, in [`crate::report::lab::ShadowSettings::move_frames`].
const HELD: [usize; 2] = [2, 3];
/// Last frames whose mean error is the settled one.
const SETTLED: usize = 5;
/// Least difference, display values, that the step makes in a pixel that can hold a ghost: more than the references' noise.
const CHANGED: f32 = 0.04;
/// Frames after the step, from 1, whose ghosts are in the table.
const GHOSTS: [usize; 3] = [1, 5, 15];

/// The true pictures before and after.
struct Truth {
    old: Picture,
    new: Picture,
    /// The old one where the step changes it visibly, the new one elsewhere.
    old_where_changed: Picture,
}

/// What a method gave, frame by frame from the step on.
struct Curve {
    name: &'static str,
    before: f64,
    errors: Vec<f64>,
    ghosts: Vec<f64>,
    flicker: f64,
    /// Time from the start of the first frame after the step to each frame's end, ms.
    times_ms: Vec<f64>,
}

fn measure(lab: &mut Lab) -> Vec<Block> {
    let settings = lab.settings.shadows.clone();
    let [width, height] = settings.size_px;
    let mut blocks = vec![Block::Text(format!(
        "{width}x{height} pixels, 2 % of them sampled a frame, in lockstep. The scene stands still for {} frames, one thing \
         changes at once, and it stands still for {} more, judged by the renderer's reference method at {} samples a pixel. \
         Recovery is the number of frames, and the time with all waiting, until FLIP is at most 1.1 times its settled value, \
         the mean of the last {SETTLED} frames; since a still picture keeps getting better, also until 1.1 times the error \
         just before the step. Ghost area is the share of pixels nearer to the old picture than to the new one, among those \
         that the step changes by more than {CHANGED}; what is left at the end is no memory of the old picture but noise, or \
         for the teleport chance. Flicker is the mean change from frame to frame that the reference does not have.",
        HELD[0] * settings.move_frames as usize,
        HELD[1] * settings.move_frames as usize,
        settings.move_reference_spp,
    ))];
    let steps = &STEPS[..settings.moves.min(STEPS.len())];
    for (i, step) in steps.iter().enumerate() {
        lab.allow_part(steps.len() - i);
        let truth = truth(lab, step);
        let Some(truth) = or_missing(&mut blocks, step.what, truth) else {
            continue;
        };
        let mut curves = Vec::new();
        for (name, method, shadows) in METHODS {
            let curve = curve(lab, step, name, method, shadows, &truth);
            let what = format!("{}, {name}", step.what);
            curves.extend(or_missing(&mut blocks, &what, curve));
        }
        blocks.push(Block::Text(format!("{}.", step.what)));
        blocks.push(Block::Table(table(step, &curves)));
        blocks.extend(charts(step, &curves).map(Block::Chart));
    }
    blocks
}

/// The step's scene with two paths: `step` for the sparse methods, `judge` with one frame before and one after.
fn scene_text(step: &Step) -> String {
    let path = |name: &str, held: [usize; 2]| {
        let keys: Vec<&str> = (0..2).flat_map(|k| vec![step.keys[k]; held[k]]).collect();
        format!(
            "\n[[path]]\nname = \"{name}\"\n{}seconds = {}\nopen = true\nstep = true\nkeys = [{}]\n",
            step.subject,
            keys.len(),
            keys.join(", "),
        )
    };
    let text = scenes::builtin_text(step.scene).unwrap_or_default();
    text.to_owned() + &path("step", HELD) + &path("judge", [1, 1])
}

fn job(lab: &Lab, step: &Step, method: Method, shadows: Shadows) -> Result<Job, RunError> {
    let settings = &lab.settings.shadows;
    let is_reference = matches!(method, Method::Reference(_));
    let frames = settings.move_frames;
    let scene = lab.work().join(format!("step-{}.toml", step.name));
    fs::write(&scene, scene_text(step))?;
    Ok(Job {
        scene,
        method,
        size_px: settings.size_px,
        frames: if is_reference {
            2
        } else {
            frames * (HELD[0] + HELD[1]) as u32
        },
        path: Some(if is_reference { "judge" } else { "step" }.to_owned()),
        fps: if is_reference { 1 } else { frames },
        samples_per_frame: budget(settings.size_px, 200),
        write: Write::All,
        threads: None,
        seed: u32::from(is_reference),
        shadows,
        visibility: None,
    })
}

fn truth(lab: &mut Lab, step: &Step) -> Result<Truth, MeasureError> {
    let method = Method::Reference(lab.settings.shadows.move_reference_spp);
    let job = job(lab, step, method, Shadows::Chosen)?;
    let run = lab.run(&job, &[0, 1])?;
    let (old, new) = (run.picture(0)?, run.picture(1)?);
    let old_where_changed = where_changed(&old, &new)?;
    Ok(Truth {
        old,
        new,
        old_where_changed,
    })
}

fn where_changed(old: &Picture, new: &Picture) -> Result<Picture, PictureError> {
    old.check_same_size(new)?;
    let (a, b) = (old.to_srgb(), new.to_srgb());
    let pixel = |i: usize| {
        let changed = (0..3).any(|c| (a[i][c] - b[i][c]).abs() > CHANGED);
        if changed { old.rgb()[i] } else { new.rgb()[i] }
    };
    Picture::from_linear(old.size_px(), (0..a.len()).map(pixel).collect())
}

fn curve(
    lab: &mut Lab,
    step: &Step,
    name: &'static str,
    method: Method,
    shadows: Shadows,
    truth: &Truth,
) -> Result<Curve, MeasureError> {
    let job = job(lab, step, method, shadows)?;
    let first = HELD[0] as u32 * lab.settings.shadows.move_frames;
    let kept: Vec<u32> = (first - 1..job.frames).collect();
    let run: Rc<Run> = lab.run(&job, &kept)?;
    let flip = |a: &Picture, b: &Picture| FlipMap::between(a, b).map(|map| map.mean());
    let mut last = run.picture(first - 1)?;
    let before = flip(&last, &truth.old)?;
    let (mut errors, mut ghosts, mut flickers) = (Vec::new(), Vec::new(), Vec::new());
    for frame in first..job.frames {
        let picture = run.picture(frame)?;
        errors.push(flip(&picture, &truth.new)?);
        ghosts.push(ghost_share(&picture, &truth.old_where_changed, &truth.new)?);
        let was = if frame == first {
            &truth.old
        } else {
            &truth.new
        };
        flickers.push(flicker([&last, &picture], [was, &truth.new])?);
        last = picture;
    }
    let start_ms = run.elapsed_ms(first - 1);
    let times_ms = (first..job.frames)
        .map(|n| run.elapsed_ms(n) - start_ms)
        .collect();
    Ok(Curve {
        name,
        before,
        errors,
        ghosts,
        flicker: metrics::linear::mean(&flickers),
        times_ms,
    })
}

fn table(step: &Step, curves: &[Curve]) -> Table {
    let mut columns: Vec<String> = [
        "method",
        "FLIP before",
        "FLIP, first frame after",
        "FLIP settled",
        "recovery, frames",
        "recovery, ms",
        "to 1.1 x before, frames",
        "to 1.1 x before, ms",
    ]
    .map(str::to_owned)
    .to_vec();
    columns.extend(GHOSTS.map(|n| format!("ghost area, frame {n}, %")));
    columns.extend(["ghost area, last, %", "flicker"].map(str::to_owned));
    let mut table = Table::new(
        &format!("step-{}", step.name),
        &format!("{}.", step.what),
        &[],
    );
    table.columns = columns;
    for curve in curves {
        let settled = &curve.errors[curve.errors.len().saturating_sub(SETTLED)..];
        let recovery = recovery_frames(&curve.errors, 0, SETTLED);
        let again = curve.errors.iter().position(|e| *e <= 1.1 * curve.before);
        let ghost = |n: usize| cell(curve.ghosts.get(n).map(|share| 100.0 * share), 2);
        let mut row = vec![
            curve.name.to_owned(),
            format!("{:.4}", curve.before),
            cell(curve.errors.first().copied(), 4),
            format!("{:.4}", metrics::linear::mean(settled)),
        ];
        for frames in [recovery, again] {
            row.push(frames.map_or_else(|| "never".to_owned(), |n| (n + 1).to_string()));
            row.push(cell(frames.and_then(|n| curve.times_ms.get(n).copied()), 0));
        }
        row.extend(GHOSTS.map(|n| ghost(n - 1)));
        row.push(ghost(curve.ghosts.len().saturating_sub(1)));
        row.push(format!("{:.5}", curve.flicker));
        table.row(row);
    }
    table
}

fn charts<'a>(step: &'a Step, curves: &'a [Curve]) -> impl Iterator<Item = Chart> + 'a {
    let axes = [
        ("frames", "frames since the step"),
        ("time", "time since the step, waiting included, ms"),
    ];
    axes.into_iter().map(move |(key, label)| {
        let title = format!("{}: FLIP against {key}", step.what);
        let mut chart = Chart::new(&format!("step-{}-{key}", step.name), &title, label, "FLIP");
        for curve in curves {
            let at = |i: usize| match key {
                "time" => curve.times_ms[i],
                _ => i as f64 + 1.0,
            };
            let points = curve.errors.iter().enumerate().map(|(i, e)| (at(i), *e));
            chart.series.push(Series::line(curve.name, points));
        }
        chart
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_that_hardly_change_hold_no_ghosts() {
        let row = |values: [f32; 3]| {
            let rgb = values.map(|v| [v; 3]).to_vec();
            Picture::from_linear([3, 1], rgb).unwrap()
        };
        let (old, new) = (row([0.2, 0.5, 0.9]), row([0.201, 0.5, 0.1]));
        let old = where_changed(&old, &new).unwrap();
        assert_eq!(ghost_share(&row([0.2, 0.4, 0.1]), &old, &new).unwrap(), 0.0);
        let share = ghost_share(&row([0.2, 0.4, 0.9]), &old, &new).unwrap();
        assert!((share - 1.0 / 3.0).abs() < 1e-9);
    }

    #[test]
    fn every_step_is_a_path_of_its_scene() {
        let folder = tempfile::tempdir().unwrap();
        for step in &STEPS {
            let file = folder.path().join("step.toml");
            fs::write(&file, scene_text(step)).unwrap();
            let loaded = scenes::load(&file).unwrap();
            let camera = loaded.path("step").map(|p| {
                // The last frame before and the first after, at 20 frames a second.
                [39, 40].map(|frame| p.at_seconds(frame as f32 / 20.0).eye)
            });
            let changes = match camera {
                Some([before, after]) => before != after,
                None => loaded.motions.iter().any(|m| m.name == "step"),
            };
            assert!(changes, "{}", step.name);
        }
    }
}
