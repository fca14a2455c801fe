//! Ways to find how much of a light is seen: error against time, and what each does to the pictures.

use std::collections::BTreeMap;
use std::sync::Arc;

use protocol::messages::ShadowMethod;
use shader_server::Stage;
use shader_server::shadows::survey::{Survey, Surveyed};

use super::{Lab, Section, cell};
use crate::metrics::{self, Scores};
use crate::picture::Picture;
use crate::report::cases::Case;
use crate::report::chart::{Chart, Series};
use crate::report::lab::{MeasureError, or_missing};
use crate::report::page::Block;
use crate::report::runner::{Job, Method, Write};
use crate::report::table::Table;

pub(super) const SECTION: Section = Section {
    name: "visibility",
    title: "Ways to find how much of a light is seen",
    share: 12,
    measure,
};

/// Built-in scenes: the figures of the 2000 paper, the scenes of the 2003 paper and those of the 2005 paper.
const SCENES: [&str; 12] = [
    "soft2", "soft6", "soft8", "soft9", "rooms", "chains", "mack", "head", "dragon", "grids",
    "flowers", "court",
];
/// Scenes of a quick report.
const FEW: [&str; 3] = ["soft2", "chains", "grids"];

/// Errors asked for.
const ERRORS: [f64; 4] = [0.05, 0.02, 0.01, 0.005];

/// Frames of a forced method, and how it is named on the command line.
const FRAMES: u32 = 10;
const FORCED: [&str; 4] = ["auto", "rays", "penumbra", "soft-map"];

const SURVEYED: &str = "Each point is a method with a setting: root mean square error over receivers in the light's penumbrae \
    against processor time a receiver, preparations shared among the 262,144 receivers of a picture. Numbered points are \
    what the automatic choice takes for an error of 5, 2, 1 and 0.5 %; it is made on other receivers than it is judged by.";

fn measure(lab: &mut Lab) -> Vec<Block> {
    let quick = !lab.settings.still_of_the_paper;
    let mut blocks = vec![Block::Text(SURVEYED.to_owned())];
    let mut picks = Table::new(
        "visibility-picks",
        "What the automatic choice takes, and its cost over that of the cheapest method that keeps the error.",
        &[
            "scene",
            "light",
            "error allowed, %",
            "method",
            "setting",
            "error, %",
            "prepared in, ms",
            "µs a receiver",
            "µs in all",
            "cheapest good enough",
            "µs in all",
            "ratio",
        ],
    );
    for name in SCENES {
        if quick && !FEW.contains(&name) {
            continue;
        }
        lab.say(&format!("{name} visibility of lights"));
        let loaded = scenes::open(name);
        let Some(loaded) = or_missing(&mut blocks, name, loaded) else {
            continue;
        };
        let stage = Stage::build(Arc::new(loaded.scene));
        let Some(stage) = or_missing(&mut blocks, name, stage) else {
            continue;
        };
        for light in 0..stage.emitters().len() {
            let survey = Survey::new(&stage, light, &ERRORS);
            if survey.rows.is_empty() {
                continue;
            }
            blocks.push(Block::Chart(chart(name, light, &survey)));
            add_picks(&mut picks, name, light, &survey);
        }
    }
    blocks.push(Block::Table(picks));
    blocks.extend(forced(lab));
    blocks
}

fn name_of(method: ShadowMethod) -> &'static str {
    match method {
        ShadowMethod::Auto => "automatic",
        ShadowMethod::Rays => "shadow rays",
        ShadowMethod::Penumbra => "penumbra casting",
        ShadowMethod::SoftMap => "soft shadow maps",
    }
}

fn microseconds(row: &Surveyed) -> f64 {
    1e6 * row.cost_s()
}

