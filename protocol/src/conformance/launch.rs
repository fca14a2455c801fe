//! A server that is started for the checks and ended after them, as a display does it.

use std::ffi::OsString;
use std::io::{self, BufRead, BufReader};
use std::net::SocketAddr;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

/// Time in which a server has to say where it listens. Interpreters and their modules take long to load.
const START: Duration = Duration::from_secs(60);

/// What a server's first line of output says before its address.
const ANNOUNCEMENT: &str = "listening on ";

/// A server cannot be started.
#[derive(Debug, thiserror::Error)]
pub enum LaunchError {
    /// There is no such program, or it may not be run.
    #[error("cannot start {}: {source}", program.to_string_lossy())]
    Spawn {
        /// The program.
        program: OsString,
        /// Why not.
        source: io::Error,
    },
    /// It does not say where it listens.
    #[error(
        "{}: the first line of output must be `listening on ADDRESS:PORT`; came {line:?} within {seconds} s",
        program.to_string_lossy()
    )]
    Silent {
        /// The program.
        program: OsString,
        /// What it said.
        line: String,
        /// Time it was given.
        seconds: u64,
    },
}

/// A running server, ended when dropped.
#[derive(Debug)]
pub struct Launched {
    child: Child,
    address: SocketAddr,
}

impl Launched {
    /// Starts a program with these arguments and `--listen 127.0.0.1:0 --parent-stdin`, and with the secret's file if there is one. What
    /// it writes to standard error goes to `messages`.
    ///
    /// # Errors
    /// If it cannot be started, or does not say in time where it listens.
    pub fn start(
        command: &[OsString],
        secret_file: Option<&Path>,
        messages: Stdio,
    ) -> Result<Self, LaunchError> {
        let (program, args) = match command {
            [program, args @ ..] => (program.clone(), args),
            [] => (OsString::new(), command),
        };
        let failed = |source| LaunchError::Spawn {
            program: program.clone(),
            source,
        };
        let mut started = Command::new(&program);
        started
            .args(args)
            .args(["--listen", "127.0.0.1:0", "--parent-stdin"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(messages);
        if let Some(file) = secret_file {
            started.arg("--secret-file").arg(file);
        }
        let mut child = started.spawn().map_err(failed)?;
        let (send, receive) = mpsc::channel();
        if let Some(output) = child.stdout.take() {
            thread::spawn(move || {
                // Read to its end, so that a server that says more never waits for a reader.
                for line in BufReader::new(output).lines().map_while(Result::ok) {
                    let _ = send.send(line);
                }
            });
        }
        let line = receive.recv_timeout(START).unwrap_or_default();
        let address = line.strip_prefix(ANNOUNCEMENT).and_then(|a| a.parse().ok());
        let mut launched = Self {
            child,
            address: SocketAddr::from(([127, 0, 0, 1], 0)),
        };
        match address {
            Some(address) => launched.address = address,
            None => {
                return Err(LaunchError::Silent {
                    program,
                    line,
                    seconds: START.as_secs(),
                });
            }
        }
        Ok(launched)
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for Launched {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
