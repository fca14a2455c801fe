//! Whether shadow edges pay: error with none, with all as barriers, and with those that are chosen; and how the choice
//! depends on its threshold.

use std::collections::BTreeMap;

use super::{Lab, Section, cell};
use crate::metrics::{self, Scores};
use crate::picture::{Picture, PictureError};
use crate::report::cases::Case;
use crate::report::chart::{Chart, Series};
use crate::report::lab::{MeasureError, budget, or_missing};
use crate::report::page::Block;
use crate::report::runner::{Job, Method, Shadows, Write};
use crate::report::table::Table;

pub(super) const SECTION: Section = Section {
    name: "shadows",
    title: "Shadow edges must pay",
    share: 30,
    measure,
};

const MODES: [Shadows; 3] = [Shadows::Off, Shadows::All, Shadows::Chosen];

/// Errors after so many frames.
type Errors = BTreeMap<u32, Scores>;

fn measure(lab: &mut Lab) -> Vec<Block> {
    let settings = lab.settings.shadows.clone();
    let [width, height] = settings.size_px;
    let mut blocks = vec![Block::Text(format!(
        "A still camera, 2 % of the pixels sampled a frame, in lockstep, {width}x{height} pixels, judged by the renderer's \
         reference method at {} samples a pixel; the dragon by an independent picture of its own size. \"All\" is the paper's \
         way: every umbral and penumbral edge keeps samples apart.",
        settings.reference_spp
    ))];
    let cases = lab.shadow_cases.clone();
    let mut worst = Vec::new();
    let mut thresholds = Vec::new();
    for (i, case) in cases.iter().enumerate() {
        lab.allow_part(cases.len() - i);
        let reference = reference(lab, case);
        let Some(reference) = or_missing(&mut blocks, &case.name, reference) else {
            continue;
        };
        let measured = modes(lab, case, &reference, &mut blocks);
        blocks.push(Block::Text(format!("{}. {}", case.name, case.remark)));
        blocks.push(Block::Table(table(case, &measured)));
        blocks.push(Block::Chart(chart(case, &measured)));
        worst.push((case.name.clone(), gains(&measured)));
        let off = measured.iter().find(|(mode, _)| *mode == Shadows::Off);
        let widths = widths(lab, case, &reference, &mut blocks);
        thresholds.push((
            case.name.clone(),
            off.map(|o| o.1.clone()).unwrap_or_default(),
            widths,
        ));
    }
    blocks.push(Block::Table(summary(&worst)));
    for frames in settings.threshold_checkpoints {
        blocks.push(Block::Chart(threshold_chart(*frames, &thresholds)));
    }
    blocks
}

fn job(lab: &Lab, case: &Case, shadows: Shadows, frames: u32) -> Result<Job, PictureError> {
    let size_px = match &case.picture {
        Some(path) => Picture::size_px_of(path)?,
        None => lab.settings.shadows.size_px,
    };
    Ok(Job {
        size_px,
        samples_per_frame: budget(size_px, 200),
        shadows,
        ..lab.still_job(case, Method::EdgeAndPoint, frames)?
    })
}

fn reference(lab: &mut Lab, case: &Case) -> Result<Picture, MeasureError> {
    if let Some(path) = &case.picture {
        return Ok(Picture::open(path)?);
    }
    let job = Job {
        method: Method::Reference(lab.settings.shadows.reference_spp),
        seed: 1,
        write: Write::Last,
        ..job(lab, case, Shadows::Chosen, 1)?
    };
    Ok(lab.run(&job, &[0])?.picture(0)?)
}

/// Errors of one run after each of `counts` frames.
fn errors(
    lab: &mut Lab,
    job: &Job,
    counts: &[u32],
    reference: &Picture,
) -> Result<Errors, MeasureError> {
    let kept: Vec<u32> = counts.iter().map(|n| n - 1).collect();
    let run = lab.run(job, &kept)?;
    let scored = counts.iter().map(|n| {
        let (scores, _) = metrics::score(&run.picture(n - 1)?, reference)?;
        Ok((*n, scores))
    });
    scored.collect()
}

fn modes(
    lab: &mut Lab,
    case: &Case,
    reference: &Picture,
    blocks: &mut Vec<Block>,
) -> Vec<(Shadows, Errors)> {
    let counts = lab.settings.shadows.checkpoints;
    let frames = counts.last().copied().unwrap_or(1);
    let of_mode = |mode| {
        let errors = job(lab, case, mode, frames)
            .map_err(MeasureError::from)
            .and_then(|job| errors(lab, &job, counts, reference));
        let what = format!("{}, shadow edges {}", case.name, mode.name());
        or_missing(blocks, &what, errors).map(|errors| (mode, errors))
    };
    MODES.into_iter().filter_map(of_mode).collect()
}

