//! The display's program.

use std::ffi::OsString;
use std::io::Write as _;
use std::process::ExitCode;
use std::sync::Arc;

use anyhow::{Result, bail};
use clap::Parser;
use renderer::cli::{
    Cli, Command, DEFAULT_SCENE, RecordArgs, RenderArgs, ReplayArgs, ServerArgs, WindowArgs,
};
use renderer::config::Method;
use renderer::headless::{self, Subject};
use renderer::servers::Servers;
use renderer::traces::{self, Recorded, Recording};
use renderer::window::{self, WindowError};
use scenes::LoadedScene;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;

/// Exit code for input that cannot be used, as for a wrong command line.
const BAD_INPUT: u8 = 2;

/// Exit code for a replay whose pictures are not the recorded ones, or a server that broke a rule.
const NOT_THE_SAME: u8 = 1;

fn main() -> ExitCode {
    let cli = Cli::parse();
    if let Some(Command::ShaderServer { args }) = cli.command {
        let name = OsString::from("shader-server");
        return shader_server::main_from_args(std::iter::once(name).chain(args));
    }
    let wanted = std::env::var("RUST_LOG")
        .ok()
        .and_then(|text| text.parse().ok());
    let filter = wanted.unwrap_or_else(|| {
        Targets::new()
            .with_default(LevelFilter::WARN)
            .with_target("winit", LevelFilter::ERROR)
    });
    let layer = tracing_subscriber::fmt::layer()
        .with_writer(std::io::stderr)
        .with_ansi(std::io::IsTerminal::is_terminal(&std::io::stderr()));
    tracing_subscriber::registry()
        .with(layer)
        .with(filter)
        .init();
    let result = match cli.command {
        Some(Command::Record(args)) => record(&args).map(|()| ExitCode::SUCCESS),
        Some(Command::Replay(args)) => replay(&args),
        command => run(command, &cli.window).map(|()| ExitCode::SUCCESS),
    };
    match result {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(BAD_INPUT)
        }
    }
}

/// Renders or opens a window.
fn run(command: Option<Command>, window: &WindowArgs) -> Result<()> {
    match command {
        Some(Command::Render(args)) => open(&args.scene).and_then(|scene| render(scene, &args)),
        _ => show(window),
    }
}

/// Does what the arguments say and records it.
fn record(args: &RecordArgs) -> Result<()> {
    let typed = std::iter::once(OsString::from("renderer record TRACE"));
    let mut cli = Cli::try_parse_from(typed.chain(args.command.iter().cloned()))
        .unwrap_or_else(|error| error.exit());
    let servers = match &mut cli.command {
        None => &mut cli.window.servers,
        Some(Command::Render(render)) => &mut render.servers,
        Some(_) => {
            bail!("what is to be recorded? give `render` and its arguments, or those of the window")
        }
    };
    let words = args.command.iter().map(|word| word.to_string_lossy());
    let options = serde_json::json!({ "arguments": words.collect::<Vec<_>>() });
    let recording = Recording::create(&args.trace, options.to_string())?;
    servers.recorder = Some(recording.recorder());
    let done = run(cli.command, &cli.window);
    let recorded = recording.finish();
    done?;
    let Recorded { bytes, frames } = recorded?;
    // Whoever reads this may have stopped reading: that is no failure of the trace.
    let _ = writeln!(
        std::io::stdout(),
        "recorded {frames} pictures in {bytes} bytes: {}",
        args.trace.display()
    );
    Ok(())
}

/// Draws, serves or plays a trace.
fn replay(args: &ReplayArgs) -> Result<ExitCode> {
    let trace = &args.trace;
    let same = if let Some(out) = &args.out {
        let redrawn = traces::draw(trace, out, args)?;
        let _ = writeln!(std::io::stdout(), "{redrawn}");
        redrawn.differing.is_empty()
    } else if let Some(address) = args.listen {
        traces::serve(trace, address, args)?
    } else {
        traces::play(trace, &args.connect, args.real_time)?
    };
    Ok(if same {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(NOT_THE_SAME)
    })
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
