//! The thread on which shadow edges are computed, so that no frame waits for them.

use std::collections::{HashMap, VecDeque};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::JoinHandle;

use glam::{DVec3, Vec3};

use super::cast::{CastScratch, Receiver as Casting, ShadowEdge, cast_event};
use super::events::{Blocker, EventOptions, EventScratch, find_events};
use super::geometry::ShadowScene;
use super::grade::{Grade, Grader};
use super::light::ShadowLight;
use super::order;
use super::wedge::Event;
use crate::edges::meets::{Meet, Meets};

/// Most shadow edges of a pair of light and blocker. Foliage can throw more than anybody can see or any memory hold.
const MOST_EDGES: usize = 1 << 20;
/// Events that are cast in one go: a few milliseconds' worth.
const PART: usize = 1024;

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

/// What is to be computed. Long jobs are done in parts, by turns.
pub(super) enum Job {
    /// What every mesh needs before it can cast shadows and receive them.
    Prepare(Arc<ShadowScene>),
    /// The edges that one blocker throws on its receivers in one light.
    Pair(PairJob),
    /// Where objects pass through one another, all of them or, later on, those that moved.
    Meet {
        version: u64,
        scene: Arc<ShadowScene>,
        moved: Vec<u32>,
    },
}

/// See [`Job::Pair`].
pub(super) struct PairJob {
    /// Light and blocker.
    pub(super) pair: (u32, u32),
    /// Comes back with the answer.
    pub(super) version: u64,
    /// Once this is not the version any more, nobody wants the answer.
    pub(super) wanted: Arc<AtomicU64>,
    pub(super) scene: Arc<ShadowScene>,
    pub(super) receivers: Vec<u32>,
    /// What else blocks the light.
    pub(super) others: Vec<u32>,
    pub(super) lines: Lines,
}

/// Some of the shadow edges of a pair.
#[derive(Clone, Debug, Default)]
pub struct Cast {
    /// Those on one receiver follow each other.
    pub edges: Vec<ShadowEdge>,
    /// What each is judged by, if they are of [`Lines::Middle`].
    pub grades: Vec<Grade>,
    /// Numbers of the ends of each: equal where edges on one receiver meet. Below twice their number.
    pub vertices: Vec<[u32; 2]>,
    /// Events that they come from.
    pub events: usize,
}

impl Cast {
    fn new(mut edges: Vec<ShadowEdge>, events: usize) -> Self {
        edges.sort_by_key(|edge| edge.receiver);
        let mut numbers: HashMap<(u32, [u32; 3]), u32> = HashMap::with_capacity(2 * edges.len());
        let mut number = |receiver: u32, p: DVec3| {
            // Two events that share a ray agree on where it ends but for the last bits of a double. Adding nought makes of a
            // negative zero a positive one.
            let bits = (p.as_vec3() + Vec3::ZERO).to_array().map(f32::to_bits);
            let next = numbers.len() as u32;
            *numbers.entry((receiver, bits)).or_insert(next)
        };
        let ends = |e: &ShadowEdge| [number(e.receiver, e.from), number(e.receiver, e.to)];
        let vertices = edges.iter().map(ends).collect();
        Self {
            edges,
            grades: Vec::new(),
            vertices,
            events,
        }
    }

    /// Grades the edges of a light.
    fn grade(&mut self, scene: &ShadowScene, light: u32) {
        let light = scene.lights.get(light as usize);
        let Some(grader) = light.and_then(Grader::new) else {
            return;
        };
        let graded = self.edges.iter().filter_map(|edge| {
            let receiver = scene.objects.get(edge.receiver as usize)?;
            Some(grader.grade(edge, receiver))
        });
        self.grades = graded.collect();
    }

    /// Leaves out the edges on a receiver.
    pub fn forget(&mut self, receiver: u32) {
        let mut kept = self.edges.iter().map(|e| e.receiver != receiver);
        self.vertices.retain(|_| kept.next().unwrap_or(true));
        let mut kept = self.edges.iter().map(|e| e.receiver != receiver);
        self.grades.retain(|_| kept.next().unwrap_or(true));
        self.edges.retain(|e| e.receiver != receiver);
    }
}

/// What was computed.
pub(super) enum Answer {
    /// Some edges of a pair; whether they are the last.
    Part {
        pair: (u32, u32),
        version: u64,
        cast: Cast,
        last: bool,
    },
    Meet {
        version: u64,
        meets: Vec<Meet>,
    },
    /// A job has ended that has no answer, or whose answer is not wanted any more.
    Nothing,
}

impl Answer {
    /// Whether its job has ended.
    pub(super) fn is_last(&self) -> bool {
        !matches!(self, Self::Part { last: false, .. })
    }
}

