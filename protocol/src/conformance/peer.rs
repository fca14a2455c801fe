//! A display's end of a connection, on plain blocking sockets: it keeps account of what the server may send, and can be told to break the rules.

use std::collections::HashMap;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

use crate::framing::{HEADER, frame};
use crate::limits::MAX_FRAME;
use crate::messages::{
    Camera, Capabilities, Digest, FaultCode, Sample, SampleRequest, Texel, ToDisplay, ToServer,
    Triple, VERSION,
};
use crate::secret::{Role, dialled};
use crate::session::{DisplaySession, SceneSize};
use crate::transfer::EncodedScene;
use crate::validate::validate_to_display;
use crate::{decode, handshake::MIN_VERSION};

use super::check::{Stop, ensure, failed};
use super::world::{World, camera};
use super::{Bench, Checked};

/// Seed in every `Hello`.
pub(super) const SEED: u64 = 0x5eed;

/// What the next bytes of the server are.
#[derive(Debug)]
pub(super) enum Came {
    Message(ToDisplay),
    /// It closed the connection, well or not.
    Closed,
    /// Nothing in time.
    Nothing,
}

/// What a server said of itself.
#[derive(Clone, Debug)]
pub(super) struct Welcome {
    pub(super) version: u16,
    pub(super) shader: String,
    pub(super) capabilities: Capabilities,
    pub(super) holds: Vec<Digest>,
}

/// An answer, with what it answers.
#[derive(Clone, Debug)]
pub(super) struct Answer {
    pub(super) camera: Camera,
    pub(super) request: SampleRequest,
    pub(super) epoch: u32,
    pub(super) sample: Sample,
    pub(super) texel: Option<Texel>,
    /// Number of the message that it came in.
    pub(super) message: usize,
}

/// A triple, with its epoch and the number of the message that it came in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Told {
    pub(super) epoch: u32,
    pub(super) triple: Triple,
    pub(super) message: usize,
}

pub(super) struct Peer {
    stream: TcpStream,
    timeout: Duration,
    buffer: Vec<u8>,
    session: DisplaySession,
    welcome: Option<Welcome>,
    asked: HashMap<u64, (Camera, SampleRequest)>,
    cameras: HashMap<u32, Camera>,
    messages: usize,
    answers: Vec<Answer>,
    pub(super) told: Vec<Told>,
    /// `cancelled_before` of the last `Status`.
    pub(super) cancelled_before: u32,
}

/// Whether anybody listens.
pub(super) fn reach(bench: &Bench) -> io::Result<()> {
    TcpStream::connect_timeout(&bench.options.address, bench.options.timeout).map(drop)
}

fn open(bench: &Bench) -> io::Result<TcpStream> {
    let timeout = bench.options.timeout;
    let stream = TcpStream::connect_timeout(&bench.options.address, timeout)?;
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(timeout))?;
    Ok(stream)
}

/// Proves the secret on a fresh connection.
fn prove(bench: &Bench, stream: TcpStream) -> io::Result<TcpStream> {
    let Some(secret) = &bench.options.secret else {
        return Ok(stream);
    };
    stream.set_nonblocking(true)?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    let stream = runtime.block_on(async {
        let mut stream = tokio::net::TcpStream::from_std(stream)?;
        dialled(&mut stream, secret, Role::Display)
            .await
            .map_err(io::Error::other)?;
        stream.into_std()
    })?;
    stream.set_nonblocking(false)?;
    Ok(stream)
}

impl Peer {
    /// Connects, and says nothing.
    pub(super) fn connect(bench: &Bench) -> Result<Self, Stop> {
        Self::connect_for(bench, &bench.worlds.lit)
    }

    fn connect_for(bench: &Bench, world: &World) -> Result<Self, Stop> {
        let stream = match open(bench).and_then(|stream| prove(bench, stream)) {
            Ok(stream) => stream,
            Err(error) => return failed("a connection", format!("{error}")),
        };
        Ok(Self {
            stream,
            timeout: bench.options.timeout,
            buffer: Vec::new(),
            session: DisplaySession::new(SceneSize::from(&world.scene)),
            welcome: None,
            asked: HashMap::new(),
            cameras: HashMap::new(),
            messages: 0,
            answers: Vec::new(),
            told: Vec::new(),
            cancelled_before: 0,
        })
    }

    /// A connection as far as `Welcome`.
    pub(super) fn greeted(bench: &Bench) -> Result<Self, Stop> {
        Self::greeted_for(bench, &bench.worlds.lit, VERSION)
    }

    fn greeted_for(bench: &Bench, world: &World, version: u16) -> Result<Self, Stop> {
        let mut peer = Self::connect_for(bench, world)?;
        peer.hello(MIN_VERSION, version);
        peer.expect_welcome()?;
        Ok(peer)
    }

