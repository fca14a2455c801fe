//! Servers that dial in, where only the display can be reached.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use protocol::doorway::{Displaced, Doorway, Guest};
use protocol::limits::MAX_GUESTS;
use protocol::secret::{self, Role};
use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinSet;

use super::connection::{self, Stranger};
use super::server::{ServerError, Shared};

/// Pause after a connection failed before it was accepted, as when no more files can be opened.
const PAUSE: Duration = Duration::from_millis(50);

/// Takes in servers until the link closes.
pub(super) async fn accept(listener: TcpListener, shared: Arc<Shared>) {
    let doorway = Doorway::new(MAX_GUESTS);
    let mut servers = JoinSet::new();
    loop {
        let (stream, address) = tokio::select! {
            () = shared.closed() => break,
            accepted = listener.accept() => match accepted {
                Ok(accepted) => accepted,
                Err(error) => {
                    tracing::warn!("a connection failed before it was accepted: {error}");
                    tokio::time::sleep(PAUSE).await;
                    continue;
                }
            },
        };
        while servers.try_join_next().is_some() {}
        let (guest, displaced) = doorway.enter();
        servers.spawn(serve(
            stream,
            address,
            (guest, displaced),
            Arc::clone(&shared),
        ));
    }
    servers.join_all().await;
}

async fn serve(
    mut stream: TcpStream,
    address: SocketAddr,
    (guest, mut displaced): (Guest, Displaced),
    shared: Arc<Shared>,
) {
    if let Err(error) = stream.set_nodelay(true) {
        tracing::debug!("{address}: no low-delay mode: {error}");
    }
    if let Some(secret) = &shared.secret {
        let proved = tokio::select! {
            proved = secret::accepted(&mut stream, secret, Role::Display) => proved,
            () = displaced.told() => return,
            () = shared.closed() => return,
        };
        if let Err(error) = proved {
            tracing::warn!("{address}: kept out: {error}");
            return;
        }
    }
    let Some(slot) = shared.lock().slots.open(&address.to_string()) else {
        tracing::warn!("{address}: kept out: there are too many shader servers");
        return;
    };
    let stranger = Stranger { guest, displaced };
    let end = connection::run(stream, slot, &shared, Some(stranger)).await;
    let mut state = shared.lock();
    if let Err(error) = end {
        if matches!(error, ServerError::Crowded) {
            tracing::debug!("{address}: {error}");
        } else {
            tracing::warn!("{address}: lost a shader server: {error}");
        }
        state.lost(slot, 1, &error.to_string());
    }
    state.slots.close(slot);
    state.slots.wake_all();
    drop(state);
    shared.changed.notify_all();
}
