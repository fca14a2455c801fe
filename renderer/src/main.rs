//! The display's program.

use std::io::Write as _;
use std::process::ExitCode;
use std::sync::Arc;

use anyhow::Result;
use clap::Parser;
use renderer::cli::{Cli, Command, DEFAULT_SCENE, RenderArgs, ServerArgs, WindowArgs};
use renderer::config::Method;
use renderer::headless::{self, Subject};
use renderer::servers::Servers;
use renderer::window::{self, WindowError};
use scenes::LoadedScene;

/// Exit code for input that cannot be used, as for a wrong command line.
const BAD_INPUT: u8 = 2;

fn main() -> ExitCode {
    let cli = Cli::parse();
    if let Some(Command::ShaderServer { args }) = cli.command {
        let name = std::ffi::OsString::from("shader-server");
        return shader_server::main_from_args(std::iter::once(name).chain(args));
    }
    tracing_subscriber::fmt()
        .with_env_filter(
            tracing_subscriber::EnvFilter::try_from_default_env()
                .unwrap_or_else(|_| "warn,winit=error".into()),
        )
        .with_writer(std::io::stderr)
        .with_ansi(std::io::IsTerminal::is_terminal(&std::io::stderr()))
        .init();
    let result = match cli.command {
        Some(Command::Render(args)) => open(&args.scene).and_then(|scene| render(scene, &args)),
        Some(Command::ShaderServer { .. }) | None => show(&cli.window),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(BAD_INPUT)
        }
    }
}

/// Opens a window, or, where there is no display server, says so and renders along the scene's first path.
fn show(args: &WindowArgs) -> Result<()> {
    let name = args.scene.as_deref().unwrap_or(DEFAULT_SCENE);
    let loaded = open(name)?;
    let path = loaded.paths.first().map(|p| p.name.clone());
    let scene = Arc::new(loaded.scene);
    let subject = window::Subject {
        name,
        scene: &scene,
        camera: &loaded.camera,
        path: loaded.paths.first(),
        motions: &loaded.motions,
        shadows: &loaded.shadows,
    };
    match window::run(subject, args) {
        Err(WindowError::NoDisplay(why)) => {
            eprintln!(
                "no window can be opened: {why}; rendering pictures into {} instead",
                args.out.display()
            );
            let loaded = LoadedScene {
                scene: Arc::unwrap_or_clone(scene),
                ..loaded
            };
            render(loaded, &args.headless(path))
        }
        other => Ok(other?),
    }
}

fn render(loaded: LoadedScene, args: &RenderArgs) -> Result<()> {
    let LoadedScene {
        scene,
        camera,
        paths,
        motions,
        shadows,
        ..
    } = loaded;
    let scene = Arc::new(scene);
    let pixels = args.size.0 as usize * args.size.1 as usize;
    let server_args = ServerArgs {
        even_shadow_rays: args.choices.method == Method::Reference,
        steady: args.lockstep || matches!(args.choices.method, Method::Full | Method::Reference),
        ..args.servers.clone()
    };
    let mut servers = Servers::start(&server_args, &scene, &shadows, args.seed, pixels, None)?;
    let subject = Subject {
        scene: &scene,
        camera: &camera,
        paths: &paths,
        motions: &motions,
    };
    let summary = headless::render(subject, args, &mut servers)?;
    // Whoever reads the summary may have stopped reading: that is no failure of the frames.
    let mut told = std::io::stdout().lock();
    let _ = writeln!(
        told,
        "{} frames, median {:.2} ms a frame without waiting, {} samples in {:.1} s",
        summary.frames,
        summary.median_ms,
        summary.samples,
        summary.elapsed.as_secs_f64()
    );
    if args.explain {
        let _ = match summary.explanation {
            Some(explanation) => write!(told, "{explanation}"),
            None => writeln!(
                told,
                "every pixel is shaded in every frame: nothing is chosen"
            ),
        };
    }
    if let Some(file) = summary.last_file {
        let _ = writeln!(told, "last picture: {}", file.display());
    }
    Ok(())
}

fn open(name: &str) -> Result<LoadedScene> {
    let scene = scenes::open(name)?;
    if !scene.report.is_clean() {
        tracing::warn!("{name}: {}", scene.report);
    }
    Ok(scene)
}
