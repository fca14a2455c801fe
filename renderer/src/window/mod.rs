//! The window: a person flies through the scene and sees each stage of the display.

mod app;
mod baseline;
mod budget;
mod controller;
mod grab;
mod hands;
mod keys;
mod moves;
mod overlay;
mod pace;
mod screenshot;
mod session;
mod surface;
mod tell;

use std::sync::{Arc, Mutex, PoisonError};

use protocol::messages::ShadowMethod;
use protocol::scene::Scene;
use scenes::{CameraPath, CameraSpec, Motion};
use winit::error::EventLoopError;
use winit::event_loop::EventLoop;

use crate::cli::{ServerArgs, WindowArgs};
use crate::servers::{Servers, ServersError};
use app::{App, Wake};
use controller::Controller;
use hands::Hands;
use moves::Moves;
use session::Session;

/// Why there is no window, or none any more.
#[derive(Debug, thiserror::Error)]
pub enum WindowError {
    /// Nothing could be shown at all; frames can still be rendered to files.
    #[error("no window can be opened: {0}")]
    NoDisplay(String),
    /// The window was lost while it was open.
    #[error("the window was lost: {0}")]
    Lost(String),
    /// The display's own threads cannot be started.
    #[error("cannot start the display's threads: {0}; try fewer with --threads")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// The servers cannot be used.
    #[error(transparent)]
    Servers(#[from] ServersError),
}

/// What is shown.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// Its name, for the title.
    pub name: &'a str,
    /// The scene.
    pub scene: &'a Arc<Scene>,
    /// Where the camera starts.
    pub camera: &'a CameraSpec,
    /// What can be played, if anything.
    pub path: Option<&'a CameraPath>,
    /// Paths of objects and lights.
    pub motions: &'a [Motion],
    /// How the visibility of each light is wanted to be found.
    pub shadows: &'a [ShadowMethod],
}

/// Opens a window on the scene and returns when it is closed.
///
/// # Errors
/// [`WindowError::NoDisplay`] where there is no display server, before any shader server is started.
pub fn run(subject: Subject<'_>, args: &WindowArgs) -> Result<(), WindowError> {
    let events = EventLoop::<Wake>::with_user_event()
        .build()
        .map_err(|e| WindowError::NoDisplay(reason(&e)))?;
    let proxy = Mutex::new(events.create_proxy());
    let waker = Box::new(move || {
        // An error means that the window is closed.
        let _ = proxy
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .send_event(Wake);
    });
    let pixels = args.size.0 as usize * args.size.1 as usize;
    let servers = Servers::start(
        &with_room_for_the_display(&args.servers),
        subject.scene,
        subject.shadows,
        args.seed,
        pixels,
        Some(waker),
    )?;
    let mut session = Session::new(
        subject.scene,
        args.choices,
        args.seed,
        servers,
        args.samples_per_frame,
    );
    session.use_threads(usize::from(args.threads))?;
    let controller = Controller::new(
        subject.camera,
        controller::extent(subject.scene),
        subject.path.cloned(),
    );
    let title = format!("{} - edge and point", subject.name);
    let moves = Moves::new(subject.scene, subject.motions);
    let hands = Hands::new(subject.scene, subject.camera.up.into(), moves);
    let mut app = App::new(session, controller, hands, title, args);
    if args.explain {
        eprint!("{}", app.explain(subject.scene));
    }
    let ended = events.run_app(&mut app);
    if args.explain {
        eprint!("{}", app.explain(subject.scene));
    }
    match (app.into_failure(), ended) {
        (Some(failure), _) => Err(failure),
        (None, Err(e)) => Err(WindowError::Lost(reason(&e))),
        (None, Ok(())) => Ok(()),
    }
}

/// Servers that are started here leave a core to the display, which would else have to wait for them after all.
fn with_room_for_the_display(args: &ServerArgs) -> ServerArgs {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let each = (cores.saturating_sub(1) / usize::from(args.shaders)).max(1);
    ServerArgs {
        shader_threads: args.shader_threads.or_else(|| {
            // A foreign program need not know the option.
            args.shader
                .is_none()
                .then(|| u16::try_from(each).unwrap_or(u16::MAX))
        }),
        ..args.clone()
    }
}

/// An event loop's error in a line, without where in its source it came about.
fn reason(error: &EventLoopError) -> String {
    match error {
        EventLoopError::Os(_) | EventLoopError::NotSupported(_) => {
            let unset = |name| std::env::var_os(name).is_none_or(|v| v.is_empty());
            if unset("DISPLAY") && unset("WAYLAND_DISPLAY") {
                "there is no display server (neither DISPLAY nor WAYLAND_DISPLAY is set)".into()
            } else {
                "the display server named by DISPLAY or WAYLAND_DISPLAY does not answer".into()
            }
        }
        other => other.to_string(),
    }
}
