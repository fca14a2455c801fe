//! How far a server's answers are those that were recorded.

use std::collections::BTreeSet;
use std::fmt;

use protocol::messages::{Sample, Texel, Triple, flags};

use super::script::Script;

/// The comparison of a connection's answers with the recorded ones.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Compared {
    /// Answers that are the same to the bit.
    pub same: usize,
    /// Answers that are not, final ones both.
    pub differing: usize,
    /// Of these, those that hit another object.
    pub elsewhere: usize,
    /// Answers traced in another epoch than the recorded ones: an edit came sooner or later this time.
    pub other_epoch: usize,
    /// Greatest difference of radiance in a channel, as a share of the recorded radiance.
    pub radiance: f32,
    /// Greatest distance between positions, metres.
    pub distance_m: f32,
    /// Answers that were provisional, then or now: they depend on when they are asked for.
    pub provisional: usize,
    /// Recorded triples that were not told.
    pub triples_missing: usize,
    /// Triples that were not recorded.
    pub triples_new: usize,
}

/// Radiance below which shares mean nothing, W/(m² sr).
const DARK: f32 = 1e-3;

impl Compared {
    /// Takes an answer in; one that was never recorded says nothing.
    pub(super) fn add(
        &mut self,
        script: &Script,
        epoch: u32,
        sample: &Sample,
        texel: Option<&Texel>,
    ) {
        let Some((then, old, old_texel)) = script.answers.get(&sample.id) else {
            return;
        };
        if (sample.flags | old.flags) & flags::PROVISIONAL != 0 {
            self.provisional += 1;
            return;
        }
        let bytes = |one: (u32, &Sample, Option<&Texel>)| protocol::encode(&one).ok();
        if bytes((epoch, sample, texel)) == bytes((*then, old, old_texel.as_ref())) {
            self.same += 1;
            return;
        }
        if epoch != *then {
            self.other_epoch += 1;
            return;
        }
        self.differing += 1;
        if sample.object != old.object {
            self.elsewhere += 1;
            return;
        }
        for (new, old) in sample.radiance.iter().zip(old.radiance) {
            self.radiance = self.radiance.max((new - old).abs() / old.max(DARK));
        }
        let offset = glam::Vec3::from(sample.position) - glam::Vec3::from(old.position);
        self.distance_m = self.distance_m.max(offset.length());
    }

    /// Takes in which triples were told in all.
    pub(super) fn add_triples(&mut self, script: &Script, told: &BTreeSet<(u32, Triple)>) {
        self.triples_missing = script.triples.difference(told).count();
        self.triples_new = told.difference(&script.triples).count();
    }
}

impl fmt::Display for Compared {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} answers as recorded to the bit", self.same)?;
        if self.differing > 0 {
            write!(
                f,
                ", {} differ: {} on another object, else radiance by at most {:.2e} of itself and places by {:.2e} m",
                self.differing, self.elsewhere, self.radiance, self.distance_m
            )?;
        }
        if self.other_epoch > 0 {
            write!(f, ", {} before another edit", self.other_epoch)?;
        }
        if self.provisional > 0 {
            write!(f, ", {} provisional", self.provisional)?;
        }
        if self.triples_missing + self.triples_new > 0 {
            write!(
                f,
                ", {} triples missing and {} new",
                self.triples_missing, self.triples_new
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_told_by_kind_and_size() {
        let sample = |id, x: f32, red: f32, flags| Sample {
            id,
            position: [x, 0.0, 0.0],
            object: 1,
            radiance: [red, 0.0, 1.0],
            flags,
        };
        let mut script = Script::default();
        for id in 0..6 {
            script
                .answers
                .insert(id, (0, sample(id, 1.0, 0.5, 0), None));
        }
        let mut compared = Compared::default();
        compared.add(&script, 0, &sample(0, 1.0, 0.5, 0), None);
        compared.add(&script, 0, &sample(1, 1.0, 0.25, 0), None);
        compared.add(&script, 0, &sample(2, 1.5, 0.5, 0), None);
        compared.add(&script, 1, &sample(3, 1.0, 0.5, 0), None);
        let other = Sample {
            object: 2,
            ..sample(5, 1.0, 0.5, 0)
        };
        compared.add(&script, 0, &other, None);
        compared.add(&script, 0, &sample(4, 9.0, 9.0, flags::PROVISIONAL), None);
        compared.add(&script, 0, &sample(77, 9.0, 9.0, 0), None);
        let triple = |light| Triple {
            light,
            blocker: 0,
            receiver: 0,
        };
        script.triples = BTreeSet::from([(0, triple(0)), (0, triple(1))]);
        compared.add_triples(&script, &BTreeSet::from([(0, triple(1)), (1, triple(1))]));
        let wanted = Compared {
            same: 1,
            differing: 3,
            elsewhere: 1,
            other_epoch: 1,
            radiance: 0.5,
            distance_m: 0.5,
            provisional: 1,
            triples_missing: 1,
            triples_new: 1,
        };
        assert_eq!(compared, wanted);
    }
}
