//! The `shadow-speed` command: Table 2 of "Hierarchical Penumbra Casting" (2005), against this project's rays at their fastest.

pub mod subject;

use std::io::{self, Write};
use std::time::Instant;

use clap::Parser;
use penumbra::{Caster, Costs, LightError, PaperOrder, Receivers, Route, Seen, Wanted};
use scenes::SceneError;

use subject::{Subject, some_of};

/// Times casting against shadow rays on the three scenes of the 2005 paper, on one thread.
#[derive(Clone, Debug, Parser)]
#[command(name = "shadow-speed", version)]
pub struct Args {
    /// Scenes to measure: of grids, flowers and court those named, all if none is.
    pub scenes: Vec<String>,
    /// A quarter of the width and height.
    #[arg(long)]
    pub quick: bool,
    /// Leave out casting in the paper's own order, which takes longest.
    #[arg(long)]
    pub no_paper: bool,
    /// Rays are traced from at most about so many receivers, and their time taken in proportion.
    #[arg(long, default_value_t = 60_000)]
    pub traced: usize,
    /// Only the rows with these numbers, from 0 to 4.
    #[arg(long, value_delimiter = ',')]
    pub rows: Vec<usize>,
}

/// Why nothing was measured.
#[derive(Debug, thiserror::Error)]
pub enum SpeedError {
    /// A scene cannot be used.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A scene has no area light to cast from.
    #[error("{0}: the first light is not an area light")]
    NoAreaLight(String),
    /// The light cannot be sampled.
    #[error(transparent)]
    Light(#[from] LightError),
    /// No thread could be made.
    #[error("cannot start a thread: {0}")]
    Thread(#[from] rayon::ThreadPoolBuildError),
    /// The standard output is closed or full.
    #[error("cannot write the result: {0}")]
    Output(#[from] io::Error),
}

/// The paper's order: its own columns. Seconds and bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaperColumns {
    /// Coarse sorting of the polygons.
    pub sort_s: f64,
    /// Building hierarchies.
    pub build_s: f64,
    /// Casting.
    pub cast_s: f64,
    /// Receiver points.
    pub points_bytes: usize,
    /// The largest hierarchy.
    pub hierarchy_bytes: usize,
    /// Masks in use at once.
    pub masks_bytes: usize,
}

impl PaperColumns {
    /// Sorting, building and casting.
    pub fn total_s(&self) -> f64 {
        self.sort_s + self.build_s + self.cast_s
    }
}

/// A row of the table. Times are seconds of one thread for all receivers.
#[derive(Clone, Debug)]
pub struct Row {
    /// The scene.
    pub scene: String,
    /// Its triangles.
    pub triangles: usize,
    /// Polygons that are cast after merging, without those turned away.
    pub polygons: usize,
    /// Width and height, pixels.
    pub size_px: [u32; 2],
    /// Light samples.
    pub samples: u32,
    /// How many times as large the light's area is.
    pub light_area: u32,
    /// Visible points.
    pub receivers: usize,
    /// The paper's own order, if it was asked for.
    pub paper: Option<PaperColumns>,
    /// Leaf by leaf.
    pub leaf_s: f64,
    /// Each tile by whichever is cheaper, measuring of the costs not included.
    pub tiles_s: f64,
    /// Share of the tiles' samples that rays were sent to.
    pub tiles_traced: f64,
    /// Shadow rays, in the faster way.
    pub rays_s: f64,
    /// Of the samples that were both cast and traced, the share that differs.
    pub differing: f64,
    /// What the costs were.
    pub costs: Costs,
}

impl Row {
    /// How many times as long rays take as casting in the paper's order.
    pub fn paper_ratio(&self) -> Option<f64> {
        Some(self.rays_s / self.paper?.total_s())
    }

    /// How many times as long rays take as casting leaf by leaf.
    pub fn leaf_ratio(&self) -> f64 {
        self.rays_s / self.leaf_s
    }

    /// Speed of choosing by tile relative to the better of the two.
    pub fn tiles_share(&self) -> f64 {
        self.rays_s.min(self.leaf_s) / self.tiles_s
    }
}

/// The paper's five settings: size, samples, sides of the light.
const SETTINGS: [([u32; 2], u32, u32); 5] = [
    ([640, 480], 256, 1),
    ([1280, 960], 256, 1),
    ([2560, 1920], 256, 1),
    ([1280, 960], 1024, 1),
    ([1280, 960], 256, 2),
];

/// The paper's three scenes.
const SCENES: [&str; 3] = ["grids", "flowers", "court"];

/// Measures rows and gives each to `take` as soon as it is there.
///
/// # Errors
/// [`SpeedError`], also from `take`.
pub fn rows(
    args: &Args,
    mut take: impl FnMut(&Row) -> Result<(), SpeedError>,
) -> Result<(), SpeedError> {
    let all = SCENES.map(str::to_owned).to_vec();
    let names = if args.scenes.is_empty() {
        &all
    } else {
        &args.scenes
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    for name in names {
        let subject = Subject::new(name, scenes::open(name)?)
            .ok_or_else(|| SpeedError::NoAreaLight(name.clone()))?;
        for (i, setting) in SETTINGS.into_iter().enumerate() {
            if args.rows.is_empty() || args.rows.contains(&i) {
                let (size, samples, scale) = setting;
                let size = if args.quick {
                    size.map(|x| x / 4)
                } else {
                    size
                };
                let row = pool.install(|| row(args, &subject, (size, samples, scale)))?;
                take(&row)?;
            }
        }
    }
    Ok(())
}

fn timed<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let start = Instant::now();
    let result = work();
    (start.elapsed().as_secs_f64(), result)
}

fn row(
    args: &Args,
    subject: &Subject,
    (size_px, samples, scale): ([u32; 2], u32, u32),
) -> Result<Row, SpeedError> {
    let caster = subject.caster(samples, f64::from(scale))?;
    let receivers = subject.receivers(size_px, caster.light());
    let costs = Costs::measured(&caster, &subject.world, &receivers);
    let cast = |receivers: &Receivers, route: Route<'_>, masks: bool| {
        let mut seen = Seen::default();
        let wanted = Wanted {
            masks,
            ..Wanted::default()
        };
        let (seconds, ()) = timed(|| caster.cast(receivers, route, wanted, &mut seen));
        (seconds, seen)
    };
    let some = some_of(&receivers, args.traced);
    let part = receivers.len() as f64 / some.len().max(1) as f64;
    let (rays_s, traced) = cast(&some, Route::Rays(&subject.world, costs), true);
    let (_, same) = cast(&some, Route::Cast, true);
    let differing: u64 = traced
        .masks
        .iter()
        .zip(&same.masks)
        .map(|(a, b)| u64::from((a ^ b).count_ones()))
        .sum();
    let (leaf_s, _) = cast(&receivers, Route::Cast, false);
    let (tiles_s, tiles) = cast(&receivers, Route::Cheaper(&subject.world, costs), false);
    let every = |receivers: &Receivers| (receivers.len() * samples as usize).max(1) as f64;
    Ok(Row {
        scene: subject.name.clone(),
        triangles: subject.triangles,
        polygons: caster.blockers(),
        size_px,
        samples,
        light_area: scale * scale,
        receivers: receivers.len(),
        paper: (!args.no_paper).then(|| in_papers_order(&caster, &receivers)),
        leaf_s,
        tiles_s,
        tiles_traced: tiles.counts.rays as f64 / every(&receivers),
        rays_s: rays_s * part,
        differing: differing as f64 / every(&some),
        costs,
    })
}

fn in_papers_order(caster: &Caster, receivers: &Receivers) -> PaperColumns {
    let seen = caster.cast_in_papers_order(receivers, &PaperOrder::ALL);
    PaperColumns {
        sort_s: seen.sort_s,
        build_s: seen.build_s,
        cast_s: seen.cast_s,
        points_bytes: seen.points_bytes,
        hierarchy_bytes: seen.hierarchy_bytes,
        masks_bytes: seen.masks_bytes,
    }
}

/// Measures and writes a table.
///
/// # Errors
/// [`SpeedError`].
pub fn run(args: &Args, out: &mut impl Write) -> Result<(), SpeedError> {
    writeln!(
        out,
        "scene    size       samples light | sort  build   cast  MB points hierarchy masks   total | rays s   ratio | leaf s   ratio | tiles s traced  of better | differ"
    )?;
    rows(args, |row| {
        let [width, height] = row.size_px;
        write!(
            out,
            "{:8} {:>4}x{:<4} {:>6} {:>5}x |",
            row.scene, width, height, row.samples, row.light_area
        )?;
        match (&row.paper, row.paper_ratio()) {
            (Some(paper), Some(ratio)) => {
                let mb = |bytes: usize| bytes as f64 / f64::from(1 << 20);
                write!(
                    out,
                    " {:.2} {:6.2} {:7.2} {:6.0} {:6.0} {:6.0} {:9.2} | {:7.2} {:6.2} |",
                    paper.sort_s,
                    paper.build_s,
                    paper.cast_s,
                    mb(paper.points_bytes),
                    mb(paper.hierarchy_bytes),
                    mb(paper.masks_bytes),
                    paper.total_s(),
                    row.rays_s,
                    ratio
                )?;
            }
            _ => write!(out, " {:7.2} |", row.rays_s)?,
        }
        writeln!(
            out,
            " {:7.2} {:6.2} | {:7.2} {:4.0} % {:6.2} | {:.1e}",
            row.leaf_s,
            row.leaf_ratio(),
            row.tiles_s,
            100. * row.tiles_traced,
            row.tiles_share(),
            row.differing
        )?;
        Ok(out.flush()?)
    })
}
