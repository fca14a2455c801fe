//! The shadow edges of a scene, kept by light, blocker and receiver (paper section 6.5).
//!
//! Driven by the triples that shader servers report: nothing is computed for a pair of light and blocker that no sample
//! has met. A pair is computed whole, for all receivers known of it, since nearer ones hide others; it is computed again
//! when another receiver turns up and when any of them moves. What an edit moved is taken to meet the same receivers as
//! before until samples say more, so that its edges move with it at once. Where another blocker of the light hides it from
//! the blocker or the receiver there is no edge; edges are cut anew when such a blocker turns up or moves, once nothing is
//! more urgent. Pairs are computed in the order in which samples met them, which is that of what can be seen best: samples
//! are asked for in that order. Those with many events are computed in parts, by turns with others, and what is known of
//! them is shown; a new answer in place of one that is not wrong is shown once it is whole.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use protocol::messages::Triple;
use protocol::scene::{Affine, Light, Scene};
use serde::Serialize;

use super::answers::Answers;
use super::geometry::ShadowScene;
use super::light::ShadowLight;
use super::worker::{Answer, Cast, Job, Lines, PairJob, Worker};
use crate::edges::finder::EdgeFinder;
use crate::edges::meets::Meet;

/// A light and a blocker.
#[derive(Debug, Default)]
struct Pair {
    receivers: BTreeSet<u32>,
    /// Of the job that is under way or was the last.
    version: u64,
    /// The same, for the thread to see.
    wanted: Arc<AtomicU64>,
    /// Something has changed since that job was given.
    stale: bool,
    /// What else blocks the light has changed since, and may hide more of it or less.
    uncut: bool,
    /// Its edges, as far as they are known.
    parts: Vec<Cast>,
    /// Those that take their place once all of them are known, while the old ones are still right.
    coming: Option<Vec<Cast>>,
}

impl Pair {
    /// Has it computed anew; what is known is wrong.
    fn forget(&mut self) {
        self.stale = true;
        self.wanted.store(0, Ordering::Relaxed);
        self.parts.clear();
    }

    fn edges(&self) -> usize {
        self.parts.iter().map(|part| part.edges.len()).sum()
    }
}

/// What is known of a light's shadows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Known {
    /// Objects that keep some of its light from some sample: each is a pair with the light.
    pub blockers: usize,
    /// Objects that some of its light is kept from.
    pub receivers: usize,
    /// Shadow events of the pairs.
    pub events: usize,
    /// Shadow edges that the events draw on the receivers.
    pub edges: usize,
}

/// All shadow edges and intersection creases that are known.
pub struct Shadows {
    scene: Arc<ShadowScene>,
    lines: Option<Lines>,
    pairs: BTreeMap<(u32, u32), Pair>,
    meets: Vec<Meet>,
    meets_version: u64,
    /// Objects that moved since creases were last asked for.
    moved: Vec<u32>,
    worker: Option<Worker>,
    /// Jobs given out since the start; each has the number that this was then.
    given: u64,
    answers: Answers,
    /// Jobs that have not been answered.
    under_way: usize,
    last_version: u64,
    generation: u64,
}

impl Shadows {
    /// Of a scene whose edges have been prepared; intersection creases are computed at once, and shadow edges, of these
    /// lines of the lights, when triples come.
    pub fn new(scene: &Scene, finder: &EdgeFinder, lines: Option<Lines>) -> Self {
        let worker = Worker::start();
        if let Err(error) = &worker {
            tracing::warn!("no thread for shadow edges ({error}): there will be none");
        }
        let mut shadows = Self {
            scene: Arc::new(ShadowScene::new(scene, finder)),
            lines,
            pairs: BTreeMap::new(),
            meets: Vec::new(),
            meets_version: 0,
            moved: Vec::new(),
            worker: worker.ok(),
            given: 0,
            answers: Answers::default(),
            under_way: 0,
            last_version: 0,
            generation: 1,
        };
        if lines.is_some() && !scene.lights.is_empty() {
            let scene = Arc::clone(&shadows.scene);
            shadows.ask(Job::Prepare(scene));
        }
        if scene.objects.len() > 1 {
            shadows.ask_meets();
        }
        shadows
    }

    /// Changes which lines of the lights are wanted; what is known is computed again.
    pub fn set_lines(&mut self, lines: Option<Lines>) {
        if lines == self.lines {
            return;
        }
        self.lines = lines;
        self.pairs.values_mut().for_each(Pair::forget);
        self.generation += 1;
    }

