//! Says whether a shader server keeps to `PROTOCOL.md`.

use std::ffi::OsString;
use std::io::{self, Write};
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::PathBuf;
use std::process::{ExitCode, Stdio};
use std::time::Duration;

use clap::Parser;
use protocol::conformance::{
    ConformanceError, DEFAULT_TIMEOUT, LaunchError, Launched, Options, check_server,
};
use protocol::secret::{Secret, SecretFileError};

/// Exit code for a server that fails checks.
const FAILED: u8 = 1;
/// Exit code for what the user can mend: the command line, an address where nobody listens.
const USAGE: u8 = 2;

/// Plays a display to a shader server and says what it does wrong: one line a check, `pass`, `FAIL` or `skip`.
/// Exit code 0 if nothing failed, 1 if something did, 2 if there is no server.
#[derive(Debug, Parser)]
#[command(name = "conformance", version)]
struct Args {
    /// Server to check: host and port
    #[arg(long, value_name = "ADDR", required_unless_present = "shader")]
    connect: Option<String>,
    /// Starts this program with its arguments, `--listen 127.0.0.1:0` and `--parent-stdin`, and checks it; the last option
    #[arg(long, value_name = "CMD", conflicts_with = "connect", num_args = 1.., allow_hyphen_values = true)]
    shader: Vec<OsString>,
    /// File with the secret that the server asks for
    #[arg(long, value_name = "FILE")]
    secret_file: Option<PathBuf>,
    /// Longest wait for a sign of life, seconds; more for slow servers
    #[arg(long, value_name = "S", default_value_t = DEFAULT_TIMEOUT.as_secs_f32())]
    timeout: f32,
    /// Runs only checks whose name contains this
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
    /// Prints only what did not pass, and the count; nothing that the server itself writes
    #[arg(long)]
    quiet: bool,
}

#[derive(Debug, thiserror::Error)]
enum Error {
    #[error("{0} is no host and port: {1}")]
    Address(String, io::Error),
    #[error("{0} has no address")]
    NoAddress(String),
    #[error("--timeout must be from .1 to 3600 seconds")]
    Timeout,
    #[error(transparent)]
    Secret(#[from] SecretFileError),
    #[error(transparent)]
    Launch(#[from] LaunchError),
    #[error(transparent)]
    Conformance(#[from] ConformanceError),
    #[error("cannot write: {0}")]
    Output(#[from] io::Error),
}

fn main() -> ExitCode {
    match run(Args::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(FAILED),
        Err(error) => {
            // If even this cannot be printed, the exit code has to do.
            let _ = writeln!(io::stderr(), "conformance: {error}");
            ExitCode::from(USAGE)
        }
    }
}

fn resolve(address: &str) -> Result<SocketAddr, Error> {
    let mut found = address
        .to_socket_addrs()
        .map_err(|error| Error::Address(address.into(), error))?;
    found.next().ok_or_else(|| Error::NoAddress(address.into()))
}

/// Whether nothing failed.
fn run(args: Args) -> Result<bool, Error> {
    if !(0.1..=3600.0).contains(&args.timeout) {
        return Err(Error::Timeout);
    }
    let timeout = Duration::from_secs_f32(args.timeout);
    let secret_file = args.secret_file.as_deref();
    let secret = secret_file.map(Secret::read).transpose()?;
    let (address, _launched) = match &args.connect {
        Some(address) => (resolve(address)?, None),
        None => {
            let messages = if args.quiet {
                Stdio::null()
            } else {
                Stdio::inherit()
            };
            let launched = Launched::start(&args.shader, secret_file, messages)?;
            (launched.address(), Some(launched))
        }
    };
    let options = Options {
        address,
        timeout,
        secret,
        only: args.only,
    };
    let mut out = io::stdout().lock();
    let mut written = Ok(());
    let count = check_server(options, |line| {
        if !args.quiet || line.result.is_err() {
            written = std::mem::replace(&mut written, Ok(()))
                .and_then(|()| writeln!(out, "{line}"))
                .and_then(|()| out.flush());
        }
    })?;
    written?;
    writeln!(
        out,
        "{} passed, {} failed, {} skipped",
        count.passed, count.failed, count.skipped
    )?;
    Ok(count.failed == 0)
}
