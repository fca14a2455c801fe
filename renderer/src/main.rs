//! The display's program.

use std::process::ExitCode;
use std::sync::Arc;

use anyhow::Result;
use clap::Parser;
use renderer::cli::{Cli, Command, RenderArgs};
use renderer::headless::{self, Subject};
use renderer::servers::Servers;
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
            tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| "warn".into()),
        )
        .with_writer(std::io::stderr)
        .init();
    let result = match cli.command {
        Some(Command::Render(args)) => render(&args),
        Some(Command::ShaderServer { .. }) | None => render(&cli.window.headless(None)),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(BAD_INPUT)
        }
    }
}

fn render(args: &RenderArgs) -> Result<()> {
    let LoadedScene {
        scene,
        camera,
        paths,
        ..
    } = open(&args.scene)?;
    let scene = Arc::new(scene);
    let pixels = args.size.0 as usize * args.size.1 as usize;
    let mut servers = Servers::start(&args.servers, &scene, args.seed, pixels, None)?;
    let subject = Subject {
        scene: &scene,
        camera: &camera,
        paths: &paths,
    };
    let summary = headless::render(subject, args, &mut servers)?;
    println!(
        "{} frames, median {:.2} ms a frame without waiting, {} samples in {:.1} s",
        summary.frames,
        summary.median_ms,
        summary.samples,
        summary.elapsed.as_secs_f64()
    );
    if let Some(file) = summary.last_file {
        println!("last picture: {}", file.display());
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