    /// Takes in what samples met.
    pub fn learn(&mut self, triples: &[Triple]) {
        for triple in triples {
            let key = (triple.light, triple.blocker);
            if !self.pairs.contains_key(&key) {
                self.doubt(triple.light);
            }
            let pair = self.pairs.entry(key).or_default();
            pair.stale |= pair.receivers.insert(triple.receiver);
        }
    }

    /// What blocks a light has changed.
    fn doubt(&mut self, light: u32) {
        let lines = self.lines;
        let known = self.scene.lights.get(light as usize);
        if known.is_none_or(|l| lines.is_none_or(|lines| !lines.are_whole(l))) {
            return;
        }
        for (_, pair) in self.pairs.range_mut(of_light(light)) {
            pair.uncut = true;
        }
    }

    /// Moves an object.
    pub fn move_object(&mut self, object: u32, transform: &Affine) {
        let scene = Arc::make_mut(&mut self.scene);
        if let Some(placed) = scene.objects.get_mut(object as usize) {
            placed.place(transform);
            self.moved.push(object);
            let lights: Vec<u32> = self
                .pairs
                .keys()
                .filter(|p| p.1 == object)
                .map(|p| p.0)
                .collect();
            lights.into_iter().for_each(|light| self.doubt(light));
            for ((_, blocker), pair) in &mut self.pairs {
                if *blocker == object {
                    pair.forget();
                } else if pair.receivers.contains(&object) {
                    pair.stale = true;
                    pair.parts.iter_mut().for_each(|part| part.forget(object));
                }
            }
            self.meets.retain(|meet| !meet.objects.contains(&object));
            self.generation += 1;
        }
    }

    /// Changes a light.
    pub fn change_light(&mut self, light: u32, value: &Light) {
        let changed = ShadowLight::new(value);
        let scene = Arc::make_mut(&mut self.scene);
        let Some(place) = scene.lights.get_mut(light as usize) else {
            return;
        };
        if *place == changed {
            return;
        }
        *place = changed;
        for (_, pair) in self.pairs.range_mut(of_light(light)) {
            pair.forget();
        }
        self.generation += 1;
    }

    /// Gives out what has to be computed and takes in what has been: all of it, waiting for what is under way, if
    /// `wait` is set, so that the outcome does not depend on how fast the thread is.
    pub fn update(&mut self, wait: bool) {
        self.answers.taken.clear();
        if !self.moved.is_empty() {
            self.ask_meets();
        }
        if wait {
            self.under_way -= self.answers.forget_ended();
        }
        loop {
            let idle = self.under_way == 0;
            let asked = self.ask_pairs();
            while self.under_way > 0 {
                let Some((job, answer)) = self.answers.next(self.worker.as_ref(), wait) else {
                    if wait {
                        // The thread is gone: nothing will come.
                        self.under_way = 0;
                    }
                    break;
                };
                self.answers.taken.push((job, answer.is_last()));
                if answer.is_last() {
                    self.under_way -= 1;
                }
                self.take(answer);
            }
            // What others may hide comes after what is more urgent: waiting means waiting for both.
            if !wait || (idle && !asked) {
                break;
            }
        }
    }

    /// Answers that the last [`Shadows::update`] took: the number of each one's job, counted from 1 on, and whether it was the
    /// job's last.
    pub fn taken(&self) -> &[(u64, bool)] {
        &self.answers.taken
    }

    /// As [`Shadows::update`] without waiting was in another run, that took these answers: waits for the same ones, so that
    /// everything is as it was there.
    pub fn update_as(&mut self, taken: &[(u64, bool)]) {
        if !self.moved.is_empty() {
            self.ask_meets();
        }
        self.ask_pairs();
        for &(job, last) in taken {
            while let Some(answer) = {
                let worker = self.worker.as_ref();
                self.answers.next_of(worker, self.given, job)
            } {
                let ends = answer.is_last();
                if ends && !last {
                    // The thread saw sooner than there that nobody wants the rest.
                    self.answers.ended.push(job);
                }
                self.take(answer);
                if ends || !last {
                    break;
                }
            }
            if last {
                self.answers.ended.retain(|ended| *ended != job);
                self.under_way = self.under_way.saturating_sub(1);
            }
        }
    }

