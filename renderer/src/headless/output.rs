//! Frames and statistics as files.

use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

use crate::cli::Write;
use crate::epi::grid::Grid;
use crate::stats::FrameStats;

/// Why a file could not be written.
#[derive(Debug, thiserror::Error)]
#[error(
    "cannot write `{path}`: {reason}; check that the folder can be written to and the disk has room"
)]
pub struct OutputError {
    path: PathBuf,
    reason: String,
}

impl OutputError {
    pub(crate) fn new(path: &Path, reason: &impl ToString) -> Self {
        Self {
            path: path.to_owned(),
            reason: reason.to_string(),
        }
    }
}

/// Which files are wanted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Files<'a> {
    /// Folder of the frames.
    pub(crate) out: &'a Path,
    /// Which frames become files.
    pub(crate) write: Write,
    /// Whether linear radiance does, too.
    pub(crate) exr: bool,
    /// How many frames there will be.
    pub(crate) frames: usize,
    /// File for statistics.
    pub(crate) stats: Option<&'a Path>,
}

/// Where frames go.
#[derive(Debug)]
pub(crate) struct Output {
    dir: PathBuf,
    write: Write,
    exr: bool,
    frames: usize,
    stats: Option<(PathBuf, BufWriter<File>)>,
    last_file: Option<PathBuf>,
}

impl Output {
    /// Makes the folder and opens the statistics file.
    ///
    /// # Errors
    /// If either cannot be made.
    pub(crate) fn new(files: &Files<'_>) -> Result<Self, OutputError> {
        std::fs::create_dir_all(files.out).map_err(|e| OutputError::new(files.out, &e))?;
        let stats = files.stats.map(|path| {
            let file = File::create(path).map_err(|e| OutputError::new(path, &e))?;
            Ok((path.to_owned(), BufWriter::new(file)))
        });
        Ok(Self {
            dir: files.out.to_owned(),
            write: files.write,
            exr: files.exr,
            frames: files.frames,
            stats: stats.transpose()?,
            last_file: None,
        })
    }

    /// Writes a frame, if it is one that is wanted: `rgb` is linear radiance by `grid`, `shown` what a display shows,
    /// 0x00RRGGBB, row by row.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub(crate) fn frame(
        &mut self,
        frame: usize,
        grid: Grid,
        rgb: &[Vec<f32>; 3],
        shown: &[u32],
    ) -> Result<(), OutputError> {
        if !self.write.wants(frame, self.frames) {
            return Ok(());
        }
        let name = |extension: &str| self.dir.join(format!("frame-{frame:04}.{extension}"));
        let path = name("png");
        write_png(&path, grid.width as u32, grid.height as u32, shown)?;
        if self.exr {
            write_exr(&name("exr"), grid, rgb)?;
        }
        self.last_file = Some(path);
        Ok(())
    }

    /// Writes a line of statistics, if a file for them was named.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(crate) fn stats(&mut self, stats: &FrameStats) -> Result<(), OutputError> {
        let Some((path, file)) = &mut self.stats else {
            return Ok(());
        };
        let line = serde_json::to_string(stats).map_err(|e| OutputError::new(path, &e))?;
        // Each line goes out whole, so that whoever follows the file sees frames as they come.
        writeln!(file, "{line}")
            .and_then(|()| file.flush())
            .map_err(|e| OutputError::new(path, &e))
    }

    /// The last picture written.
    pub(super) fn last_file(&self) -> Option<PathBuf> {
        self.last_file.clone()
    }
}

/// Writes what a display shows (0x00RRGGBB, row by row) as PNG.
///
/// # Errors
/// If it cannot be written.
pub fn write_png(path: &Path, width: u32, height: u32, shown: &[u32]) -> Result<(), OutputError> {
    let bytes = shown
        .iter()
        .flat_map(|p| [(p >> 16) as u8, (p >> 8) as u8, *p as u8])
        .collect();
    image::RgbImage::from_raw(width, height, bytes)
        .ok_or_else(|| OutputError::new(path, &"the picture has no pixels"))?
        .save(path)
        .map_err(|e| OutputError::new(path, &e))
}

/// Writes linear radiance (planes by `grid`) as OpenEXR.
///
/// # Errors
/// If it cannot be written.
pub fn write_exr(path: &Path, grid: Grid, rgb: &[Vec<f32>; 3]) -> Result<(), OutputError> {
    let pixels = (0..grid.height).flat_map(|y| (0..grid.width).map(move |x| grid.at(x, y)));
    let data: Vec<f32> = pixels
        .flat_map(|at| [rgb[0][at], rgb[1][at], rgb[2][at]])
        .collect();
    image::Rgb32FImage::from_raw(grid.width as u32, grid.height as u32, data)
        .ok_or_else(|| OutputError::new(path, &"the picture has no pixels"))?
        .save(path)
        .map_err(|e| OutputError::new(path, &e))
}
