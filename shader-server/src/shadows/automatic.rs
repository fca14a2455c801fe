//! The cheapest method that is good enough.
//!
//! Methods are tried on a pilot's receivers. Those whose preparation alone would cost more than shadow rays do for a whole
//! picture are not even prepared.

use std::sync::Arc;

use penumbra::{Costs, MAX_SAMPLES, Sampling};
use soft_maps::{Options, Transition, predicted_error};

use super::{
    ShadowRays, Work,
    casting::{Blockers, Casting},
    chosen::{Choice, Way},
    mapping::{self, Mapping},
    pilot::{Effort, Pilot, Tried},
};
use crate::stage::Stage;

/// Receivers that a light's preparations serve before something moves: a picture of 512x512.
pub(super) const PICTURE: f64 = 262_144.;

/// Samples come in groups of so many.
const GROUP: u32 = 32;
/// What is tried first, and tells about the others.
const TRIED_SAMPLES: u32 = 256;
/// Jittered samples of a square have an error that falls with this power of their number: about the square root of the strata
/// that an outline passes through are in doubt, out of all.
const POWER: f64 = 0.75;

/// Share of the error allowed that a method may seem to have: what some two hundred receivers tell is a tenth off or so.
const MARGIN: f64 = 0.85;

/// Strata a side that shadow rays begin with.
const STRATA: [u32; 5] = [2, 3, 4, 5, 8];

/// Angles between texels of maps, radians, from cheap to exact.
const TEXELS: [f32; 4] = [0.016, 0.008, 0.004, 0.002];

/// Nanoseconds of one thread for a unit of work.
///
/// Medians on a 2.6 GHz AMD EPYC 9R14 over the built-in scenes. Their ratios count, not their size.
struct Units {
    /// To look for what may be between a receiver and a light.
    search: f64,
    /// A shadow ray.
    ray: f64,
    /// A face drawn onto a light.
    face: f64,
    /// To sort a receiver into a leaf and to weigh its samples.
    cast_receiver: f64,
    /// Casting.
    casting: Costs,
    /// Making a face ready to be cast.
    prepared_face: f64,
    /// A texel of a map with its share of what follows.
    texel: f64,
    /// Asking the map of a sample.
    lookup: f64,
}

const UNITS: Units = Units {
    search: 450.,
    ray: 150.,
    face: 250.,
    cast_receiver: 110.,
    casting: Costs::TYPICAL,
    prepared_face: 300.,
    texel: 350.,
    lookup: 300.,
};

/// A method with a setting, and what it is expected to come to.
struct Candidate {
    way: Way,
    name: String,
    error: f64,
    /// Nanoseconds a receiver, preparations included.
    cost: f64,
}

/// What all lights of a scene have in common.
pub(super) struct Terms<'a> {
    pub(super) stage: &'a Stage,
    pub(super) rays: ShadowRays,
    pub(super) error: f64,
    /// Memory that preparations may fill, bytes.
    pub(super) most_bytes: usize,
    /// Costs are those of [`UNITS`] alone, the same on every machine.
    pub(super) steady: bool,
}

