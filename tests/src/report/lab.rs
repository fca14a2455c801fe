//! Where sections get their runs: each distinct run is made once, within the time allowed.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::{Duration, Instant};

use super::cases::Case;
use super::machine::Machine;
use super::page::Block;
use super::runner::{Job, Method, Render, Run, RunError, Shadows, Write};
use crate::picture::{Picture, PictureError};

/// Frames of a timed run that are not counted: buffers grow and the cache fills.
pub const WARM_UP: usize = 3;

/// How much is measured.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Settings {
    /// Width and height of pictures that are judged, pixels; an independent reference brings its own.
    pub size_px: [u32; 2],
    /// Frames of a still camera.
    pub still_frames: u32,
    /// Width and height of such pictures in scenes with indirect light, pixels: it takes most of a run's time.
    pub indirect_size_px: [u32; 2],
    /// Whether a still camera is judged in all scenes of the 2003 paper.
    pub still_of_the_paper: bool,
    /// Frames of a still camera for the settled error; not measured without.
    pub settled_frames: Option<u32>,
    /// Samples a pixel of the renderer's own references.
    pub reference_spp: u32,
    /// Samples a pixel of the reference method as a rival.
    pub spp_steps: &'static [u32],
    /// Shares of pixels sampled a frame along a path, in hundredths of a percent.
    pub path_shares: &'static [u32],
    /// Width and height of pictures judged along a path, pixels.
    pub path_size_px: [u32; 2],
    /// Samples a pixel of references along a path.
    pub path_reference_spp: u32,
    /// Sizes at which stages are timed on one core, with the number of frames, [`WARM_UP`] included.
    pub timed: &'static [([u32; 2], u32)],
    /// How many of these sizes, from the first, are timed on all cores too.
    pub timed_on_all_cores: usize,
    /// How shadow edges and moves are judged.
    pub shadows: ShadowSettings,
}

/// How much is measured of shadow edges and of what moves.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ShadowSettings {
    /// Width and height, pixels; an independent reference brings its own.
    pub size_px: [u32; 2],
    /// Samples a pixel of the renderer's own references.
    pub reference_spp: u32,
    /// Numbers of frames after which a still picture is judged, rising.
    pub checkpoints: &'static [u32],
    /// Numbers of frames after which thresholds are judged, rising.
    pub threshold_checkpoints: &'static [u32],
    /// Thresholds of the width of penumbrae, hundredths of the mean distance between samples.
    pub widths: &'static [u32],
    /// Frames for which one state of a scene is held before or after a step; it is held for two, then three of these.
    pub move_frames: u32,
    /// Samples a pixel of references before and after a step.
    pub move_reference_spp: u32,
    /// How many of the steps are measured.
    pub moves: usize,
}

impl Settings {
    /// What two minutes allow.
    pub fn quick() -> Self {
        Self {
            size_px: [256, 256],
            still_frames: 10,
            indirect_size_px: [256, 256],
            still_of_the_paper: false,
            settled_frames: None,
            reference_spp: 8,
            spp_steps: &[2],
            path_shares: &[200],
            path_size_px: [128, 128],
            path_reference_spp: 4,
            timed: &[([512, 512], 13), ([1280, 720], 8)],
            timed_on_all_cores: 1,
            shadows: ShadowSettings {
                size_px: [128, 128],
                reference_spp: 16,
                checkpoints: &[5, 10],
                threshold_checkpoints: &[10],
                widths: &[50, 150, 400],
                move_frames: 6,
                move_reference_spp: 8,
                moves: 1,
            },
        }
    }

    /// Everything.
    pub fn full() -> Self {
        Self {
            size_px: [512, 512],
            still_frames: 50,
            indirect_size_px: [256, 256],
            still_of_the_paper: true,
            settled_frames: Some(400),
            reference_spp: 16,
            spp_steps: &[2, 8],
            path_shares: &[50, 200, 1000],
            path_size_px: [256, 256],
            path_reference_spp: 8,
            timed: &[([512, 512], 33), ([1920, 1080], 10), ([3840, 2160], 8)],
            timed_on_all_cores: 2,
            shadows: ShadowSettings {
                size_px: [256, 256],
                reference_spp: 64,
                checkpoints: &[5, 10, 25, 50, 100],
                threshold_checkpoints: &[5, 10, 25],
                widths: &[25, 50, 75, 100, 150, 200, 300, 400],
                move_frames: 20,
                move_reference_spp: 24,
                moves: usize::MAX,
            },
        }
    }
}

/// The measuring bench.
pub struct Lab<'a> {
    renderer: &'a dyn Render,
    /// How much is measured.
    pub settings: Settings,
    /// The scenes.
    pub cases: Vec<Case>,
    /// The scenes in which shadow edges must pay.
    pub shadow_cases: Vec<Case>,
    /// Those of the 2003 paper's tables.
    pub paper_cases: Vec<Case>,
    /// Embree 4's shared library, where it was given.
    pub embree: Option<PathBuf>,
    /// The machine measured on.
    pub machine: Machine,
    work: PathBuf,
    start: Instant,
    section_end: Instant,
    deadline: Instant,
    runs: HashMap<Job, Result<Rc<Run>, RunError>>,
    started: usize,
}

/// Samples a frame for a share of the pixels given in hundredths of a percent, rounded to nearest.
pub fn budget([width, height]: [u32; 2], share: u32) -> u32 {
    let pixels = u64::from(width) * u64::from(height);
    ((pixels * u64::from(share) + 5_000) / 10_000) as u32
}