    /// A connection with this scene built and view 1 sent.
    pub(super) fn ready(bench: &Bench, world: &World) -> Result<Self, Stop> {
        Self::ready_in(bench, world, VERSION)
    }

    /// As [`Self::ready`], speaking no newer version than this.
    pub(super) fn ready_in(bench: &Bench, world: &World, version: u16) -> Result<Self, Stop> {
        let mut peer = Self::greeted_for(bench, world, version)?;
        peer.send_scene(&world.encoded);
        peer.expect_ready()?;
        peer.view(1, camera());
        Ok(peer)
    }

    pub(super) fn hello(&mut self, min_version: u16, max_version: u16) {
        self.send(&ToServer::Hello {
            min_version,
            max_version,
            name: "conformance".into(),
            seed: SEED,
        });
    }

    pub(super) fn expect_welcome(&mut self) -> Result<Welcome, Stop> {
        let came = self.next()?;
        match (&came, &self.welcome) {
            (Came::Message(ToDisplay::Welcome { .. }), Some(welcome)) => Ok(welcome.clone()),
            _ => failed("Welcome", describe(&came, self.timeout)),
        }
    }

    /// What the server said of itself.
    pub(super) fn welcome(&self) -> Result<&Welcome, Stop> {
        match &self.welcome {
            Some(welcome) => Ok(welcome),
            None => failed("Welcome", "nothing yet"),
        }
    }

    /// Requests that it may have at once, as far as checks go: servers that hold millions are not filled.
    pub(super) fn credits(&self) -> Result<usize, Stop> {
        Ok(self.welcome()?.capabilities.credits as usize)
    }

    /// Announces a scene, and sends it unless it is held.
    pub(super) fn send_scene(&mut self, scene: &EncodedScene) {
        self.send(&scene.begin());
        if !self.session.announce(scene.digest()) {
            scene.chunks().for_each(|chunk| self.send(&chunk));
        }
    }

    /// Notes a scene that is sent in some other way. True if the server holds it.
    pub(super) fn announce(&mut self, scene: &EncodedScene) -> bool {
        self.session.announce(scene.digest())
    }

    pub(super) fn expect_ready(&mut self) -> Checked {
        self.until("SceneReady", |message| {
            matches!(message, ToDisplay::SceneReady { .. })
        })
        .map(drop)
    }

    pub(super) fn view(&mut self, view: u32, camera: Camera) {
        self.cameras.insert(view, camera);
        self.send(&ToServer::View { view, camera });
    }

    /// Notes requests as sent; gives the messages that carry them.
    pub(super) fn requests(&mut self, view: u32, requests: &[SampleRequest]) -> Vec<ToServer> {
        let most = self
            .welcome
            .as_ref()
            .map_or(1, |w| w.capabilities.max_batch as usize);
        self.session.requested(view, requests);
        if let Some(&camera) = self.cameras.get(&view) {
            self.asked
                .extend(requests.iter().map(|r| (r.id, (camera, *r))));
        }
        let message = |samples: &[SampleRequest]| ToServer::Request {
            view,
            samples: samples.to_vec(),
        };
        requests.chunks(most).map(message).collect()
    }

    pub(super) fn ask(&mut self, view: u32, requests: &[SampleRequest]) {
        for message in self.requests(view, requests) {
            self.send(&message);
        }
    }

    pub(super) fn edit(
        &mut self,
        epoch: u32,
        objects: Vec<crate::messages::ObjectMove>,
        lights: Vec<crate::messages::LightMove>,
    ) {
        self.session.edited(epoch);
        self.send(&ToServer::Edit {
            epoch,
            objects,
            lights,
        });
    }

    pub(super) fn cancel(&mut self, views_before: u32) {
        self.session.cancelling(views_before);
        self.send(&ToServer::Cancel { views_before });
    }

    /// Notes a `Ping` that is sent in some other way.
    pub(super) fn expecting_pong(&mut self, token: u64) {
        self.session.pinged(token);
    }

    pub(super) fn ping(&mut self, token: u64) {
        self.expecting_pong(token);
        self.send(&ToServer::Ping { token });
    }

    /// A `Ping`, and the time until its answer. Other messages may come before.
    pub(super) fn round_trip(&mut self, token: u64) -> Result<Duration, Stop> {
        let start = Instant::now();
        self.ping(token);
        self.pong(token)?;
        Ok(start.elapsed())
    }

    pub(super) fn pong(&mut self, token: u64) -> Checked {
        self.until(
            "Pong",
            |message| matches!(message, ToDisplay::Pong { token: t } if *t == token),
        )
        .map(drop)
    }

