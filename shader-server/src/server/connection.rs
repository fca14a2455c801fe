//! One display: messages in, messages out.

use std::{collections::VecDeque, net::SocketAddr, sync::Arc, time::Duration};

use protocol::{
    ToDisplay, ToServer,
    doorway::Guest,
    framing::{FrameError, Receiver, Sender, server_side},
    limits::{AUTH_TIMEOUT_S, MAX_FRAME, MAX_GREETING},
    messages::{Digest, FaultCode},
    scene::Scene,
    session::{ServerEvent, ServerSession, Violation},
    transfer::Assembler,
};
use tokio::{
    io::{ReadHalf, WriteHalf},
    net::TcpStream,
    sync::oneshot,
    time::{MissedTickBehavior, interval, timeout},
};

use super::{
    MAX_DISPLAYS, Shared,
    desk::{Current, Desk},
};
use crate::{
    camera::Pinhole,
    irradiance::Patience,
    shadows::{Chosen, Wish},
    stage::{Stage, StageError},
};

/// Time for a display's first message.
const GREETING: Duration = Duration::from_secs(AUTH_TIMEOUT_S);
/// Time to write what is left when a connection ends.
const FAREWELL: Duration = Duration::from_secs(2);
/// A display that takes none of what is written for so long is gone.
const STALL: Duration = Duration::from_secs(30);
/// Between reports on how it goes.
const REPORT: Duration = Duration::from_secs(1);

/// Messages read ahead while a scene is being built or edited.
const MOST_WAITING: usize = 16;

type Incoming = Receiver<ReadHalf<TcpStream>, ToServer>;
type Outgoing = Sender<WriteHalf<TcpStream>, ToDisplay>;

/// How a connection ends.
enum End {
    /// The display left, or was never there.
    Gone,
    /// It broke a rule, or the server failed it.
    Violation(Violation),
}

impl From<Violation> for End {
    fn from(violation: Violation) -> Self {
        Self::Violation(violation)
    }
}

impl From<FrameError> for End {
    fn from(error: FrameError) -> Self {
        Violation::of_frame(&error).map_or(Self::Gone, Self::Violation)
    }
}

struct Connection {
    shared: Arc<Shared>,
    desk: Arc<Desk>,
    held: Vec<(Digest, Arc<Stage>)>,
    address: SocketAddr,
}

/// Serves one display, which may be a stranger, until it leaves or breaks a rule.
pub(super) async fn serve(
    shared: &Arc<Shared>,
    stream: TcpStream,
    address: SocketAddr,
    mut guest: Option<Guest>,
) {
    let held = shared.cache.snapshot();
    let digests = held.iter().map(|(digest, _)| *digest).collect();
    let rules = ServerSession::new(
        shared.capabilities(),
        digests,
        shared.config.max_scene_bytes,
    );
    let desk = Desk::new(Arc::clone(shared), rules);
    let (mut incoming, outgoing) = server_side(stream);
    incoming.set_longest(MAX_GREETING);
    let connection = Connection {
        shared: Arc::clone(shared),
        desk: Arc::clone(&desk),
        held,
        address,
    };
    // Dropped however this ends, so that chunks of a display that left are not traced.
    let _closer = Closer(Arc::clone(&desk));

    let writing = write(Arc::clone(&desk), outgoing);
    tokio::pin!(writing);
    let end = tokio::select! {
        end = connection.read(&mut incoming, &mut guest) => end,
        () = &mut writing => return,
    };
    match end {
        End::Gone => desk.close(None),
        End::Violation(violation) => {
            tracing::warn!("{address}: closed: {violation}");
            desk.close(Some(&violation));
        }
    }
    // A display that does not read its last messages loses them.
    let _ = timeout(FAREWELL, async {
        writing.await;
        incoming.discard().await;
    })
    .await;
}

struct Closer(Arc<Desk>);

impl Drop for Closer {
    fn drop(&mut self) {
        self.0.close(None);
    }
}

