//! What a replayed server says to a display, without sockets: recorded answers, when they are asked for.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::time::Duration;

use protocol::ToDisplay;
use protocol::messages::{Camera, SampleRequest, TexturedSample, Triple};

use super::answers::{Answer, Answers};

/// A message, and how long after the request it is due.
pub(super) type Due = (Duration, Reply);

/// What is to be sent.
pub(super) enum Reply {
    /// Samples of one frame of the trace.
    Samples {
        /// The view, by the display's count.
        view: u32,
        /// The epoch, by the display's count.
        epoch: u32,
        answers: Vec<u64>,
    },
    /// Triples.
    Triples { epoch: u32, triples: Vec<Triple> },
}

/// What became of a display's requests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Served {
    /// Requests.
    pub asked: usize,
    /// Those that were answered.
    pub answered: usize,
    /// Those that are not in the trace: another pixel or camera was asked for there, or nothing.
    pub unknown: usize,
}

/// A display's requests and the answers to them.
pub(super) struct Desk<'a> {
    answers: &'a Answers,
    epoch: u32,
    /// Requests whose answers were traced, or came, after an edit that this display has yet to make, by that epoch.
    waiting: BTreeMap<u32, Vec<(u32, u64)>>,
    /// Triples that were sent.
    sent: HashSet<usize>,
    /// Triples by the frame of samples that they came with.
    met: HashMap<usize, Vec<usize>>,
    pub(super) served: Served,
    /// The first request that is not in the trace.
    pub(super) stranger: Option<(u32, u64)>,
    /// Requests that are not in the trace and that the display has not cancelled.
    pub(super) held: HashMap<u64, u32>,
}

impl<'a> Desk<'a> {
    pub(super) fn new(answers: &'a Answers) -> Self {
        let mut met: HashMap<usize, Vec<usize>> = HashMap::new();
        for (index, one) in answers.met.iter().enumerate() {
            met.entry(one.place).or_default().push(index);
        }
        Self {
            answers,
            epoch: 0,
            waiting: BTreeMap::new(),
            sent: HashSet::new(),
            met,
            served: Served::default(),
            stranger: None,
            held: HashMap::new(),
        }
    }

    /// Takes requests; gives what is to be sent for them.
    pub(super) fn ask(
        &mut self,
        view: u32,
        camera: &Camera,
        requests: &[SampleRequest],
    ) -> Vec<Due> {
        self.served.asked += requests.len();
        let mut ready = Vec::new();
        for request in requests {
            match self.answers.by_id.get(&request.id) {
                Some(answer) if is_to(answer, camera, request) => {
                    let when = answer.epoch + u32::from(answer.late);
                    if when <= self.epoch {
                        ready.push((view, request.id));
                    } else {
                        let waiting = self.waiting.entry(when).or_default();
                        waiting.push((view, request.id));
                    }
                }
                _ => {
                    self.served.unknown += 1;
                    self.stranger = self.stranger.or(Some((view, request.id)));
                    self.held.insert(request.id, view);
                }
            }
        }
        self.give(ready)
    }

    /// An edit begins this epoch; gives what is to be sent now.
    pub(super) fn edit(&mut self, epoch: u32) -> Vec<Due> {
        self.epoch = epoch;
        let later = self.waiting.split_off(&(epoch + 1));
        let ready = std::mem::replace(&mut self.waiting, later);
        self.give(ready.into_values().flatten().collect())
    }

    /// Requests of views before this one are wanted no more.
    pub(super) fn cancel(&mut self, before: u32) {
        self.held.retain(|_, view| *view >= before);
        for waiting in self.waiting.values_mut() {
            waiting.retain(|(view, _)| *view >= before);
        }
    }

    /// Answers in the order and in the frames in which they came, triples before the samples that they came with.
    fn give(&mut self, mut ready: Vec<(u32, u64)>) -> Vec<Due> {
        let answers = self.answers;
        let place = |id: &u64| answers.by_id.get(id).map(|a| a.place);
        ready.sort_unstable_by_key(|(view, id)| (place(id), *view));
        let mut due: Vec<Due> = Vec::new();
        let mut last = None;
        for (view, id) in ready {
            let Some(answer) = answers.by_id.get(&id) else {
                continue;
            };
            let kind = (answer.place.0, view, answer.epoch, answer.texel.is_some());
            if last.replace(kind) != Some(kind) {
                self.give_triples(answer, &mut due);
                let reply = Reply::Samples {
                    view,
                    epoch: answer.epoch,
                    answers: Vec::new(),
                };
                due.push((answer.latency, reply));
            }
            if let Some((_, Reply::Samples { answers: ids, .. })) = due.last_mut() {
                ids.push(id);
            }
        }
        due
    }

    fn give_triples(&mut self, with: &Answer, due: &mut Vec<Due>) {
        for index in self.met.get(&with.place.0).into_iter().flatten() {
            let met = &self.answers.met[*index];
            if met.epoch <= self.epoch && self.sent.insert(*index) {
                let (epoch, triples) = (met.epoch, met.triples.clone());
                due.push((with.latency, Reply::Triples { epoch, triples }));
            }
        }
    }

    /// The message of a reply, with those of its samples that the display still wants.
    pub(super) fn message(
        &mut self,
        reply: Reply,
        mut wanted: impl FnMut(u64) -> bool,
    ) -> Option<ToDisplay> {
        let (view, epoch, ids) = match reply {
            Reply::Triples { epoch, triples } => {
                return Some(ToDisplay::Triples { epoch, triples });
            }
            Reply::Samples {
                view,
                epoch,
                answers,
            } => (view, epoch, answers),
        };
        let ids = ids.into_iter().filter(|id| wanted(*id));
        let found: Vec<&Answer> = ids.filter_map(|id| self.answers.by_id.get(&id)).collect();
        self.served.answered += found.len();
        if found.first()?.texel.is_none() {
            let samples = found.iter().map(|answer| answer.sample).collect();
            return Some(ToDisplay::Samples {
                view,
                epoch,
                samples,
            });
        }
        let textured = |answer: &&Answer| {
            Some(TexturedSample {
                sample: answer.sample,
                texel: answer.texel?,
            })
        };
        Some(ToDisplay::Textured {
            view,
            epoch,
            samples: found.iter().filter_map(textured).collect(),
        })
    }

    /// What is said once the scene is there.
    pub(super) fn opening(&self, version: u16) -> Option<ToDisplay> {
        let lights = self.answers.shadows.clone();
        let told = version >= protocol::messages::SHADOWS_VERSION && !lights.is_empty();
        told.then_some(ToDisplay::Shadows { lights })
    }

    /// The welcome of the recorded server, to a display that speaks this version. The trace holds the scene.
    pub(super) fn welcome(&self, chosen: u16) -> ToDisplay {
        let mut welcome = self.answers.welcome.clone();
        if let ToDisplay::Welcome {
            version,
            name,
            holds,
            ..
        } = &mut welcome
        {
            *version = chosen;
            *holds = vec![self.answers.header.digest];
            if name.len() + REPLAY.len() <= protocol::limits::MAX_NAME {
                name.insert_str(0, REPLAY);
            }
        }
        welcome
    }
}

const REPLAY: &str = "replay of ";

/// Whether an answer is to this request of this camera, to the bit.
fn is_to(answer: &Answer, camera: &Camera, request: &SampleRequest) -> bool {
    let bytes = |asked: (&SampleRequest, &Camera)| protocol::encode(&asked).ok();
    let recorded = answer.camera.as_ref();
    recorded.is_some_and(|c| bytes((&answer.request, c)) == bytes((request, camera)))
}
