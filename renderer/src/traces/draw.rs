//! Draws the pictures of a trace again, from the trace alone.

use std::collections::HashMap;
use std::fmt;
use std::path::Path;
use std::time::{Duration, Instant};

use protocol::limits::MAX_SIDE;
use protocol::messages::{Camera, Digest, Sample, Texel};
use protocol::scene::Scene;
use protocol::session::SceneSize;
use protocol::trace::{Event, Run, Step};
use protocol::validate::{validate_camera, validate_light, validate_transform};

use super::follow::{Follower, News};
use super::marks::picture_digest;
use super::open::{ReplayError, Trace, Trouble};
use crate::camera::View;
use crate::cli::ReplayArgs;
use crate::config::Choices;
use crate::frame::{Display, Edit, Received, Wanted};
use crate::headless::{Files, Output};
use crate::show::{Stages, show};
use crate::tone::ToneMap;

/// More samples a pixel than a plan ever asks for.
const MOST_A_PIXEL: usize = 4;

/// What a replay came to.
#[derive(Clone, Debug, Default)]
pub struct Redrawn {
    /// Pictures drawn.
    pub frames: usize,
    /// Those of them that could be compared with the recorded ones.
    pub compared: usize,
    /// Those that differ, by number.
    pub differing: Vec<usize>,
    /// How much later than when recorded a picture came at most, where the timing was to be kept.
    pub late: Duration,
    /// Whether the trace ends before its time.
    pub cut: bool,
}

impl fmt::Display for Redrawn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} pictures", self.frames)?;
        match self.differing.first() {
            Some(first) => write!(
                f,
                ", {} of {} differ from those recorded, the first is {first}",
                self.differing.len(),
                self.compared
            )?,
            None if self.compared > 0 => {
                write!(f, ", {} the same to the bit as recorded", self.compared)?;
            }
            None => {}
        }
        if self.late > Duration::ZERO {
            write!(f, ", at most {:.1} ms late", self.late.as_secs_f64() * 1e3)?;
        }
        Ok(())
    }
}

/// Draws the pictures of a trace into `out`: each from exactly the samples that it had when it was recorded, so that it is
/// the same to the bit. With `--real-time` none is drawn before its time.
///
/// # Errors
/// If the trace cannot be replayed or a file not be written. A trace that is cut off is replayed up to there.
pub fn draw(path: &Path, out: &Path, args: &ReplayArgs) -> Result<Redrawn, ReplayError> {
    replay(path, out, args).map_err(|why| ReplayError::new(path, why))
}

fn replay(path: &Path, out: &Path, args: &ReplayArgs) -> Result<Redrawn, Trouble> {
    let frames = count(path)?;
    if frames == 0 {
        return Err(Trouble::NoPicture);
    }
    let mut trace = Trace::open(path)?;
    trace.encoded = Vec::new();
    let scene = std::sync::Arc::clone(&trace.scene);
    let files = Files {
        out,
        write: args.write,
        exr: args.exr,
        frames,
        stats: args.stats.as_deref(),
    };
    let mut replay = Replay::new(&scene, trace.header.seed, args, Output::new(&files)?);
    let mut follower = Follower::new(SceneSize::from(&*scene));
    while let Some(entry) = trace.next()? {
        match &entry.event {
            Event::Step(step) => {
                if args.real_time && matches!(step, Step::Drawn { .. }) {
                    replay.wait_until(Duration::from_micros(entry.time_us));
                }
                replay.step(step)?;
            }
            event => match follower.follow(event) {
                Some(News::Samples {
                    connection,
                    view,
                    samples,
                    ..
                }) => replay.deliver(connection, view, samples),
                _ => continue,
            },
        }
    }
    replay.write_stats()?;
    let cut = trace.warn_of_ending(replay.told.frames);
    Ok(Redrawn { cut, ..replay.told })
}

/// Pictures in a trace.
fn count(path: &Path) -> Result<usize, Trouble> {
    let mut trace = Trace::open(path)?;
    let mut frames = 0;
    while let Some(entry) = trace.next()? {
        frames += usize::from(matches!(entry.event, Event::Step(Step::Drawn { .. })));
    }
    Ok(frames)
}