/// Writes until nothing will come any more or the display is gone, or takes nothing for too long.
async fn write(desk: Arc<Desk>, mut outgoing: Outgoing) {
    let mut reports = interval(REPORT);
    reports.set_missed_tick_behavior(MissedTickBehavior::Delay);
    while let Some(messages) = desk.take_outgoing() {
        if messages.is_empty() {
            tokio::select! {
                () = desk.to_write.notified() => {}
                _ = reports.tick() => desk.report(),
            }
            continue;
        }
        for message in &messages {
            if let Err(error) = in_time(outgoing.feed(message)).await {
                tracing::debug!("cannot write: {error}");
                return;
            }
        }
        if let Err(error) = in_time(outgoing.flush()).await {
            tracing::debug!("cannot write: {error}");
            return;
        }
    }
    let _ = outgoing.close().await;
}

async fn in_time(writing: impl Future<Output = Result<(), FrameError>>) -> Result<(), FrameError> {
    timeout(STALL, writing)
        .await
        .unwrap_or_else(|_| Err(std::io::Error::from(std::io::ErrorKind::TimedOut).into()))
}

impl Connection {
    async fn read(&self, incoming: &mut Incoming, guest: &mut Option<Guest>) -> End {
        let Ok(first) = timeout(GREETING, incoming.receive()).await else {
            let text = format!("no Hello within {} s", GREETING.as_secs());
            return Violation::new(FaultCode::OutOfOrder, text).into();
        };
        // Held for as long as one of so many displays is served.
        let _place = if matches!(first, Ok(Some(ToServer::Hello { .. }))) {
            match Arc::clone(&self.shared.places).try_acquire_owned() {
                Ok(place) => {
                    // Whoever says something else stays a guest until it is gone.
                    *guest = None;
                    Some(place)
                }
                Err(_) => {
                    let text = format!("this server works for {MAX_DISPLAYS} displays already");
                    return Violation::new(FaultCode::Limit, text).into();
                }
            }
        } else {
            None
        };
        incoming.set_longest(MAX_FRAME);
        let mut waiting = VecDeque::new();
        let mut next = first;
        loop {
            let message = match next {
                Ok(Some(message)) => message,
                Ok(None) => return End::Gone,
                Err(error) => return error.into(),
            };
            if let Err(end) = self.attend(message, incoming, &mut waiting).await {
                return end;
            }
            while self.desk.is_full() {
                self.desk.room.notified().await;
            }
            next = match waiting.pop_front() {
                Some(message) => Ok(Some(message)),
                None => incoming.receive().await,
            };
        }
    }

    /// Does what a message asks for. Meanwhile pings are answered and the display's end is noticed, since a scene or an edit
    /// may take long; other messages wait for their turn in `waiting`.
    async fn attend(
        &self,
        message: ToServer,
        incoming: &mut Incoming,
        waiting: &mut VecDeque<ToServer>,
    ) -> Result<(), End> {
        let work = self.take(message);
        tokio::pin!(work);
        loop {
            // The answers to pings that a display does not read must not pile up either.
            let full = self.desk.is_full();
            let next = tokio::select! {
                biased;
                done = &mut work => return done,
                () = self.desk.room.notified(), if full => continue,
                next = incoming.receive(), if waiting.len() < MOST_WAITING && !full => next?,
            };
            match next {
                Some(message @ ToServer::Ping { .. }) => self.take(message).await?,
                Some(message) => waiting.push_back(message),
                None => return Err(End::Gone),
            }
        }
    }

