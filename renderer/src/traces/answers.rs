//! What servers answered in a trace, by request.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use protocol::messages::{Camera, LightShadows, Sample, SampleRequest, Texel, Triple};
use protocol::scene::Scene;
use protocol::session::SceneSize;
use protocol::trace::{Event, Header, Step};
use protocol::{ToDisplay, ToServer};

use super::follow::{Follower, News};
use super::open::{Trace, Trouble};

/// The answer to a request.
#[derive(Clone, Debug)]
pub(super) struct Answer {
    /// What was asked.
    pub(super) request: SampleRequest,
    /// Of which camera; nothing if the trace does not say.
    pub(super) camera: Option<Camera>,
    /// The display's epoch in which it was traced.
    pub(super) epoch: u32,
    /// It came when the server had been told of the next.
    pub(super) late: bool,
    /// The frame that it came in, and its place there.
    pub(super) place: (usize, usize),
    /// From the request to the answer.
    pub(super) latency: Duration,
    pub(super) sample: Sample,
    pub(super) texel: Option<Texel>,
}

/// Triples as they came.
#[derive(Clone, Debug)]
pub(super) struct Met {
    /// The display's epoch in which they were met.
    pub(super) epoch: u32,
    pub(super) triples: Vec<Triple>,
    /// The frame of samples that they came with.
    pub(super) place: usize,
}

/// What a trace's servers had to say.
pub(super) struct Answers {
    pub(super) header: Header,
    pub(super) scene: Arc<Scene>,
    /// The first server's.
    pub(super) welcome: ToDisplay,
    pub(super) shadows: Vec<LightShadows>,
    pub(super) by_id: HashMap<u64, Answer>,
    pub(super) met: Vec<Met>,
}

/// A connection as it goes on.
#[derive(Default)]
struct Connection {
    views: HashMap<u32, Camera>,
    /// Requests under way, and when they were sent, microseconds.
    asked: HashMap<u64, (u32, SampleRequest, u64)>,
    /// The display's epoch by the connection's own count: epochs are not told one by one to who comes late.
    epochs: Vec<u32>,
    /// Triples whose samples are still to come.
    met: Vec<usize>,
}

impl Connection {
    fn epoch(&self, own: u32) -> u32 {
        self.epochs.get(own as usize).copied().unwrap_or(0)
    }
}

/// Reads all of a trace.
pub(super) fn read(path: &Path) -> Result<Answers, Trouble> {
    let mut trace = Trace::open(path)?;
    let mut reading = Reading {
        connections: HashMap::new(),
        epoch: 0,
        frames: 0,
        welcome: None,
        shadows: Vec::new(),
        by_id: HashMap::new(),
        met: Vec::new(),
    };
    let mut follower = Follower::new(SceneSize::from(&*trace.scene));
    let mut pictures = 0;
    while let Some(entry) = trace.next()? {
        match &entry.event {
            Event::Step(Step::Edited { epoch, .. }) => reading.epoch = *epoch,
            Event::Step(Step::Drawn { .. }) => pictures += 1,
            Event::Opened { connection, .. } => {
                let first = Connection {
                    epochs: vec![0],
                    ..Connection::default()
                };
                reading.connections.insert(*connection, first);
            }
            _ => {}
        }
        if let Some(news) = follower.follow(&entry.event) {
            reading.take(news, entry.time_us, &trace.header);
        }
    }
    trace.warn_of_ending(pictures);
    Ok(Answers {
        header: trace.header,
        scene: trace.scene,
        welcome: reading.welcome.ok_or(Trouble::NoAnswers)?,
        shadows: reading.shadows,
        by_id: reading.by_id,
        met: reading.met,
    })
}

struct Reading {
    connections: HashMap<u32, Connection>,
    /// The display's.
    epoch: u32,
    /// Frames with samples so far.
    frames: usize,
    welcome: Option<ToDisplay>,
    shadows: Vec<LightShadows>,
    by_id: HashMap<u64, Answer>,
    met: Vec<Met>,
}

impl Reading {
    fn take(&mut self, news: News, time_us: u64, header: &Header) {
        match news {
            News::Sent {
                connection,
                message,
            } => self.sent(connection, message, time_us, header),
            News::Samples {
                connection,
                epoch,
                samples,
                ..
            } => self.samples(connection, epoch, samples, time_us),
            News::Triples {
                connection,
                epoch,
                triples,
            } => {
                let Some(from) = self.connections.get_mut(&connection) else {
                    return;
                };
                from.met.push(self.met.len());
                self.met.push(Met {
                    epoch: from.epoch(epoch),
                    triples,
                    // Unless samples follow.
                    place: self.frames.saturating_sub(1),
                });
            }
            News::Other(message) => match message {
                ToDisplay::Welcome { .. } if self.welcome.is_none() => self.welcome = Some(message),
                ToDisplay::Shadows { lights } => {
                    for light in lights {
                        self.shadows.retain(|known| known.light != light.light);
                        self.shadows.push(light);
                    }
                }
                _ => {}
            },
        }
    }

    fn sent(&mut self, connection: u32, message: ToServer, time_us: u64, header: &Header) {
        let now = self.epoch;
        let Some(to) = self.connections.get_mut(&connection) else {
            return;
        };
        match message {
            // A server that takes no edits is sent the scene as it is now.
            ToServer::SceneBegin { digest, .. } if digest != header.digest => to.epochs = vec![now],
            ToServer::Edit { .. } => to.epochs.push(now),
            ToServer::View { view, camera } => {
                to.views.insert(view, camera);
            }
            ToServer::Request { view, samples } => {
                for request in samples {
                    to.asked.insert(request.id, (view, request, time_us));
                }
            }
            _ => {}
        }
    }

    fn samples(
        &mut self,
        connection: u32,
        epoch: u32,
        samples: Vec<(Sample, Option<Texel>)>,
        time_us: u64,
    ) {
        let frame = self.frames;
        self.frames += 1;
        let Some(from) = self.connections.get_mut(&connection) else {
            return;
        };
        for met in from.met.drain(..) {
            self.met[met].place = frame;
        }
        let late = (epoch as usize) + 1 < from.epochs.len();
        let epoch = from.epoch(epoch);
        for (index, (sample, texel)) in samples.into_iter().enumerate() {
            let Some((view, request, sent)) = from.asked.remove(&sample.id) else {
                continue;
            };
            let answer = Answer {
                request,
                camera: from.views.get(&view).copied(),
                epoch,
                late,
                place: (frame, index),
                latency: Duration::from_micros(time_us - sent),
                sample,
                texel,
            };
            // The first counts, unless it came too late and another did not.
            let known = self.by_id.get(&sample.id);
            if known.is_none_or(|known| known.late && !answer.late) {
                self.by_id.insert(sample.id, answer);
            }
        }
    }
}