/// The display of a trace.
struct Replay<'a> {
    scene: &'a Scene,
    seed: u64,
    args: &'a ReplayArgs,
    output: Output,
    display: Option<Display>,
    /// What has been received and not been taken, by connection and id.
    inbox: HashMap<(u32, u64), (u32, Sample, Option<Texel>)>,
    received: Vec<Received>,
    wanted: Wanted,
    tone: ToneMap,
    shown: Vec<u32>,
    last: Option<Digest>,
    triples: usize,
    /// The last picture's statistics have not been taken yet.
    untold: bool,
    start: Instant,
    told: Redrawn,
}

impl<'a> Replay<'a> {
    fn new(scene: &'a Scene, seed: u64, args: &'a ReplayArgs, output: Output) -> Self {
        Self {
            scene,
            seed,
            args,
            output,
            display: None,
            inbox: HashMap::new(),
            received: Vec::new(),
            wanted: Wanted::default(),
            tone: ToneMap::new(),
            shown: Vec::new(),
            last: None,
            triples: 0,
            untold: false,
            start: Instant::now(),
            told: Redrawn::default(),
        }
    }

    fn wait_until(&mut self, time: Duration) {
        let now = self.start.elapsed();
        match time.checked_sub(now) {
            Some(left) => std::thread::sleep(left),
            None => self.told.late = self.told.late.max(now - time),
        }
    }

    fn deliver(&mut self, connection: u32, view: u32, samples: Vec<(Sample, Option<Texel>)>) {
        for (sample, texel) in samples {
            self.inbox
                .insert((connection, sample.id), (view, sample, texel));
        }
    }

    fn step(&mut self, step: &Step) -> Result<(), Trouble> {
        if self.untold
            && !matches!(
                step,
                Step::Edited { .. } | Step::Pictured { .. } | Step::Planned { .. }
            )
        {
            self.write_stats()?;
        }
        if let Step::Shaped {
            choices,
            width,
            height,
            keep_points,
        } = step
        {
            return self.shape(choices, (*width, *height), *keep_points);
        }
        let Some(mut display) = self.display.take() else {
            return Err(self.nonsense("a display is used that was never made"));
        };
        let done = self.with(&mut display, step);
        self.display = Some(display);
        done
    }

    fn with(&mut self, display: &mut Display, step: &Step) -> Result<(), Trouble> {
        match step {
            Step::Shaped { .. } => {}
            Step::Passed => {
                // As after a picture, samples are counted from here on.
                let _ = display.take_stats(0);
            }
            Step::Begun { view, camera } => display.begin(&self.view(display, camera)?, *view),
            Step::Edited {
                epoch,
                objects,
                lights,
            } => {
                let edit = Edit {
                    objects: objects.clone(),
                    lights: lights.clone(),
                };
                self.check_edit(&edit)?;
                display.edit(*epoch, &edit);
                // Nothing that came before is of use any more.
                self.inbox.clear();
            }
            Step::Learned { triples } => {
                let (lights, objects) = (self.scene.lights.len(), self.scene.objects.len());
                let known = |t: &protocol::messages::Triple| {
                    (t.light as usize) < lights
                        && t.blocker.max(t.receiver) < u32::try_from(objects).unwrap_or(u32::MAX)
                };
                if !triples.iter().all(known) {
                    return Err(self.nonsense("a triple names what is not in the scene"));
                }
                self.triples += triples.len();
                display.learn(triples);
            }
            Step::Shadowed(shadowed) => display.update_shadows_as(shadowed),
            Step::Took { view, samples } => {
                self.take(display.epoch(), samples)?;
                display.receive(&self.received, *view);
            }
            Step::Drawn { view, camera } => self.draw(display, *view, camera)?,
            Step::Pictured { digest } => {
                self.told.compared += 1;
                if self.last != Some(*digest) {
                    self.told.differing.push(self.told.frames.saturating_sub(1));
                }
            }
            Step::Planned {
                budget,
                first,
                next,
            } => {
                let pixels = display.grid().width * display.grid().height;
                let budget = (*budget as usize).min(MOST_A_PIXEL * pixels);
                let next = next.as_ref().map(|c| self.view(display, c)).transpose()?;
                if *first {
                    display.plan_first(budget, &mut self.wanted);
                } else {
                    display.plan(budget, next.as_ref(), &mut self.wanted);
                }
            }
        }
        Ok(())
    }