fn chart(scene: &str, light: usize, survey: &Survey) -> Chart {
    let mut chart = Chart::new(
        &format!("visibility-{scene}-{light}"),
        &format!("{scene}, light {light}: error of visibility against time"),
        "µs a receiver, preparations included",
        "RMS error in penumbrae",
    );
    let mut by_method: BTreeMap<&str, Vec<(f64, f64)>> = BTreeMap::new();
    for row in &survey.rows {
        let name = match row.method {
            ShadowMethod::Rays if row.setting.contains("drawn") => "shadow rays, few faces drawn",
            method => name_of(method),
        };
        let points = by_method.entry(name).or_default();
        points.push((microseconds(row), row.error));
    }
    for (name, points) in by_method {
        chart.series.push(Series::line(name, points));
    }
    let picked = survey.picks.iter().map(|pick| {
        let name = format!(
            "{} % allowed: {}, {}",
            100. * pick.allowed,
            name_of(pick.taken.method),
            pick.taken.setting
        );
        (microseconds(&pick.taken), pick.taken.error, name)
    });
    chart.series.push(Series::named("automatic", picked));
    chart
}

fn add_picks(table: &mut Table, scene: &str, light: usize, survey: &Survey) {
    for pick in &survey.picks {
        let best = survey.cheapest(pick.allowed);
        let taken = &pick.taken;
        table.row([
            scene.to_owned(),
            light.to_string(),
            format!("{}", 100. * pick.allowed),
            name_of(taken.method).to_owned(),
            taken.setting.clone(),
            format!("{:.2}", 100. * taken.error),
            format!("{:.1}", 1e3 * taken.prepare_s),
            format!("{:.2}", 1e6 * taken.receiver_s),
            format!("{:.2}", microseconds(taken)),
            best.map_or_else(
                || "none".to_owned(),
                |row| format!("{}, {}", name_of(row.method), row.setting),
            ),
            cell(best.map(microseconds), 2),
            cell(best.map(|row| taken.cost_s() / row.cost_s()), 2),
        ]);
    }
}

/// The scenes of the 2003 paper with every method forced on all lights.
fn forced(lab: &mut Lab) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut table = Table::new(
        "visibility-forced",
        "Every light's visibility by one method: a still camera, 2 % of the pixels a frame, in lockstep, ten frames. Samples a \
         second are those of the servers after the first frame, which also waits for indirect light and for preparations.",
        &[
            "scene",
            "method",
            "samples a second",
            "over rays",
            "first frame waits, ms",
            "FLIP",
            "FLIP near edges",
        ],
    );
    let cases = lab.paper_cases.clone();
    for (i, case) in cases.iter().enumerate() {
        lab.allow_part(cases.len() - i);
        let reference = lab.still_reference(case);
        let Some(reference) = or_missing(&mut blocks, &case.name, reference) else {
            continue;
        };
        let mut by_rays = None;
        let mut rows = Vec::new();
        for method in FORCED {
            let what = format!("{}, {method}", case.name);
            let measured = run(lab, case, method, &reference);
            let Some((rate, first_ms, scores)) = or_missing(&mut blocks, &what, measured) else {
                continue;
            };
            if method == "rays" {
                by_rays = Some(rate);
            }
            rows.push((method, rate, first_ms, scores));
        }
        for (method, rate, first_ms, scores) in rows {
            table.row([
                case.name.clone(),
                method.to_owned(),
                format!("{rate:.0}"),
                cell(by_rays.map(|rays| rate / rays), 2),
                format!("{first_ms:.0}"),
                format!("{:.4}", scores.flip),
                cell(scores.flip_edges, 4),
            ]);
        }
    }
    blocks.push(Block::Table(table));
    blocks
}

/// Samples a second, the wait of the first frame, milliseconds, and the errors of the last.
fn run(
    lab: &mut Lab,
    case: &Case,
    visibility: &'static str,
    reference: &Picture,
) -> Result<(f64, f64, Scores), MeasureError> {
    let job = Job {
        write: Write::Last,
        visibility: Some(visibility),
        ..lab.still_job(case, Method::EdgeAndPoint, FRAMES)?
    };
    let run = lab.run(&job, &[FRAMES - 1])?;
    let (first, later) = (run.frames.first(), run.frames.get(1..).unwrap_or_default());
    let samples: u64 = later.iter().map(|frame| frame.samples_new).sum();
    let wait_ms: f64 = later.iter().map(|frame| frame.wait_ms).sum();
    let (scores, _) = metrics::score(&run.picture(FRAMES - 1)?, reference)?;
    let rate = samples as f64 / (1e-3 * wait_ms).max(1e-9);
    Ok((rate, first.map_or(0., |frame| frame.wait_ms), scores))
}
