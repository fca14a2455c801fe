//! The `compare` command: scores of one picture, or of a folder of frames, against a reference.

mod crop;
mod frames;

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Parser;
use serde::Serialize;
use thiserror::Error;

use crate::metrics::{self, Scores};
use crate::picture::{Picture, PictureError, save_srgb8};
pub use crop::{Crop, render_crop};
pub use frames::{FramePair, FrameRange, pair_frames};

/// Compares pictures (EXR linear, PNG sRGB) or folders of frames with a reference.
#[derive(Debug, Parser)]
#[command(name = "compare", version)]
pub struct Args {
    /// The picture or the folder of frames to judge.
    pub test: PathBuf,
    /// The reference: a picture, or a folder of frames with the same numbers.
    pub reference: PathBuf,
    /// Print JSON: one object, or an array of frames and their mean.
    #[arg(long)]
    pub json: bool,
    /// Write the FLIP map in the magma palette (pictures only).
    #[arg(long, value_name = "OUT.png")]
    pub map: Option<PathBuf>,
    /// Write test, reference and FLIP map side by side, a part of them enlarged (pictures only; may be repeated).
    #[arg(long, num_args = 2, value_names = ["X,Y,W,H,SCALE", "OUT.png"])]
    pub crop: Vec<String>,
    /// Frames whose mean is taken, A..B (without B) or A..=B; all by default.
    #[arg(long, value_name = "A..B")]
    pub frames: Option<FrameRange>,
}

/// Why a comparison cannot be made.
#[derive(Debug, Error)]
pub enum CompareError {
    /// A picture cannot be read, written or compared.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// A frame of the folder cannot be compared.
    #[error("frame {number}: {source}")]
    Frame {
        /// The frame's number, from its file name.
        number: u64,
        /// What is wrong with it.
        source: PictureError,
    },
    /// A file or folder is missing, or a folder cannot be listed.
    #[error("cannot open {path}: {source}")]
    Folder {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// No frame is in both folders and in the range.
    #[error(
        "no numbered frame (.exr or .png) is in both {test} and {reference} and in the range asked for"
    )]
    NoFrames {
        /// The folder judged.
        test: PathBuf,
        /// The reference.
        reference: PathBuf,
    },
    /// A crop's text or place is wrong.
    #[error("bad crop {text:?}: {reason}; write X,Y,W,H,SCALE in pixels, inside the picture")]
    BadCrop {
        /// What was given.
        text: String,
        /// What is wrong with it.
        reason: String,
    },
    /// An option that needs two pictures was given with folders.
    #[error("--map and --crop need two pictures; give single files instead of folders")]
    PicturesOnly,
    /// The standard output is closed or full.
    #[error("cannot write the result: {0}")]
    Output(#[from] io::Error),
}

/// One frame's line of a folder comparison.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct FrameScores {
    /// The frame's number.
    pub frame: u64,
    /// Its scores.
    #[serde(flatten)]
    pub scores: Scores,
    /// Change since the previous listed frame that the reference does not have (sRGB values).
    pub flicker: Option<f64>,
}

/// A folder comparison: every frame in the range, and the mean over them.
#[derive(Debug, Clone, Serialize)]
pub struct SequenceScores {
    /// In ascending frame order.
    pub frames: Vec<FrameScores>,
    /// Means over the frames; PSNR is the mean of the frames' values.
    pub mean: MeanScores,
}

/// Means of the frames' scores.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct MeanScores {
    /// Mean FLIP.
    pub flip: f64,
    /// Mean FLIP near edges, over the frames that have edges.
    pub flip_edges: Option<f64>,
    /// Mean RMSE.
    pub rmse: f64,
    /// Mean relMSE.
    pub rel_mse: f64,
    /// Mean trimmed relMSE.
    pub rel_mse_trimmed: f64,
    /// Mean PSNR in dB over the frames where it is finite.
    pub psnr_db: Option<f64>,
    /// Mean flicker; none for fewer than two frames.
    pub flicker: Option<f64>,
}

/// Runs the command and writes its result to `out`.
///
/// # Errors
/// [`CompareError`] names the file, frame or option that is wrong.
pub fn run(args: &Args, out: &mut impl Write) -> Result<(), CompareError> {
    if args.test.is_dir() || args.reference.is_dir() {
        if args.map.is_some() || !args.crop.is_empty() {
            return Err(CompareError::PicturesOnly);
        }
        let scores = compare_frames(&args.test, &args.reference, args.frames)?;
        return print_sequence(&scores, args.json, out);
    }
    let (test, reference) = (Picture::open(&args.test)?, Picture::open(&args.reference)?);
    let (scores, map) = metrics::score(&test, &reference)?;
    let magma = map.to_magma();
    if let Some(path) = &args.map {
        save_srgb8(&magma, path)?;
    }
    for pair in args.crop.chunks_exact(2) {
        let panels = [test.to_srgb8(), reference.to_srgb8(), magma.clone()];
        save_srgb8(
            &render_crop(&panels, Crop::parse(&pair[0])?)?,
            Path::new(&pair[1]),
        )?;
    }
    if args.json {
        writeln!(out, "{}", to_json(&scores)?)?;
    } else {
        print_picture(&scores, out)?;
    }
    Ok(())
}

