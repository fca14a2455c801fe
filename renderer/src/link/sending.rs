//! What is sent on one connection: decided anew each time, from what is wanted and what the server was told.

use std::sync::Arc;
use std::time::{Duration, Instant};

use protocol::ToServer;
use protocol::framing::{FrameError, Sender};
use protocol::handshake::hello;
use protocol::messages::SampleRequest;
use protocol::transfer::EncodedScene;
use tokio::net::tcp::OwnedWriteHalf;
use tokio::time::MissedTickBehavior;

use super::connection::{Connection, End};
use super::server::ServerError;

/// Between looks at whether others should be asked for what a server holds.
const RELIEF: Duration = Duration::from_millis(50);

/// What to do next.
enum Step {
    Send(Vec<ToServer>),
    Scene,
    Restart,
    Wait,
}

impl Connection<'_> {
    pub(super) async fn write(
        &self,
        sender: &mut Sender<OwnedWriteHalf, ToServer>,
    ) -> Result<End, ServerError> {
        let timeout = self.shared.timeout;
        let mut heartbeat = tokio::time::interval(timeout / 4);
        heartbeat.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut relief = tokio::time::interval(RELIEF);
        relief.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut batch = Vec::new();
        self.put(sender, &hello(&self.shared.name, self.shared.seed))
            .await?;
        loop {
            match self.next(&mut batch) {
                Step::Send(messages) => {
                    for message in &messages {
                        self.put(sender, message).await?;
                    }
                    continue;
                }
                Step::Scene => {
                    self.send_scene(sender).await?;
                    continue;
                }
                Step::Restart => return Ok(End::Restart),
                Step::Wait => {}
            }
            in_time(timeout, sender.flush()).await?;
            tokio::select! {
                () = self.wake.notified() => {}
                _ = relief.tick(), if self.has_others() => self.relieve(),
                _ = heartbeat.tick() => {
                    if let Some(ping) = self.beat()? {
                        self.put(sender, &ping).await?;
                    }
                }
            }
        }
    }

    async fn put(
        &self,
        sender: &mut Sender<OwnedWriteHalf, ToServer>,
        message: &ToServer,
    ) -> Result<(), ServerError> {
        let sending = sender.feed_seen(message, |payload| self.tap.sent(payload));
        in_time(self.shared.timeout, sending).await
    }

    pub(super) async fn send(
        &self,
        sender: &mut Sender<OwnedWriteHalf, ToServer>,
        message: &ToServer,
    ) -> Result<(), FrameError> {
        let sending = sender.feed_seen(message, |payload| self.tap.sent(payload));
        sending.await?;
        sender.flush().await
    }

    /// What the server should be told next, and notes it as sent.
    fn next(&self, batch: &mut Vec<SampleRequest>) -> Step {
        let mut state = self.shared.lock();
        let mut account = self.account();
        if !account.session.is_ready() {
            let send_scene = account.welcomed && !account.announced;
            return if send_scene { Step::Scene } else { Step::Wait };
        }
        let Some(offer) = account.session.capabilities().cloned() else {
            return Step::Wait;
        };
        let mut messages = Vec::new();
        let epoch = state.edits.epoch();
        if account.known_epoch < epoch {
            if !offer.edits {
                return Step::Restart;
            }
            for (objects, lights) in state.edits.since(account.known_epoch) {
                account.session_epoch += 1;
                let epoch = account.session_epoch;
                account.session.edited(epoch);
                messages.push(ToServer::Edit {
                    epoch,
                    objects,
                    lights,
                });
            }
            account.known_epoch = epoch;
        }
        if account.cancel_before < state.cancel_before {
            account.cancel_before = state.cancel_before;
            account.session.cancelling(state.cancel_before);
            messages.push(ToServer::Cancel {
                views_before: state.cancel_before,
            });
        }
        for &(view, camera) in &state.views {
            if view > account.view {
                account.view = view;
                messages.push(ToServer::View { view, camera });
            }
        }
        let most = account.session.free_credits().min(offer.max_batch as usize);
        if most > 0
            && let Some(view) = state.take(self.server, most, batch, Instant::now())
        {
            account.session.requested(view, batch);
            messages.push(ToServer::Request {
                view,
                samples: batch.clone(),
            });
        }
        if messages.is_empty() {
            Step::Wait
        } else {
            Step::Send(messages)
        }
    }

    async fn send_scene(
        &self,
        sender: &mut Sender<OwnedWriteHalf, ToServer>,
    ) -> Result<(), ServerError> {
        if self.account().session.takes_shadows() {
            self.put(sender, &self.shared.shadows).await?;
        }
        let encoded = self.scene_to_send().await?;
        let holds = {
            let mut account = self.account();
            account.announced = true;
            account.session.announce(encoded.digest())
        };
        self.put(sender, &encoded.begin()).await?;
        if !holds {
            for chunk in encoded.chunks() {
                self.put(sender, &chunk).await?;
            }
        }
        Ok(())
    }

    /// The scene as it was loaded, or as it is now for a server that takes no edits.
    async fn scene_to_send(&self) -> Result<Arc<EncodedScene>, ServerError> {
        let edited = {
            let state = self.shared.lock();
            let mut account = self.account();
            let edits = account
                .session
                .capabilities()
                .is_some_and(|offer| offer.edits);
            if edits || state.edits.epoch() == 0 {
                None
            } else {
                account.known_epoch = state.edits.epoch();
                Some(state.edits.clone())
            }
        };
        let Some(edits) = edited else {
            return Ok(Arc::clone(&self.shared.encoded));
        };
        let scene = Arc::clone(&self.shared.scene);
        let encoding =
            tokio::task::spawn_blocking(move || EncodedScene::new(&edits.applied(&scene)));
        match encoding.await {
            Ok(encoded) => Ok(Arc::new(encoded?)),
            Err(_) => Err(ServerError::Closed),
        }
    }

    /// A ping, if the last one was answered.
    fn beat(&self) -> Result<Option<ToServer>, ServerError> {
        let mut account = self.account();
        if account.session.awaits_pong() && account.since.elapsed() >= self.shared.timeout {
            return Err(ServerError::TimedOut(self.shared.timeout));
        }
        if !account.welcomed || account.session.awaits_pong() {
            return Ok(None);
        }
        account.pings += 1;
        account.since = Instant::now();
        let token = account.pings;
        account.session.pinged(token);
        Ok(Some(ToServer::Ping { token }))
    }
}

pub(super) async fn in_time(
    timeout: Duration,
    sending: impl Future<Output = Result<(), FrameError>>,
) -> Result<(), ServerError> {
    let done = tokio::time::timeout(timeout, sending).await;
    Ok(done.map_err(|_| ServerError::TimedOut(timeout))??)
}
