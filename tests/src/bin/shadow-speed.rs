//! Races casting against shadow rays; see [`system_tests::shadow_speed::Args`].

use std::process::ExitCode;

use clap::Parser;
use system_tests::shadow_speed;

fn main() -> ExitCode {
    let args = shadow_speed::Args::parse();
    match shadow_speed::run(&args, &mut std::io::stdout().lock()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("shadow-speed: {error}");
            ExitCode::from(2)
        }
    }
}
