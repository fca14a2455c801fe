//! One connection, from the handshake to its end.
//!
//! Reading and writing go on side by side, so that neither end can block the other. What to write next is decided from
//! the shared state each time: nothing queues up for a server that does not read.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use protocol::framing::{FrameError, Receiver, Sender};
use protocol::handshake::hello;
use protocol::messages::{LightShadows, Sample, SampleRequest, Texel};
use protocol::session::{DisplayEvent, DisplaySession, SceneSize, Violation};
use protocol::transfer::EncodedScene;
use protocol::{ToDisplay, ToServer};
use tokio::net::TcpStream;
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};

use super::face::ReceivedSample;
use super::server::{ServerError, Shared};
use super::status::ServerPhase;
use crate::traces::Tap;

/// How long the last message may take.
const FAREWELL: Duration = Duration::from_millis(500);

/// Why a connection ended although nothing is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// The link is being closed.
    Closing,
    /// The server takes no edits, so that it must be sent the scene again.
    Restart,
}

/// What was sent and agreed so far.
struct Account {
    session: DisplaySession,
    welcomed: bool,
    announced: bool,
    /// The link's epoch that the server knows of.
    known_epoch: u32,
    /// The same in the session's own count.
    session_epoch: u32,
    view: u32,
    cancel_before: u32,
    pings: u64,
    since: Instant,
}

struct Connection<'a> {
    server: usize,
    shared: &'a Shared,
    tap: Tap,
    account: Mutex<Account>,
}

/// What to do next.
enum Step {
    Send(Vec<ToServer>),
    Scene,
    Restart,
    Wait,
}

/// Works with a server until one of the two is done.
pub(super) async fn run(
    stream: TcpStream,
    server: usize,
    shared: &Shared,
) -> Result<End, ServerError> {
    let (read, write) = stream.into_split();
    let mut receiver = Receiver::new(read);
    let mut sender = Sender::new(write);
    let account = Account {
        session: DisplaySession::new(SceneSize::from(&*shared.scene)),
        welcomed: false,
        announced: false,
        known_epoch: 0,
        session_epoch: 0,
        view: 0,
        cancel_before: 0,
        pings: 0,
        since: Instant::now(),
    };
    let connection = Connection {
        server,
        shared,
        tap: Tap::open(shared.recorder.as_ref(), server),
        account: Mutex::new(account),
    };
    let end = tokio::select! {
        end = connection.read(&mut receiver) => end,
        end = connection.write(&mut sender) => end,
        () = shared.closed() => Ok(End::Closing),
    };
    connection.release();
    connection.farewell(sender, &mut receiver, &end).await;
    connection.tap.closed(&match &end {
        Ok(End::Closing) => "the display is done".into(),
        Ok(End::Restart) => "the server takes no edits: it is sent the scene anew".into(),
        Err(error) => error.to_string(),
    });
    end
}

/// Keeps what is said of lights, by their index and the last word of each.
fn tell(known: &mut Vec<LightShadows>, news: Vec<LightShadows>) {
    for light in news {
        match known.binary_search_by_key(&light.light, |l| l.light) {
            Ok(place) => known[place] = light,
            Err(place) => known.insert(place, light),
        }
    }
}

