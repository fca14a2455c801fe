//! Serves a trace: recorded answers to whatever display asks for them.

use std::collections::BTreeMap;
use std::fmt;
use std::io::Write as _;
use std::net::SocketAddr;
use std::path::Path;
use std::rc::Rc;
use std::time::Duration;

use protocol::ToServer;
use protocol::framing::{FrameError, Receiver, Sender, server_side};
use protocol::messages::{Capabilities, FaultCode, ToDisplay};
use protocol::session::{ServerEvent, ServerSession, Violation};
use tokio::io::{ReadHalf, WriteHalf};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::Instant;

use super::answers::{self, Answers};
use super::desk::{Desk, Due, Reply, Served};
use super::open::{ReplayError, Trouble};
use crate::cli::ReplayArgs;

/// How long a display may ask for nothing but what is not in the trace.
const GRACE: Duration = Duration::from_secs(5);
/// How long the last message may take.
const FAREWELL: Duration = Duration::from_secs(2);
/// Displays served at once; more wait to be accepted.
const MOST_DISPLAYS: usize = 16;

impl fmt::Display for Served {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            asked,
            answered,
            unknown,
        } = self;
        write!(
            f,
            "{asked} requests, {answered} answered, {unknown} not in the trace"
        )
    }
}

/// Serves the recorded answers at an address of this machine, which is printed as `listening on ADDR`, until interrupted,
/// or until the first display has left with `--once`. With `--real-time` each answer takes as long as it did. False if
/// a display asked for what is not in the trace.
///
/// # Errors
/// If the trace cannot be replayed or the address not be listened on.
pub fn serve(path: &Path, address: SocketAddr, args: &ReplayArgs) -> Result<bool, ReplayError> {
    run(path, address, args).map_err(|why| ReplayError::new(path, why))
}

fn run(path: &Path, address: SocketAddr, args: &ReplayArgs) -> Result<bool, Trouble> {
    if !address.ip().is_loopback() {
        return Err(Trouble::NotLoopback(address.to_string()));
    }
    let answers = Rc::new(answers::read(path)?);
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    let served = runtime.block_on(tokio::task::LocalSet::new().run_until(async {
        let listener = TcpListener::bind(address).await?;
        let mut out = std::io::stdout();
        writeln!(out, "listening on {}", listener.local_addr()?)?;
        out.flush()?;
        tokio::select! {
            served = accept(&listener, &answers, args) => served,
            () = stopped(args.parent_stdin) => Ok(Served::default()),
        }
    }))?;
    // Reading standard input cannot be interrupted; nothing else is worth waiting for.
    runtime.shutdown_background();
    Ok(served.unknown == 0)
}

async fn accept(
    listener: &TcpListener,
    answers: &Rc<Answers>,
    args: &ReplayArgs,
) -> Result<Served, Trouble> {
    let mut all = tokio::task::JoinSet::new();
    let mut displays = 0;
    loop {
        tokio::select! {
            accepted = listener.accept(), if all.len() < MOST_DISPLAYS && !(args.once && displays > 0) => {
                let stream = accepted?.0;
                stream.set_nodelay(true)?;
                displays += 1;
                let (answers, real_time) = (Rc::clone(answers), args.real_time);
                all.spawn_local(async move { (displays, attend(stream, &answers, real_time).await) });
            }
            Some(done) = all.join_next() => {
                let Ok((display, served)) = done else { continue };
                // Whoever reads this may have stopped reading: the displays are served all the same.
                let _ = writeln!(std::io::stdout(), "display {display}: {served}");
                if args.once {
                    return Ok(served);
                }
            }
        }
    }
}

/// Done when there is nobody to serve for any more.
async fn stopped(parent_stdin: bool) {
    let (end_of_input, ended) = tokio::sync::oneshot::channel();
    if parent_stdin {
        std::thread::spawn(move || {
            // Whatever ends reading, an error included, the parent is gone.
            let _ = std::io::copy(&mut std::io::stdin().lock(), &mut std::io::sink());
            let _ = end_of_input.send(());
        });
        let _ = ended.await;
    } else if tokio::signal::ctrl_c().await.is_err() {
        // Without a way to hear of interrupts the process ends by them all the same.
        std::future::pending::<()>().await;
    }
}

type Incoming = Receiver<ReadHalf<TcpStream>, ToServer>;
type Outgoing = Sender<WriteHalf<TcpStream>, ToDisplay>;

/// Serves one display until it leaves, or breaks a rule.
async fn attend(stream: TcpStream, answers: &Answers, real_time: bool) -> Served {
    let (mut incoming, outgoing) = server_side(stream);
    let mut counter = Counter {
        session: ServerSession::new(
            offer(&answers.welcome),
            vec![answers.header.digest],
            answers.header.scene_bytes,
        ),
        desk: Desk::new(answers),
        outgoing,
        queue: BTreeMap::new(),
        patience: None,
        last: 0,
        real_time,
        traced: 0,
        version: 0,
    };
    let end = counter.work(&mut incoming, answers).await;
    let fault = match &end {
        Err(FrameError::Io(_)) | Ok(None) => None,
        Ok(Some(violation)) => Some(violation.clone()),
        Err(error) => Violation::of_frame(error),
    };
    if let Some(violation) = fault {
        tracing::warn!("a display is closed: {violation}");
        let told = async {
            if counter.outgoing.send(&violation.to_display()).await.is_ok()
                && counter.outgoing.close().await.is_ok()
            {
                incoming.discard().await;
            }
        };
        // A display that goes on sending is not waited for.
        let _ = tokio::time::timeout(FAREWELL, told).await;
    }
    counter.desk.served
}

