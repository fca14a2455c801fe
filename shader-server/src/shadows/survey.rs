//! What every method costs for a light, at every setting, and how wrong it is.
//!
//! Judged on other receivers than those that choices are made by, and more of them.

use std::sync::Arc;

use cpu_time::ThreadTime;
use penumbra::Sampling;
use protocol::messages::ShadowMethod;
use rayon::ThreadPoolBuilder;
use soft_maps::Options;

use super::{
    ShadowRays,
    automatic::{PICTURE, Terms},
    casting::{Blockers, Casting},
    chosen::Way,
    mapping::{self, Mapping},
    pilot::{Effort, Pilot},
};
use crate::stage::Stage;

/// Strata that rays begin with, sample counts of casting and angles between texels of maps, radians.
const STRATA: [u32; 6] = [2, 3, 4, 5, 8, 12];
const SAMPLES: [u32; 6] = [32, 64, 128, 256, 512, 1024];
const TEXELS: [f32; 4] = [0.016, 0.008, 0.004, 0.002];

const EFFORT: Effort = Effort {
    receivers: 4096,
    truths: 768,
    seed: 0x0054_7e11,
    timed: true,
};

/// A method with a setting, measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Surveyed {
    /// The method.
    pub method: ShadowMethod,
    /// Its setting, for people.
    pub setting: String,
    /// Root mean square error over receivers in penumbrae, as a share of the light.
    pub error: f64,
    /// Seconds of one thread to prepare it.
    pub prepare_s: f64,
    /// Seconds of one thread for a receiver.
    pub receiver_s: f64,
}

impl Surveyed {
    /// Seconds of one thread for a receiver, preparations shared among those of a picture.
    #[must_use]
    pub fn cost_s(&self) -> f64 {
        self.receiver_s + self.prepare_s / PICTURE
    }
}

/// What the automatic choice takes.
#[derive(Clone, Debug, PartialEq)]
pub struct Pick {
    /// The error allowed.
    pub allowed: f64,
    /// What it took, measured like all others.
    pub taken: Surveyed,
}

/// All methods for one light.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Survey {
    /// Every method at every setting.
    pub rows: Vec<Surveyed>,
    /// The automatic choice for each error asked for.
    pub picks: Vec<Pick>,
}

impl Survey {
    /// Measures all methods for a light of the stage, and what the automatic choice takes for each of `errors`. Empty if no
    /// receiver found is in a penumbra. Takes some seconds.
    #[must_use]
    pub fn new(stage: &Stage, light: usize, errors: &[f64]) -> Self {
        let pilot = Pilot::new(stage, light, ShadowRays::default(), &EFFORT);
        let mut survey = Self::default();
        if pilot.penumbral() == 0 {
            return survey;
        }
        let mut add = |way: &Way, prepare_s: f64, setting: String| {
            survey.rows.push(measured(&pilot, way, prepare_s, setting));
        };
        for drawn_faces in [0, ShadowRays::default().drawn_faces] {
            for strata in STRATA {
                let rays = ShadowRays {
                    strata,
                    drawn_faces,
                    ..ShadowRays::default()
                };
                let drawn = if drawn_faces > 0 {
                    ", few faces drawn"
                } else {
                    ""
                };
                add(
                    &Way::Rays(rays),
                    0.,
                    format!("{strata}x{strata} strata{drawn}"),
                );
            }
        }
        let mut blockers = None;
        for samples in SAMPLES {
            let sampling = Sampling {
                samples,
                ..Sampling::default()
            };
            if let Some((way, prepare_s)) = timed(|| casting(stage, light, sampling, &mut blockers))
            {
                // Without what lights share: the meshes are made ready once.
                add(&way, prepare_s, format!("{samples} samples"));
            }
        }
        for texel_angle in TEXELS {
            let options = Options {
                texel_angle,
                ..mapping::OPTIONS
            };
            if let Some((way, prepare_s)) = timed(|| maps(stage, light, &options)) {
                add(&way, prepare_s, format!("texels of {texel_angle} radians"));
            }
        }
        for allowed in errors {
            let terms = Terms {
                stage,
                rays: ShadowRays::default(),
                error: *allowed,
                most_bytes: usize::MAX,
                steady: false,
            };
            let choice = terms.choose(light, &mut blockers);
            let prepare_s = prepared(stage, light, &choice.way, &mut blockers);
            survey.picks.push(Pick {
                allowed: *allowed,
                taken: measured(&pilot, &choice.way, prepare_s, setting_of(&choice.way)),
            });
        }
        survey
    }

