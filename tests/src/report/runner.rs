//! Running the real `renderer` binary by its stable command line (DESIGN section 7).

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::rc::Rc;
use std::thread::sleep;
use std::time::{Duration, Instant};

use thiserror::Error;

pub use super::job::{Job, Method, Shadows, Write};
use super::lab::WARM_UP;
use super::stats::{self, FrameStats, StatsError};
use crate::picture::{Picture, PictureError};

/// What a run left behind.
#[derive(Debug, Clone)]
pub struct Run {
    /// The folder with its frames.
    pub folder: PathBuf,
    /// Statistics of every frame.
    pub frames: Vec<FrameStats>,
    /// Time of the whole process, start and loading included, milliseconds.
    pub wall_ms: f64,
}

impl Run {
    /// The linear picture of a frame.
    ///
    /// # Errors
    /// [`PictureError::Read`] when the frame was not written.
    pub fn picture(&self, frame: u32) -> Result<Picture, PictureError> {
        Picture::open(&self.folder.join(format!("frame-{frame:04}.exr")))
    }

    /// Time from the first frame's start to this frame's end, waiting for samples included, milliseconds.
    pub fn elapsed_ms(&self, frame: u32) -> f64 {
        self.frames
            .iter()
            .take(frame as usize + 1)
            .map(|f| f.total_ms + f.wait_ms)
            .sum()
    }

    /// Samples that arrived up to and with this frame.
    pub fn samples(&self, frame: u32) -> u64 {
        self.frames
            .iter()
            .take(frame as usize + 1)
            .map(|f| f.samples_new)
            .sum()
    }
}

/// Why a run gave nothing.
#[derive(Debug, Clone, Error)]
pub enum RunError {
    /// The binary is not there.
    #[error("the renderer is not at {0}; build it with `cargo build --release` first")]
    NotBuilt(PathBuf),
    /// The time for this part is over.
    #[error("the time allowed is over; run without --quick for the whole report")]
    OutOfTime,
    /// The process said no.
    #[error("`renderer {args}` failed ({status}): {stderr}")]
    Failed {
        /// Its arguments.
        args: String,
        /// How it ended.
        status: String,
        /// The line of its error output that says so.
        stderr: String,
    },
    /// A file or a process of the run cannot be used.
    #[error("cannot run the renderer: {0}")]
    Io(Rc<io::Error>),
    /// Its statistics are not as agreed.
    #[error(transparent)]
    Stats(Rc<StatsError>),
}

impl From<io::Error> for RunError {
    fn from(error: io::Error) -> Self {
        Self::Io(Rc::new(error))
    }
}

/// Something that can do a [`Job`]: the real renderer, or a stand-in in tests.
pub trait Render {
    /// Does `job` into the empty folder `folder`, giving up at `deadline`.
    ///
    /// # Errors
    /// [`RunError`] says what went wrong. A run past its deadline is ended: one that writes pictures gives
    /// [`RunError::OutOfTime`], one that only takes times what it has, if that is [`FEWEST_TIMED`] frames or more.
    fn render(&self, job: &Job, folder: &Path, deadline: Instant) -> Result<Run, RunError>;
}

/// The real binary.
#[derive(Debug, Clone)]
pub struct Renderer {
    program: PathBuf,
}

impl Renderer {
    /// The binary next to this process's own executable, or one folder up (for tests and examples).
    ///
    /// # Errors
    /// [`RunError::NotBuilt`] with the place where it should be.
    pub fn locate() -> Result<Self, RunError> {
        let own = std::env::current_exe()?;
        let name = format!("renderer{}", std::env::consts::EXE_SUFFIX);
        let places: Vec<PathBuf> = own
            .ancestors()
            .skip(1)
            .take(2)
            .map(|f| f.join(&name))
            .collect();
        match places.iter().find(|p| p.is_file()) {
            Some(program) => Ok(Self {
                program: program.clone(),
            }),
            None => Err(RunError::NotBuilt(places.into_iter().next().unwrap_or(own))),
        }
    }

    /// A given binary.
    pub fn at(program: PathBuf) -> Self {
        Self { program }
    }
}

