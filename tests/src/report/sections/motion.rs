//! Error along a camera path against the share of pixels sampled a frame: the axis of the 2003 paper.

use std::rc::Rc;

use super::still::SPARSE;
use super::{Lab, Section, cell};
use crate::metrics::{self, Scores};
use crate::picture::Picture;
use crate::report::cases::Case;
use crate::report::chart::{Chart, Series};
use crate::report::lab::{MeasureError, budget, or_missing};
use crate::report::page::Block;
use crate::report::runner::{Job, Method, Run, Shadows, Write};
use crate::report::stats::median;
use crate::report::table::Table;

pub(super) const SECTION: Section = Section {
    name: "motion",
    title: "Along a path: error against samples a frame",
    share: 35,
    measure,
};

/// Frames of the path at 30 a second, the last one judged.
const FRAMES: u32 = 61;
/// One frame in so many is judged; methods that keep nothing from frame to frame render no others.
const STEP: u32 = 5;
/// Judged frames divided by [`STEP`]: frames 30 to 60, when the cache has filled.
const JUDGED: [u32; 7] = [6, 7, 8, 9, 10, 11, 12];

struct Point {
    method: Method,
    share: u32,
    flip: f64,
    flip_edges: Option<f64>,
    rel_mse: f64,
    frame_ms: f64,
    wait_ms: f64,
}

fn measure(lab: &mut Lab) -> Vec<Block> {
    let [width, height] = lab.settings.path_size_px;
    let mut blocks = vec![Block::Text(format!(
        "A path at 30 frames a second, {}x{} pixels, in lockstep; mean error of every fifth of the frames 30 to 60 against \
         the renderer's reference method at {} samples a pixel.",
        width, height, lab.settings.path_reference_spp,
    ))];
    let cases: Vec<Case> = lab
        .cases
        .iter()
        .filter(|c| c.path.is_some())
        .cloned()
        .collect();
    for (i, case) in cases.iter().enumerate() {
        lab.allow_part(cases.len() - i);
        let points = points(lab, case, &mut blocks);
        if points.is_empty() {
            continue;
        }
        blocks.push(Block::Table(table(case, &points)));
        blocks.extend(charts(case, &points).map(Block::Chart));
    }
    blocks
}

fn job(lab: &Lab, case: &Case, method: Method, share: u32) -> Job {
    let size_px = lab.settings.path_size_px;
    let remembers = SPARSE.contains(&method);
    Job {
        scene: case.scene.clone(),
        method,
        size_px,
        frames: if remembers {
            FRAMES
        } else {
            FRAMES.div_ceil(STEP)
        },
        path: case.path.clone(),
        fps: if remembers { 30 } else { 30 / STEP },
        samples_per_frame: budget(size_px, share),
        write: if remembers {
            Write::Every(STEP)
        } else {
            Write::All
        },
        threads: None,
        seed: 0,
        shadows: Shadows::Chosen,
        visibility: None,
    }
}

/// The run and the pictures of its judged frames.
fn judged_pictures(lab: &mut Lab, job: &Job) -> Result<(Rc<Run>, Vec<Picture>), MeasureError> {
    let step = if SPARSE.contains(&job.method) {
        STEP
    } else {
        1
    };
    let frames = JUDGED.map(|frame| frame * step);
    let run = lab.run(job, &frames)?;
    let pictures = frames
        .iter()
        .map(|frame| run.picture(*frame))
        .collect::<Result<_, _>>()?;
    Ok((run, pictures))
}

fn points(lab: &mut Lab, case: &Case, blocks: &mut Vec<Block>) -> Vec<Point> {
    let what = format!("{} along its path", case.name);
    let method = Method::Reference(lab.settings.path_reference_spp);
    let reference = Job {
        seed: 1,
        ..job(lab, case, method, 10_000)
    };
    let reference = judged_pictures(lab, &reference);
    let Some((_, reference)) = or_missing(blocks, &what, reference) else {
        return Vec::new();
    };
    let shares = lab.settings.path_shares;
    let sparse = shares
        .iter()
        .flat_map(|share| SPARSE.map(|method| (method, *share)));
    let mut points = Vec::new();
    for (method, share) in sparse.chain([(Method::Full, 10_000)]) {
        let point = point(lab, &job(lab, case, method, share), share, &reference);
        points.extend(or_missing(blocks, &what, point));
    }
    points
}

fn point(
    lab: &mut Lab,
    job: &Job,
    share: u32,
    reference: &[Picture],
) -> Result<Point, MeasureError> {
    let (run, pictures) = judged_pictures(lab, job)?;
    let score = |(test, reference)| metrics::score(test, reference).map(|(scores, _)| scores);
    let scores = pictures
        .iter()
        .zip(reference)
        .map(score)
        .collect::<Result<Vec<Scores>, _>>()?;
    let mean = |get: fn(&Scores) -> Option<f64>| {
        let values: Vec<f64> = scores.iter().filter_map(get).collect();
        (!values.is_empty()).then(|| metrics::linear::mean(&values))
    };
    Ok(Point {
        method: job.method,
        share,
        flip: mean(|s| Some(s.flip)).unwrap_or_default(),
        flip_edges: mean(|s| s.flip_edges),
        rel_mse: mean(|s| Some(s.rel_mse)).unwrap_or_default(),
        frame_ms: median(run.frames.iter().map(|f| f.total_ms)),
        wait_ms: median(run.frames.iter().map(|f| f.wait_ms)),
    })
}

fn table(case: &Case, points: &[Point]) -> Table {
    let columns = [
        "method",
        "samples, % of pixels a frame",
        "FLIP",
        "FLIP near edges",
        "relMSE",
        "frame ms",
        "waiting ms",
    ];
    let caption = format!(
        "Error along the path of {}, and medians of the frame's and the waiting time.",
        case.name
    );
    let mut table = Table::new(&format!("path-{}", case.name), &caption, &columns);
    for p in points {
        table.row([
            p.method.name().to_owned(),
            format!("{}", f64::from(p.share) / 100.0),
            format!("{:.4}", p.flip),
            cell(p.flip_edges, 4),
            format!("{:.5}", p.rel_mse),
            format!("{:.2}", p.frame_ms),
            format!("{:.1}", p.wait_ms),
        ]);
    }
    table
}

fn charts<'a>(case: &'a Case, points: &'a [Point]) -> impl Iterator<Item = Chart> + 'a {
    type Get = fn(&Point) -> Option<f64>;
    let errors: [(&str, &str, Get); 3] = [
        ("flip", "FLIP", |p| Some(p.flip)),
        ("edges", "FLIP near edges", |p| p.flip_edges),
        ("relmse", "relMSE", |p| Some(p.rel_mse)),
    ];
    errors.into_iter().map(move |(key, name, get)| {
        let title = format!("{} along its path: {name}", case.name);
        let file = format!("path-{}-{key}", case.name);
        let mut chart = Chart::new(&file, &title, "samples a frame, % of pixels", name);
        for method in SPARSE {
            let of_method = points.iter().filter(|p| p.method == method);
            let line = of_method.filter_map(|p| Some((f64::from(p.share) / 100.0, get(p)?)));
            chart.series.push(Series::line(method.name(), line));
        }
        let full = points
            .iter()
            .find(|p| p.method == Method::Full)
            .and_then(get);
        chart
            .series
            .extend(full.map(|y| Series::floor("full, every pixel shaded each frame", y)));
        chart
    })
}
