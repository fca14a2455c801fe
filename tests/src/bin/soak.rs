//! A long session with servers that come and go; see [`system_tests::soak::Args`].

use std::process::ExitCode;

use clap::Parser;
use system_tests::soak;

fn main() -> ExitCode {
    let args = soak::Args::parse();
    match soak::run(&args, &mut std::io::stdout().lock()) {
        Ok(report) if report.soak.lost == 0 => ExitCode::SUCCESS,
        Ok(report) => {
            eprintln!("soak: {} requests are lost", report.soak.lost);
            ExitCode::FAILURE
        }
        Err(error) => {
            eprintln!("soak: {error:#}");
            ExitCode::from(2)
        }
    }
}
