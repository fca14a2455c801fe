//! Rays against Embree's.

use super::{Lab, Section, cell};
use crate::ray_speed::embree::Embree;
use crate::ray_speed::sets::Subject;
use crate::ray_speed::{Line, measure as race};
use crate::report::cases::Case;
use crate::report::lab::or_missing;
use crate::report::page::Block;
use crate::report::table::Table;

pub(super) const SECTION: Section = Section {
    name: "rays",
    title: "Rays a second",
    share: 3,
    measure,
};

/// Scenes of few, of many and of very many triangles; a quick report has the last one alone.
const RACED: [&str; 5] = ["chains", "rooms", "dragon", "dragon-reference", "torus"];

/// How often each way is timed.
const ROUNDS: usize = 5;

const CAPTION: &str = "Millions of rays a second on one thread: medians of runs in turns, all triangles in one tree unless \
    two levels are named. Ratios are to Embree's default single rays, which are not watertight; robust ones are. Packets are \
    of eight rays.";

const COLUMNS: [&str; 16] = [
    "scene",
    "triangles",
    "build, ms",
    "rays",
    "hit, %",
    "ours",
    "ratio",
    "ours, two levels",
    "ours, packets",
    "ratio",
    "ours, packets, two levels",
    "Embree",
    "Embree robust",
    "Embree packets",
    "rays",
    "other answer than Embree robust",
];

const PUBLISHED: &str = "Embree's library was not given (--embree FILE), so that there is nothing to compare with in this run. \
    Measured elsewhere on two cores of a server, one thread: from the eye 9-11 Mrays/s (74,000 triangles) and 9-10 (871,000), \
    shuffled bounces 6.5-7 and 2.5-3.8, shadow rays 13-14.5 and 7.4-7.9.";

fn measure(lab: &mut Lab) -> Vec<Block> {
    let mut blocks = Vec::new();
    let embree = lab.embree.clone();
    let loaded = embree.as_deref().map(Embree::load).transpose();
    let embree = or_missing(&mut blocks, "Embree", loaded).flatten();
    if embree.is_none() {
        blocks.push(Block::Text(PUBLISHED.to_owned()));
    }
    let mut table = Table::new("rays", CAPTION, &COLUMNS);
    let raced = |case: &&Case| RACED.contains(&case.name.as_str());
    let cases: Vec<Case> = lab.paper_cases.iter().filter(raced).cloned().collect();
    for case in cases {
        lab.say(&format!("{} rays", case.scene.display()));
        let scene = scenes::open(&case.scene.to_string_lossy());
        let Some(scene) = or_missing(&mut blocks, &case.name, scene) else {
            continue;
        };
        let subject = Subject::new(&scene, lab.settings.size_px[0]);
        let lines = race(&subject, embree.as_ref(), ROUNDS);
        for line in or_missing(&mut blocks, &case.name, lines).unwrap_or_default() {
            table.row(cells(&case.name, &subject, &line));
        }
    }
    if !table.rows.is_empty() {
        blocks.push(Block::Table(table));
    }
    blocks
}

fn cells(name: &str, subject: &Subject, line: &Line) -> Vec<String> {
    let embree = line.embree.as_ref();
    let ratio = |rate: f64| cell(embree.map(|e| rate / e.single), 2);
    let packets = |i: usize| line.packets.map(|p| p[i]);
    vec![
        name.to_owned(),
        subject.flat.faces.len().to_string(),
        format!("{:.0}", subject.build_s * 1e3),
        line.name.to_owned(),
        format!("{:.0}", 100. * line.hit_share),
        format!("{:.2}", line.ours),
        ratio(line.ours),
        format!("{:.2}", line.two_levels),
        cell(packets(0), 2),
        packets(0).map_or_else(String::new, ratio),
        cell(packets(1), 2),
        cell(embree.map(|e| e.single), 2),
        cell(embree.map(|e| e.robust), 2),
        cell(embree.and_then(|e| e.packets), 2),
        line.rays.to_string(),
        embree.map_or_else(String::new, |e| e.differing.to_string()),
    ]
}
