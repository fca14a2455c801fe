//! What is to be done for each source of servers.

use std::net::SocketAddr;
use std::sync::Arc;

use tokio::net::TcpListener;
use tokio::runtime::Runtime;

use super::accept::accept;
use super::face::{LinkConfig, LinkError, ServerSource};
use super::named::follow;
use super::server::{Shared, Target, supervise};
use super::state::State;

/// One source of servers, with the slot that is open for its first.
pub(super) enum Plan {
    /// One server.
    One { slot: usize, target: Target },
    /// All that a host name leads to.
    Named { slot: usize, host: String },
    /// All that dial in.
    Open { listener: TcpListener },
}

impl Plan {
    /// Keeps its servers in use until the link closes.
    pub(super) async fn run(self, shared: Arc<Shared>) {
        match self {
            Self::One { slot, target } => supervise(slot, target, shared).await,
            Self::Named { slot, host } => follow(host, slot, shared).await,
            Self::Open { listener } => accept(listener, shared).await,
        }
    }

    /// Where it waits for servers, if it does.
    pub(super) fn listens(&self) -> Option<SocketAddr> {
        match self {
            Self::Open { listener } => listener.local_addr().ok(),
            Self::One { .. } | Self::Named { .. } => None,
        }
    }
}

/// Opens what each source of servers needs.
pub(super) fn plan(
    config: &LinkConfig,
    state: &mut State,
    runtime: &Runtime,
) -> Result<Vec<Plan>, LinkError> {
    let allowed = |address: SocketAddr| {
        if config.secret.is_some() || address.ip().is_loopback() {
            Ok(())
        } else {
            Err(LinkError::NotLoopback(address))
        }
    };
    let mut open = |place: &str| state.slots.open(place).ok_or(LinkError::TooMany);
    let mut plans = Vec::with_capacity(config.servers.len());
    let mut dials_in = false;
    for source in &config.servers {
        plans.push(match source {
            ServerSource::Spawn { program, args } => Plan::One {
                slot: open(&program.display().to_string())?,
                target: Target::Program {
                    program: program.clone(),
                    args: args.clone(),
                },
            },
            ServerSource::Connect(place) => match place.parse::<SocketAddr>() {
                Ok(address) => {
                    allowed(address)?;
                    let target = Target::Address {
                        address,
                        named: None,
                    };
                    Plan::One {
                        slot: open(place)?,
                        target,
                    }
                }
                Err(_) => Plan::Named {
                    slot: open(place)?,
                    host: place.clone(),
                },
            },
            &ServerSource::Accept(address) => {
                allowed(address)?;
                dials_in = true;
                let listener = runtime.block_on(TcpListener::bind(address));
                let failed = |source| LinkError::Listen { address, source };
                Plan::Open {
                    listener: listener.map_err(failed)?,
                }
            }
        });
    }
    state.open = dials_in;
    Ok(plans)
}
