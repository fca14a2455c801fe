//! The thread on which shadow edges are computed, so that no frame waits for them.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use glam::DVec3;

use super::cast::{CastScratch, Receiver as Casting, ShadowEdge, cast_event};
use super::events::{Blocker, EventOptions, EventScratch, find_events};
use super::geometry::ShadowScene;
use super::light::ShadowLight;
use super::wedge::Event;
use crate::edges::meets::{Meet, Meets};

/// Most shadow edges of a pair of light and blocker. Foliage can throw more than anybody can see or any memory hold.
const MOST_EDGES: usize = 1 << 20;

/// Which lines of a light stand for its shadows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lines {
    /// Umbral and penumbral events (the paper's).
    Boundaries,
    /// Events of the light's middle alone: the line along which about half of it is seen.
    Middle,
}

impl Lines {
    /// Whether nothing of the light is seen past what hides these lines, as half of a light that has a size may be past
    /// what hides its middle.
    pub(super) fn are_whole(self, light: &ShadowLight) -> bool {
        self == Self::Boundaries || light.extent() == 0.0
    }
}

/// What is to be computed. Jobs are done in the order in which they come.
pub(super) enum Job {
    /// The edges that one blocker throws on its receivers in one light.
    Pair {
        /// Light and blocker.
        pair: (u32, u32),
        /// Comes back with the answer.
        version: u64,
        scene: Arc<ShadowScene>,
        receivers: Vec<u32>,
        /// What else blocks the light.
        others: Vec<u32>,
        lines: Lines,
    },
    /// Where objects pass through one another, all of them or, later on, those that moved.
    Meet {
        version: u64,
        scene: Arc<ShadowScene>,
        moved: Vec<u32>,
    },
}

/// The shadow edges of a pair.
#[derive(Clone, Debug, Default)]
pub struct Cast {
    /// Those on one receiver follow each other.
    pub edges: Vec<ShadowEdge>,
    /// Numbers of the ends of each: equal where edges on one receiver meet. Below twice the number of edges.
    pub vertices: Vec<[u32; 2]>,
    /// Events that they come from.
    pub events: usize,
}

impl Cast {
    fn new(mut edges: Vec<ShadowEdge>, events: usize) -> Self {
        edges.sort_by_key(|edge| edge.receiver);
        let mut numbers: HashMap<(u32, [u64; 3]), u32> = HashMap::with_capacity(2 * edges.len());
        let mut number = |receiver: u32, p: DVec3| {
            // Adding nought makes of a negative zero a positive one.
            let bits = (p + DVec3::ZERO).to_array().map(f64::to_bits);
            let next = numbers.len() as u32;
            *numbers.entry((receiver, bits)).or_insert(next)
        };
        let ends = |e: &ShadowEdge| [number(e.receiver, e.from), number(e.receiver, e.to)];
        let vertices = edges.iter().map(ends).collect();
        Self {
            edges,
            vertices,
            events,
        }
    }

    /// Leaves out the edges on a receiver.
    pub fn forget(&mut self, receiver: u32) {
        let mut kept = self.edges.iter().map(|e| e.receiver != receiver);
        self.vertices.retain(|_| kept.next().unwrap_or(true));
        self.edges.retain(|e| e.receiver != receiver);
    }
}

/// What was computed.
pub(super) enum Answer {
    Pair {
        pair: (u32, u32),
        version: u64,
        cast: Cast,
    },
    Meet {
        version: u64,
        meets: Vec<Meet>,
    },
}

/// A thread that does jobs.
pub(super) struct Worker {
    jobs: Option<Sender<Job>>,
    answers: Receiver<Answer>,
    thread: Option<JoinHandle<()>>,
}

impl Worker {
    /// Starts the thread.
    ///
    /// # Errors
    /// If the system gives none.
    pub(super) fn start() -> std::io::Result<Self> {
        let (jobs, todo) = channel();
        let (done, answers) = channel();
        let thread = std::thread::Builder::new()
            .name("shadow-edges".into())
            .spawn(move || {
                let mut shop = Shop::default();
                while let Ok(job) = todo.recv() {
                    if done.send(shop.work(job)).is_err() {
                        break;
                    }
                }
            })?;
        Ok(Self {
            jobs: Some(jobs),
            answers,
            thread: Some(thread),
        })
    }

    /// Hands a job over; false if the thread is gone.
    pub(super) fn send(&self, job: Job) -> bool {
        self.jobs
            .as_ref()
            .is_some_and(|jobs| jobs.send(job).is_ok())
    }