    /// Has pairs computed: first those whose own parts have changed, and only while none has those that others may hide.
    /// Says whether there were any.
    fn ask_pairs(&mut self) -> bool {
        let Some(lines) = self.lines else {
            return false;
        };
        let mut wanted: Vec<(u32, u32)> = self.pairs_where(|p| p.stale);
        if wanted.is_empty() && self.under_way == 0 {
            wanted = self.pairs_where(|p| p.uncut);
        }
        let any = !wanted.is_empty();
        for pair in wanted {
            let others = self.pairs.range(of_light(pair.0)).map(|(p, _)| p.1);
            let others = others.filter(|o| *o != pair.1).collect();
            let Some(state) = self.pairs.get_mut(&pair) else {
                continue;
            };
            self.last_version += 1;
            (state.version, state.stale, state.uncut) = (self.last_version, false, false);
            state.wanted.store(state.version, Ordering::Relaxed);
            state.coming = (!state.parts.is_empty()).then(Vec::new);
            let job = Job::Pair(PairJob {
                pair,
                version: state.version,
                wanted: Arc::clone(&state.wanted),
                scene: Arc::clone(&self.scene),
                receivers: state.receivers.iter().copied().collect(),
                others,
                lines,
            });
            self.ask(job);
        }
        any
    }

    fn ask(&mut self, job: Job) {
        let number = self.given + 1;
        if self.worker.as_ref().is_some_and(|w| w.send(number, job)) {
            self.given = number;
            self.under_way += 1;
        }
    }

    fn pairs_where(&self, is: impl Fn(&Pair) -> bool) -> Vec<(u32, u32)> {
        let pairs = self.pairs.iter().filter(|(_, pair)| is(pair));
        pairs.map(|(key, _)| *key).collect()
    }

    fn ask_meets(&mut self) {
        self.last_version += 1;
        self.meets_version = self.last_version;
        let job = Job::Meet {
            version: self.meets_version,
            scene: Arc::clone(&self.scene),
            moved: std::mem::take(&mut self.moved),
        };
        self.ask(job);
    }

    fn take(&mut self, answer: Answer) {
        match answer {
            Answer::Part {
                pair,
                version,
                cast,
                last,
            } => {
                // An answer to an older question is of no use: something has moved since.
                let current = self.pairs.get_mut(&pair).filter(|p| p.version == version);
                let Some(state) = current.filter(|p| !p.stale) else {
                    return;
                };
                match &mut state.coming {
                    Some(parts) => parts.push(cast),
                    None => state.parts.push(cast),
                }
                if last && let Some(parts) = state.coming.take() {
                    state.parts = parts;
                } else if state.coming.is_some() {
                    return;
                }
                self.generation += 1;
            }
            Answer::Nothing => {}
            Answer::Meet { version, meets } => {
                if version == self.meets_version && self.moved.is_empty() {
                    self.meets = meets;
                    self.generation += 1;
                }
            }
        }
    }

    /// Changes whenever what [`Shadows::edges`] or [`Shadows::meets`] give does.
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// Jobs that the thread has not answered yet.
    pub fn under_way(&self) -> usize {
        self.under_way
    }

    /// Shadow edges, world space, with the index of the light that makes them.
    pub fn edges(&self) -> impl Iterator<Item = (u32, &Cast)> {
        self.pairs
            .iter()
            .flat_map(|((light, _), pair)| pair.parts.iter().map(|part| (*light, part)))
            .filter(|(_, part)| !part.edges.is_empty())
    }

    /// What samples have met of a light's shadows, and what was computed from that.
    pub fn known(&self, light: u32) -> Known {
        let pairs = || self.pairs.range((light, 0)..=(light, u32::MAX));
        let receivers: BTreeSet<u32> = pairs().flat_map(|(_, p)| &p.receivers).copied().collect();
        Known {
            blockers: pairs().count(),
            receivers: receivers.len(),
            events: pairs()
                .flat_map(|(_, pair)| &pair.parts)
                .map(|part| part.events)
                .sum(),
            edges: pairs().map(|(_, pair)| pair.edges()).sum(),
        }
    }

    /// Where objects pass through one another, world space.
    pub fn meets(&self) -> &[Meet] {
        &self.meets
    }

    /// Lights and objects as they are now.
    pub fn scene(&self) -> &ShadowScene {
        &self.scene
    }
}

/// All pairs of a light.
fn of_light(light: u32) -> std::ops::RangeInclusive<(u32, u32)> {
    (light, 0)..=(light, u32::MAX)
}

#[cfg(test)]
#[path = "store_tests.rs"]
mod tests;