/// A thread that does jobs.
pub(super) struct Worker {
    jobs: Option<Sender<(u64, Job)>>,
    answers: Receiver<(u64, Answer)>,
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
            .spawn(move || work(&todo, &done))?;
        Ok(Self {
            jobs: Some(jobs),
            answers,
            thread: Some(thread),
        })
    }

    /// Hands a job over, with a number of its own; false if the thread is gone.
    pub(super) fn send(&self, number: u64, job: Job) -> bool {
        self.jobs
            .as_ref()
            .is_some_and(|jobs| jobs.send((number, job)).is_ok())
    }

    /// An answer and its job's number, if one is ready, or after waiting for it.
    pub(super) fn answer(&self, wait: bool) -> Option<(u64, Answer)> {
        if wait {
            self.answers.recv().ok()
        } else {
            self.answers.try_recv().ok()
        }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // The thread ends when nothing can come any more, after the part it is at; what waits is dropped unseen.
        while self.answers.try_recv().is_ok() {}
        self.jobs = None;
        drop(self.thread.take());
    }
}

/// Does jobs until no more can come, short ones before long ones have ended.
fn work(todo: &Receiver<(u64, Job)>, done: &Sender<(u64, Answer)>) {
    let mut shop = Shop::default();
    let mut tasks = VecDeque::new();
    loop {
        if tasks.is_empty() {
            let Ok(job) = todo.recv() else { return };
            tasks.push_back(Task::from(job));
        }
        loop {
            match todo.try_recv() {
                Ok(job) => tasks.push_back(Task::from(job)),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return,
            }
        }
        let Some(mut task) = tasks.pop_front() else {
            continue;
        };
        let number = task.number;
        let answer = shop.go_on(&mut task);
        if !answer.is_last() {
            tasks.push_back(task);
        }
        if done.send((number, answer)).is_err() {
            return;
        }
    }
}

/// A job and how far it has come.
struct Task {
    number: u64,
    job: Job,
    /// Of a pair that has been begun.
    events: Option<Events>,
}

/// The events of a pair.
struct Events {
    all: Vec<Event>,
    /// The next one to be cast.
    next: usize,
    /// Edges that there are already.
    edges: usize,
}

impl From<(u64, Job)> for Task {
    fn from((number, job): (u64, Job)) -> Self {
        Self {
            number,
            job,
            events: None,
        }
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
    casting: CastScratch,
    meets: Option<Meets>,
}

impl Shop {
    fn go_on(&mut self, task: &mut Task) -> Answer {
        match &mut task.job {
            Job::Prepare(scene) => {
                for object in &scene.objects {
                    object.mesh.faces();
                    object.mesh.rings();
                }
                Answer::Nothing
            }
            Job::Pair(job) => {
                if job.wanted.load(Ordering::Relaxed) != job.version {
                    return Answer::Nothing;
                }
                let events = task.events.get_or_insert_with(|| Events {
                    all: self.find(job),
                    next: 0,
                    edges: 0,
                });
                self.cast(job, events)
            }
            Job::Meet {
                version,
                scene,
                moved,
            } => Answer::Meet {
                version: *version,
                meets: self.meet(scene, moved),
            },
        }
    }

    fn meet(&mut self, scene: &ShadowScene, moved: &[u32]) -> Vec<Meet> {
        let meets = self.meets.get_or_insert_with(|| {
            let objects = scene.objects.iter();
            Meets::new(objects.map(|o| (Arc::clone(o.mesh.faces()), o.to_world)))
        });
        for object in moved {
            if let Some(o) = scene.objects.get(*object as usize) {
                meets.move_object(*object as usize, o.to_world);
            }
        }
        meets.iter().copied().collect()
    }

    /// Finds the events of a pair, in the blocker's space.
    fn find(&mut self, job: &PairJob) -> Vec<Event> {
        let mut events = Vec::new();
        let (light, blocker) = job.pair;
        let (Some(light), Some(object)) = (
            job.scene.lights.get(light as usize),
            job.scene.objects.get(blocker as usize),
        ) else {
            return events;
        };
        let Some(to_object) = object.to_object else {
            return events;
        };
        match job.lines {
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
        find_events(caster, &self.light, options, &mut self.finding, &mut events);
        order::sort(&mut events, mesh.faces().bounds());
        events
    }

    /// Finds what some more events of a pair meet.
    fn cast(&mut self, job: &PairJob, events: &mut Events) -> Answer {
        let PairJob {
            pair,
            version,
            scene,
            lines,
            ..
        } = job;
        let (light, blocker) = *pair;
        let mut edges = Vec::new();
        let to = events.all.len().min(events.next + PART);
        let some = &events.all[events.next..to];
        let mut last = to == events.all.len();
        if let (Some(light), Some(object)) = (
            scene.lights.get(light as usize),
            scene.objects.get(blocker as usize),
        ) {
            let met = Met {
                receivers: &job.receivers,
                others: &job.others,
            };
            let list = met.casting(scene, blocker, lines.are_whole(light));
            for event in some {
                let world = Event {
                    wedge: event.wedge.transformed(&object.to_world),
                    ..*event
                };
                cast_event(&world, &list, &mut self.casting, &mut edges);
            }
        }
        if events.edges + edges.len() > MOST_EDGES {
            tracing::warn!(
                "object {blocker} throws more than {MOST_EDGES} shadow edges: the others are left out"
            );
            last = true;
        }
        let mut cast = Cast::new(edges, some.len());
        if *lines == Lines::Middle {
            cast.grade(scene, light);
        }
        events.next = to;
        events.edges += cast.edges.len();
        Answer::Part {
            pair: *pair,
            version: *version,
            cast,
            last,
        }
    }
}