fn offer(welcome: &ToDisplay) -> Capabilities {
    match welcome {
        ToDisplay::Welcome { capabilities, .. } => capabilities.clone(),
        _ => Capabilities {
            credits: 1,
            max_batch: 1,
            triples: true,
            edits: true,
            threads: 1,
        },
    }
}

/// A display that is being served.
struct Counter<'a> {
    session: ServerSession,
    desk: Desk<'a>,
    outgoing: Outgoing,
    /// What is to be sent, by when.
    queue: BTreeMap<(Instant, u64), Reply>,
    /// Until when it may ask for nothing but what is not in the trace, once it does.
    patience: Option<Instant>,
    last: u64,
    real_time: bool,
    traced: u64,
    version: u16,
}

impl Counter<'_> {
    async fn work(
        &mut self,
        incoming: &mut Incoming,
        answers: &Answers,
    ) -> Result<Option<Violation>, FrameError> {
        loop {
            self.send_due().await?;
            let next = self.queue.keys().next().map(|(when, _)| *when);
            let stuck = !self.desk.held.is_empty() && self.desk.held.len() == self.session.held();
            // A display that waits still sends pings.
            self.patience = match self.patience {
                _ if !stuck => None,
                None => Some(Instant::now() + GRACE),
                since => since,
            };
            let message = tokio::select! {
                message = incoming.receive() => message?,
                () = at(next) => continue,
                () = at(self.patience) => return Ok(Some(self.stranger())),
            };
            let Some(message) = message else {
                return Ok(None);
            };
            match self.session.receive(message) {
                Ok(ServerEvent::Goodbye(fault)) => {
                    if let Some(fault) = fault {
                        tracing::warn!("the display reports {:?}: {fault}", fault.code);
                    }
                    return Ok(None);
                }
                Ok(event) => {
                    if let Some(violation) = self.answer(event, answers).await? {
                        return Ok(Some(violation));
                    }
                }
                Err(violation) => return Ok(Some(violation)),
            }
        }
    }

    async fn answer(
        &mut self,
        event: ServerEvent,
        answers: &Answers,
    ) -> Result<Option<Violation>, FrameError> {
        let reply = match event {
            ServerEvent::Hello { version, .. } => {
                self.version = version;
                self.desk.welcome(version)
            }
            ServerEvent::Held(digest) => {
                self.session.scene_built(&answers.scene);
                self.outgoing
                    .feed(&ToDisplay::SceneReady { digest })
                    .await?;
                if let Some(opening) = self.desk.opening(self.version) {
                    self.outgoing.feed(&opening).await?;
                }
                return self.outgoing.flush().await.map(|()| None);
            }
            ServerEvent::Scene(..) => {
                let text = "the trace was recorded with another scene";
                return Ok(Some(Violation::new(FaultCode::Unsupported, text)));
            }
            ServerEvent::Request {
                view,
                camera,
                samples,
            } => {
                let due = self.desk.ask(view, &camera, &samples);
                self.put(due);
                return Ok(None);
            }
            ServerEvent::Edit { epoch, .. } => {
                let due = self.desk.edit(epoch);
                self.put(due);
                return Ok(None);
            }
            ServerEvent::Cancel { views_before } => {
                self.desk.cancel(views_before);
                ToDisplay::Status {
                    queued: self.session.held() as u32,
                    traced: self.traced,
                    rays: 0,
                    cancelled_before: views_before,
                }
            }
            ServerEvent::Ping { token } => ToDisplay::Pong { token },
            _ => return Ok(None),
        };
        self.outgoing.send(&reply).await?;
        Ok(None)
    }

    fn put(&mut self, due: Vec<Due>) {
        let now = Instant::now();
        for (latency, reply) in due {
            let when = if self.real_time { now + latency } else { now };
            self.last += 1;
            self.queue.insert((when, self.last), reply);
        }
    }

    async fn send_due(&mut self) -> Result<(), FrameError> {
        let now = Instant::now();
        while let Some(first) = self.queue.first_entry()
            && first.key().0 <= now
        {
            let reply = first.remove();
            let session = &mut self.session;
            if let Some(message) = self.desk.message(reply, |id| session.release(id)) {
                self.traced = self.desk.served.answered as u64;
                self.outgoing.feed(&message).await?;
            }
        }
        self.outgoing.flush().await
    }

    fn stranger(&self) -> Violation {
        let (view, id) = self.desk.stranger.unwrap_or_default();
        let text = format!(
            "{} requests are not in the trace, the first is {id} of view {view}: start the display as it was when it was recorded",
            self.desk.served.unknown
        );
        Violation::new(FaultCode::Unsupported, text)
    }
}

/// Done at this time, or never.
async fn at(when: Option<Instant>) {
    match when {
        Some(when) => tokio::time::sleep_until(when).await,
        None => std::future::pending().await,
    }
}
