//! The command line.

use std::{
    ffi::OsString,
    io::{self, Write},
    net::SocketAddr,
    num::NonZeroUsize,
    path::PathBuf,
    process::ExitCode,
};

use anyhow::{Context, bail};
use clap::{Parser, ValueEnum};
use protocol::secret::Secret;
use tokio::net::TcpListener;
use tracing_subscriber::{
    filter::{LevelFilter, Targets},
    layer::SubscriberExt,
    util::SubscriberInitExt,
};

use crate::{
    irradiance::Patience,
    server::{Entrance, ServerConfig, run},
    shadows::{ShadowOptions, ShadowRays},
};

/// Exit code for what the user can mend.
const USAGE: u8 = 2;

/// Traces rays for displays that connect.
#[derive(Clone, Debug, Parser)]
#[command(name = "shader-server", version)]
struct Args {
    /// Address to listen on: IP and port, 0 for any free port; beyond this machine only with --secret-file
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1:0")]
    listen: SocketAddr,
    /// Displays to visit instead of listening, HOST:PORT, as often as they are there: `renderer --accept` is one
    #[arg(long, value_name = "ADDR", num_args = 1.., conflicts_with = "listen")]
    dial: Vec<String>,
    /// File with the secret that this server and its displays prove to each other
    #[arg(long, value_name = "FILE")]
    secret_file: Option<PathBuf>,
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
/// output is `listening on ADDR`, or `dialling ADDR, ...`. Returns when told to stop (interrupt, or standard input's end with
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
    let wanted = std::env::var("RUST_LOG")
        .ok()
        .and_then(|text| text.parse().ok());
    let filter = wanted.unwrap_or_else(|| Targets::new().with_default(LevelFilter::WARN));
    // An embedding program may have set one up already.
    let _ = tracing_subscriber::registry()
        .with(tracing_subscriber::fmt::layer().with_writer(io::stderr))
        .with(filter)
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
    let secret = args.secret_file.as_deref().map(Secret::read).transpose()?;
    if let (Some(secret), Some(path)) = (&secret, &args.secret_file)
        && secret.is_readable_by_others()
    {
        tracing::warn!(
            "every user of this machine can read {}; `chmod 600` it",
            path.display()
        );
    }
    if secret.is_none() && !args.listen.ip().is_loopback() {
        bail!(
            "{} is not a loopback address, where anybody may come; give --secret-file on both sides",
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
        secret,
        ..ServerConfig::default()
    };
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .thread_name("sockets")
        .enable_all()
        .build()
        .context("cannot start the threads that serve sockets")?;
    let parent_stdin = args.parent_stdin;
    let (listen, dial) = (args.listen, args.dial.clone());
    let served = runtime.block_on(async move {
        let (entrance, place) = if dial.is_empty() {
            let listener = TcpListener::bind(listen)
                .await
                .with_context(|| format!("cannot listen on {listen}; is the port taken?"))?;
            let address = listener
                .local_addr()
                .context("cannot tell the address listened on")?;
            (
                Entrance::Listen(listener),
                format!("listening on {address}"),
            )
        } else {
            let place = format!("dialling {}", dial.join(", "));
            (Entrance::Dial(dial), place)
        };
        announce(&place).context("cannot write to standard output where displays are")?;
        run(config, entrance, stop(parent_stdin)).await?;
        Ok(())
    });
    // Reading standard input cannot be interrupted; nothing else is worth waiting for.
    runtime.shutdown_background();
    served
}

fn announce(place: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    writeln!(out, "{place}")?;
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
        let far = std::env::temp_dir().join("edge-point-no-such-secret");
        let far = far.to_string_lossy();
        let missing = served(&["s", "--listen", "0.0.0.0:0", "--secret-file", &far]);
        let missing = missing.unwrap_err().to_string();
        assert!(missing.contains("cannot read the secret file"), "{missing}");
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
