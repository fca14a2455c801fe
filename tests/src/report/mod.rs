//! The `report` command: measures on this machine and writes one page with tables, charts and pictures.
//!
//! A [`sections::Section`] asks the [`lab::Lab`] for runs of the renderer and returns [`page::Block`]s.
//! To add one, write a module beside the others in `sections/` and name it in [`sections::ALL`].

pub mod cases;
pub mod chart;
#[cfg(test)]
mod fake;
pub mod job;
pub mod lab;
mod labels;
pub mod machine;
pub mod page;
pub mod rivals;
pub mod runner;
pub mod sections;
pub mod stats;
pub mod table;

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::Parser;
use thiserror::Error;

use lab::{Lab, Settings};
use page::{Block, Part};
use runner::{Render, RunError};
use sections::Section;

/// Time that --quick gives to all runs, leaving the rest of its two minutes for scoring and start-up. Each section has its
/// share, and passes on what it leaves.
const QUICK_TIME: Duration = Duration::from_secs(100);
/// Time that the whole report gives to a section: none should need it, and nothing is left out on a slow machine.
const SECTION_TIME: Duration = Duration::from_secs(24 * 3600);

/// Measures speed and error on this machine; writes report.html and CSV files.
#[derive(Debug, Parser)]
#[command(name = "report", version)]
pub struct Args {
    /// At most two minutes: smaller pictures, fewer settings.
    #[arg(long)]
    pub quick: bool,
    /// Folder for report.html and the CSV files.
    #[arg(long, default_value = "report", value_name = "DIR")]
    pub out: PathBuf,
    /// Only these sections (may be repeated).
    #[arg(long, value_name = "SECTION", value_parser = sections::names())]
    pub only: Vec<String>,
    /// Embree 4's shared library, to race rays against.
    #[arg(long, value_name = "FILE")]
    pub embree: Option<PathBuf>,
}

/// Folders that the report looks into.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Places {
    /// The repository, for the commit.
    pub checkout: PathBuf,
    /// Scenes with pictures by an independent renderer, where there are any.
    pub shared: Option<PathBuf>,
}

/// Why there is no report.
#[derive(Debug, Error)]
pub enum ReportError {
    /// The renderer is missing or cannot be started at all.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A file of the report cannot be written.
    #[error("cannot write {path}: {source}; choose another folder with --out")]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// What a finished report holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Summary {
    /// The page.
    pub page: PathBuf,
    /// Why something could not be measured, and how often.
    pub missing: BTreeMap<String, usize>,
    /// Whether there was any other reason than the time allowed.
    pub failed: bool,
}

/// Measures and writes everything asked for. What cannot be measured is named on the page and in the summary.
///
/// # Errors
/// [`ReportError`] when a file cannot be written.
pub fn run(args: &Args, renderer: &dyn Render, places: &Places) -> Result<Summary, ReportError> {
    let settings = if args.quick {
        Settings::quick()
    } else {
        Settings::full()
    };
    measure(args, settings, renderer, places)
}

fn measure(
    args: &Args,
    settings: Settings,
    renderer: &dyn Render,
    places: &Places,
) -> Result<Summary, ReportError> {
    let in_folder = |source| ReportError::Write {
        path: args.out.clone(),
        source,
    };
    fs::create_dir_all(&args.out).map_err(in_folder)?;
    let work = tempfile::tempdir().map_err(in_folder)?;
    let cases = cases::find(places, work.path(), args.quick).map_err(in_folder)?;
    let mut lab = Lab::new(
        renderer,
        settings,
        cases,
        work.path().to_owned(),
        &places.checkout,
    );
    lab.embree.clone_from(&args.embree);
    lab.shadow_cases = cases::with_shadows(places, work.path(), args.quick).map_err(in_folder)?;
    lab.paper_cases = cases::of_the_paper(places, work.path(), args.quick).map_err(in_folder)?;
    let wanted = |s: &&Section| args.only.is_empty() || args.only.iter().any(|name| name == s.name);
    let chosen: Vec<&Section> = sections::ALL.iter().filter(wanted).collect();
    let end = args.quick.then(|| Instant::now() + QUICK_TIME);
    let mut parts = Vec::new();
    for (i, section) in chosen.iter().enumerate() {
        let left: u32 = chosen[i..].iter().map(|s| s.share).sum();
        lab.allow(match end {
            Some(end) => {
                end.saturating_duration_since(Instant::now()) * section.share / left.max(1)
            }
            None => SECTION_TIME,
        });
        lab.say(&format!(
            "section {} of {}: {}",
            i + 1,
            chosen.len(),
            section.name
        ));
        parts.push(Part {
            title: section.title.to_owned(),
            blocks: (section.measure)(&mut lab),
        });
        // Written after every section, so that nothing is lost if the next one never ends.
        write_files(&args.out, &parts)?;
    }
    lab.say("done");
    Ok(Summary::of(args.out.join("report.html"), &parts))
}

impl Summary {
    fn of(page: PathBuf, parts: &[Part]) -> Self {
        let mut missing = BTreeMap::new();
        for block in parts.iter().flat_map(|p| &p.blocks) {
            if let Block::Missing { reason, .. } = block {
                *missing.entry(reason.clone()).or_default() += 1;
            }
        }
        let out_of_time = RunError::OutOfTime.to_string();
        let failed = missing.keys().any(|reason| *reason != out_of_time);
        Self {
            page,
            missing,
            failed,
        }
    }
}

