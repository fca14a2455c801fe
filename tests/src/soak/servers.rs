//! Shader servers as processes that can be killed.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use anyhow::{Context, bail};

/// A server at one address, whatever process runs there now.
pub(super) struct Server {
    program: PathBuf,
    child: Child,
    pub(super) address: String,
}

impl Server {
    pub(super) fn start(program: &Path) -> anyhow::Result<Self> {
        let (child, address) = spawn(program, "127.0.0.1:0")?;
        Ok(Self {
            program: program.to_owned(),
            child,
            address,
        })
    }

    pub(super) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Ends the process as `kill -9` does.
    pub(super) fn kill(&mut self) -> anyhow::Result<()> {
        self.child.kill()?;
        self.child.wait()?;
        Ok(())
    }

    /// Starts another at the same address.
    pub(super) fn restart(&mut self) -> anyhow::Result<()> {
        (self.child, _) = spawn(&self.program, &self.address)?;
        Ok(())
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn spawn(program: &Path, listen: &str) -> anyhow::Result<(Child, String)> {
    let mut child = Command::new(program)
        .args(["--listen", listen, "--threads", "1"])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .with_context(|| format!("cannot start {}", program.display()))?;
    let output = child.stdout.take().context("it has no output")?;
    let mut line = String::new();
    BufReader::new(output).read_line(&mut line)?;
    match line.trim().strip_prefix("listening on ") {
        Some(address) => Ok((child, address.to_owned())),
        None => {
            let _ = child.kill();
            bail!("{} does not listen on {listen}", program.display());
        }
    }
}
