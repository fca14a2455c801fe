//! What the frames of a trace mean: each connection is followed by the same account that the display kept of it.

use std::collections::HashMap;

use protocol::framing::Message as _;
use protocol::messages::{Sample, Texel, Triple};
use protocol::session::{DisplaySession, SceneSize};
use protocol::trace::Event;
use protocol::{ToDisplay, ToServer, decode};

/// What a frame that was received came to.
pub(super) enum News {
    /// Samples of a view, traced in an epoch of the connection's own count.
    Samples {
        connection: u32,
        view: u32,
        epoch: u32,
        samples: Vec<(Sample, Option<Texel>)>,
    },
    /// Triples, met in an epoch of the connection's own count.
    Triples {
        connection: u32,
        epoch: u32,
        triples: Vec<Triple>,
    },
    /// Anything else that a server may say.
    Other(ToDisplay),
    /// The display said something.
    Sent { connection: u32, message: ToServer },
}

/// The accounts of all connections.
pub(super) struct Follower {
    size: SceneSize,
    sessions: HashMap<u32, DisplaySession>,
}

impl Follower {
    /// Of a session about a scene of this size.
    pub(super) fn new(size: SceneSize) -> Self {
        Self {
            size,
            sessions: HashMap::new(),
        }
    }

    /// What an event means; nothing if it is none of a connection's, or a frame that a display throws away.
    pub(super) fn follow(&mut self, event: &Event) -> Option<News> {
        match event {
            Event::Opened { connection, .. } => {
                let session = DisplaySession::new(self.size);
                self.sessions.insert(*connection, session);
                None
            }
            Event::Closed { connection, .. } => {
                self.sessions.remove(connection);
                None
            }
            Event::Sent { connection, frame } => {
                let message: ToServer = decode(frame).ok()?;
                note(self.sessions.get_mut(connection)?, &message);
                Some(News::Sent {
                    connection: *connection,
                    message,
                })
            }
            Event::Received { connection, frame } => {
                let message: ToDisplay = decode(frame).ok()?;
                message.validate().ok()?;
                self.sessions.get_mut(connection)?.receive(&message).ok()?;
                Some(news(*connection, message))
            }
            Event::Scene(_) | Event::SceneSent { .. } | Event::Step(_) | Event::End { .. } => None,
        }
    }
}

/// Tells an account what is sent.
pub(super) fn note(session: &mut DisplaySession, message: &ToServer) {
    match message {
        ToServer::SceneBegin { digest, .. } => {
            session.announce(*digest);
        }
        ToServer::Request { view, samples } => session.requested(*view, samples),
        ToServer::Edit { epoch, .. } => session.edited(*epoch),
        ToServer::Cancel { views_before } => session.cancelling(*views_before),
        ToServer::Ping { token } => session.pinged(*token),
        _ => {}
    }
}

/// Splits off what samples and triples are in a message that an account has taken.
pub(super) fn news(connection: u32, message: ToDisplay) -> News {
    match message {
        ToDisplay::Samples {
            view,
            epoch,
            samples,
        } => News::Samples {
            connection,
            view,
            epoch,
            samples: samples.into_iter().map(|sample| (sample, None)).collect(),
        },
        ToDisplay::Textured {
            view,
            epoch,
            samples,
        } => News::Samples {
            connection,
            view,
            epoch,
            samples: samples
                .into_iter()
                .map(|t| (t.sample, Some(t.texel)))
                .collect(),
        },
        ToDisplay::Triples { epoch, triples } => News::Triples {
            connection,
            epoch,
            triples,
        },
        message => News::Other(message),
    }
}
