//! Shader servers that the display starts itself.

use std::ffi::OsString;
use std::net::SocketAddr;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use tokio::io::{AsyncBufReadExt, AsyncReadExt, BufReader};
use tokio::process::{Child, ChildStdin, Command};

use super::server::ServerError;

/// What a server's first line of output says before its address.
const ANNOUNCEMENT: &str = "listening on ";
/// Most bytes of that line.
const LONGEST_LINE: u64 = 200;
/// How long a server may take to end by itself.
const GRACE: Duration = Duration::from_millis(500);

/// A running server. It ends when its standard input does, so it never outlives the display, however that ends.
#[derive(Debug)]
pub(super) struct Process {
    child: Child,
    stdin: Option<ChildStdin>,
    address: SocketAddr,
}

impl Process {
    /// Starts a server on a free loopback port and waits for it to say which.
    pub(super) async fn spawn(
        program: &Path,
        args: &[OsString],
        timeout: Duration,
    ) -> Result<Self, ServerError> {
        let failed = |source| ServerError::Spawn {
            program: program.to_owned(),
            source,
        };
        let mut child = Command::new(program)
            .args(args)
            .args(["--listen", "127.0.0.1:0", "--parent-stdin"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .kill_on_drop(true)
            .spawn()
            .map_err(failed)?;
        let stdin = child.stdin.take();
        let silent = || ServerError::Silent {
            program: program.to_owned(),
        };
        let mut output = BufReader::new(child.stdout.take().ok_or_else(silent)?);
        let mut line = String::new();
        let read = async { (&mut output).take(LONGEST_LINE).read_line(&mut line).await };
        tokio::time::timeout(timeout, read)
            .await
            .map_err(|_| silent())?
            .map_err(failed)?;
        let address = line
            .trim_end()
            .strip_prefix(ANNOUNCEMENT)
            .and_then(|address| address.parse().ok())
            .ok_or_else(silent)?;
        // Read on, so that a server that says more never waits for a reader.
        tokio::spawn(async move { tokio::io::copy(&mut output, &mut tokio::io::sink()).await });
        Ok(Self {
            child,
            stdin,
            address,
        })
    }

    /// Where it listens.
    pub(super) fn address(&self) -> SocketAddr {
        self.address
    }

    /// Asks it to end, and ends it if it does not.
    pub(super) async fn stop(mut self) {
        drop(self.stdin.take());
        if tokio::time::timeout(GRACE, self.child.wait())
            .await
            .is_err()
            && let Err(error) = self.child.kill().await
        {
            tracing::warn!(%error, "cannot end a shader server");
        }
    }
}
