//! What a frame holds: edges, pixel classes, samples.

use super::stages::{counted, timed_runs};
use super::{Lab, Section};
use crate::report::lab::or_missing;
use crate::report::page::Block;
use crate::report::stats::{FrameStats, median};
use crate::report::table::Table;

pub(super) const SECTION: Section = Section {
    name: "counts",
    title: "What a frame holds",
    share: 5,
    measure,
};

const COLUMNS: [&str; 12] = [
    "scene",
    "size",
    "silhouette edges",
    "shadow edges",
    "empty %",
    "simple %",
    "complex %",
    "new samples",
    "visible samples, % of pixels",
    "points",
    "triples",
    "servers",
];

fn measure(lab: &mut Lab) -> Vec<Block> {
    let mut blocks = Vec::new();
    let caption = "Medians over the frames of the stage timings on one core.";
    let mut table = Table::new("counts", caption, &COLUMNS);
    for case in lab.cases.clone() {
        for (size, run) in timed_runs(lab, &case, 1, usize::MAX) {
            let what = format!("{}, {}x{}", case.name, size[0], size[1]);
            let Some(run) = or_missing(&mut blocks, &what, run) else {
                continue;
            };
            let pixels = f64::from(size[0]) * f64::from(size[1]);
            let middle =
                |get: fn(&FrameStats) -> u64| median(counted(&run).iter().map(|f| get(f) as f64));
            let count = |get| format!("{:.0}", middle(get));
            let percent = |get| format!("{:.2}", 100.0 * middle(get) / pixels);
            table.row([
                case.name.clone(),
                format!("{}x{}", size[0], size[1]),
                count(|f| f.silhouette_edges),
                count(|f| f.shadow_edges),
                percent(|f| f.pixels.empty),
                percent(|f| f.pixels.simple),
                percent(|f| f.pixels.complex),
                count(|f| f.samples_new),
                percent(|f| f.samples_visible),
                count(|f| f.points),
                count(|f| f.triples),
                count(|f| f.servers),
            ]);
        }
    }
    if !table.rows.is_empty() {
        blocks.push(Block::Table(table));
    }
    blocks
}