impl Render for Renderer {
    fn render(&self, job: &Job, folder: &Path, deadline: Instant) -> Result<Run, RunError> {
        let cut_short = |wall_ms| partial(job, folder, wall_ms).ok_or(RunError::OutOfTime);
        let (stats_file, log_file) = (folder.join("stats.jsonl"), folder.join("stderr.txt"));
        let args = job.args(folder, &stats_file);
        let log = fs::File::create(&log_file)?;
        let start = Instant::now();
        let mut child = Command::new(&self.program)
            .args(&args)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(log)
            .spawn()?;
        let status = loop {
            if let Some(status) = child.try_wait()? {
                break status;
            }
            if Instant::now() >= deadline {
                child.kill()?;
                child.wait()?;
                return cut_short(start.elapsed().as_secs_f64() * 1e3);
            }
            sleep(Duration::from_millis(2));
        };
        let wall_ms = start.elapsed().as_secs_f64() * 1e3;
        if !status.success() {
            let text = String::from_utf8_lossy(&fs::read(&log_file)?).into_owned();
            let mut lines = text.lines().filter(|l| !l.trim().is_empty());
            // A program says first what is wrong; what follows may be a back trace.
            let said = lines
                .clone()
                .find(|l| l.to_ascii_lowercase().contains("error"));
            let said = said
                .or(lines.next())
                .unwrap_or("it said nothing")
                .to_owned();
            let args = args
                .iter()
                .map(|a| a.to_string_lossy())
                .collect::<Vec<_>>()
                .join(" ");
            return Err(RunError::Failed {
                args,
                status: status.to_string(),
                stderr: said,
            });
        }
        let frames = stats::parse(&fs::read_to_string(&stats_file)?)
            .map_err(|error| RunError::Stats(Rc::new(error)))?;
        Ok(Run {
            folder: folder.to_owned(),
            frames,
            wall_ms,
        })
    }
}

/// Fewest frames of a run cut short that are worth having: warm-up, and enough for a median.
pub const FEWEST_TIMED: usize = WARM_UP + 5;

/// What a run that only takes times had measured when it was ended.
fn partial(job: &Job, folder: &Path, wall_ms: f64) -> Option<Run> {
    let text = fs::read_to_string(folder.join("stats.jsonl")).ok()?;
    let whole_lines = &text[..text.rfind('\n')? + 1];
    let frames = stats::parse(whole_lines).ok()?;
    let enough = job.write == Write::None && frames.len() >= FEWEST_TIMED;
    enough.then(|| Run {
        folder: folder.to_owned(),
        frames,
        wall_ms,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job() -> Job {
        Job {
            write: Write::Every(2),
            ..super::super::job::example()
        }
    }

    #[cfg(unix)]
    fn script(folder: &Path, text: &str) -> Renderer {
        use std::os::unix::fs::PermissionsExt;
        let program = folder.join("fake");
        fs::write(&program, format!("#!/bin/sh\n{text}\n")).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        Renderer::at(program)
    }

    #[cfg(unix)]
    #[test]
    fn a_run_gives_its_statistics_its_failure_or_its_end() {
        let folder = tempfile::tempdir().unwrap();
        let soon = || Instant::now() + Duration::from_secs(20);
        let line = r#"{"frame":0,"total_ms":2.0,"wait_ms":3.0,"samples_new":9}"#;
        let good = script(
            folder.path(),
            &format!("while [ \"$1\" != --stats ]; do shift; done; echo '{line}' > \"$2\""),
        );
        let run = good.render(&job(), folder.path(), soon()).unwrap();
        assert_eq!((run.elapsed_ms(0), run.samples(0)), (5.0, 9));

        let bad = script(
            folder.path(),
            "echo 'Error: no such scene' >&2; echo trace >&2; exit 2",
        );
        let error = bad
            .render(&job(), folder.path(), soon())
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("no such scene") && error.contains('2'),
            "{error}"
        );

        let endless = script(
            folder.path(),
            &format!(
                "while [ \"$1\" != --stats ]; do shift; done\n\
                 for i in 1 2 3 4 5 6 7 8 9; do echo '{line}'; done > \"$2\"; printf '{{' >> \"$2\"; exec sleep 20"
            ),
        );
        let timed = Job {
            write: Write::None,
            ..job()
        };
        let in_a_while = Instant::now() + Duration::from_millis(500);
        let run = endless.render(&timed, folder.path(), in_a_while).unwrap();
        assert_eq!(run.frames.len(), 9);

        let slow = script(folder.path(), "exec sleep 20");
        let error = slow
            .render(&job(), folder.path(), Instant::now())
            .unwrap_err();
        assert!(matches!(error, RunError::OutOfTime), "{error}");
    }
}