    /// So many answers, once they are all there.
    pub(super) fn answers(&mut self, count: usize) -> Result<Vec<Answer>, Stop> {
        let mut deadline = Instant::now() + self.timeout;
        while self.answers.len() < count {
            let before = self.answers.len();
            let came = self.next_by(deadline)?;
            if !matches!(came, Came::Message(_)) || is_fault(&came) {
                let came = describe(&came, self.timeout);
                let so_far = format!("{came}, after {before} of them");
                return failed(format!("{count} samples"), so_far);
            }
            if self.answers.len() > before {
                deadline = Instant::now() + self.timeout;
            }
        }
        Ok(std::mem::take(&mut self.answers))
    }

    /// Answers that have come and were not taken yet.
    pub(super) fn answered(&self) -> usize {
        self.answers.len()
    }

    /// Asks and waits for all answers.
    pub(super) fn ask_all(
        &mut self,
        view: u32,
        requests: &[SampleRequest],
    ) -> Result<Vec<Answer>, Stop> {
        self.ask(view, requests);
        self.answers(requests.len())
    }

    /// Reads on until a message of this kind.
    pub(super) fn until(
        &mut self,
        what: &str,
        is_it: impl Fn(&ToDisplay) -> bool,
    ) -> Result<ToDisplay, Stop> {
        let deadline = Instant::now() + self.timeout;
        loop {
            match self.next_by(deadline)? {
                Came::Message(message) if is_it(&message) => return Ok(message),
                Came::Message(ToDisplay::Fault { code, text }) => {
                    return failed(what, format!("Fault {code:?} \"{text}\""));
                }
                Came::Message(_) => {}
                came => return failed(what, describe(&came, self.timeout)),
            }
        }
    }

    /// Expects a `Fault` with one of these codes as the last message, and the connection closed. What comes before it is not looked at.
    pub(super) fn expect_fault(&mut self, codes: &[FaultCode]) -> Checked {
        let wanted: Vec<String> = codes.iter().map(|code| format!("{code:?}")).collect();
        let expected = format!("Fault {}, then the end", wanted.join(" or "));
        let deadline = Instant::now() + self.timeout;
        loop {
            match self.read_message(deadline)? {
                Came::Message(ToDisplay::Fault { code, text }) => {
                    ensure(
                        codes.contains(&code),
                        || expected.clone(),
                        || format!("Fault {code:?} \"{text}\""),
                    )?;
                    return self.expect_closed("Fault, the last message");
                }
                Came::Message(_) => {}
                came => return failed(expected, describe(&came, self.timeout)),
            }
        }
    }

    /// Expects the server to close, with no message any more.
    pub(super) fn expect_closed(&mut self, after: &str) -> Checked {
        let deadline = Instant::now() + self.timeout;
        match self.read_message(deadline)? {
            Came::Closed => Ok(()),
            came => failed(
                format!("the end of the connection after {after}"),
                describe(&came, self.timeout),
            ),
        }
    }

    /// Expects the server to close; samples and the like may still come, a `Fault` may not.
    pub(super) fn expect_left(&mut self, after: &str) -> Checked {
        let deadline = Instant::now() + self.timeout;
        loop {
            match self.read_message(deadline)? {
                Came::Closed => return Ok(()),
                Came::Message(ref message) if !matches!(message, ToDisplay::Fault { .. }) => {}
                came => {
                    let expected = format!("the end of the connection after {after}, no Fault");
                    return failed(expected, describe(&came, self.timeout));
                }
            }
        }
    }

    /// The next message, held against the rules.
    pub(super) fn next(&mut self) -> Result<Came, Stop> {
        self.next_by(Instant::now() + self.timeout)
    }

    pub(super) fn next_by(&mut self, deadline: Instant) -> Result<Came, Stop> {
        let came = self.read_message(deadline)?;
        if let Came::Message(message) = &came {
            self.messages += 1;
            if let Err(violation) = self.session.receive(message) {
                return failed("messages that keep to the rules", violation.text);
            }
            self.note(message);
        }
        Ok(came)
    }

    fn note(&mut self, message: &ToDisplay) {
        match message {
            ToDisplay::Welcome {
                version,
                shader,
                capabilities,
                holds,
                ..
            } => {
                self.welcome = Some(Welcome {
                    version: *version,
                    shader: shader.clone(),
                    capabilities: capabilities.clone(),
                    holds: holds.clone(),
                });
            }
            ToDisplay::Samples { epoch, samples, .. } => {
                samples.iter().for_each(|s| self.take(*epoch, *s, None));
            }
            ToDisplay::Textured { epoch, samples, .. } => samples
                .iter()
                .for_each(|t| self.take(*epoch, t.sample, Some(t.texel))),
            ToDisplay::Triples { epoch, triples } => {
                let (epoch, message) = (*epoch, self.messages);
                self.told.extend(triples.iter().map(|&triple| Told {
                    epoch,
                    triple,
                    message,
                }));
            }
            ToDisplay::Status {
                cancelled_before, ..
            } => self.cancelled_before = *cancelled_before,
            _ => {}
        }
    }