    fn shape(&mut self, choices: &str, size: (u32, u32), keep: bool) -> Result<(), Trouble> {
        let choices: Choices = serde_json::from_str(choices)
            .map_err(|e| self.nonsense(&format!("choices are not those of this program ({e})")))?;
        let (width, height) = size;
        if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) {
            return Err(self.nonsense(&format!("pictures are {width}x{height} pixels large")));
        }
        match &mut self.display {
            Some(display) => display.rebuild(choices, width, height, keep),
            None => {
                let mut display = Display::new(self.scene, choices, width, height, self.seed);
                display.use_threads(usize::from(self.args.threads))?;
                self.display = Some(display);
            }
        }
        Ok(())
    }

    fn draw(&mut self, display: &mut Display, number: u32, camera: &Camera) -> Result<(), Trouble> {
        let view = self.view(display, camera)?;
        display.draw(&view, number);
        let what = self.args.show;
        display.time_present(|d| show(what, &Stages::of(d), &self.tone, &mut self.shown));
        self.last = Some(picture_digest(display.grid(), display.image()));
        let (frame, grid) = (self.told.frames, display.grid());
        self.output
            .frame(frame, grid, display.image(), &self.shown)?;
        self.told.frames += 1;
        self.untold = true;
        Ok(())
    }

    /// The last picture's line of statistics, now that all that belongs to it is done, and nothing of the next: the display
    /// counts samples from here on.
    fn write_stats(&mut self) -> Result<(), Trouble> {
        if std::mem::take(&mut self.untold)
            && let Some(display) = &mut self.display
        {
            let mut stats = display.take_stats(self.told.frames - 1);
            stats.triples = self.triples;
            self.output.stats(&stats)?;
        }
        Ok(())
    }

    fn take(&mut self, epoch: u32, runs: &[Run]) -> Result<(), Trouble> {
        self.received.clear();
        for run in runs {
            for k in 0..u64::from(run.count) {
                let key = (run.connection, run.first.wrapping_add(k));
                let Some((view, sample, texel)) = self.inbox.remove(&key) else {
                    let what = format!("sample {} is taken in that did not come", key.1);
                    return Err(self.nonsense(&what));
                };
                self.received.push(Received {
                    view,
                    epoch,
                    sample,
                    texel,
                });
            }
        }
        Ok(())
    }

    /// A camera made ready, if it is one of the display's pictures.
    fn view(&self, display: &Display, camera: &Camera) -> Result<View, Trouble> {
        validate_camera(camera).map_err(|e| self.nonsense(&e.to_string()))?;
        let grid = display.grid();
        if (camera.width as usize, camera.height as usize) != (grid.width, grid.height) {
            return Err(self.nonsense("a camera is not one of the display's pictures"));
        }
        Ok(View::new(camera))
    }

    fn check_edit(&self, edit: &Edit) -> Result<(), Trouble> {
        let kind = std::mem::discriminant;
        for moved in &edit.objects {
            validate_transform(&moved.transform).map_err(|e| self.nonsense(&e.to_string()))?;
            if moved.object as usize >= self.scene.objects.len() {
                return Err(self.nonsense("an object moves that is not in the scene"));
            }
        }
        for moved in &edit.lights {
            validate_light(&moved.value).map_err(|e| self.nonsense(&e.to_string()))?;
            let light = self.scene.lights.get(moved.light as usize);
            if light.map(kind) != Some(kind(&moved.value)) {
                return Err(self.nonsense("a light changes that is not in the scene"));
            }
        }
        Ok(())
    }

    fn nonsense(&self, what: &str) -> Trouble {
        Trouble::Step {
            frame: self.told.frames,
            what: what.to_owned(),
        }
    }
}
