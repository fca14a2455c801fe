//! One connection, from the handshake to its end.
//!
//! Reading and writing go on side by side, so that neither end can block the other. What to write next is decided from
//! the shared state each time: nothing queues up for a server that does not read.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use protocol::doorway::{Displaced, Guest};
use protocol::framing::{Receiver, Sender};
use protocol::limits::{AUTH_TIMEOUT_S, MAX_FRAME, MAX_GREETING};
use protocol::messages::{LightShadows, Sample, Texel};
use protocol::session::{DisplayEvent, DisplaySession, SceneSize, Violation};
use protocol::{ToDisplay, ToServer};
use tokio::net::TcpStream;
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::sync::Notify;

use super::face::ReceivedSample;
use super::flow::Flow;
use super::sending::in_time;
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
pub(super) struct Account {
    pub(super) session: DisplaySession,
    pub(super) welcomed: bool,
    pub(super) announced: bool,
    /// The link's epoch that the server knows of.
    pub(super) known_epoch: u32,
    /// The same in the session's own count.
    pub(super) session_epoch: u32,
    pub(super) view: u32,
    pub(super) cancel_before: u32,
    pub(super) pings: u64,
    pub(super) since: Instant,
}

pub(super) struct Connection<'a> {
    pub(super) server: usize,
    pub(super) shared: &'a Shared,
    pub(super) wake: Arc<Notify>,
    pub(super) tap: Tap,
    account: Mutex<Account>,
}

/// A server that came by itself, until it has said who it is.
pub(super) struct Stranger {
    /// Its place in the doorway.
    pub(super) guest: Guest,
    /// Tells when it has to make room.
    pub(super) displaced: Displaced,
}

/// Works with a server, at a slot that is open, until one of the two is done.
pub(super) async fn run(
    stream: TcpStream,
    server: usize,
    shared: &Shared,
    stranger: Option<Stranger>,
) -> Result<End, ServerError> {
    let (read, write) = stream.into_split();
    let mut receiver = Receiver::new(read);
    receiver.set_longest(MAX_GREETING);
    let (guest, mut displaced) = match stranger {
        Some(Stranger { guest, displaced }) => (Some(guest), Some(displaced)),
        None => (None, None),
    };
    let wake = {
        let mut state = shared.lock();
        state.slots.connect(server);
        let slot = state.slots.get(server);
        slot.map_or_else(Arc::default, |slot| Arc::clone(&slot.wake))
    };
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
        wake,
        tap: Tap::open(shared.recorder.as_ref(), server),
        account: Mutex::new(account),
    };
    let told = async {
        match &mut displaced {
            Some(displaced) => displaced.told().await,
            None => std::future::pending().await,
        }
    };
    let end = tokio::select! {
        end = connection.read(&mut receiver, guest) => end,
        end = connection.write(&mut sender) => end,
        () = told => Err(ServerError::Crowded),
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
    pub(super) fn account(&self) -> MutexGuard<'_, Account> {
        self.account.lock().unwrap_or_else(PoisonError::into_inner)
    }

    async fn read(
        &self,
        receiver: &mut Receiver<OwnedReadHalf, ToDisplay>,
        mut guest: Option<Guest>,
    ) -> Result<End, ServerError> {
        let patience = match guest {
            Some(_) => Duration::from_secs(AUTH_TIMEOUT_S).min(self.shared.timeout),
            None => self.shared.timeout,
        };
        let receiving = receiver.receive_seen(|payload| self.tap.received(payload));
        let first = tokio::time::timeout(patience, receiving).await;
        let mut next = first.map_err(|_| ServerError::TimedOut(patience))?;
        loop {
            let message = next?.ok_or(ServerError::Closed)?;
            let event = self
                .account()
                .session
                .receive(&message)
                .map_err(ServerError::Violation)?;
            if event == DisplayEvent::Welcome {
                drop(guest.take());
                receiver.set_longest(MAX_FRAME);
            }
            self.received(event, message)?;
            next = receiver
                .receive_seen(|payload| self.tap.received(payload))
                .await;
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
                if let Some(slot) = self.shared.lock().slots.get_mut(self.server) {
                    slot.status.name = format!("{name} ({shader})").into();
                    slot.status.threads = capabilities.threads;
                    slot.flow = Flow::new(capabilities.threads, Instant::now());
                }
            }
            (DisplayEvent::Ready, _) => {
                let credits = self.account().session.free_credits();
                let mut state = self.shared.lock();
                if let Some(slot) = state.slots.get_mut(self.server) {
                    slot.status.phase = ServerPhase::Ready;
                    slot.status.credits = credits;
                }
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
                if let Some(slot) = self.shared.lock().slots.get_mut(self.server) {
                    tell(&mut slot.status.shadows, lights);
                }
            }
            (DisplayEvent::Status { released }, _) => {
                self.shared.lock().release(self.server, &released);
            }
            (DisplayEvent::Fault(violation), _) => return Err(ServerError::Fault(violation)),
            _ => {}
        }
        self.shared.changed.notify_all();
        self.wake.notify_one();
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

    /// Whether there is anyone else to ask.
    pub(super) fn has_others(&self) -> bool {
        self.shared.lock().slots.iter().nth(1).is_some()
    }

    /// Has others asked for what this server should have answered by now.
    pub(super) fn relieve(&self) {
        let mut state = self.shared.lock();
        let overdue = state.overdue(self.server, Instant::now());
        if overdue == 0 {
            return;
        }
        let account = self.account();
        let mut held: Vec<_> = account
            .session
            .held()
            .filter(|held| !state.is_asked_again(held.request.id))
            .copied()
            .collect();
        drop(account);
        // What was asked last is furthest from being answered.
        held.sort_unstable_by_key(|held| held.request.id);
        let first = held.len().saturating_sub(overdue);
        state.ask_again(self.server, held.drain(first..));
    }

    /// Hands what the server held to the others.
    fn release(&self) {
        let held = self.account().session.take_outstanding();
        let mut state = self.shared.lock();
        state.hand_back(self.server, &held);
        if let Some(slot) = state.slots.get_mut(self.server) {
            slot.status.credits = 0;
            slot.status.phase = ServerPhase::Connecting;
        }
        state.slots.wake_all();
        drop(state);
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