fn widths(
    lab: &mut Lab,
    case: &Case,
    reference: &Picture,
    blocks: &mut Vec<Block>,
) -> Vec<(u32, Errors)> {
    let widths = lab.settings.shadows.widths;
    let counts = lab.settings.shadows.threshold_checkpoints;
    let frames = counts.last().copied().unwrap_or(1);
    let of_width = |width: &u32| {
        let errors = job(lab, case, Shadows::Narrower(*width), frames)
            .map_err(MeasureError::from)
            .and_then(|job| errors(lab, &job, counts, reference));
        let what = format!("{}, threshold {width}", case.name);
        or_missing(blocks, &what, errors).map(|errors| (*width, errors))
    };
    widths.iter().filter_map(of_width).collect()
}

/// By how many percent one error is above another.
fn above(value: Option<f64>, base: Option<f64>) -> Option<f64> {
    Some(100.0 * (value? / base.filter(|b| *b > 0.0)? - 1.0))
}

fn table(case: &Case, measured: &[(Shadows, Errors)]) -> Table {
    let columns = [
        "shadow edges",
        "frames",
        "FLIP",
        "against off, %",
        "FLIP near edges",
        "against off, %",
    ];
    let caption = format!("Error by the shadow edges drawn, {}.", case.name);
    let mut table = Table::new(&format!("shadows-{}", case.name), &caption, &columns);
    let off = measured.iter().find(|(mode, _)| *mode == Shadows::Off);
    for (mode, errors) in measured {
        for (frames, s) in errors {
            let base = off.and_then(|(_, errors)| errors.get(frames));
            table.row([
                mode.name(),
                frames.to_string(),
                format!("{:.4}", s.flip),
                cell(above(Some(s.flip), base.map(|b| b.flip)), 1),
                cell(s.flip_edges, 4),
                cell(above(s.flip_edges, base.and_then(|b| b.flip_edges)), 1),
            ]);
        }
    }
    table
}

fn chart(case: &Case, measured: &[(Shadows, Errors)]) -> Chart {
    let title = format!("{}: FLIP near edges by the shadow edges drawn", case.name);
    let file = format!("shadows-{}-edges", case.name);
    let mut chart = Chart::new(
        &file,
        &title,
        "frames of 2 % of the pixels",
        "FLIP near edges",
    );
    for (mode, errors) in measured {
        let points = errors
            .iter()
            .filter_map(|(n, s)| Some((f64::from(*n), s.flip_edges?)));
        chart.series.push(Series::line(&mode.name(), points));
    }
    chart
}

/// Of a mode: by how much FLIP and FLIP near edges are above those without shadow edges, percent, at every count.
type Gains = Vec<(Shadows, Vec<f64>, Vec<f64>)>;

fn gains(measured: &[(Shadows, Errors)]) -> Gains {
    let off = measured.iter().find(|(mode, _)| *mode == Shadows::Off);
    let base = |n: &u32| off.and_then(|(_, errors)| errors.get(n));
    let of_mode = |(mode, errors): &(Shadows, Errors)| {
        let flip = errors
            .iter()
            .filter_map(|(n, s)| above(Some(s.flip), base(n).map(|b| b.flip)));
        let near = errors
            .iter()
            .filter_map(|(n, s)| above(s.flip_edges, base(n)?.flip_edges));
        (*mode, flip.collect(), near.collect())
    };
    measured.iter().map(of_mode).collect()
}

fn summary(scenes: &[(String, Gains)]) -> Table {
    let columns = [
        "scene",
        "shadow edges",
        "FLIP, least %",
        "FLIP, most %",
        "near edges, least %",
        "near edges, most %",
    ];
    let caption =
        "Change against no shadow edges over all numbers of frames above; less is better.";
    let mut table = Table::new("shadows", caption, &columns);
    for (name, gains) in scenes {
        for (mode, flip, near) in gains.iter().filter(|(mode, ..)| *mode != Shadows::Off) {
            let least = |v: &[f64]| cell(v.iter().copied().reduce(f64::min), 1);
            let most = |v: &[f64]| cell(v.iter().copied().reduce(f64::max), 1);
            let name = name.clone();
            table.row([
                name,
                mode.name(),
                least(flip),
                most(flip),
                least(near),
                most(near),
            ]);
        }
    }
    table
}

/// Errors without shadow edges and at each threshold.
type Thresholds = (String, Errors, Vec<(u32, Errors)>);

fn threshold_chart(frames: u32, scenes: &[Thresholds]) -> Chart {
    let title = format!("Threshold of the width of penumbrae, after {frames} frames");
    let mut chart = Chart::new(
        &format!("shadow-width-{frames}"),
        &title,
        "greatest width of a penumbra that is chosen, mean distances between samples",
        "FLIP near edges / the same without shadow edges",
    );
    for (name, off, widths) in scenes {
        let base = off
            .get(&frames)
            .and_then(|s| s.flip_edges)
            .filter(|b| *b > 0.0);
        let points = widths.iter().filter_map(|(width, errors)| {
            let near = errors.get(&frames)?.flip_edges?;
            Some((f64::from(*width) / 100.0, near / base?))
        });
        chart.series.push(Series::line(name, points));
    }
    chart.series.push(Series::floor("no shadow edges", 1.0));
    chart
}
