//! Plays the display of a trace to shader servers.

use std::collections::{BTreeSet, HashMap};
use std::io::Write as _;
use std::net::SocketAddr;
use std::path::Path;
use std::time::Duration;

use protocol::ToServer;
use protocol::framing::{FrameError, Receiver, Sender, display_side};
use protocol::messages::{ToDisplay, Triple};
use protocol::session::{DisplayEvent, DisplaySession, Violation};
use protocol::transfer::{EncodedScene, TransferError};
use tokio::io::{ReadHalf, WriteHalf};
use tokio::net::TcpStream;
use tokio::time::Instant;

use super::compare::Compared;
use super::follow::{News, news, note};
use super::open::{ReplayError, Trouble};
use super::script::{self, Script, Scripts};

/// How long a server may say nothing while something is to be answered.
const PATIENCE: Duration = Duration::from_secs(60);
/// How long a server may take to close after the last message.
const FAREWELL: Duration = Duration::from_secs(2);

/// Plays each connection of the recorded display to one of these servers of this machine, by turns, and prints how far their
/// answers are the recorded ones: as fast as servers answer and the recorded order allows, or with `real_time` not before
/// its time. False if a server broke a rule, or did not answer.
///
/// # Errors
/// If the trace cannot be replayed or a server not be connected to.
pub fn play(path: &Path, servers: &[String], real_time: bool) -> Result<bool, ReplayError> {
    run(path, servers, real_time).map_err(|why| ReplayError::new(path, why))
}

fn run(path: &Path, servers: &[String], real_time: bool) -> Result<bool, Trouble> {
    let Scripts {
        header,
        size,
        encoded,
        scripts,
    } = script::read(path)?;
    let scene = protocol::decode(&encoded).map_err(TransferError::from)?;
    let encoded = EncodedScene::new(&scene)?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    runtime.block_on(async {
        let mut plays = Vec::new();
        for ((connection, script), address) in scripts.into_iter().zip(servers.iter().cycle()) {
            let stream = connect(address).await?;
            let (receiver, sender) = display_side(stream);
            let player = Player {
                sender,
                session: DisplaySession::new(size),
                encoded: &encoded,
                digest: header.digest,
                script,
                asked: HashMap::new(),
                told: BTreeSet::new(),
                compared: Compared::default(),
                answered: 0,
                holds: false,
                start: Instant::now(),
                real_time,
            };
            plays.push(async move { (connection, player.play(receiver).await) });
        }
        let mut good = true;
        for (connection, (name, end)) in futures_util::future::join_all(plays).await {
            let told = match end {
                Ok(compared) => compared.to_string(),
                Err(why) => {
                    good = false;
                    why
                }
            };
            // Whoever reads this may have stopped reading: the exit code says it too.
            let _ = writeln!(std::io::stdout(), "connection {connection}, {name}: {told}");
        }
        Ok(good)
    })
}

async fn connect(address: &str) -> Result<TcpStream, Trouble> {
    let found: Vec<SocketAddr> = tokio::net::lookup_host(address).await?.collect();
    let local: Vec<SocketAddr> = found.into_iter().filter(|a| a.ip().is_loopback()).collect();
    if local.is_empty() {
        return Err(Trouble::NotLoopback(address.to_owned()));
    }
    let connecting = TcpStream::connect(&local[..]);
    let stream = connecting
        .await
        .map_err(|e| std::io::Error::new(e.kind(), format!("cannot connect to {address}: {e}")))?;
    stream.set_nodelay(true)?;
    Ok(stream)
}

/// A recorded connection that is being played.
struct Player<'a> {
    sender: Sender<WriteHalf<TcpStream>, ToServer>,
    session: DisplaySession,
    encoded: &'a EncodedScene,
    digest: protocol::messages::Digest,
    script: Script,
    /// Views of requests under way that were answered when this was recorded.
    asked: HashMap<u64, u32>,
    told: BTreeSet<(u32, Triple)>,
    compared: Compared,
    answered: usize,
    /// The server has the scene that was announced.
    holds: bool,
    start: Instant,
    real_time: bool,
}

/// Whether the next message may go.
enum Turn {
    Now,
    At(Instant),
    /// When the server has said something more.
    Later,
    /// Nothing more is to be said.
    Over,
}

