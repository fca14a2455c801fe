//! Table 2 of the 2005 paper.

use super::{Lab, Section, cell};
use crate::report::lab::or_missing;
use crate::report::page::Block;
use crate::report::table::Table;
use crate::shadow_speed::{self, Row};

pub(super) const SECTION: Section = Section {
    name: "casting",
    title: "Penumbra casting beside shadow rays, as in Table 2 of the 2005 paper",
    share: 4,
    measure,
};

const CAPTION: &str = "Seconds and megabytes on one thread. Rays are the fastest of this project, single or eight together, traced \
    from a part of the receivers and taken in proportion. Tiles take casting or rays, whichever they find cheaper. The paper's \
    order has columns of its own.";

const COLUMNS: [&str; 19] = [
    "scene",
    "triangles",
    "polygons cast",
    "picture, px",
    "samples",
    "light area",
    "receivers",
    "sort",
    "build",
    "cast",
    "points, MB",
    "hierarchy, MB",
    "masks, MB",
    "paper's order",
    "leaf by leaf",
    "tiles choose",
    "rays",
    "rays over the paper's order, leaf by leaf, and tiles",
    "the paper's ratio",
];

/// "Performance ratio" of Table 2 for GRIDS, FLOWERS and Sponza, in the place of which the court stands: at 640x480, 1280x960
/// and 2560x1920 with 256 samples, and at 1280x960 with 1024 samples and with four times the light.
const PAPER_RATIOS: [(&str, [f64; 5]); 3] = [
    ("grids", [9.0, 13.5, 16.7, 26.1, 5.0]),
    ("flowers", [1.4, 3.5, 7.8, 4.2, 2.1]),
    ("court", [4.5, 8.2, 11.4, 11.6, 2.0]),
];

fn paper_ratio(row: &Row) -> Option<f64> {
    let place = match (row.size_px[0], row.samples, row.light_area) {
        (640, 256, 1) => 0,
        (1280, 256, 1) => 1,
        (2560, 256, 1) => 2,
        (1280, 1024, 1) => 3,
        (1280, 256, 4) => 4,
        _ => return None,
    };
    let scene = PAPER_RATIOS.iter().find(|(scene, _)| *scene == row.scene);
    scene.map(|(_, ratios)| ratios[place])
}

fn measure(lab: &mut Lab) -> Vec<Block> {
    let quick = !lab.settings.still_of_the_paper;
    let mut table = Table::new("casting", CAPTION, &COLUMNS);
    let args = if quick {
        shadow_speed::Args {
            scenes: vec!["grids".to_owned()],
            quick,
            no_paper: true,
            traced: 2_000,
            rows: vec![0],
        }
    } else {
        shadow_speed::Args {
            scenes: Vec::new(),
            quick,
            no_paper: false,
            traced: 20_000,
            rows: Vec::new(),
        }
    };
    let mut blocks = Vec::new();
    lab.say("penumbra casting beside shadow rays");
    let measured = shadow_speed::rows(&args, |row| {
        table.row(cells(row));
        Ok(())
    });
    or_missing(&mut blocks, "penumbra casting", measured);
    blocks.push(Block::Table(table));
    blocks
}

fn cells(row: &Row) -> Vec<String> {
    let paper = row.paper.as_ref();
    let megabytes = |bytes: Option<usize>| cell(bytes.map(|b| b as f64 * 1e-6), 1);
    let ratios = [
        cell(row.paper_ratio(), 2),
        format!("{:.2}", row.leaf_ratio()),
        format!("{:.2}", row.rays_s / row.tiles_s),
    ];
    vec![
        row.scene.clone(),
        row.triangles.to_string(),
        row.polygons.to_string(),
        format!("{}x{}", row.size_px[0], row.size_px[1]),
        row.samples.to_string(),
        row.light_area.to_string(),
        row.receivers.to_string(),
        cell(paper.map(|p| p.sort_s), 2),
        cell(paper.map(|p| p.build_s), 2),
        cell(paper.map(|p| p.cast_s), 2),
        megabytes(paper.map(|p| p.points_bytes)),
        megabytes(paper.map(|p| p.hierarchy_bytes)),
        megabytes(paper.map(|p| p.masks_bytes)),
        cell(paper.map(shadow_speed::PaperColumns::total_s), 2),
        format!("{:.2}", row.leaf_s),
        format!("{:.2}", row.tiles_s),
        format!("{:.2}", row.rays_s),
        ratios.join(" / "),
        cell(paper_ratio(row), 1),
    ]
}
