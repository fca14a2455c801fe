//! Measures precision and recall of drawn edges; see [`system_tests::edge_accuracy::Args`].

use std::process::ExitCode;

use clap::Parser;
use system_tests::edge_accuracy;

fn main() -> ExitCode {
    let args = edge_accuracy::Args::parse();
    match edge_accuracy::run(&args, &mut std::io::stdout().lock()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("edge-accuracy: {error}");
            ExitCode::from(2)
        }
    }
}
