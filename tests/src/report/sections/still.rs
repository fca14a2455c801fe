//! Error of a still camera against time and against the share of pixels sampled, for every method.

use super::{Lab, Section, cell};
use crate::metrics::{self, Scores, temporal};
use crate::picture::Picture;
use crate::report::cases::Case;
use crate::report::chart::{Chart, Series};
use crate::report::lab::{MeasureError, budget, or_missing};
use crate::report::page::Block;
use crate::report::rivals::{RIVALS, WITHOUT_EDGES};
use crate::report::runner::{Job, Method, Run, Write};
use crate::report::table::Table;

pub(super) const SECTION: Section = Section {
    name: "still",
    title: "A still camera: error against time and samples",
    share: 110,
    measure,
};

/// The methods that keep samples from frame to frame.
pub(super) const SPARSE: [Method; 3] =
    [Method::EdgeAndPoint, Method::NoComplex, Method::PointsOnly];
const COLUMNS: [&str; 12] = [
    "method",
    "frames",
    "samples, % of pixels",
    "time ms",
    "FLIP",
    "FLIP near edges",
    "RMSE",
    "relMSE",
    "relMSE trimmed",
    "PSNR dB",
    "mean / reference",
    "flicker",
];
const AXES: [&str; 2] = [
    "time since the first frame's start, ms",
    "samples so far, % of pixels",
];
type Get = fn(&Scores) -> Option<f64>;
const ERRORS: [(&str, &str, Get); 3] = [
    ("flip", "FLIP", |s| Some(s.flip)),
    ("edges", "FLIP near edges", |s| s.flip_edges),
    ("relmse", "relMSE", |s| Some(s.rel_mse)),
];

/// One judged picture.
struct Judged {
    frames: u32,
    share_percent: f64,
    time_ms: f64,
    scores: Scores,
    flicker: Option<f64>,
}

struct Curve {
    label: String,
    points: Vec<Judged>,
}

fn measure(lab: &mut Lab) -> Vec<Block> {
    let mut blocks = vec![Block::Text(
        "Each sparse method gets 2 % of the pixels as samples a frame, in lockstep; time is the frames' stages and the waiting \
         for samples, on all cores. The dashed floor is one frame with every pixel sampled once, then reconstructed: the \
         bias that reconstruction leaves however fast samples come; only averaging of further samples goes below it. \
         Scenes with indirect light start without any of it: the first frames wait for it, which is most of their time."
            .to_owned(),
    )];
    let cases = cases(lab);
    for (i, case) in cases.iter().enumerate() {
        lab.allow_part(cases.len() - i);
        blocks.push(Block::Text(format!("{}. {}", case.name, case.remark)));
        let reference = lab.still_reference(case);
        let Some(reference) = or_missing(&mut blocks, &case.name, reference) else {
            continue;
        };
        let (curves, floor) = curves(lab, case, &reference, &mut blocks);
        if curves.iter().any(|c| !c.points.is_empty()) {
            blocks.push(Block::Table(table(case, &curves, floor.as_ref())));
            blocks.extend(charts(case, &curves, floor.as_ref()).map(Block::Chart));
        }
    }
    blocks
}

/// The scenes of the report, and those of the 2003 paper that are not among them.
fn cases(lab: &Lab) -> Vec<Case> {
    let mut cases = lab.cases.clone();
    if lab.settings.still_of_the_paper {
        let other = |case: &&Case| lab.cases.iter().all(|own| own.name != case.name);
        cases.extend(lab.paper_cases.iter().filter(other).cloned());
    }
    cases
}

/// Numbers of frames after which pictures are judged: 1, 2, 5, 10, 20, 50, ... up to `last`.
fn checkpoints(last: u32) -> Vec<u32> {
    let steps = (0..9).flat_map(|d| [1, 2, 5].map(|s| s * 10_u32.saturating_pow(d)));
    let mut counts: Vec<u32> = steps.filter(|n| *n < last).collect();
    counts.push(last);
    counts
}

/// Frame numbers whose pictures a still run keeps: the judged ones and those before them, for flicker.
pub(super) fn kept_frames(last: u32) -> Vec<u32> {
    checkpoints(last)
        .into_iter()
        .flat_map(|n| [n.saturating_sub(2), n - 1])
        .collect()
}

fn curves(
    lab: &mut Lab,
    case: &Case,
    reference: &Picture,
    blocks: &mut Vec<Block>,
) -> (Vec<Curve>, Option<Judged>) {
    let frames = lab.settings.still_frames;
    // Long runs are for the method itself, where an independent picture can tell how far it gets.
    let settled = lab
        .settings
        .settled_frames
        .filter(|_| case.picture.is_some());
    let mut curves = Vec::new();
    let mut add = |lab: &mut Lab, label: String, jobs: Vec<(Job, Vec<u32>)>| {
        let mut points = Vec::new();
        for (job, counts) in jobs {
            let judged = judge_run(lab, &job, &counts, reference);
            let what = format!("{}, {label}", case.name);
            points.extend(or_missing(blocks, &what, judged).into_iter().flatten());
        }
        curves.push(Curve { label, points });
    };
    for method in SPARSE {
        let Ok(job) = lab.still_job(case, method, frames) else {
            continue;
        };
        let mut jobs = vec![(job.clone(), checkpoints(frames))];
        if let Some(n) = settled.filter(|_| method == Method::EdgeAndPoint) {
            jobs.push((
                Job {
                    frames: n,
                    write: Write::Last,
                    ..job
                },
                vec![n],
            ));
        }
        add(lab, method.name().to_owned(), jobs);
    }
    let spps = lab
        .settings
        .spp_steps
        .iter()
        .map(|spp| Method::Reference(*spp));
    let single = |lab: &Lab, method| {
        let job = lab.still_job(case, method, 1).ok()?;
        Some((
            Job {
                write: Write::Last,
                ..job
            },
            vec![1],
        ))
    };
    let full = single(lab, Method::Full).into_iter().collect();
    let steps = spps.filter_map(|m| single(lab, m)).collect();
    add(lab, "full".to_owned(), full);
    add(lab, "reference".to_owned(), steps);
    let floor = single(lab, Method::EdgeAndPoint).and_then(|(job, counts)| {
        let job = Job {
            samples_per_frame: budget(job.size_px, 10_000),
            ..job
        };
        let judged = judge_run(lab, &job, &counts, reference);
        or_missing(blocks, &format!("{}, floor", case.name), judged)?.pop()
    });
    (curves, floor)
}