impl Player<'_> {
    /// Gives the server's name, and how far its answers are those recorded, or what is wrong with it.
    async fn play(
        mut self,
        mut receiver: Receiver<ReadHalf<TcpStream>, ToDisplay>,
    ) -> (String, Result<Compared, String>) {
        let end = self.work(&mut receiver).await;
        let name = match self.session.name() {
            "" => "a server without a name".to_owned(),
            name => name.to_owned(),
        };
        let told = match end {
            Ok(()) => {
                let _ = self.sender.send(&ToServer::Goodbye).await;
                let _ = self.sender.close().await;
                let _ = tokio::time::timeout(FAREWELL, receiver.discard()).await;
                self.compared.add_triples(&self.script, &self.told);
                return (name, Ok(self.compared));
            }
            Err(why) => why,
        };
        let answered = format!("after {} answers", self.answered);
        let why = match told {
            Fail::Rule(violation) => {
                let _ = self.sender.send(&violation.to_server()).await;
                format!("it broke a rule {answered}: {violation}")
            }
            Fail::Fault(fault) => format!("it reports {:?} {answered}: {fault}", fault.code),
            Fail::Frame(error) => format!("{answered}: {error}"),
            Fail::Closed => format!(
                "it closed the connection {answered}, with {} to come",
                self.asked.len()
            ),
            Fail::Silent => format!(
                "it said nothing for {} s {answered}, with {} to come",
                PATIENCE.as_secs(),
                self.asked.len()
            ),
        };
        (name, Err(why))
    }

    async fn work(
        &mut self,
        receiver: &mut Receiver<ReadHalf<TcpStream>, ToDisplay>,
    ) -> Result<(), Fail> {
        loop {
            let due = match self.turn() {
                Turn::Over => return Ok(()),
                Turn::Now => {
                    self.say().await?;
                    continue;
                }
                Turn::At(when) => Some(when),
                Turn::Later => None,
            };
            self.sender.flush().await.map_err(Fail::of)?;
            let silent = Instant::now() + PATIENCE;
            let message = tokio::select! {
                message = receiver.receive() => message.map_err(Fail::of)?.ok_or(Fail::Closed)?,
                () = tokio::time::sleep_until(due.unwrap_or(silent)) => match due {
                    Some(_) => continue,
                    None => return Err(Fail::Silent),
                },
            };
            self.hear(message)?;
        }
    }

    fn turn(&self) -> Turn {
        let Some((after, message)) = self.script.sent.front() else {
            return if self.asked.is_empty() {
                Turn::Over
            } else {
                Turn::Later
            };
        };
        let settled = |epoch: u32| {
            let came = |id: &u64| self.script.came.get(id).copied().unwrap_or(0);
            self.asked.keys().all(|id| came(id) >= epoch)
        };
        let ready = self.session.is_ready();
        let may = match message {
            ToServer::Hello { .. } => true,
            ToServer::Shadows { .. }
            | ToServer::SceneBegin { .. }
            | ToServer::SceneChunk { .. }
            | ToServer::Ping { .. } => self.session.capabilities().is_some(),
            ToServer::View { .. } => ready,
            ToServer::Request { .. } => ready && self.session.free_credits() > 0,
            // What came before the edit is to be answered before it again.
            ToServer::Edit { epoch, .. } => ready && settled(*epoch),
            ToServer::Cancel { views_before } => {
                ready && self.asked.values().all(|view| view >= views_before)
            }
            ToServer::Goodbye | ToServer::Fault { .. } => self.asked.is_empty(),
        };
        let when = self.start + *after;
        match may {
            false => Turn::Later,
            true if self.real_time && Instant::now() < when => Turn::At(when),
            true => Turn::Now,
        }
    }

    /// Sends the next message, or of requests as many as the server takes.
    async fn say(&mut self) -> Result<(), Fail> {
        let Some((after, message)) = self.script.sent.pop_front() else {
            return Ok(());
        };
        match message {
            ToServer::Goodbye | ToServer::Fault { .. } => {
                self.script.sent.clear();
                return Ok(());
            }
            ToServer::Edit { .. } if self.session.capabilities().is_some_and(|c| !c.edits) => {
                tracing::warn!("the server takes no edits: played up to the first");
                self.script.sent.clear();
                return Ok(());
            }
            ToServer::Shadows { .. } if !self.session.takes_shadows() => return Ok(()),
            ToServer::SceneChunk { .. } if self.holds => return Ok(()),
            ToServer::SceneBegin { digest, .. } => {
                self.holds = self.session.announce(digest);
                self.put(&message).await?;
                if digest == self.digest && !self.holds {
                    let encoded = self.encoded;
                    for chunk in encoded.chunks() {
                        self.put(&chunk).await?;
                    }
                }
                // Chunks of this scene that the trace has are of no use any more.
                self.holds |= digest == self.digest;
                return Ok(());
            }
            ToServer::Request { view, mut samples } => {
                let offer = self.session.capabilities();
                let batch = offer.map_or(0, |offer| offer.max_batch as usize);
                let most = self.session.free_credits().min(batch).max(1);
                if samples.len() > most {
                    let samples = samples.split_off(most);
                    let rest = ToServer::Request { view, samples };
                    self.script.sent.push_front((after, rest));
                }
                let answered = samples.iter().map(|request| request.id);
                let answered = answered.filter(|id| self.script.answers.contains_key(id));
                self.asked.extend(answered.map(|id| (id, view)));
                return self.put(&ToServer::Request { view, samples }).await;
            }
            _ => {}
        }
        self.put(&message).await
    }

    async fn put(&mut self, message: &ToServer) -> Result<(), Fail> {
        if !matches!(message, ToServer::SceneBegin { .. }) {
            note(&mut self.session, message);
        }
        self.sender.feed(message).await.map_err(Fail::of)
    }

    fn hear(&mut self, message: ToDisplay) -> Result<(), Fail> {
        match self.session.receive(&message).map_err(Fail::Rule)? {
            DisplayEvent::Fault(fault) => return Err(Fail::Fault(fault)),
            DisplayEvent::Status { .. } => {
                let ToDisplay::Status {
                    cancelled_before, ..
                } = message
                else {
                    return Ok(());
                };
                self.asked.retain(|_, view| *view >= cancelled_before);
            }
            DisplayEvent::Samples | DisplayEvent::Triples => match news(0, message) {
                News::Samples { epoch, samples, .. } => {
                    for (sample, texel) in &samples {
                        self.asked.remove(&sample.id);
                        self.answered += 1;
                        let (script, texel) = (&self.script, texel.as_ref());
                        self.compared.add(script, epoch, sample, texel);
                    }
                }
                News::Triples { epoch, triples, .. } => {
                    self.told.extend(triples.into_iter().map(|t| (epoch, t)));
                }
                News::Other(_) | News::Sent { .. } => {}
            },
            _ => {}
        }
        Ok(())
    }
}

/// Why a server is done with.
enum Fail {
    Rule(Violation),
    Fault(Violation),
    Frame(FrameError),
    Closed,
    Silent,
}

impl Fail {
    fn of(error: FrameError) -> Self {
        match Violation::of_frame(&error) {
            Some(violation) => Self::Rule(violation),
            None => Self::Frame(error),
        }
    }
}
