//! A display's account of whatever a server says.

use std::collections::BTreeMap;

use protocol::messages::{
    LightShadows, SampleRequest, ShadowMethod, Texel, TexturedSample, Triple, flags,
};
use protocol::session::{DisplayEvent, DisplaySession, SceneSize};
use protocol::validate::validate_to_display;
use protocol::{ToDisplay, decode};

use super::source::Source;
use super::world;

/// What the account must say.
#[derive(Default)]
struct Model {
    outstanding: BTreeMap<u64, u32>,
    next_id: u64,
    credits: usize,
    epoch: u32,
    asked: u32,
    cancelled: u32,
    token: u64,
}

/// The account says what a slow and obvious one says; what a fault is found in changes nothing.
pub(super) fn display_session(data: &[u8]) {
    let mut source = Source::new(data);
    let mut session = DisplaySession::new(SceneSize::from(&world::scene()));
    let mut model = Model::default();
    let offer = world::offer(&mut source);
    if !source.chance(4) {
        let welcome = ToDisplay::Welcome {
            version: 1 + source.below(3) as u16,
            name: String::new(),
            shader: String::new(),
            capabilities: offer.clone(),
            holds: vec![],
        };
        session.receive(&welcome).expect("a good beginning");
        session.announce(world::encoded().digest());
        let ready = ToDisplay::SceneReady {
            digest: world::encoded().digest(),
        };
        session.receive(&ready).expect("a good scene");
        model.credits = offer.credits as usize;
    }
    while !source.is_empty() {
        if source.chance(2) {
            act(&mut source, &mut model, &mut session);
        } else if let Some(message) = next(&mut source, &model)
            && validate_to_display(&message).is_ok()
        {
            let Ok(event) = session.receive(&message) else {
                break;
            };
            model.take(&event, &message, &session);
        }
        model.check(&session);
    }
    model.check(&session);
    let left: Vec<_> = session
        .take_outstanding()
        .iter()
        .map(|held| (held.request.id, held.view))
        .collect();
    assert_eq!(left, Vec::from_iter(model.outstanding));
    assert_eq!(session.outstanding(), 0);
}

/// What a good display does.
fn act(source: &mut Source, model: &mut Model, session: &mut DisplaySession) {
    match source.below(6) {
        0..=2 => {
            let view = model.asked + source.below(3) as u32;
            let count = source.below(session.free_credits() + 1);
            let requests: Vec<SampleRequest> = (0..count)
                .map(|_| {
                    model.next_id += 1;
                    model.outstanding.insert(model.next_id, view);
                    world::request(source, model.next_id)
                })
                .collect();
            session.requested(view, &requests);
        }
        3 => {
            model.asked += source.below(3) as u32;
            session.cancelling(model.asked);
        }
        4 if session.is_ready() => {
            model.epoch += 1;
            session.edited(model.epoch);
        }
        _ => {
            model.token += 1;
            session.pinged(model.token);
        }
    }
}

/// What a server says, mostly something good.
fn next(source: &mut Source, model: &Model) -> Option<ToDisplay> {
    Some(match source.below(12) {
        0..=3 => samples(source, model),
        4 => textured(source, model),
        5 => ToDisplay::Status {
            queued: 0,
            traced: source.u64(),
            rays: 0,
            cancelled_before: source.close_to(model.asked.saturating_sub(1)),
        },
        6 => ToDisplay::Pong {
            token: source.close_to(model.token as u32).into(),
        },
        7 => ToDisplay::Triples {
            epoch: source.close_to(model.epoch.saturating_sub(1)),
            triples: vec![
                Triple {
                    light: source.below(3) as u32,
                    blocker: source.below(2) as u32,
                    receiver: 0,
                };
                source.below(4)
            ],
        },
        8 => ToDisplay::Shadows {
            lights: vec![
                LightShadows {
                    light: source.below(3) as u32,
                    method: ShadowMethod::Rays,
                    why: String::new(),
                };
                source.below(3)
            ],
        },
        9 => ToDisplay::Welcome {
            version: source.byte().into(),
            name: String::new(),
            shader: String::new(),
            capabilities: world::offer(source),
            holds: vec![[1; 32]; source.below(3)],
        },
        10 => ToDisplay::SceneReady {
            digest: world::encoded().digest(),
        },
        _ => {
            let length = source.byte().into();
            return decode(source.take(length)).ok();
        }
    })
}