    /// An answer, if one is ready, or after waiting for it.
    pub(super) fn answer(&self, wait: bool) -> Option<Answer> {
        if wait {
            self.answers.recv().ok()
        } else {
            self.answers.try_recv().ok()
        }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // The thread ends when nothing can come any more, after the job it is at; what waits is dropped unseen.
        while self.answers.try_recv().is_ok() {}
        self.jobs = None;
        drop(self.thread.take());
    }
}

/// What the events of a pair may fall on.
#[derive(Clone, Copy)]
struct Met<'a> {
    receivers: &'a [u32],
    /// What else blocks the light.
    others: &'a [u32],
}

impl Met<'_> {
    /// Everything that takes part. The blocker always does: it hides what it stands before, itself too. With `hidden` so
    /// does what blocks the light elsewhere: where it hides the light from the blocker, or what lies behind the blocker, there
    /// is nothing for the blocker's shadow to take away.
    fn casting<'s>(&self, scene: &'s ShadowScene, blocker: u32, hidden: bool) -> Vec<Casting<'s>> {
        let others = self.others.iter().filter(|_| hidden);
        let mut ids: Vec<u32> = self.receivers.iter().chain(others).copied().collect();
        ids.push(blocker);
        ids.sort_unstable();
        ids.dedup();
        let all = ids.into_iter().filter_map(|id| {
            let object = scene.objects.get(id as usize)?;
            Some(Casting {
                tree: object.mesh.faces(),
                to_object: object.to_object?,
                id,
                is_blocker: id == blocker,
                receives: self.receivers.contains(&id),
            })
        });
        all.collect()
    }
}

/// What is kept from job to job.
#[derive(Default)]
struct Shop {
    light: ShadowLight,
    finding: EventScratch,
    events: Vec<Event>,
    casting: CastScratch,
    meets: Option<Meets>,
}

impl Shop {
    fn work(&mut self, job: Job) -> Answer {
        match job {
            Job::Pair {
                pair,
                version,
                scene,
                receivers,
                others,
                lines,
            } => {
                let mut edges = Vec::new();
                self.events.clear();
                let met = Met {
                    receivers: &receivers,
                    others: &others,
                };
                self.cast(&scene, pair, met, lines, &mut edges);
                Answer::Pair {
                    pair,
                    version,
                    cast: Cast::new(edges, self.events.len()),
                }
            }
            Job::Meet {
                version,
                scene,
                moved,
            } => {
                let meets = self.meets.get_or_insert_with(|| {
                    let objects = scene.objects.iter();
                    Meets::new(objects.map(|o| (Arc::clone(o.mesh.faces()), o.to_world)))
                });
                for object in moved {
                    if let Some(o) = scene.objects.get(object as usize) {
                        meets.move_object(object as usize, o.to_world);
                    }
                }
                Answer::Meet {
                    version,
                    meets: meets.iter().copied().collect(),
                }
            }
        }
    }

    /// Finds the events of a pair and what they meet.
    fn cast(
        &mut self,
        scene: &ShadowScene,
        (light, blocker): (u32, u32),
        met: Met<'_>,
        lines: Lines,
        out: &mut Vec<ShadowEdge>,
    ) {
        let (Some(light), Some(object)) = (
            scene.lights.get(light as usize),
            scene.objects.get(blocker as usize),
        ) else {
            return;
        };
        let Some(to_object) = object.to_object else {
            return;
        };
        let whole = lines.are_whole(light);
        match lines {
            Lines::Boundaries => self.light.set_transformed(light, &to_object),
            Lines::Middle => self.light.set_transformed(&light.middle(), &to_object),
        }
        let mesh = &object.mesh;
        let options = EventOptions {
            back_hidden: self.light.is_outside(&mesh.adjacency),
        };
        let caster = Blocker {
            adjacency: &mesh.adjacency,
            tree: &mesh.tree,
            rings: mesh.rings(),
        };
        find_events(
            caster,
            &self.light,
            options,
            &mut self.finding,
            &mut self.events,
        );
        let list = met.casting(scene, blocker, whole);
        for event in &self.events {
            let world = Event {
                wedge: event.wedge.transformed(&object.to_world),
                ..*event
            };
            cast_event(&world, &list, &mut self.casting, out);
            if out.len() > MOST_EDGES {
                tracing::warn!(
                    "object {blocker} throws more than {MOST_EDGES} shadow edges: the others are left out"
                );
                break;
            }
        }
    }
}