fn judge_run(
    lab: &mut Lab,
    job: &Job,
    counts: &[u32],
    reference: &Picture,
) -> Result<Vec<Judged>, MeasureError> {
    let run = lab.run(job, &kept_frames(job.frames))?;
    counts
        .iter()
        .map(|n| judge(&run, job, *n, reference))
        .collect()
}

fn judge(run: &Run, job: &Job, frames: u32, reference: &Picture) -> Result<Judged, MeasureError> {
    let picture = run.picture(frames - 1)?;
    let (scores, _) = metrics::score(&picture, reference)?;
    let before = frames
        .checked_sub(2)
        .and_then(|frame| run.picture(frame).ok());
    let flicker = before
        .map(|before| temporal::flicker([&before, &picture], [reference, reference]))
        .transpose()?;
    let pixels = f64::from(job.size_px[0]) * f64::from(job.size_px[1]);
    let share_percent = match job.method {
        Method::Full => 100.0,
        Method::Reference(spp) => 100.0 * f64::from(spp),
        _ => 100.0 * run.samples(frames - 1) as f64 / pixels,
    };
    Ok(Judged {
        frames,
        share_percent,
        time_ms: run.elapsed_ms(frames - 1),
        scores,
        flicker,
    })
}

fn table(case: &Case, curves: &[Curve], floor: Option<&Judged>) -> Table {
    let caption = format!("Error of a still camera, {}.", case.name);
    let mut table = Table::new(&format!("still-{}", case.name), &caption, &COLUMNS);
    let points = curves
        .iter()
        .flat_map(|c| c.points.iter().map(|p| (c.label.as_str(), p)));
    for (label, p) in points.chain(floor.map(|p| ("every pixel sampled once", p))) {
        let s = &p.scores;
        table.row([
            label.to_owned(),
            p.frames.to_string(),
            format!("{:.1}", p.share_percent),
            format!("{:.1}", p.time_ms),
            format!("{:.4}", s.flip),
            cell(s.flip_edges, 4),
            format!("{:.5}", s.rmse),
            format!("{:.5}", s.rel_mse),
            format!("{:.5}", s.rel_mse_trimmed),
            format!("{:.2}", s.psnr_db),
            format!("{:.4}", s.mean_test / s.mean_reference),
            cell(p.flicker, 5),
        ]);
    }
    table
}

fn charts<'a>(
    case: &'a Case,
    curves: &'a [Curve],
    floor: Option<&'a Judged>,
) -> impl Iterator<Item = Chart> + 'a {
    let pairs = (0..AXES.len()).flat_map(|axis| (0..ERRORS.len()).map(move |error| (axis, error)));
    pairs.map(move |(axis, error)| {
        let (key, name, get) = ERRORS[error];
        let against = ["time", "samples"][axis];
        let file = format!("still-{}-{key}-{against}", case.name);
        let mut chart = Chart::new(
            &file,
            &format!("{}: {name} against {against}", case.name),
            AXES[axis],
            name,
        );
        for curve in curves.iter().filter(|c| !c.points.is_empty()) {
            let x = |p: &Judged| {
                if axis == 0 {
                    p.time_ms
                } else {
                    p.share_percent
                }
            };
            let points = curve
                .points
                .iter()
                .filter_map(|p| Some((x(p), get(&p.scores)?)));
            chart.series.push(Series::line(&curve.label, points));
        }
        if let Some(y) = floor.and_then(|p| get(&p.scores)) {
            chart
                .series
                .push(Series::floor("every pixel sampled once", y));
        }
        chart.series.extend(fixed_points(case, axis, key));
        chart
    })
}

/// Rivals on the time axis and the floor without edges on the other, in the scenes they were measured in.
fn fixed_points(case: &Case, axis: usize, error: &str) -> Option<Series> {
    if axis == 0 {
        let points: Vec<(f64, f64, String)> = RIVALS
            .iter()
            .filter_map(|rival| {
                let figure = rival.in_scene(&case.name)?;
                let y = match error {
                    "flip" => figure.flip,
                    "edges" => figure.flip_edges,
                    _ => return None,
                };
                Some((figure.frame_ms, y, rival.name.to_owned()))
            })
            .collect();
        return (!points.is_empty()).then(|| Series::named("rivals, measured apart", points));
    }
    let flip = |(share, _, chains, _, _): &(f64, f64, f64, f64, f64)| (*share, *chains);
    (case.name == "chains-reference" && error == "flip").then(|| {
        Series::line(
            "converged points, no edges, measured apart",
            WITHOUT_EDGES.iter().map(flip),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checkpoints_are_spread_and_end_at_the_last_frame() {
        assert_eq!(checkpoints(50), [1, 2, 5, 10, 20, 50]);
        assert_eq!(checkpoints(30), [1, 2, 5, 10, 20, 30]);
        assert_eq!(checkpoints(1), [1]);
        assert!(kept_frames(20).ends_with(&[18, 19]));
    }
}
