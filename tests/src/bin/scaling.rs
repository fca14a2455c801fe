//! Samples a second with several shader servers of fixed speed, and what a sample costs the display.

use std::process::ExitCode;

fn main() -> ExitCode {
    match system_tests::scaling::run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}
