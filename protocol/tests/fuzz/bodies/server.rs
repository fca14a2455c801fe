//! A server's account of whatever a display says.

use std::collections::BTreeMap;

use protocol::messages::{FaultCode, LightMove, ObjectMove, SampleRequest, ShadowMethod};
use protocol::session::{ServerEvent, ServerSession};
use protocol::validate::validate_to_server;
use protocol::{ToServer, decode};

use super::source::Source;
use super::world;

/// What the account must say.
#[derive(Default)]
struct Model {
    held: BTreeMap<u64, u32>,
    views: Vec<u32>,
    next_id: u64,
    epoch: u32,
    cancelled: u32,
    sent: usize,
    building: bool,
}

/// The account says what a slow and obvious one says, and never holds more than was offered.
pub(super) fn server_session(data: &[u8]) {
    let mut source = Source::new(data);
    let offer = world::offer(&mut source);
    let holds = if source.chance(4) {
        vec![world::encoded().digest()]
    } else {
        vec![]
    };
    let mut session = ServerSession::new(offer.clone(), holds, 1 << 20);
    let mut model = Model::default();
    // The beginning of a good session, or of any.
    let mut opening = if source.chance(4) { 3 } else { 0 };
    while !source.is_empty() {
        let message = if opening < 3 {
            opening += 1;
            opening_message(opening, &mut model)
        } else {
            match next(&mut source, &mut model, &mut session) {
                Some(message) => message,
                None => continue,
            }
        };
        if validate_to_server(&message).is_err() {
            continue;
        }
        let Ok(event) = session.receive(message) else {
            // The connection ends here: what the bad message did to the account makes no difference, but for its size.
            assert!(session.held() <= offer.credits as usize);
            return;
        };
        model.take(&event, &mut session, offer.max_batch as usize);
        if let ServerEvent::Goodbye(_) = event {
            break;
        }
        model.check(&session, offer.credits as usize);
    }
    model.check(&session, offer.credits as usize);
}

fn opening_message(step: u32, model: &mut Model) -> ToServer {
    match step {
        1 => protocol::handshake::hello("d", 1),
        2 => world::encoded().begin(),
        _ => model.chunk(usize::MAX),
    }
}

fn next(source: &mut Source, model: &mut Model, session: &mut ServerSession) -> Option<ToServer> {
    Some(match source.below(16) {
        0..=3 => ToServer::Request {
            view: model.some_view(source),
            samples: requests(source, model),
        },
        4 | 5 => ToServer::View {
            view: source.close_to(model.views.last().map_or(1, |view| view.wrapping_add(1))),
            camera: world::camera(),
        },
        6 | 7 => {
            let id = model.some_id(source);
            assert_eq!(session.release(id), model.held.remove(&id).is_some());
            return None;
        }
        8 => ToServer::Cancel {
            views_before: source.close_to(model.cancelled.wrapping_add(1)),
        },
        9 => edit(source, model),
        10 => model.chunk(1 + source.below(256)),
        11 => ToServer::SceneBegin {
            digest: if source.chance(4) {
                [7; 32]
            } else {
                world::encoded().digest()
            },
            bytes: if source.chance(4) { source.u64() } else { 99 },
        },
        12 => ToServer::Shadows {
            steady: true,
            error: source.number(),
            methods: vec![ShadowMethod::Rays; source.below(5)],
        },
        13 => ToServer::Hello {
            min_version: source.byte().into(),
            max_version: source.byte().into(),
            name: "x".repeat(source.below(3)),
            seed: 0,
        },
        14 => match source.below(3) {
            0 => ToServer::Goodbye,
            1 => ToServer::Fault {
                code: FaultCode::Value,
                text: String::new(),
            },
            _ => ToServer::Ping {
                token: source.u64(),
            },
        },
        _ => {
            let length = source.byte().into();
            return decode(source.take(length)).ok();
        }
    })
}

fn requests(source: &mut Source, model: &mut Model) -> Vec<SampleRequest> {
    (0..source.below(10))
        .map(|_| {
            let id = if source.chance(16) {
                model.some_id(source)
            } else {
                model.next_id += 1;
                model.next_id
            };
            world::request(source, id)
        })
        .collect()
}

fn edit(source: &mut Source, model: &Model) -> ToServer {
    let mut transform = world::IDENTITY;
    if source.chance(8) {
        transform[source.below(3)] = source.numbers();
    }
    let light = source.close_to(0);
    ToServer::Edit {
        epoch: source.close_to(model.epoch.wrapping_add(1)),
        objects: (0..source.below(3))
            .map(|_| ObjectMove {
                object: if source.chance(8) { 1 } else { 0 },
                transform,
            })
            .collect(),
        lights: (0..source.below(2))
            .map(|_| LightMove {
                light,
                value: world::light(),
            })
            .collect(),
    }
}

impl Model {
    /// The next bytes of the scene.
    fn chunk(&mut self, most: usize) -> ToServer {
        let bytes = world::encoded().bytes();
        let start = self.sent.min(bytes.len() - 1);
        let end = start.saturating_add(most).min(bytes.len());
        self.sent = end;
        ToServer::SceneChunk {
            data: bytes[start..end].to_vec(),
        }
    }

    fn some_view(&self, source: &mut Source) -> u32 {
        match self.views.len() {
            0 => source.byte().into(),
            _ if source.chance(16) => source.close_to(0),
            len => self.views[len - 1 - source.below(len.min(3))],
        }
    }

    fn some_id(&self, source: &mut Source) -> u64 {
        let place = source.below(self.held.len() + 1);
        match self.held.keys().nth(place) {
            Some(id) => *id,
            None => source.u64(),
        }
    }

    fn take(&mut self, event: &ServerEvent, session: &mut ServerSession, max_batch: usize) {
        match event {
            ServerEvent::Held(digest) | ServerEvent::Scene(digest, _) => {
                assert_eq!(*digest, world::encoded().digest());
                assert!(!self.building, "a scene is built once");
                self.building = true;
                session.scene_built(&world::scene());
            }
            ServerEvent::View { view, .. } => {
                assert!(self.views.last().is_none_or(|last| view > last));
                self.views.push(*view);
            }
            ServerEvent::Request { view, samples, .. } => {
                let kept = protocol::limits::MAX_VIEWS.min(self.views.len());
                assert!(self.views[self.views.len() - kept..].contains(view));
                assert!(*view >= self.cancelled && samples.len() <= max_batch);
                for sample in samples {
                    assert!(
                        u32::from(sample.x) < world::IMAGE && u32::from(sample.y) < world::IMAGE
                    );
                    assert!(self.held.insert(sample.id, *view).is_none(), "an id twice");
                }
            }
            ServerEvent::Edit { epoch, .. } => {
                assert_eq!(*epoch, self.epoch + 1);
                self.epoch = *epoch;
            }
            ServerEvent::Cancel { views_before } => {
                assert!(*views_before >= self.cancelled);
                self.cancelled = *views_before;
                self.held.retain(|_, view| *view >= self.cancelled);
            }
            _ => {}
        }
    }

    fn check(&self, session: &ServerSession, credits: usize) {
        assert_eq!(session.held(), self.held.len());
        assert!(session.held() <= credits, "more is held than was offered");
        assert_eq!(session.epoch(), self.epoch);
        assert_eq!(session.cancelled_before(), self.cancelled);
    }
}
