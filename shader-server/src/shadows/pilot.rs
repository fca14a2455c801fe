//! A few receivers of a light, on which methods are tried before one is chosen.

use cpu_time::ThreadTime;
use glam::{DVec3, Vec3};
use rayon::{ThreadPool, ThreadPoolBuilder, prelude::*};
use rays::Ray;

use super::{Asked, ShadowRays, Shadows, Visibility};
use crate::{
    irradiance::hemisphere::frame,
    lights::{Emitter, Receiver, Shape},
    random::Stream,
    stage::Stage,
};

/// Receivers wanted; twice as many rays from the light are spent on finding them.
const RECEIVERS: usize = 1024;
/// Surfaces met one behind the other: what is behind the first is where shadows are.
const DEEP: usize = 4;
/// Receivers in penumbrae whose true answer is found, at most.
const TRUTHS: usize = 192;
/// Lights of which each gets all that.
const FEW_LIGHTS: usize = 8;
/// Tells streams for finding receivers from those of requests.
const SEED: u64 = 0x0070_1107;

/// By which penumbrae are judged: a ray to each of 1024 strata.
const TRUTH: ShadowRays = ShadowRays {
    max_rays: 4096,
    strata: 32,
    drawn_faces: 0,
};

/// What is spent on a pilot.
pub(super) struct Effort {
    /// Receivers, at most about; at least one.
    pub(super) receivers: usize,
    /// Receivers in penumbrae whose true answer is found, at most about.
    pub(super) truths: usize,
    /// Another one, other receivers.
    pub(super) seed: u64,
    /// Take the time as well.
    pub(super) timed: bool,
}

impl Effort {
    /// For choosing a method: all lights together get no more than a few would.
    pub(super) fn choosing(stage: &Stage, timed: bool) -> Self {
        let part = (stage.emitters().len() / FEW_LIGHTS).max(1);
        Self {
            receivers: (RECEIVERS / part).max(1),
            truths: (TRUTHS / part).max(1),
            seed: SEED,
            timed,
        }
    }
}

/// What trying a method gave.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Tried {
    /// Root mean square over the receivers in penumbrae, as a share of the light.
    pub(super) error: f64,
    /// Seconds of one thread for each receiver; 0 if no time was taken.
    pub(super) seconds: f64,
    /// What was done for all of them.
    pub(super) work: super::Work,
}

/// Receivers of one light with what is known of them.
pub(super) struct Pilot<'a> {
    stage: &'a Stage,
    light: usize,
    asked: Vec<Asked>,
    /// A thread on which time is taken, if it is to be.
    clock: Option<ThreadPool>,
    /// Receivers in penumbrae, and what they see.
    truth: Vec<(usize, f32)>,
}

impl<'a> Pilot<'a> {
    /// Finds receivers where light falls or would fall, and the true answer for some of those in penumbrae. The same in every
    /// run.
    pub(super) fn new(stage: &'a Stage, light: usize, rays: ShadowRays, effort: &Effort) -> Self {
        let emitter = &stage.emitters()[light];
        let seed = effort.seed.wrapping_add(light as u64);
        let found: Vec<Vec<Receiver>> = (0..2 * effort.receivers as u64)
            .into_par_iter()
            .map(|ray| below(stage, emitter, Stream::new(seed, ray)))
            .collect();
        // Spread over all rays from the light.
        let all: Vec<Receiver> = found.into_iter().flatten().collect();
        let step = all.len().div_ceil(effort.receivers).max(1);
        let asked = all.into_iter().step_by(step).enumerate();
        let asked = asked.map(|(index, receiver)| Asked {
            receiver,
            stream: Stream::new(!seed, index as u64),
            index,
            unoccluded: emitter.unoccluded(&receiver) as f32,
            seen: 0.,
        });
        let mut pilot = Self {
            stage,
            light,
            asked: asked.collect(),
            clock: effort
                .timed
                .then(|| ThreadPoolBuilder::new().num_threads(1).build().ok())
                .flatten(),
            truth: Vec::new(),
        };
        pilot.find_truth(rays, effort.truths);
        pilot
    }