/// Ids that are outstanding, of one view, but now and then any.
fn ids(source: &mut Source, model: &Model) -> (u32, Vec<u64>) {
    let (view, first) = match model.outstanding.iter().next() {
        Some((id, view)) => (*view, *id),
        None => (source.byte().into(), source.byte().into()),
    };
    let held = model.outstanding.iter().filter(|(_, of)| **of == view);
    let mut ids: Vec<u64> = held.map(|(id, _)| *id).take(source.below(6)).collect();
    if source.chance(8) {
        ids.push(first);
    }
    let view = if source.chance(32) { view + 1 } else { view };
    (view, ids)
}

fn samples(source: &mut Source, model: &Model) -> ToDisplay {
    let (view, ids) = ids(source, model);
    ToDisplay::Samples {
        view,
        epoch: source.close_to(model.epoch.saturating_sub(1)),
        samples: ids.iter().map(|id| world::sample(source, *id)).collect(),
    }
}

fn textured(source: &mut Source, model: &Model) -> ToDisplay {
    let (view, ids) = ids(source, model);
    let epoch = source.close_to(model.epoch.saturating_sub(1));
    let samples = ids.iter().map(|id| {
        let mut sample = world::sample(source, *id);
        sample.flags &= !(flags::LIGHT | flags::MISS);
        let texel = Texel {
            face: u32::from(source.chance(8)),
            reflectance: [0.5; 3],
            reflected: if source.chance(8) {
                source.numbers()
            } else {
                [2.0; 3]
            },
        };
        TexturedSample { sample, texel }
    });
    ToDisplay::Textured {
        view,
        epoch,
        samples: samples.collect(),
    }
}

impl Model {
    fn take(&mut self, event: &DisplayEvent, message: &ToDisplay, session: &DisplaySession) {
        match (event, message) {
            (DisplayEvent::Welcome, ToDisplay::Welcome { capabilities, .. }) => {
                self.credits = capabilities.credits as usize;
            }
            (
                DisplayEvent::Samples,
                ToDisplay::Samples {
                    view,
                    epoch,
                    samples,
                },
            ) => {
                samples.iter().for_each(|s| self.answered(*view, s.id));
                assert!(*epoch <= self.epoch, "an epoch that is yet to come");
            }
            (DisplayEvent::Samples, ToDisplay::Textured { view, samples, .. }) => {
                samples
                    .iter()
                    .for_each(|s| self.answered(*view, s.sample.id));
            }
            (
                DisplayEvent::Status { released },
                ToDisplay::Status {
                    cancelled_before, ..
                },
            ) => {
                assert!(*cancelled_before <= self.asked && *cancelled_before >= self.cancelled);
                let mut gone = Vec::new();
                if *cancelled_before > self.cancelled {
                    self.cancelled = *cancelled_before;
                    self.outstanding.retain(|id, view| {
                        let kept = *view >= *cancelled_before;
                        gone.extend((!kept).then_some(*id));
                        kept
                    });
                }
                let mut released = released.clone();
                released.sort_unstable();
                assert_eq!(released, gone);
            }
            (DisplayEvent::Ready, _) => assert!(session.is_ready()),
            _ => {}
        }
    }

    fn answered(&mut self, view: u32, id: u64) {
        assert_eq!(self.outstanding.remove(&id), Some(view), "answered unasked");
    }

    fn check(&self, session: &DisplaySession) {
        assert_eq!(session.outstanding(), self.outstanding.len());
        if session.is_ready() {
            assert!(
                self.outstanding.len() <= self.credits,
                "more is asked than offered"
            );
            assert_eq!(
                session.free_credits(),
                self.credits - self.outstanding.len()
            );
        } else {
            assert_eq!(session.free_credits(), 0);
        }
    }
}