impl Connection<'_> {
    fn account(&self) -> MutexGuard<'_, Account> {
        self.account.lock().unwrap_or_else(PoisonError::into_inner)
    }

    async fn read(
        &self,
        receiver: &mut Receiver<OwnedReadHalf, ToDisplay>,
    ) -> Result<End, ServerError> {
        loop {
            let received = receiver.receive_seen(|payload| self.tap.received(payload));
            let message = received.await?.ok_or(ServerError::Closed)?;
            let event = self
                .account()
                .session
                .receive(&message)
                .map_err(ServerError::Violation)?;
            self.received(event, message)?;
        }
    }

    fn received(&self, event: DisplayEvent, message: ToDisplay) -> Result<(), ServerError> {
        let mut first = false;
        match (event, message) {
            (
                DisplayEvent::Welcome,
                ToDisplay::Welcome {
                    name,
                    shader,
                    capabilities,
                    ..
                },
            ) => {
                self.account().welcomed = true;
                let mut state = self.shared.lock();
                let status = &mut state.servers[self.server];
                status.name = format!("{name} ({shader})").into();
                status.threads = capabilities.threads;
            }
            (DisplayEvent::Ready, _) => {
                let credits = self.account().session.free_credits();
                let mut state = self.shared.lock();
                state.servers[self.server].phase = ServerPhase::Ready;
                state.servers[self.server].credits = credits;
            }
            (
                DisplayEvent::Samples,
                ToDisplay::Samples {
                    view,
                    epoch,
                    samples,
                },
            ) => {
                let samples = samples.into_iter().map(|sample| (sample, None));
                first = self.deliver(view, epoch, samples);
            }
            (
                DisplayEvent::Samples,
                ToDisplay::Textured {
                    view,
                    epoch,
                    samples,
                },
            ) => {
                let samples = samples.into_iter().map(|t| (t.sample, Some(t.texel)));
                first = self.deliver(view, epoch, samples);
            }
            (DisplayEvent::Triples, ToDisplay::Triples { epoch, triples }) => {
                let mut state = self.shared.lock();
                let current = self.is_current(epoch, state.edits.epoch());
                state.deliver_triples(&triples, current);
            }
            (DisplayEvent::Shadows, ToDisplay::Shadows { lights }) => {
                let mut state = self.shared.lock();
                tell(&mut state.servers[self.server].shadows, lights);
            }
            (DisplayEvent::Status { released }, _) => {
                self.shared.lock().release(self.server, released);
            }
            (DisplayEvent::Fault(violation), _) => return Err(ServerError::Fault(violation)),
            _ => {}
        }
        self.shared.changed.notify_all();
        self.shared.wake[self.server].notify_one();
        if first && let Some(waker) = &self.shared.waker {
            waker();
        }
        Ok(())
    }

    /// Hands samples over; true if there were none before.
    fn deliver(
        &self,
        view: u32,
        session_epoch: u32,
        samples: impl ExactSizeIterator<Item = (Sample, Option<Texel>)>,
    ) -> bool {
        let mut state = self.shared.lock();
        let epoch = state.edits.epoch();
        let current = self.is_current(session_epoch, epoch);
        let samples = samples.map(|(sample, texel)| ReceivedSample {
            view,
            epoch,
            connection: self.tap.connection(),
            sample,
            texel,
        });
        state.deliver(self.server, samples, current)
    }

    /// Whether a session's epoch stands for the scene as it is now.
    fn is_current(&self, session_epoch: u32, now: u32) -> bool {
        let account = self.account();
        account.known_epoch == now && account.session_epoch == session_epoch
    }

    async fn write(
        &self,
        sender: &mut Sender<OwnedWriteHalf, ToServer>,
    ) -> Result<End, ServerError> {
        let timeout = self.shared.timeout;
        let mut heartbeat = tokio::time::interval(timeout / 4);
        heartbeat.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
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
                () = self.shared.wake[self.server].notified() => {}
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

    async fn send(
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
            && let Some(view) = state.take(self.server, most, batch)
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
        let waits = !account.welcomed || account.session.awaits_pong();
        if waits && account.since.elapsed() >= self.shared.timeout {
            return Err(ServerError::TimedOut(self.shared.timeout));
        }
        if waits {
            return Ok(None);
        }
        account.pings += 1;
        account.since = Instant::now();
        let token = account.pings;
        account.session.pinged(token);
        Ok(Some(ToServer::Ping { token }))
    }

    /// Hands what the server held to the others.
    fn release(&self) {
        let held = self.account().session.take_outstanding();
        let mut state = self.shared.lock();
        state.hand_back(self.server, &held);
        state.servers[self.server].credits = 0;
        state.servers[self.server].phase = ServerPhase::Connecting;
        drop(state);
        self.shared.wake_servers();
        self.shared.changed.notify_all();
    }

    /// Tells the server why the connection ends, if it can still hear it.
    async fn farewell(
        &self,
        mut sender: Sender<OwnedWriteHalf, ToServer>,
        receiver: &mut Receiver<OwnedReadHalf, ToDisplay>,
        end: &Result<End, ServerError>,
    ) {
        let fault = match end {
            Ok(_) => {
                // Whether it arrives makes no difference to the display.
                let _ = in_time(FAREWELL, self.send(&mut sender, &ToServer::Goodbye)).await;
                return;
            }
            Err(ServerError::Violation(violation)) => violation.to_server(),
            Err(ServerError::Frame(error)) => match Violation::of_frame(error) {
                Some(violation) => violation.to_server(),
                None => return,
            },
            Err(_) => return,
        };
        let told = async {
            if self.send(&mut sender, &fault).await.is_ok() && sender.close().await.is_ok() {
                drop(sender);
                receiver.discard().await;
            }
        };
        // A server that goes on sending is not waited for.
        let _ = tokio::time::timeout(FAREWELL, told).await;
    }
}

async fn in_time(
    timeout: Duration,
    sending: impl Future<Output = Result<(), FrameError>>,
) -> Result<(), ServerError> {
    let done = tokio::time::timeout(timeout, sending).await;
    Ok(done.map_err(|_| ServerError::TimedOut(timeout))??)
}