    fn find_truth(&mut self, rays: ShadowRays, most: usize) {
        let seen = self.answers(&rays);
        let partly = (0..seen.len()).filter(|index| seen[*index] > 0. && seen[*index] < 1.);
        let partly: Vec<usize> = partly.collect();
        let step = partly.len().div_ceil(most.max(1)).max(1);
        let some: Vec<usize> = partly.into_iter().step_by(step).collect();
        self.truth = some
            .into_par_iter()
            .map(|index| {
                let mut one = [self.asked[index].clone()];
                TRUTH.ask(self.stage, self.light, &mut one, &mut Shadows::default());
                (index, one[0].seen)
            })
            .collect();
    }

    fn answers(&self, method: &dyn Visibility) -> Vec<f32> {
        let parts = self.asked.par_chunks(64).map(|asked| {
            let mut asked = asked.to_vec();
            method.ask(self.stage, self.light, &mut asked, &mut Shadows::default());
            asked.into_iter().map(|asked| asked.seen)
        });
        parts.flat_map_iter(|seen| seen).collect()
    }

    /// Receivers found.
    pub(super) fn len(&self) -> usize {
        self.asked.len()
    }

    /// Receivers in penumbrae whose answer is known.
    pub(super) fn penumbral(&self) -> usize {
        self.truth.len()
    }

    /// The receivers' places and normals.
    pub(super) fn places(&self) -> impl Iterator<Item = [Vec3; 2]> + '_ {
        let receivers = self.asked.iter().map(|asked| &asked.receiver);
        receivers.map(|at| [at.position.as_vec3(), at.normal.as_vec3()])
    }

    /// Tries a method on all receivers at once.
    pub(super) fn try_out(&self, method: &dyn Visibility) -> Tried {
        let mut asked = self.asked.clone();
        let mut shadows = Shadows::default();
        let mut ask = || method.ask(self.stage, self.light, &mut asked, &mut shadows);
        let mut elapsed = 0.;
        match &self.clock {
            None => ask(),
            Some(clock) => {
                // The second time everything is in the caches, as it will be.
                let times = [(); 2].map(|()| {
                    clock.install(|| {
                        let start = ThreadTime::now();
                        ask();
                        start.elapsed().as_secs_f64()
                    })
                });
                elapsed = times[0].min(times[1]);
            }
        }
        let squares = self.truth.iter().map(|(index, truth)| {
            let off = f64::from(asked[*index].seen - truth);
            off * off
        });
        Tried {
            error: (squares.sum::<f64>() / self.truth.len().max(1) as f64).sqrt(),
            seconds: elapsed / self.asked.len().max(1) as f64,
            work: shadows.work(),
        }
    }
}

/// Receivers along a random ray from the light.
fn below(stage: &Stage, light: &Emitter, mut stream: Stream) -> Vec<Receiver> {
    let mut found = Vec::new();
    let Some(from) = light.shape.somewhere(&mut stream) else {
        return found;
    };
    let direction = away(&light.shape, &mut stream);
    let (mut origin, mut skip) = (from, None);
    for _ in 0..DEEP {
        let ray = Ray {
            origin: origin.as_vec3(),
            direction: direction.as_vec3(),
        };
        let Some(hit) = stage.world().closest(&ray, f32::INFINITY) else {
            break;
        };
        let reached = ray.at(hit.t).as_dvec3();
        // A step on, by more than rounding.
        origin = reached + direction * (1e-6 * (1. + reached.abs().max_element()));
        if skip.replace((hit.instance, hit.face)) == Some((hit.instance, hit.face)) {
            continue;
        }
        let Some(surface) = stage.surface(&hit) else {
            continue;
        };
        let receiver = surface.seen_along(direction, hit.instance, hit.face);
        if light.unoccluded(&receiver) as f32 > 0. {
            found.push(receiver);
        }
    }
    found
}

/// A random unit direction in which the light shines: by the cosine from a polygon, to all sides from others.
fn away(shape: &Shape, stream: &mut Stream) -> DVec3 {
    let place = stream.square().as_dvec2();
    let (sin, cos) = (std::f64::consts::TAU * place.x).sin_cos();
    match shape {
        Shape::Polygon(polygon) if polygon.normal != DVec3::ZERO => {
            let [u, v] = frame(polygon.normal);
            let radius = place.y.sqrt();
            u * (radius * cos) + v * (radius * sin) + polygon.normal * (1. - place.y).sqrt()
        }
        _ => {
            let height = 2. * place.y - 1.;
            let radius = (1. - height * height).max(0.).sqrt();
            DVec3::new(radius * cos, height, radius * sin)
        }
    }
}
