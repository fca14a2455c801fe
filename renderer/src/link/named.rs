//! Servers behind a host name: all that it leads to, as a scheduler's service name leads to all tasks of a job.
//!
//! The name is looked up again and again, so that servers that start later are found too. Where it leads to addresses of
//! both families of the Internet protocol those of one are used, since they are mostly two ways to the same machines: the
//! family that the system puts first, or if none of that can be reached, the other.

use std::collections::BTreeSet;
use std::io;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::task::JoinSet;

use super::server::{ServerError, Shared, Target, supervise};

/// Between look-ups.
const AGAIN: Duration = Duration::from_millis(500);
/// The same as long as nobody was reached.
const AGAIN_AT_FIRST: Duration = Duration::from_millis(50);

#[derive(Debug, Default)]
struct Found {
    addresses: BTreeSet<SocketAddr>,
    /// The family of the first address that was reached: whether it is version 6.
    family: Option<bool>,
    failed: bool,
}

/// What a host name leads to.
#[derive(Debug, Default)]
pub(super) struct Named(Mutex<Found>);

impl Named {
    fn lock(&self) -> MutexGuard<'_, Found> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether the name still leads there.
    pub(super) fn has(&self, address: SocketAddr) -> bool {
        self.lock().addresses.contains(&address)
    }

    /// Somebody listens there.
    pub(super) fn reached(&self, address: SocketAddr) {
        self.lock().family.get_or_insert(address.is_ipv6());
    }

    /// A connection failed.
    pub(super) fn failed(&self) {
        self.lock().failed = true;
    }

    /// Takes in what a look-up gave, and gives what of it is to be used.
    fn found(&self, all: &[SocketAddr]) -> BTreeSet<SocketAddr> {
        let mut found = self.lock();
        let family = found.family;
        let first = all.first().map(SocketAddr::is_ipv6);
        let wanted = |address: &&SocketAddr| match (family, found.failed) {
            (Some(family), _) => address.is_ipv6() == family,
            (None, true) => true,
            (None, false) => Some(address.is_ipv6()) == first,
        };
        let chosen: BTreeSet<SocketAddr> = all.iter().filter(wanted).copied().collect();
        found.addresses.clone_from(&chosen);
        chosen
    }
}

/// Keeps all servers in use that a host name, with a port, leads to, until the link closes. `slot` is open, for the first.
pub(super) async fn follow(host: String, slot: usize, shared: Arc<Shared>) {
    let named = Arc::new(Named::default());
    let mut spare = Some(slot);
    let mut failures = 0;
    let mut followed = BTreeSet::new();
    let mut servers = JoinSet::new();
    while !*shared.closing.borrow() {
        match look_up(&host, &shared).await {
            Ok(all) => {
                for address in named.found(&all) {
                    if !followed.contains(&address)
                        && let Some(slot) = spare.take().or_else(|| open(&shared, address))
                    {
                        followed.insert(address);
                        let target = Target::Address {
                            address,
                            named: Some(Arc::clone(&named)),
                        };
                        let shared = Arc::clone(&shared);
                        servers.spawn(async move {
                            supervise(slot, target, shared).await;
                            address
                        });
                    }
                }
            }
            // Servers that are in use do not go away because a name server did.
            Err(error) if followed.is_empty() => {
                failures += 1;
                tracing::debug!(%error, failures, "a host name leads nowhere");
                spare = spare.or_else(|| shared.lock().slots.open(&host));
                if let Some(slot) = spare {
                    shared.lock().lost(slot, failures, &error.to_string());
                }
                shared.changed.notify_all();
            }
            Err(_) => {}
        }
        let pause = match named.lock().family {
            Some(_) => AGAIN,
            None if failures > 0 => AGAIN,
            None => AGAIN_AT_FIRST,
        };
        tokio::select! {
            () = tokio::time::sleep(pause) => {}
            Some(ended) = servers.join_next() => {
                if let Ok(address) = ended {
                    followed.remove(&address);
                }
            }
            () = shared.closed() => {}
        }
    }
    servers.join_all().await;
}

fn open(shared: &Shared, address: SocketAddr) -> Option<usize> {
    shared.lock().slots.open(&address.to_string())
}

async fn look_up(host: &str, shared: &Shared) -> Result<Vec<SocketAddr>, ServerError> {
    let failed = |source| ServerError::Name {
        host: host.to_owned(),
        source,
    };
    let (asked, name) = (Arc::clone(&shared.look_up), host.to_owned());
    // Waiting ends with the link: how long a look-up takes is not the display's choice.
    let looking = tokio::task::spawn_blocking(move || asked(&name));
    let found = tokio::select! {
        found = looking => found.map_err(|_| failed(io::ErrorKind::Other.into()))?,
        () = tokio::time::sleep(shared.timeout) => return Err(failed(io::ErrorKind::TimedOut.into())),
        () = shared.closed() => return Ok(Vec::new()),
    };
    let all = found.map_err(failed)?;
    let allowed = |address: &&SocketAddr| shared.secret.is_some() || address.ip().is_loopback();
    let usable: Vec<SocketAddr> = all.iter().filter(allowed).copied().collect();
    match (all.is_empty(), usable.is_empty()) {
        (true, _) => Err(failed(io::ErrorKind::NotFound.into())),
        (false, true) => Err(ServerError::NotLoopback {
            address: host.to_owned(),
        }),
        (false, false) => Ok(usable),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(text: &str) -> SocketAddr {
        text.parse().unwrap()
    }

    #[test]
    fn one_family_of_addresses_is_used() {
        let all = ["[::1]:9", "127.0.0.1:9", "127.0.0.2:9"].map(at);
        let named = Named::default();
        let six: BTreeSet<_> = [all[0]].into();
        let four: BTreeSet<_> = [all[1], all[2]].into();
        assert_eq!(named.found(&all), six);
        named.failed();
        assert_eq!(named.found(&all).len(), 3);
        named.reached(all[2]);
        assert_eq!(named.found(&all), four);
        named.reached(all[0]);
        assert_eq!(named.found(&all), four);
        assert!(named.has(all[1]) && !named.has(all[0]));
        assert!(named.found(&[]).is_empty() && !named.has(all[1]));
    }
}