    /// The cheapest method that keeps an error, if any does.
    #[must_use]
    pub fn cheapest(&self, allowed: f64) -> Option<&Surveyed> {
        let good = self.rows.iter().filter(|row| row.error <= allowed);
        good.min_by(|a, b| a.cost_s().total_cmp(&b.cost_s()))
    }

    /// Cost of the automatic choice over that of the cheapest method that keeps the error, for each pick for which any does.
    #[must_use]
    pub fn ratios(&self) -> Vec<f64> {
        let of = |pick: &Pick| Some(pick.taken.cost_s() / self.cheapest(pick.allowed)?.cost_s());
        self.picks.iter().filter_map(of).collect()
    }
}

fn measured(pilot: &Pilot<'_>, way: &Way, prepare_s: f64, setting: String) -> Surveyed {
    let tried = pilot.try_out(way.visibility());
    Surveyed {
        method: way.method(),
        setting,
        error: tried.error,
        prepare_s,
        receiver_s: tried.seconds,
    }
}

/// What `make` gives, if anything, with the processor time that it took on one thread.
fn timed<T: Send>(make: impl FnOnce() -> Option<T> + Send) -> Option<(T, f64)> {
    let one = ThreadPoolBuilder::new().num_threads(1).build().ok()?;
    one.install(|| {
        let start = ThreadTime::now();
        let made = make()?;
        Some((made, start.elapsed().as_secs_f64()))
    })
}

fn casting(
    stage: &Stage,
    light: usize,
    sampling: Sampling,
    blockers: &mut Option<Blockers>,
) -> Option<Way> {
    let blockers = blockers.get_or_insert_with(|| Blockers::new(stage));
    let emitter = stage.emitters().get(light)?;
    let casting = Casting::new(stage, blockers, emitter, sampling).ok()?;
    Some(Way::Casting(Arc::new(casting)))
}

fn maps(stage: &Stage, light: usize, options: &Options) -> Option<Way> {
    let maps = Mapping::new(stage, stage.emitters().get(light)?, options);
    Some(Way::Maps(Arc::new(maps.ok()??)))
}

/// Seconds that preparing a way takes.
fn prepared(stage: &Stage, light: usize, way: &Way, blockers: &mut Option<Blockers>) -> f64 {
    let again = match way {
        Way::Rays(_) => None,
        Way::Casting(before) => timed(|| casting(stage, light, before.sampling(), blockers)),
        Way::Maps(before) => timed(|| maps(stage, light, before.options())),
    };
    again.map_or(0., |(_, seconds)| seconds)
}

fn setting_of(way: &Way) -> String {
    match way {
        Way::Rays(rays) => format!("{0}x{0} strata", rays.strata),
        Way::Casting(casting) => format!("{} samples", casting.sampling().samples),
        Way::Maps(maps) => format!("texels of {} radians", maps.options().texel_angle),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surveyed(error: f64, receiver_s: f64) -> Surveyed {
        Surveyed {
            method: ShadowMethod::Rays,
            setting: String::new(),
            error,
            prepare_s: 0.,
            receiver_s,
        }
    }

    #[test]
    fn ratios_are_to_the_cheapest_that_is_good_enough() {
        let survey = Survey {
            rows: vec![surveyed(0.1, 1.), surveyed(0.01, 2.), surveyed(0.01, 4.)],
            picks: [0.2, 0.05, 0.001]
                .map(|allowed| Pick {
                    allowed,
                    taken: surveyed(0.01, 3.),
                })
                .to_vec(),
        };
        assert_eq!(survey.ratios(), [3., 1.5]);
    }
}