    async fn take(&self, message: ToServer) -> Result<(), End> {
        let event = self.desk.state().rules.receive(message)?;
        match event {
            ServerEvent::Hello {
                version,
                name,
                seed,
            } => {
                tracing::info!("{}: this is {name}", self.address);
                let mut state = self.desk.state();
                (state.seed, state.version) = (seed, version);
                drop(state);
                self.desk.send(self.welcome(version));
            }
            ServerEvent::Held(digest) => self.reuse(digest).await?,
            ServerEvent::Scene(digest, assembler) => self.build(digest, assembler).await?,
            ServerEvent::Request {
                view,
                camera,
                samples,
            } => {
                self.desk.request(view, Pinhole::new(&camera), samples);
            }
            ServerEvent::Edit {
                epoch,
                objects,
                lights,
            } => {
                let now = self.desk.current().ok_or(End::Gone)?;
                let edited = self.on_pool(move || {
                    let stage = now.stage.edited(&objects, &lights)?;
                    Ok(Current {
                        visibility: Arc::new(now.visibility.after(
                            (&now.stage, &stage),
                            &objects,
                            &lights,
                        )),
                        stage: Arc::new(stage),
                        epoch,
                    })
                });
                let edited: Result<Current, StageError> = edited.await?;
                self.desk
                    .set(edited.map_err(|e| Violation::new(FaultCode::Value, e.to_string()))?);
            }
            ServerEvent::Cancel { views_before } => self.desk.cancel(views_before),
            ServerEvent::Shadows {
                steady,
                error,
                methods,
            } => {
                self.desk.state().wish = Wish {
                    steady,
                    error,
                    methods,
                };
            }
            ServerEvent::Ping { token } => self.desk.send(ToDisplay::Pong { token }),
            ServerEvent::Goodbye(reason) => {
                if let Some(violation) = reason {
                    tracing::warn!("{}: the display left: {violation}", self.address);
                }
                return Err(End::Gone);
            }
            ServerEvent::More | ServerEvent::View { .. } => {}
        }
        Ok(())
    }

    fn welcome(&self, version: u16) -> ToDisplay {
        ToDisplay::Welcome {
            version,
            name: concat!("shader-server ", env!("CARGO_PKG_VERSION")).into(),
            shader: "direct, glossy, global".into(),
            capabilities: self.shared.capabilities(),
            holds: self.held.iter().map(|(digest, _)| *digest).collect(),
        }
    }

    async fn reuse(&self, digest: Digest) -> Result<(), End> {
        let stage = self
            .held
            .iter()
            .find(|(held, _)| *held == digest)
            .map(|(_, stage)| stage);
        let stage = stage.ok_or_else(|| internal("a scene that was held is gone"))?;
        let mut stage = Arc::clone(stage);
        if stage.patience().is_some_and(|held| held != self.patience()) {
            // Whoever has patience must not meet what is held for those without, and the other way round.
            stage = Arc::new((*stage).clone().with_patience(self.patience()));
        }
        self.ready(digest, stage).await
    }

    async fn build(&self, digest: Digest, assembler: Assembler) -> Result<(), End> {
        let patience = self.patience();
        let built = self.on_pool(move || {
            let scene: Scene = assembler.finish().map_err(|e| Violation::from(&e))?;
            Stage::build(Arc::new(scene))
                .map(|stage| stage.with_patience(patience))
                .map_err(|e| Violation::new(FaultCode::Value, e.to_string()))
        });
        let stage = built.await??;
        self.ready(digest, Arc::new(stage)).await
    }

    /// What the display wishes, or who started the server.
    fn patience(&self) -> Patience {
        if self.desk.state().wish.steady {
            Patience::Final
        } else {
            self.shared.config.patience
        }
    }

    async fn ready(&self, digest: Digest, stage: Arc<Stage>) -> Result<(), End> {
        self.shared.cache.touch(digest, &stage);
        let (options, wish) = (self.shared.config.shadows, self.desk.state().wish.clone());
        let now = self.on_pool(move || Current {
            visibility: Arc::new(Chosen::new(&stage, options, wish)),
            stage,
            epoch: 0,
        });
        let now = now.await?;
        self.desk.state().rules.scene_built(now.stage.scene());
        self.desk.send(ToDisplay::SceneReady { digest });
        self.desk.set(now);
        Ok(())
    }

    /// Runs something long where rays run.
    async fn on_pool<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, End> {
        let (give, take) = oneshot::channel();
        self.shared.pool.spawn_fifo(move || {
            // Of displays that come, send and leave at once, nothing may wait for its turn for nothing.
            if give.is_closed() {
                return;
            }
            let _ = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work))
                .map(|value| give.send(value));
        });
        take.await
            .map_err(|_| internal("work on the scene failed; this is a defect of the server"))
    }
}

fn internal(text: &str) -> End {
    Violation::new(FaultCode::Internal, text).into()
}