impl Terms<'_> {
    /// Chooses for a light that has more than one place. `blockers` are made if they are needed.
    pub(super) fn choose(&self, light: usize, blockers: &mut Option<Blockers>) -> Choice {
        let pilot = Pilot::new(
            self.stage,
            light,
            self.rays,
            &Effort::choosing(self.stage, !self.steady),
        );
        if pilot.penumbral() == 0 {
            return self.only_rays(format!(
                "none of {} receivers tried is in a penumbra: nothing else is worth preparing",
                pilot.len()
            ));
        }
        let mut candidates: Vec<Candidate> = STRATA
            .iter()
            .map(|strata| self.by_rays(&pilot, *strata))
            .collect();
        let least = self.best(&candidates).map_or(0., |best| best.cost);
        self.add_casting(&pilot, (light, least), blockers, &mut candidates);
        self.add_maps(&pilot, (light, least), &mut candidates);
        let Some(best) = self.best(&candidates) else {
            return self.only_rays("nothing could be tried".into());
        };
        let others = candidates
            .iter()
            .filter(|other| other.name != best.name)
            .map(Candidate::told)
            .collect::<Vec<String>>();
        Choice {
            why: format!("{}; tried beside it: {}", best.told(), others.join(", ")),
            way: best.way.clone(),
        }
    }

    /// The cheapest that is good enough, or the best if none is.
    fn best<'c>(&self, candidates: &'c [Candidate]) -> Option<&'c Candidate> {
        let fits = |c: &&Candidate| c.way.bytes() <= self.most_bytes;
        let candidates = || candidates.iter().filter(fits);
        let good = candidates().filter(|c| c.error <= MARGIN * self.error);
        let cheapest = good.min_by(|a, b| a.cost.total_cmp(&b.cost));
        let most_exact = || candidates().min_by(|a, b| a.error.total_cmp(&b.error));
        cheapest.or_else(most_exact)
    }

    fn only_rays(&self, why: String) -> Choice {
        Choice {
            way: Way::Rays(self.rays),
            why,
        }
    }

    fn by_rays(&self, pilot: &Pilot<'_>, strata: u32) -> Candidate {
        let rays = ShadowRays {
            strata,
            ..self.rays
        };
        let tried = pilot.try_out(&rays);
        Candidate {
            name: format!("rays from {strata}x{strata} strata"),
            error: tried.error,
            cost: self.cost(
                &tried,
                UNITS.search + rays_ns(&tried.work) / pilot.len() as f64,
            ),
            way: Way::Rays(rays),
        }
    }

    /// Nanoseconds a receiver: as measured, or by what was done.
    fn cost(&self, tried: &Tried, modelled_ns: f64) -> f64 {
        if self.steady {
            modelled_ns
        } else {
            1e9 * tried.seconds
        }
    }

    fn add_casting(
        &self,
        pilot: &Pilot<'_>,
        (light, least): (usize, f64),
        blockers: &mut Option<Blockers>,
        candidates: &mut Vec<Candidate>,
    ) {
        let faces: usize = self
            .stage
            .placements()
            .map(|(mesh, _)| self.faces(mesh))
            .sum();
        let preparing = UNITS.prepared_face * faces as f64 / PICTURE;
        if preparing >= least {
            return;
        }
        let blockers = blockers.get_or_insert_with(|| Blockers::new(self.stage));
        let emitter = &self.stage.emitters()[light];
        let sampled = |samples| Sampling {
            samples,
            ..Sampling::default()
        };
        let Ok(casting) = Casting::new(self.stage, blockers, emitter, sampled(TRIED_SAMPLES))
        else {
            return;
        };
        let tried = pilot.try_out(&casting);
        let counts = tried.work.casting;
        let casting_ns = UNITS.casting.casting_ns(&counts);
        let modelled_ns = UNITS.cast_receiver + casting_ns / pilot.len() as f64;
        let cost = self.cost(&tried, modelled_ns);
        // Samples are tried row by row, and receivers and polygons whatever their number.
        let by_row = UNITS.casting.row_ns * counts.rows as f64;
        let row_share = by_row / casting_ns.max(1.);
        let mut add = |samples: u32, way: Way| {
            let ratio = f64::from(samples) / f64::from(TRIED_SAMPLES);
            candidates.push(Candidate {
                way,
                name: format!("casting {samples} samples"),
                error: tried.error * ratio.powf(-POWER),
                cost: preparing + cost * (1. - row_share + row_share * ratio),
            });
        };
        add(TRIED_SAMPLES, Way::Casting(Arc::new(casting)));
        let needed = enough(tried.error / (MARGIN * self.error));
        if needed != TRIED_SAMPLES
            && let Ok(casting) = Casting::new(self.stage, blockers, emitter, sampled(needed))
        {
            add(needed, Way::Casting(Arc::new(casting)));
        }
    }

    fn faces(&self, mesh: u32) -> usize {
        self.stage.scene().meshes[mesh as usize].faces.len()
    }

    fn add_maps(
        &self,
        pilot: &Pilot<'_>,
        (light, least): (usize, f64),
        candidates: &mut Vec<Candidate>,
    ) {
        let emitter = &self.stage.emitters()[light];
        let Some(mapped) = mapping::mapped(emitter) else {
            return;
        };
        for texel_angle in TEXELS {
            let options = Options {
                texel_angle,
                ..mapping::OPTIONS
            };
            // Polygons are taken for their edges, which is wrong by an edge's share at worst and a fraction of that on the whole.
            let worst = pilot
                .places()
                .map(|place| {
                    let transition = Transition::Rational;
                    let samples = options.samples;
                    predicted_error(&mapped, place, samples, texel_angle, 0., transition).transition
                })
                .fold(0., f32::max);
            if f64::from(worst) > 8. * self.error {
                return;
            }
            let Ok(Some(maps)) = Mapping::new(self.stage, emitter, &options) else {
                return;
            };
            let stats = maps.stats();
            let preparing = UNITS.texel * stats.texels as f64 / PICTURE;
            let tried = pilot.try_out(&maps);
            let lookups = UNITS.lookup * stats.samples as f64;
            let candidate = Candidate {
                name: format!("maps of {texel_angle} radians"),
                error: tried.error,
                cost: preparing + self.cost(&tried, lookups),
                way: Way::Maps(Arc::new(maps)),
            };
            let good = candidate.error <= MARGIN * self.error;
            let dear = candidate.cost > least;
            candidates.push(candidate);
            if good || dear {
                return;
            }
        }
    }
}

/// Samples that bring an error so many times too large with [`TRIED_SAMPLES`] down to what is wanted, if any do.
fn enough(too_large: f64) -> u32 {
    let samples = f64::from(TRIED_SAMPLES) * too_large.powf(1. / POWER);
    let groups = (samples / f64::from(GROUP)).ceil();
    groups.clamp(1., f64::from(MAX_SAMPLES / GROUP)) as u32 * GROUP
}

fn rays_ns(work: &Work) -> f64 {
    UNITS.ray * work.rays as f64 + UNITS.face * work.drawn as f64
}

impl Candidate {
    fn told(&self) -> String {
        format!(
            "{} {:.2} % at {:.1} µs",
            self.name,
            100. * self.error,
            1e-3 * self.cost
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_as_many_as_the_error_needs() {
        assert_eq!(enough(1.), TRIED_SAMPLES);
        assert_eq!(enough(2f64.powf(POWER)), 2 * TRIED_SAMPLES);
        assert_eq!(enough(0.), GROUP);
        assert_eq!(enough(f64::INFINITY), MAX_SAMPLES);
        let some = enough(0.7);
        assert!(some.is_multiple_of(GROUP) && some < TRIED_SAMPLES);
        let error = |samples: u32| (f64::from(samples) / f64::from(TRIED_SAMPLES)).powf(-POWER);
        assert!(0.7 * error(some) <= 1. && 0.7 * error(some - GROUP) > 1.);
    }
}