fn write_files(out: &std::path::Path, parts: &[Part]) -> Result<(), ReportError> {
    let write = |name: String, text: String| {
        let path = out.join(name);
        fs::write(&path, text).map_err(|source| ReportError::Write { path, source })
    };
    for (stem, csv) in page::csv_files(parts) {
        write(format!("{stem}.csv"), csv)?;
    }
    write(
        "report.html".to_owned(),
        page::to_html("Edge-and-point rendering: speed and error", parts),
    )
}

#[cfg(test)]
mod tests {
    use super::fake::Fake;
    use super::runner::Method;
    use super::*;

    fn report(fake: &Fake, only: &[&str]) -> (tempfile::TempDir, Summary, String) {
        report_with(fake, only, &Settings::quick())
    }

    fn report_with(
        fake: &Fake,
        only: &[&str],
        settings: &Settings,
    ) -> (tempfile::TempDir, Summary, String) {
        let folder = tempfile::tempdir().unwrap();
        let only = only.iter().map(|s| (*s).to_owned()).collect();
        let args = Args {
            quick: true,
            out: folder.path().join("out"),
            only,
            embree: None,
        };
        let settings = Settings {
            size_px: [64, 64],
            indirect_size_px: [64, 64],
            path_size_px: [64, 64],
            shadows: lab::ShadowSettings {
                size_px: [64, 64],
                ..settings.shadows
            },
            ..settings.clone()
        };
        let places = Places {
            checkout: folder.path().to_owned(),
            shared: None,
        };
        let summary = measure(&args, settings, fake, &places).unwrap();
        let page = fs::read_to_string(&summary.page).unwrap();
        (folder, summary, page)
    }

    #[test]
    fn every_section_gives_its_tables_charts_and_pictures() {
        let fake = Fake::default();
        let (folder, summary, page) = report(&fake, &[]);
        assert!(
            summary.missing.is_empty() && !summary.failed,
            "{:?}",
            summary.missing
        );
        for section in &sections::ALL {
            assert!(
                page.contains(&page::escape(section.title)),
                "{}",
                section.name
            );
        }
        for file in [
            "machine",
            "still-chains",
            "still-rooms-flip-time",
            "path-chains-relmse",
            "stages-rooms-one-core",
            "counts",
            "rivals",
            "shadows",
            "shadows-chains-points",
            "shadow-width-10",
            "step-link",
            "step-link-time",
            "paper-times",
            "paper-counts",
            "rays",
        ] {
            assert!(
                folder.path().join(format!("out/{file}.csv")).is_file(),
                "{file}"
            );
        }
        assert!(
            page.matches("<svg").count() >= 2 * (6 + 3),
            "charts are missing"
        );
        assert!(
            page.matches("data:image/png").count() >= 2 * 3,
            "pictures are missing"
        );
        let counts = fs::read_to_string(folder.path().join("out/counts.csv")).unwrap();
        assert!(counts.contains("321"), "{counts}");
    }

    #[test]
    fn shadow_edges_and_steps_are_judged_against_none() {
        let (folder, ..) = report(&Fake::default(), &["shadows", "moves"]);
        let read = |name: &str| fs::read_to_string(folder.path().join("out").join(name)).unwrap();
        let csv = read("shadows-torus.csv");
        let change = |mode: &str| -> f64 {
            let start = format!("{mode},10,");
            let line = csv.lines().find(|l| l.starts_with(&start)).unwrap();
            line.split(',').nth(3).unwrap().parse().unwrap()
        };
        assert_eq!(change("off"), 0.0);
        assert!(change("all") > 10.0 && change("chosen") < -10.0, "{csv}");
        let csv = read("step-link.csv");
        assert!(csv.lines().any(|l| l.starts_with("points-only,")), "{csv}");
    }

    #[test]
    fn no_run_is_made_twice() {
        let fake = Fake::default();
        report(&fake, &[]);
        let jobs = fake.jobs.borrow();
        for (i, job) in jobs.iter().enumerate() {
            assert!(!jobs[..i].contains(job), "{job:?}");
        }
    }

    #[test]
    fn a_failing_method_is_named_and_the_others_are_kept() {
        let fake = Fake {
            fails: Some(Method::NoComplex),
            ..Fake::default()
        };
        let (folder, summary, page) = report(&fake, &["still"]);
        assert!(
            summary.failed && summary.missing.len() == 1,
            "{:?}",
            summary.missing
        );
        let (reason, count) = summary.missing.first_key_value().unwrap();
        assert!(
            reason.contains("no such method") && *count == 2,
            "once for each scene"
        );
        assert!(page.contains("points-only") && page.contains("not measured"));
        let csv = fs::read_to_string(folder.path().join("out/still-chains.csv")).unwrap();
        assert!(csv.contains("edge-and-point,10,"), "{csv}");
    }

    #[test]
    fn scenes_of_the_paper_are_judged_where_there_is_time() {
        let settings = Settings {
            still_of_the_paper: true,
            ..Settings::quick()
        };
        let (folder, ..) = report_with(&Fake::default(), &["still"], &settings);
        for file in ["torus-flip-time", "torus-edges-samples", "chains-flip-time"] {
            let path = folder.path().join(format!("out/still-{file}.csv"));
            assert!(path.is_file(), "{file}");
        }
    }

    #[test]
    fn the_still_error_falls_in_the_table() {
        let (folder, ..) = report(&Fake::default(), &["still"]);
        let csv = fs::read_to_string(folder.path().join("out/still-chains.csv")).unwrap();
        let flip: Vec<f64> = csv
            .lines()
            .filter(|l| l.starts_with("points-only,"))
            .map(|l| l.split(',').nth(4).unwrap().parse().unwrap())
            .collect();
        assert!(
            flip.len() == 4 && flip.is_sorted_by(|a, b| a > b),
            "{flip:?}"
        );
    }
}
