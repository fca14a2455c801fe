//! Measures on this machine and writes a page; see [`system_tests::report::Args`].

use std::process::ExitCode;

use clap::Parser;
use system_tests::report::{self, runner::Renderer};

fn main() -> ExitCode {
    let args = report::Args::parse();
    let places = system_tests::places::find();
    let measured = Renderer::locate()
        .map_err(report::ReportError::from)
        .and_then(|renderer| report::run(&args, &renderer, &places));
    match measured {
        Ok(summary) => {
            println!("{}", summary.page.display());
            for (reason, count) in &summary.missing {
                eprintln!("report: {count} measurements are missing: {reason}");
            }
            ExitCode::from(u8::from(summary.failed))
        }
        Err(error) => {
            eprintln!("report: {error}");
            ExitCode::from(2)
        }
    }
}
