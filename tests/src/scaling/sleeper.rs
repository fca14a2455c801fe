//! A shader server that takes a fixed time for each sample, and none of the processor's.

use std::collections::VecDeque;
use std::io;
use std::net::SocketAddr;
use std::thread::JoinHandle;

use protocol::framing::server_side;
use protocol::messages::{Capabilities, NO_OBJECT, Sample, SampleRequest, flags};
use protocol::session::{ServerEvent, ServerSession};
use protocol::{ToDisplay, ToServer};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::oneshot;
use tokio::time::{Duration, Instant, sleep_until};

/// Most samples in a message.
const PORTION: usize = 64;
/// Samples are sent this far apart at least, unless a message is full.
const GAP: Duration = Duration::from_millis(5);

/// The server; it ends when dropped.
pub struct Sleeper {
    address: SocketAddr,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Sleeper {
    /// Starts one that does so many samples a second, on a free loopback port.
    ///
    /// # Errors
    /// If it cannot listen or be started.
    pub fn start(speed: f64) -> io::Result<Self> {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()?;
        let listener = runtime.block_on(TcpListener::bind("127.0.0.1:0"))?;
        let address = listener.local_addr()?;
        let (stop, mut stopped) = oneshot::channel();
        let thread = std::thread::Builder::new()
            .name("sleeper".into())
            .spawn(move || {
                runtime.block_on(async move {
                    loop {
                        let accepted = tokio::select! {
                            accepted = listener.accept() => accepted,
                            _ = &mut stopped => return,
                        };
                        let Ok((stream, _)) = accepted else { continue };
                        tokio::select! {
                            () = serve(stream, speed) => {}
                            _ = &mut stopped => return,
                        }
                    }
                });
            })?;
        Ok(Self {
            address,
            stop: Some(stop),
            thread: Some(thread),
        })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for Sleeper {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.stop.take().map(|stop| stop.send(()));
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// What waits to be answered, and when the next answer is due.
struct Bed {
    waiting: VecDeque<(u32, SampleRequest)>,
    /// Time of one sample.
    each: Duration,
    /// When the first of those that wait was begun.
    begun: Instant,
}

impl Bed {
    fn lay(&mut self, view: u32, samples: Vec<SampleRequest>) {
        if self.waiting.is_empty() {
            self.begun = Instant::now();
        }
        self.waiting.extend(samples.into_iter().map(|r| (view, r)));
    }

    /// When to look again.
    fn next(&self) -> Instant {
        let count = self.waiting.len().min(PORTION) as u32;
        self.begun + (self.each * count).min(self.each.max(GAP))
    }

    /// Everything of one view that is done by now.
    fn wake(&mut self) -> Option<(u32, Vec<SampleRequest>)> {
        let view = self.waiting.front()?.0;
        let mut done = Vec::new();
        while done.len() < PORTION
            && self.begun + self.each <= Instant::now()
            && let Some(&(of, request)) = self.waiting.front()
            && of == view
        {
            done.push(request);
            self.waiting.pop_front();
            self.begun += self.each;
        }
        (!done.is_empty()).then_some((view, done))
    }
}

async fn serve(stream: TcpStream, speed: f64) {
    // Without it answers wait for more to come; how fast a stream is says nothing of right or wrong.
    let _ = stream.set_nodelay(true);
    let (mut receiver, mut sender) = server_side(stream);
    let offer = Capabilities {
        credits: 1 << 16,
        max_batch: 1 << 15,
        triples: false,
        edits: false,
        threads: 1,
    };
    let mut session = ServerSession::new(offer.clone(), vec![], 1 << 20);
    let mut bed = Bed {
        waiting: VecDeque::new(),
        each: Duration::try_from_secs_f64(1.0 / speed).unwrap_or_default(),
        begun: Instant::now(),
    };
    loop {
        let mut replies = Vec::new();
        tokio::select! {
            message = receiver.receive() => {
                let Ok(Some(message)) = message else { return };
                if take(message, &mut session, &offer, &mut bed, &mut replies).is_none() {
                    return;
                }
            }
            () = sleep_until(bed.next()), if !bed.waiting.is_empty() => {
                while let Some((view, done)) = bed.wake() {
                    let samples: Vec<Sample> = done
                        .iter()
                        .filter(|request| session.release(request.id))
                        .map(answer)
                        .collect();
                    if !samples.is_empty() {
                        replies.push(ToDisplay::Samples { view, epoch: 0, samples });
                    }
                }
            }
        }
        for reply in &replies {
            if sender.feed(reply).await.is_err() {
                return;
            }
        }
        if sender.flush().await.is_err() {
            return;
        }
    }
}

/// Does as a message asks; nothing when the display is done or breaks a rule.
fn take(
    message: ToServer,
    session: &mut ServerSession,
    offer: &Capabilities,
    bed: &mut Bed,
    replies: &mut Vec<ToDisplay>,
) -> Option<()> {
    match session.receive(message).ok()? {
        ServerEvent::Hello { version, .. } => replies.push(ToDisplay::Welcome {
            version,
            name: "sleeper".into(),
            shader: "nothing".into(),
            capabilities: offer.clone(),
            holds: vec![],
        }),
        ServerEvent::Scene(digest, assembler) => {
            session.scene_built(&assembler.finish().ok()?);
            replies.push(ToDisplay::SceneReady { digest });
        }
        ServerEvent::Request { view, samples, .. } => bed.lay(view, samples),
        ServerEvent::Cancel { views_before } => {
            bed.waiting.retain(|(view, _)| *view >= views_before);
            replies.push(ToDisplay::Status {
                queued: session.held() as u32,
                traced: 0,
                rays: 0,
                cancelled_before: views_before,
            });
        }
        ServerEvent::Ping { token } => replies.push(ToDisplay::Pong { token }),
        ServerEvent::Goodbye(_) => return None,
        _ => {}
    }
    Some(())
}

fn answer(request: &SampleRequest) -> Sample {
    Sample {
        id: request.id,
        position: [0.0, 0.0, -1.0],
        object: NO_OBJECT,
        radiance: [0.0; 3],
        flags: flags::MISS,
    }
}