/// Scores every frame that is in both folders and in `range`; `reference` may be one picture for all.
///
/// # Errors
/// [`CompareError`] when a folder cannot be listed, nothing matches, or a frame cannot be read.
pub fn compare_frames(
    test: &Path,
    reference: &Path,
    range: Option<FrameRange>,
) -> Result<SequenceScores, CompareError> {
    let mut frames = Vec::new();
    let mut previous: Option<[Picture; 2]> = None;
    for pair in pair_frames(test, reference, range)? {
        let at = |source| CompareError::Frame {
            number: pair.number,
            source,
        };
        let test = Picture::open(&pair.test).map_err(at)?;
        let reference = Picture::open(&pair.reference).map_err(at)?;
        let (scores, _) = metrics::score(&test, &reference).map_err(at)?;
        let flicker = previous
            .as_ref()
            .map(|[t, r]| metrics::temporal::flicker([t, &test], [r, &reference]))
            .transpose()
            .map_err(at)?;
        frames.push(FrameScores {
            frame: pair.number,
            scores,
            flicker,
        });
        previous = Some([test, reference]);
    }
    Ok(SequenceScores {
        mean: MeanScores::of(&frames),
        frames,
    })
}

impl MeanScores {
    fn of(frames: &[FrameScores]) -> Self {
        let all = |get: fn(&FrameScores) -> Option<f64>| {
            let values: Vec<f64> = frames
                .iter()
                .filter_map(get)
                .filter(|v| v.is_finite())
                .collect();
            (!values.is_empty()).then(|| metrics::linear::mean(&values))
        };
        Self {
            flip: all(|f| Some(f.scores.flip)).unwrap_or(0.0),
            flip_edges: all(|f| f.scores.flip_edges),
            rmse: all(|f| Some(f.scores.rmse)).unwrap_or(0.0),
            rel_mse: all(|f| Some(f.scores.rel_mse)).unwrap_or(0.0),
            rel_mse_trimmed: all(|f| Some(f.scores.rel_mse_trimmed)).unwrap_or(0.0),
            psnr_db: all(|f| Some(f.scores.psnr_db)),
            flicker: all(|f| f.flicker),
        }
    }
}

fn to_json<T: Serialize>(value: &T) -> Result<String, io::Error> {
    serde_json::to_string(value).map_err(io::Error::from)
}

fn or_dash(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |v| format!("{v:.5}"))
}

fn print_picture(scores: &Scores, out: &mut impl Write) -> Result<(), CompareError> {
    writeln!(out, "FLIP             {:.5}", scores.flip)?;
    writeln!(out, "FLIP near edges  {}", or_dash(scores.flip_edges))?;
    writeln!(out, "RMSE             {:.6}", scores.rmse)?;
    writeln!(out, "relMSE           {:.6}", scores.rel_mse)?;
    writeln!(out, "relMSE trimmed   {:.6}", scores.rel_mse_trimmed)?;
    writeln!(out, "PSNR             {:.2} dB", scores.psnr_db)?;
    let ratio = scores.mean_test / scores.mean_reference;
    let (test, reference) = (scores.mean_test, scores.mean_reference);
    writeln!(
        out,
        "mean             {test:.6} against {reference:.6} (ratio {ratio:.5})"
    )?;
    if scores.non_finite_pixels > 0 {
        writeln!(
            out,
            "warning: {} pixels are not finite; scored as black",
            scores.non_finite_pixels
        )?;
    }
    Ok(())
}

fn print_sequence(
    sequence: &SequenceScores,
    json: bool,
    out: &mut impl Write,
) -> Result<(), CompareError> {
    if json {
        writeln!(out, "{}", to_json(sequence)?)?;
        return Ok(());
    }
    writeln!(
        out,
        "frame   FLIP     edges    RMSE      relMSE    trimmed   PSNR    flicker   mean      ref mean"
    )?;
    for FrameScores {
        frame,
        scores: s,
        flicker,
    } in &sequence.frames
    {
        let (edges, flicker) = (or_dash(s.flip_edges), or_dash(*flicker));
        writeln!(
            out,
            "{frame:<7} {:.5}  {edges:<8} {:.6}  {:.6}  {:.6}  {:<7.2} {flicker:<8}  {:.6}  {:.6}",
            s.flip, s.rmse, s.rel_mse, s.rel_mse_trimmed, s.psnr_db, s.mean_test, s.mean_reference
        )?;
    }
    let m = &sequence.mean;
    let psnr = m
        .psnr_db
        .map_or_else(|| "inf".to_owned(), |v| format!("{v:.2}"));
    writeln!(
        out,
        "mean    {:.5}  {:<8} {:.6}  {:.6}  {:.6}  {psnr:<7} {:<8}",
        m.flip,
        or_dash(m.flip_edges),
        m.rmse,
        m.rel_mse,
        m.rel_mse_trimmed,
        or_dash(m.flicker)
    )?;
    Ok(())
}
