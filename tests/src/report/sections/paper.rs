//! Tables 2 and 3 of the 2003 paper beside what is measured here.

use std::path::Path;
use std::rc::Rc;

use super::stages::counted;
use super::{Lab, Section};
use crate::report::lab::{WARM_UP, budget, or_missing};
use crate::report::page::Block;
use crate::report::runner::{Job, Method, Run, RunError, Shadows, Write};
use crate::report::stats::{FrameStats, median};
use crate::report::table::Table;

pub(super) const SECTION: Section = Section {
    name: "paper",
    title: "Beside the tables of the 2003 paper",
    share: 5,
    measure,
};

/// The paper's size of pictures.
const SIZE_PX: [u32; 2] = [512, 512];
/// Table 2: scene; edge finding, edge rasterisation, point processing, reachability, interpolation, anti-aliasing, complex
/// filter and all, ms; sparseness; full ray tracing, s; speed-up.
const TABLE_2: [[&str; 12]; 5] = [
    [
        "Rooms, paper",
        "0.5",
        "17",
        "26",
        "11",
        "14",
        "2",
        "17",
        "95",
        "97",
        "4.8",
        "51",
    ],
    [
        "Chains, paper",
        "4",
        "13",
        "26",
        "11",
        "14",
        "2",
        "6",
        "88",
        "52",
        "2.0",
        "23",
    ],
    [
        "Mack, paper",
        "2.5",
        "11",
        "26",
        "11",
        "14",
        "2",
        "6",
        "77",
        "92",
        "4.5",
        "58",
    ],
    [
        "David, paper",
        "9",
        "39",
        "27",
        "11",
        "14",
        "2",
        "16",
        "127",
        "65",
        "5.1",
        "40",
    ],
    [
        "Dragon, paper",
        "22",
        "29",
        "26",
        "11",
        "14",
        "2",
        "6",
        "124",
        "40",
        "2.3",
        "19",
    ],
];

/// Tables 1 and 3: scene, polygons, edges, silhouette edges, shadow edges, pixels of each class in percent.
const TABLE_3: [[&str; 8]; 5] = [
    [
        "Rooms, paper",
        "15006",
        "23004",
        "1814",
        "7356",
        "87.0",
        "8.9",
        "4.1",
    ],
    [
        "Chains, paper",
        "73728",
        "110592",
        "3644",
        "14138",
        "92.0",
        "6.9",
        "1.1",
    ],
    [
        "Mack, paper",
        "101306",
        "153526",
        "3669",
        "27917",
        "89.1",
        "9.7",
        "1.2",
    ],
    [
        "David, paper",
        "250014",
        "374635",
        "39116",
        "163338",
        "92.5",
        "3.5",
        "4.0",
    ],
    [
        "Dragon, paper",
        "872184",
        "1305164",
        "26269",
        "92884",
        "92.9",
        "5.9",
        "1.2",
    ],
];

const TABLE_2_COLUMNS: [&str; 14] = [
    "scene",
    "find edges",
    "rasterize edges",
    "point processing",
    "reach",
    "interpolate",
    "anti-alias",
    "complex filter",
    "total ms",
    "pixels / new samples",
    "full ray tracing s",
    "speed-up",
    "find edges, slowest frame",
    "frames a second",
];
const TABLE_3_COLUMNS: [&str; 9] = [
    "scene",
    "polygons",
    "edges",
    "silhouette edges",
    "shadow edges",
    "empty %",
    "simple %",
    "complex %",
    "triples",
];

fn measure(lab: &mut Lab) -> Vec<Block> {
    let mut blocks = vec![Block::Text(format!(
        "Bala, Walter and Greenberg 2003, Tables 1 to 3, 512x512 pixels: one 2.8 GHz Pentium 4 displayed and one shaded. Here: \
         medians over frames of a path after {WARM_UP} frames of warm-up, the display on one thread, the shader on all; point \
         processing is reprojection and depth; full ray tracing is one sample a pixel without reconstruction, and the speed-up is its time over that of \
         a frame with its waiting for samples. Finding edges \
         includes taking in finished shadow edges, which are made beside the frames; its slowest frame counts warm-up. \"All\" \
         draws every shadow edge, as the paper does. The paper's torus has 30,000 polygons and no row in its tables; \
         \"head\" stands in for its David, \"dragon\" for its dragon where the scanned one is not found; rooms and mack have indirect light, \
         head glossy reflection."
    ))];
    let mut times = Table::new(
        "paper-times",
        "Table 2: times of a typical frame, ms.",
        &TABLE_2_COLUMNS,
    );
    let mut counts = Table::new(
        "paper-counts",
        "Tables 1 and 3: edges and pixels.",
        &TABLE_3_COLUMNS,
    );
    TABLE_2.iter().for_each(|row| times.row(*row));
    TABLE_3.iter().for_each(|row| counts.row(*row));
    let shown = lab.paper_cases.clone();
    for (i, case) in shown.iter().enumerate() {
        lab.allow_part(shown.len() - i);
        let path = case.path.as_deref();
        let full = full_run(lab, &case.scene, path);
        let full = or_missing(&mut blocks, &format!("{}, every pixel", case.name), full);
        let size = scenes::load(&case.scene).map(|l| (l.report.triangles, l.report.edges));
        let size = or_missing(&mut blocks, &case.name, size);
        for shadows in [Shadows::Chosen, Shadows::All] {
            let name = format!("{}, {}", case.name, shadows.name());
            let run = sparse_run(lab, &case.scene, path, shadows);
            let Some(run) = or_missing(&mut blocks, &name, run) else {
                continue;
            };
            times.row(times_row(&name, &run, full.as_deref()));
            counts.row(counts_row(&name, size, &run));
        }
    }
    blocks.extend([times, counts].map(Block::Table));
    blocks
}

