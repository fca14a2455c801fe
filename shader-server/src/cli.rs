//! The command line.

use std::{
    ffi::OsString,
    io::{self, Write},
    net::SocketAddr,
    num::NonZeroUsize,
    process::ExitCode,
};

use anyhow::{Context, bail};
use clap::{Parser, ValueEnum};
use tokio::net::TcpListener;

use crate::{
    irradiance::Patience,
    server::{ServerConfig, run},
    shadows::{ShadowOptions, ShadowRays},
};

/// Exit code for what the user can mend.
const USAGE: u8 = 2;

/// Traces rays for displays that connect.
#[derive(Clone, Debug, Parser)]
#[command(name = "shader-server", version)]
struct Args {
    /// Address to listen on: a loopback address and a port, 0 for any free port
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1:0")]
    listen: SocketAddr,
    /// Threads that trace rays [default: one a processor]
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// How the visibility of lights is found
    #[arg(long, value_enum, default_value_t = ShadowMethod::Auto)]
    shadows: ShadowMethod,
    /// Most shadow rays a light and sample; fewer are used where light and shadow are clear
    #[arg(long, value_name = "N", default_value_t = ShadowRays::default().max_rays,
          value_parser = clap::value_parser!(u32).range(1..=65_536))]
    shadow_rays: u32,
    /// Strata a side that an area light is divided into at first: more find finer shadows, and cost a ray each
    #[arg(long, value_name = "N", default_value_t = ShadowRays::default().strata,
          value_parser = clap::value_parser!(u32).range(1..=32))]
    light_strata: u32,
    /// Answer no sample before the indirect light that it needs is computed: pictures then do not depend on how fast that goes
    #[arg(long)]
    wait_for_records: bool,
    /// Exit when standard input closes, as it does when the parent process ends
    #[arg(long)]
    parent_stdin: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ShadowMethod {
    /// The cheapest method that fits: few faces in between are drawn onto an area light, else shadow rays
    Auto,
    /// Stratified, adaptive shadow rays
    Rays,
    /// Hierarchical penumbra casting
    Penumbra,
    /// Soft shadow maps
    SoftMap,
}

impl From<ShadowMethod> for protocol::messages::ShadowMethod {
    fn from(method: ShadowMethod) -> Self {
        match method {
            ShadowMethod::Auto => Self::Auto,
            ShadowMethod::Rays => Self::Rays,
            ShadowMethod::Penumbra => Self::Penumbra,
            ShadowMethod::SoftMap => Self::SoftMap,
        }
    }
}

/// Runs the server as the program `shader-server` does: `args` begin with the program's name. The first line on standard
/// output is `listening on ADDR`. Returns when told to stop (interrupt, or standard input's end with
/// `--parent-stdin`); exit code 2 means that the command line or the address is to be mended.
pub fn main_from_args(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let args = match Args::try_parse_from(args) {
        Ok(args) => args,
        Err(error) => {
            let code = if error.use_stderr() { USAGE } else { 0 };
            // If even the message cannot be printed, the exit code has to do.
            let _ = error.print();
            return ExitCode::from(code);
        }
    };
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("warn"));
    // An embedding program may have set one up already.
    let _ = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(io::stderr)
        .try_init();
    match serve(&args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(io::stderr(), "shader-server: {error:#}");
            ExitCode::from(USAGE)
        }
    }
}

fn serve(args: &Args) -> anyhow::Result<()> {
    if !args.listen.ip().is_loopback() {
        bail!(
            "{} is not a loopback address, and nothing yet tells friend from foe; use 127.0.0.1 or [::1]",
            args.listen
        );
    }
    let config = ServerConfig {
        threads: args.threads,
        shadows: ShadowOptions {
            rays: ShadowRays {
                max_rays: args.shadow_rays,
                strata: args.light_strata,
                drawn_faces: match args.shadows {
                    ShadowMethod::Rays => 0,
                    _ => ShadowRays::default().drawn_faces,
                },
            },
            method: args.shadows.into(),
            steady: args.wait_for_records,
        },
        patience: if args.wait_for_records {
            Patience::Final
        } else {
            Patience::AtOnce
        },
        ..ServerConfig::default()
    };
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .thread_name("sockets")
        .enable_all()
        .build()
        .context("cannot start the threads that serve sockets")?;
    let parent_stdin = args.parent_stdin;
    let listen = args.listen;
    let served = runtime.block_on(async move {
        let listener = TcpListener::bind(listen)
            .await
            .with_context(|| format!("cannot listen on {listen}; is the port taken?"))?;
        let address = listener
            .local_addr()
            .context("cannot tell the address listened on")?;
        announce(address).context("cannot write the address to standard output")?;
        run(config, listener, stop(parent_stdin)).await?;
        Ok(())
    });
    // Reading standard input cannot be interrupted; nothing else is worth waiting for.
    runtime.shutdown_background();
    served
}

fn announce(address: SocketAddr) -> io::Result<()> {
    let mut out = io::stdout().lock();
    writeln!(out, "listening on {address}")?;
    out.flush()
}

/// Done when the server is to stop.
async fn stop(parent_stdin: bool) {
    let (end_of_input, ended) = tokio::sync::oneshot::channel();
    if parent_stdin {
        std::thread::spawn(move || {
            // Whatever ends reading, an error included, the parent is gone.
            let _ = io::copy(&mut io::stdin().lock(), &mut io::sink());
            let _ = end_of_input.send(());
        });
        tokio::select! {
            _ = ended => {}
            _ = tokio::signal::ctrl_c() => {}
        }
    } else if tokio::signal::ctrl_c().await.is_err() {
        // Without a way to hear of interrupts the process ends by them all the same.
        std::future::pending::<()>().await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn served(args: &[&str]) -> anyhow::Result<()> {
        serve(&Args::try_parse_from(args).expect("the arguments parse"))
    }

    #[test]
    fn foreign_addresses_are_refused() {
        let foreign = served(&["s", "--listen", "0.0.0.0:0"])
            .unwrap_err()
            .to_string();
        assert!(
            foreign.contains("0.0.0.0:0 is not a loopback address"),
            "{foreign}"
        );
    }

    #[test]
    fn bad_arguments_do_not_parse() {
        for args in [
            ["s", "--threads", "0"],
            ["s", "--listen", "here"],
            ["s", "--shadow-rays", "0"],
            ["s", "--shadows", "maps"],
        ] {
            assert!(Args::try_parse_from(args).is_err(), "{args:?}");
        }
    }
}
