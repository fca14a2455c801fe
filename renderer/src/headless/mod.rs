//! `render`: frames to files, without a window.

mod brute;
mod flight;
mod output;

use std::path::PathBuf;
use std::time::{Duration, Instant};

use protocol::scene::Scene;
use protocol::trace::Step;
use scenes::{CameraPath, CameraSpec, Motion};

use crate::camera::View;
use crate::cli::RenderArgs;
use crate::config::Method;
use crate::explain::Explanation;
use crate::frame::{Display, Wanted};
use crate::servers::{Servers, ServersError};
use crate::show::{Stages, show};
use crate::tone::ToneMap;
use crate::traces::{picture_digest, planned, shaped};
pub use flight::Flight;
pub(crate) use output::{Files, Output};
pub use output::{OutputError, write_exr, write_png};

/// Share of the pixels that are asked for in a frame unless told otherwise: the paper's 1-3 %.
const DEFAULT_SHARE: f64 = 0.02;

/// Why frames could not be rendered.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The scene has no such path.
    #[error("the scene has no path named `{name}`; it has {known}")]
    NoPath {
        /// What was asked for.
        name: String,
        /// What there is.
        known: String,
    },
    /// A file could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The display's own threads cannot be started.
    #[error("cannot start the display's threads: {0}; try fewer with --threads")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// No samples are to be had.
    #[error(transparent)]
    Servers(#[from] ServersError),
}

/// What a run came to, for people.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Frames rendered.
    pub frames: usize,
    /// Median of the frames' stage totals, ms.
    pub median_ms: f64,
    /// Samples taken in over the run.
    pub samples: u64,
    /// From start to end, waiting included.
    pub elapsed: Duration,
    /// The last file written, if any was.
    pub last_file: Option<PathBuf>,
    /// Which models were chosen; none where every pixel is shaded.
    pub explanation: Option<Explanation>,
}

/// What is rendered.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// The scene, as the servers have it.
    pub scene: &'a Scene,
    /// Where the camera stands.
    pub camera: &'a CameraSpec,
    /// Ways of the camera through the scene.
    pub paths: &'a [CameraPath],
    /// Paths of objects and lights.
    pub motions: &'a [Motion],
}

/// Renders what the arguments ask for.
///
/// # Errors
/// If the path is unknown, a file cannot be written, or no server can be had.
pub fn render(
    subject: Subject<'_>,
    args: &RenderArgs,
    servers: &mut Servers,
) -> Result<Summary, RenderError> {
    let mut flight = Flight::new(subject, args)?;
    let mut output = Output::new(&Files {
        out: &args.out,
        write: args.write,
        exr: args.exr,
        frames: args.frames,
        stats: args.stats.as_deref(),
    })?;
    let start = Instant::now();
    let mut totals = Vec::with_capacity(args.frames);
    let (mut samples, mut explanation) = (0, None);
    match args.choices.method {
        Method::Full | Method::Reference => {
            for frame in 0..args.frames {
                let stats = brute::frame(&mut flight, frame, args, servers, &mut output)?;
                samples += stats.samples_new as u64;
                totals.push(stats.total_ms);
            }
        }
        Method::EdgeAndPoint | Method::NoComplex | Method::PointsOnly => {
            explanation = Some(sparse(
                subject.scene,
                &mut flight,
                args,
                servers,
                &mut output,
                |stats| {
                    samples += stats.samples_new as u64;
                    totals.push(stats.total_ms);
                },
            )?);
        }
    }
    totals.sort_by(f64::total_cmp);
    Ok(Summary {
        frames: args.frames,
        median_ms: totals.get(totals.len() / 2).copied().unwrap_or(0.0),
        samples,
        elapsed: start.elapsed(),
        last_file: output.last_file(),
        explanation,
    })
}

fn sparse(
    scene: &Scene,
    flight: &mut Flight<'_>,
    args: &RenderArgs,
    servers: &mut Servers,
    output: &mut Output,
    mut done: impl FnMut(&crate::stats::FrameStats),
) -> Result<Explanation, RenderError> {
    let (width, height) = args.size;
    let pixels = f64::from(width) * f64::from(height);
    let budget = args
        .samples_per_frame
        .unwrap_or((pixels * DEFAULT_SHARE).round() as usize);
    let mut display = Display::new(scene, args.choices, width, height, args.seed);
    servers.note(|| shaped(&args.choices, args.size, false));
    display.use_threads(usize::from(args.threads))?;
    let tone = ToneMap::new();
    let (mut wanted, mut received, mut shown) = (Wanted::default(), Vec::new(), Vec::new());
    if let Some(edit) = flight.edit(0) {
        display.edit(servers.edit(&edit)?, &edit);
    }
    let mut camera = flight.camera(0);
    let mut view = View::new(&camera);
    let mut number = servers.set_view(&view.camera())?;
    display.begin(&view, number);
    servers.note(|| Step::Begun {
        view: number,
        camera,
    });
    display.plan_first(budget, &mut wanted);
    servers.note(|| planned(budget, true, None));
    servers.request(number, &wanted.here)?;
    for frame in 0..args.frames {
        let waited = Instant::now();
        received.clear();
        // Without lockstep too the first frame waits: for the servers to be there, and the scene to be with them.
        if args.lockstep || frame == 0 {
            servers.wait_all(&mut received)?;
        } else {
            servers.drain(&mut received);
        }
        display.learn(&servers.new_triples());
        let waits = args.lockstep || frame == 0;
        display.update_shadows(waits);
        servers.note(|| Step::Shadowed(display.shadowed(waits)));
        let wait_ms = waited.elapsed().as_secs_f64() * 1e3;
        display.receive(&received, number);
        servers.note_taken(number);
        display.draw(&view, number);
        servers.note(|| Step::Drawn {
            view: number,
            camera,
        });
        display.time_present(|d| show(args.show, &Stages::of(d), &tone, &mut shown));
        servers.note(|| Step::Pictured {
            digest: picture_digest(display.grid(), display.image()),
        });
        let next_camera = flight.camera(frame + 1);
        let next = View::new(&next_camera);
        if frame + 1 < args.frames {
            // What moves until the next frame has moved when its samples are shaded.
            if let Some(edit) = flight.edit(frame + 1) {
                display.edit(servers.edit(&edit)?, &edit);
            }
            display.plan(budget, Some(&next), &mut wanted);
            servers.note(|| planned(budget, false, Some(next_camera)));
            servers.request(number, &wanted.here)?;
            if next != view {
                (view, camera) = (next, next_camera);
                number = servers.set_view(&next.camera())?;
                servers.request(number, &wanted.ahead)?;
            }
        }
        let mut stats = display.take_stats(frame);
        stats.wait_ms = wait_ms;
        stats.servers = servers.connected();
        stats.triples = servers.triples();
        output.frame(frame, display.grid(), display.image(), &shown)?;
        output.stats(&stats)?;
        done(&stats);
    }
    Ok(Explanation::of(&display, scene, &servers.shadows()))
}
