//! Races rays against Embree; see [`system_tests::ray_speed::Args`].

use std::process::ExitCode;

use clap::Parser;
use system_tests::ray_speed;

fn main() -> ExitCode {
    let args = ray_speed::Args::parse();
    match ray_speed::run(&args, &mut std::io::stdout().lock()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("ray-speed: {error}");
            ExitCode::from(2)
        }
    }
}