fn sparse_run(
    lab: &mut Lab,
    scene: &Path,
    path: Option<&str>,
    shadows: Shadows,
) -> Result<Rc<Run>, RunError> {
    let frames = lab.settings.timed.first().map_or(13, |(_, frames)| *frames);
    let job = Job {
        scene: scene.to_owned(),
        method: Method::EdgeAndPoint,
        size_px: SIZE_PX,
        frames,
        path: path.map(str::to_owned),
        fps: 30,
        samples_per_frame: budget(SIZE_PX, 200),
        write: Write::None,
        threads: Some(1),
        seed: 0,
        shadows,
        visibility: None,
    };
    lab.run(&job, &[])
}

fn full_run(lab: &mut Lab, scene: &Path, path: Option<&str>) -> Result<Rc<Run>, RunError> {
    let job = Job {
        scene: scene.to_owned(),
        method: Method::Full,
        size_px: SIZE_PX,
        frames: 2,
        path: path.map(str::to_owned),
        fps: 30,
        samples_per_frame: budget(SIZE_PX, 10_000),
        write: Write::None,
        threads: Some(1),
        seed: 0,
        shadows: Shadows::Chosen,
        visibility: None,
    };
    lab.run(&job, &[])
}

fn times_row(name: &str, run: &Run, full: Option<&Run>) -> Vec<String> {
    let middle = |get: &dyn Fn(&FrameStats) -> f64| median(counted(run).iter().map(get));
    let stage = |f: &FrameStats, names: &[&str]| -> f64 {
        names.iter().filter_map(|name| f.stage_ms.get(*name)).sum()
    };
    let stages: [&[&str]; 7] = [
        &["find_edges"],
        &["rasterize"],
        &["reproject", "depth"],
        &["reach"],
        &["interpolate"],
        &["antialias"],
        &["complex"],
    ];
    let mut row = vec![name.to_owned()];
    row.extend(stages.map(|names| format!("{:.2}", middle(&|f| stage(f, names)))));
    let total = middle(&|f| f.total_ms);
    row.push(format!("{total:.1}"));
    let pixels = f64::from(SIZE_PX[0] * SIZE_PX[1]);
    let samples = middle(&|f| f.samples_new as f64);
    row.push(if samples > 0.0 {
        format!("{:.0}", pixels / samples)
    } else {
        String::new()
    });
    let full_ms = full.map(|run| median(run.frames.iter().map(|f| f.total_ms + f.wait_ms)));
    row.push(super::cell(full_ms.map(|ms| ms / 1e3), 2));
    let frame_ms = middle(&|f| f.total_ms + f.wait_ms);
    row.push(super::cell(
        full_ms.filter(|_| frame_ms > 0.0).map(|ms| ms / frame_ms),
        1,
    ));
    let slowest = run
        .frames
        .iter()
        .map(|f| stage(f, &["find_edges"]))
        .fold(0.0, f64::max);
    row.push(format!("{slowest:.2}"));
    row.push(if total > 0.0 {
        format!("{:.1}", 1e3 / total)
    } else {
        String::new()
    });
    row
}

fn counts_row(name: &str, size: Option<(usize, usize)>, run: &Run) -> Vec<String> {
    let middle = |get: fn(&FrameStats) -> u64| median(counted(run).iter().map(|f| get(f) as f64));
    let pixels = f64::from(SIZE_PX[0] * SIZE_PX[1]);
    let percent = |get| format!("{:.1}", 100.0 * middle(get) / pixels);
    let count = |get| format!("{:.0}", middle(get));
    let known = |n: Option<usize>| n.map_or_else(String::new, |n| n.to_string());
    vec![
        name.to_owned(),
        known(size.map(|s| s.0)),
        known(size.map(|s| s.1)),
        count(|f| f.silhouette_edges),
        count(|f| f.shadow_edges),
        percent(|f| f.pixels.empty),
        percent(|f| f.pixels.simple),
        percent(|f| f.pixels.complex),
        count(|f| f.triples),
    ]
}
