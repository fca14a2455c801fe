//! Compares a picture or a folder of frames with a reference; see [`system_tests::compare::Args`].

use std::process::ExitCode;

use clap::Parser;
use system_tests::compare;

fn main() -> ExitCode {
    match compare::run(&compare::Args::parse(), &mut std::io::stdout().lock()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("compare: {error}");
            ExitCode::from(2)
        }
    }
}
