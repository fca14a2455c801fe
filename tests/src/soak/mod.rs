//! A long session of a display with two servers that are killed and started again in turns: is anything lost, does memory
//! grow, do frames take longer?
//!
//! The display is in this process, the servers are processes of their own. What is asked for is counted where it is asked,
//! and in the end every request must be answered, or given up by one of the link's rules, which count what they give up.

mod drive;
mod measure;
mod plot;
mod servers;

use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context;
use clap::Parser;
use serde::Serialize;

use crate::report::stats::{median, percentile};
use drive::{Drive, Driven};
use measure::slope_kib_a_minute;

/// What to do.
#[derive(Clone, Debug, Parser)]
#[command(
    name = "soak",
    about = "A long session with servers that are killed and started again in turns"
)]
pub struct Args {
    /// Minutes of the run with kills
    #[arg(long, default_value_t = 10.0, value_name = "N")]
    pub minutes: f64,
    /// As long a run without kills before, to compare frame times with
    #[arg(long)]
    pub quiet: bool,
    /// Seconds from one kill to the next
    #[arg(long, default_value_t = 10.0, value_name = "SECONDS")]
    pub kill_every: f64,
    /// Frames a second
    #[arg(long, default_value_t = 20.0, value_name = "N")]
    pub pace: f64,
    /// Charts of memory in use and frame times
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
    /// The shader server's program
    #[arg(long, value_name = "PATH")]
    pub shader_server: Option<PathBuf>,
    /// A built-in scene's name or a file
    #[arg(long, default_value = "torus", value_name = "SCENE")]
    pub scene: String,
}

/// Time left out at the start of a run before memory is looked at: buffers grow to what is needed; at most.
const WARM_UP: Duration = Duration::from_secs(120);

/// A run, as one line of JSON.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    /// Whether servers were killed.
    pub kills: usize,
    /// Frames drawn.
    pub frames: usize,
    /// Edits made.
    pub edits: usize,
    /// Requests that the link took.
    pub asked: u64,
    /// Samples that came, those of older epochs among them.
    pub samples: u64,
    /// Requests given up by rule: no room, or their view forgotten.
    pub dropped: u64,
    /// Requests neither answered nor given up in the end. Should be 0.
    pub lost: i64,
    /// Longest time from a server's restart until samples came from it again, milliseconds.
    pub slowest_return_ms: f64,
    /// Longest time between samples, milliseconds.
    pub longest_gap_ms: f64,
    /// Half of the frames took less, milliseconds.
    pub median_ms: f64,
    /// 99 % of the frames took less, milliseconds.
    pub p99_ms: f64,
    /// Growth of the display's resident memory after the start, KiB a minute.
    pub display_slope: f64,
    /// The display's resident memory at the end, KiB.
    pub display_kib: u64,
    /// Most that a server had resident, KiB.
    pub server_kib: u64,
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The run without kills, if there was one.
    pub quiet: Option<Outcome>,
    /// The run with kills.
    pub soak: Outcome,
    /// Their 99th percentiles' ratio.
    pub p99_ratio: Option<f64>,
}

/// Runs it and prints the report as one line.
///
/// # Errors
/// If the scene or the servers cannot be had, or the plot not be written.
pub fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<Report> {
    let drive = Drive::new(args)?;
    let quiet = if args.quiet {
        Some(drive.run(None)?)
    } else {
        None
    };
    let soak = drive.run(Some(Duration::from_secs_f64(args.kill_every)))?;
    if let Some(file) = &args.plot {
        let svg = plot::svg(quiet.as_ref(), &soak)?;
        std::fs::write(file, svg).with_context(|| format!("cannot write {}", file.display()))?;
    }
    let quiet = quiet.map(|driven| outcome(&driven));
    let soak = outcome(&soak);
    let report = Report {
        p99_ratio: quiet.as_ref().map(|quiet| soak.p99_ms / quiet.p99_ms),
        quiet,
        soak,
    };
    print(&report, out)?;
    Ok(report)
}

fn print(report: &Report, out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "{}", serde_json::to_string(report)?)
}

fn outcome(driven: &Driven) -> Outcome {
    let times: Vec<f64> = driven.frames.iter().map(|(_, ms)| *ms).collect();
    let end = driven.memory.last().map_or(Duration::ZERO, |m| m.at);
    let display = driven.memory.iter().map(|m| (m.at, m.display));
    Outcome {
        kills: driven.kills.len(),
        frames: times.len(),
        edits: driven.edits,
        asked: driven.asked,
        samples: driven.status.samples,
        dropped: driven.status.dropped,
        lost: driven.lost(),
        slowest_return_ms: driven.slowest_return.as_secs_f64() * 1e3,
        longest_gap_ms: driven.longest_gap.as_secs_f64() * 1e3,
        median_ms: median(times.iter().copied()),
        p99_ms: percentile(times.iter().copied(), 0.99),
        display_slope: slope_kib_a_minute(display, WARM_UP.min(end / 5)),
        display_kib: driven.memory.last().map_or(0, |m| m.display),
        server_kib: driven
            .memory
            .iter()
            .flat_map(|m| m.servers)
            .max()
            .unwrap_or(0),
    }
}