    fn take(&mut self, epoch: u32, sample: Sample, texel: Option<Texel>) {
        // The session has made sure that it was asked for.
        if let Some((camera, request)) = self.asked.remove(&sample.id) {
            self.answers.push(Answer {
                camera,
                request,
                epoch,
                sample,
                texel,
                message: self.messages,
            });
        }
    }

    /// The next message, whatever it is.
    fn read_message(&mut self, deadline: Instant) -> Result<Came, Stop> {
        loop {
            if let Some(payload) = self.take_frame()? {
                let message: ToDisplay = match decode(&payload) {
                    Ok(message) => message,
                    Err(error) => return failed("frames that hold a message", error.to_string()),
                };
                if let Err(error) = validate_to_display(&message) {
                    return failed("values that are allowed", error.to_string());
                }
                return Ok(Came::Message(message));
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(Came::Nothing);
            }
            if self.stream.set_read_timeout(Some(left)).is_err() {
                return Ok(Came::Closed);
            }
            let mut bytes = [0; 1 << 16];
            match self.stream.read(&mut bytes) {
                Ok(0) if self.buffer.is_empty() => return Ok(Came::Closed),
                Ok(0) => return failed("whole frames", "the connection ended inside a frame"),
                Ok(count) => self.buffer.extend_from_slice(&bytes[..count]),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error)
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) =>
                {
                    return Ok(Came::Nothing);
                }
                Err(_) => return Ok(Came::Closed),
            }
        }
    }

    fn take_frame(&mut self) -> Result<Option<Vec<u8>>, Stop> {
        let Some(header) = self.buffer.first_chunk::<HEADER>() else {
            return Ok(None);
        };
        let length = u32::from_le_bytes(*header) as usize;
        if length > MAX_FRAME {
            return failed(
                format!("frames of at most {MAX_FRAME} bytes"),
                length.to_string(),
            );
        }
        if self.buffer.len() < HEADER + length {
            return Ok(None);
        }
        let payload = self.buffer[HEADER..HEADER + length].to_vec();
        self.buffer.drain(..HEADER + length);
        Ok(Some(payload))
    }

    /// Sends a message. If that fails the answer that is waited for does not come, which says enough.
    pub(super) fn send(&mut self, message: &ToServer) {
        if let Ok(bytes) = frame(message) {
            self.send_bytes(&bytes);
        }
    }

    /// Sends bytes as they are. False if they cannot be sent.
    pub(super) fn send_bytes(&mut self, bytes: &[u8]) -> bool {
        self.stream.write_all(bytes).is_ok()
    }

    /// Sends bytes while this side reads on, until they are sent or the connection ends.
    pub(super) fn send_in_background(&mut self, bytes: Vec<u8>) {
        // Without a second handle nothing is sent, and the answers that are waited for do not come.
        if let Ok(mut stream) = self.stream.try_clone() {
            std::thread::spawn(move || {
                let _ = stream.write_all(&bytes);
            });
        }
    }

    /// Sends a payload in a frame of its length.
    pub(super) fn send_payload(&mut self, payload: &[u8]) {
        let length = u32::try_from(payload.len()).unwrap_or(u32::MAX);
        self.send_bytes(&[&length.to_le_bytes(), payload].concat());
    }

    /// Says that nothing more will be sent.
    pub(super) fn shut_down_writing(&mut self) {
        // A connection that is gone already shows that when it is read.
        let _ = self.stream.shutdown(Shutdown::Write);
    }

    /// Bounds how long a write may block.
    pub(super) fn set_write_timeout(&mut self, timeout: Duration) {
        // It only fails for no time at all.
        let _ = self.stream.set_write_timeout(Some(timeout));
    }
}

fn is_fault(came: &Came) -> bool {
    matches!(came, Came::Message(ToDisplay::Fault { .. }))
}

/// In words.
pub(super) fn describe(came: &Came, timeout: Duration) -> String {
    match came {
        Came::Closed => "the end of the connection".into(),
        Came::Nothing => format!("nothing within {} s", timeout.as_secs_f32()),
        Came::Message(ToDisplay::Fault { code, text }) => format!("Fault {code:?} \"{text}\""),
        Came::Message(message) => {
            let text = format!("{message:?}");
            text.split([' ', '{']).next().unwrap_or_default().to_owned()
        }
    }
}
