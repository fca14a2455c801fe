//! Time of every stage of a frame, on one core and on all, at three sizes.

use std::rc::Rc;

use super::{Lab, Section};
use crate::report::cases::Case;
use crate::report::lab::{WARM_UP, budget, or_missing};
use crate::report::page::Block;
use crate::report::runner::{Job, Method, Run, RunError, Shadows, Write};
use crate::report::stats::{FrameStats, STAGES, median, percentile};
use crate::report::table::Table;

pub(super) const SECTION: Section = Section {
    name: "stages",
    title: "Time of a frame, stage by stage",
    share: 35,
    measure,
};

/// One run a size: its width and height, and what it gave.
pub(super) type Timed = Vec<([u32; 2], Result<Rc<Run>, RunError>)>;

/// The frames that count: those after warm-up.
pub(super) fn counted(run: &Run) -> &[FrameStats] {
    run.frames.get(WARM_UP..).unwrap_or_default()
}

/// Runs of the case's path with 2 % of the pixels sampled a frame, at the first `sizes` of the sizes timed.
pub(super) fn timed_runs(lab: &mut Lab, case: &Case, threads: u32, sizes: usize) -> Timed {
    let timed = lab.settings.timed;
    let sizes = &timed[..sizes.min(timed.len())];
    let run = |(size_px, frames): &([u32; 2], u32)| {
        let job = Job {
            scene: case.scene.clone(),
            method: Method::EdgeAndPoint,
            size_px: *size_px,
            frames: *frames,
            path: case.path.clone(),
            fps: 30,
            samples_per_frame: budget(*size_px, 200),
            write: Write::None,
            threads: Some(threads),
            seed: 0,
            shadows: Shadows::Chosen,
            visibility: None,
        };
        (*size_px, lab.run(&job, &[]))
    };
    sizes.iter().map(run).collect()
}

fn measure(lab: &mut Lab) -> Vec<Block> {
    let ghz = lab.machine.clock.as_ref().map(|c| c.ghz);
    let clock = lab.machine.clock.as_ref().map_or_else(String::new, |c| {
        format!(
            " Cycles are time multiplied by {:.2} GHz ({}).",
            c.ghz, c.derivation
        )
    });
    let mut blocks = vec![Block::Text(format!(
        "Medians and 95th percentiles over frames of a path after {WARM_UP} frames of warm-up, 2 % of the pixels sampled a frame, \
         lockstep. Waiting for samples is no stage and not in the total.{clock}"
    ))];
    let cases = lab.cases.clone();
    for (i, case) in cases.iter().enumerate() {
        lab.allow_part(cases.len() - i);
        let on_all = lab.settings.timed_on_all_cores;
        let cores = lab.machine.cores as u32;
        for (threads, name, sizes) in [(1, "one core", usize::MAX), (cores, "all cores", on_all)] {
            if threads == 1 && name == "all cores" {
                continue;
            }
            let runs = timed_runs(lab, case, threads, sizes);
            let mut measured = Vec::new();
            for (size, run) in runs {
                let what = format!("{}, {name}, {}x{}", case.name, size[0], size[1]);
                measured.extend(or_missing(&mut blocks, &what, run).map(|run| (size, run)));
            }
            if !measured.is_empty() {
                let cycles = ghz.filter(|_| threads == 1);
                blocks.push(Block::Table(table(case, name, &measured, cycles)));
            }
        }
    }
    blocks
}

fn table(case: &Case, threads: &str, runs: &[([u32; 2], Rc<Run>)], ghz: Option<f64>) -> Table {
    let mut columns = vec!["stage".to_owned()];
    for ([width, height], run) in runs {
        let frames = counted(run).len();
        columns.push(format!("{width}x{height}, {frames} frames, median ms"));
        columns.push("95 % ms".to_owned());
        columns.extend(ghz.map(|_| "cycles a pixel".to_owned()));
    }
    let file = format!("stages-{}-{}", case.name, threads.replace(' ', "-"));
    let mut table = Table::new(&file, &format!("{} on {threads}.", case.name), &[]);
    table.columns = columns;
    let stages = STAGES.map(|stage| (stage, Some(stage)));
    for (label, stage) in stages.into_iter().chain([("total", None)]) {
        let time = |f: &FrameStats| match stage {
            Some(stage) => f.stage_ms.get(stage).copied().unwrap_or(0.0),
            None => f.total_ms,
        };
        let cells = runs.iter().flat_map(|(size, run)| {
            let middle = median(counted(run).iter().map(time));
            let pixels = f64::from(size[0]) * f64::from(size[1]);
            let cycles = ghz.map(|ghz| format!("{:.1}", middle * ghz * 1e6 / pixels));
            let high = percentile(counted(run).iter().map(time), 0.95);
            [format!("{middle:.3}"), format!("{high:.3}")]
                .into_iter()
                .chain(cycles)
        });
        table.row([label.to_owned()].into_iter().chain(cells));
    }
    let waits = runs.iter().flat_map(|(_, run)| {
        let wait = |f: &FrameStats| f.wait_ms;
        let cells = [0.5, 0.95]
            .map(|share| format!("{:.3}", percentile(counted(run).iter().map(wait), share)));
        cells.into_iter().chain(ghz.map(|_| String::new()))
    });
    table.row(
        ["(waiting for samples)".to_owned()]
            .into_iter()
            .chain(waits),
    );
    table
}