impl<'a> Lab<'a> {
    /// A bench that keeps the runs' files under `work`.
    pub fn new(
        renderer: &'a dyn Render,
        settings: Settings,
        cases: Vec<Case>,
        work: PathBuf,
        checkout: &Path,
    ) -> Self {
        let start = Instant::now();
        let machine = Machine::look(checkout);
        Self {
            renderer,
            settings,
            cases,
            shadow_cases: Vec::new(),
            paper_cases: Vec::new(),
            embree: None,
            machine,
            work,
            start,
            section_end: start,
            deadline: start,
            runs: HashMap::new(),
            started: 0,
        }
    }

    /// Where sections may put scene files of their own.
    pub fn work(&self) -> &Path {
        &self.work
    }

    /// Tells whoever waits how far it is.
    pub fn say(&self, what: &str) {
        eprintln!("[{:6.1} s] {what}", self.start.elapsed().as_secs_f64());
    }

    /// Gives the runs of a section, from now on, this much time altogether.
    pub fn allow(&mut self, time: Duration) {
        self.section_end = Instant::now() + time;
        self.deadline = self.section_end;
    }

    /// Gives the runs from now on their share of the section's remaining time, when `parts` of equal weight are left.
    pub fn allow_part(&mut self, parts: usize) {
        let now = Instant::now();
        let left = self.section_end.saturating_duration_since(now);
        self.deadline = now + left / u32::try_from(parts.max(1)).unwrap_or(u32::MAX);
    }

    /// The run of `job`, made now or taken from before. Pictures of frames not in `keep` are removed, to save space.
    ///
    /// # Errors
    /// [`RunError`] when it failed or the time is over; a run cut short is tried again when asked for again.
    pub fn run(&mut self, job: &Job, keep: &[u32]) -> Result<Rc<Run>, RunError> {
        if let Some(known) = self.runs.get(job) {
            return known.clone();
        }
        if Instant::now() >= self.deadline {
            self.say(&format!("left out, no time: {}", describe(job)));
            return Err(RunError::OutOfTime);
        }
        let folder = self.work.join(format!("run-{}", self.started));
        self.started += 1;
        fs::create_dir_all(&folder)?;
        self.say(&describe(job));
        let result = self
            .renderer
            .render(job, &folder, self.deadline)
            .map(Rc::new);
        if result.is_ok() {
            remove_pictures(&folder, keep)?;
        }
        match &result {
            Err(RunError::OutOfTime) => self.say("  ended: its time is over"),
            Err(error) => self.say(&format!("  failed: {error}")),
            Ok(_) => {}
        }
        // A run cut short may be asked for again by a section that has time left.
        if !matches!(result, Err(RunError::OutOfTime)) {
            self.runs.insert(job.clone(), result.clone());
        }
        result
    }

    /// A job with a still camera at the size in which the case is judged and 2 % of its pixels a frame.
    ///
    /// # Errors
    /// [`PictureError`] when the independent picture cannot be read.
    pub fn still_job(&self, case: &Case, method: Method, frames: u32) -> Result<Job, PictureError> {
        let size_px = match &case.picture {
            Some(path) => Picture::size_px_of(path)?,
            None if case.is_indirect => self.settings.indirect_size_px,
            None => self.settings.size_px,
        };
        Ok(Job {
            scene: case.scene.clone(),
            method,
            size_px,
            frames,
            path: None,
            fps: 30,
            samples_per_frame: budget(size_px, 200),
            write: Write::All,
            threads: None,
            seed: 0,
            shadows: Shadows::Chosen,
            visibility: None,
        })
    }

    /// The picture that the still camera is judged by: the independent one, or else the renderer's own.
    ///
    /// # Errors
    /// [`MeasureError`] when it cannot be read or made.
    pub fn still_reference(&mut self, case: &Case) -> Result<Picture, MeasureError> {
        if let Some(path) = &case.picture {
            return Ok(Picture::open(path)?);
        }
        let method = Method::Reference(self.settings.reference_spp);
        let job = Job {
            seed: 1,
            write: Write::Last,
            ..self.still_job(case, method, 1)?
        };
        Ok(self.run(&job, &[0])?.picture(0)?)
    }
}

/// Why a figure is missing.
#[derive(Debug, thiserror::Error)]
pub enum MeasureError {
    /// A run gave nothing.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A picture cannot be used.
    #[error(transparent)]
    Picture(#[from] PictureError),
}

/// Passes a result on, or puts on the page what is missing and why; the same reason is given once.
pub fn or_missing<T, E: std::fmt::Display>(
    blocks: &mut Vec<Block>,
    what: &str,
    result: Result<T, E>,
) -> Option<T> {
    match result {
        Ok(value) => Some(value),
        Err(error) => {
            let block = Block::Missing {
                what: what.to_owned(),
                reason: error.to_string(),
            };
            if !blocks.contains(&block) {
                blocks.push(block);
            }
            None
        }
    }
}

fn describe(job: &Job) -> String {
    let [width, height] = job.size_px;
    let spp = if let Method::Reference(spp) = job.method {
        format!(" x{spp}")
    } else {
        String::new()
    };
    let path = job.path.as_deref().unwrap_or("still");
    let (scene, method, frames) = (job.scene.display(), job.method.name(), job.frames);
    format!(
        "{scene} {path} {method}{spp} {width}x{height}, {frames} frames, {} samples",
        job.samples_per_frame
    )
}

fn remove_pictures(folder: &Path, keep: &[u32]) -> Result<(), RunError> {
    let kept: Vec<String> = keep
        .iter()
        .map(|frame| format!("frame-{frame:04}"))
        .collect();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let stem = path
            .file_stem()
            .and_then(|s| s.to_str())
            .unwrap_or_default();
        if stem.starts_with("frame-") && !kept.iter().any(|k| k == stem) {
            fs::remove_file(path)?;
        }
    }
    Ok(())
}
