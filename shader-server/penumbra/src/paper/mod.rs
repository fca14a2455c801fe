//! The paper's own order: polygon after polygon, each through the hierarchy of receivers (Figures 2 and 3).
//!
//! Kept for its claims; leaf by leaf the same masks come cheaper. Every optimisation can be left out.

mod hierarchy;
mod masks;
mod process;
mod volume;

use std::time::Instant;

use crate::{
    caster::Caster,
    predicate::horizon,
    receivers::{Point, Receivers},
};
use hierarchy::Hierarchy;
use masks::Masks;
pub(crate) use process::HardRow;
use process::Process;

#[cfg(test)]
mod tests;

/// Which of the paper's optimisations to use (its section 3.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PaperOrder {
    /// A: nodes and receivers remember which groups are dark, and the hierarchy is built anew as receivers go dark.
    pub umbra_bits: bool,
    /// B: planes of a volume that a node is on the inner side of are not tried below it.
    pub active_planes: bool,
    /// C: volumes of groups and samples are made when the first receiver needs them.
    pub lazy_volumes: bool,
    /// D: masks are given out when needed, and taken back in the dark.
    pub masks_on_demand: bool,
    /// Large polygons first, in buckets by area.
    pub sort_blockers: bool,
    /// Samples are tried by hard shadow volumes, four planes a sample; else by functions that are linear on the light.
    pub hard_volumes: bool,
}

impl PaperOrder {
    /// Everything that the paper has.
    pub const ALL: Self = Self {
        umbra_bits: true,
        active_planes: true,
        lazy_volumes: true,
        masks_on_demand: true,
        sort_blockers: true,
        hard_volumes: true,
    };
}

/// What casting in the paper's order gave and took.
#[derive(Debug)]
pub struct PaperSeen {
    groups: usize,
    /// Of each receiver its place among the points, or none where all is dark.
    point_of: Vec<Option<u32>>,
    horizons: Vec<Option<Vec<u32>>>,
    umbra: Vec<u32>,
    masks: Masks,
    /// Seconds for coarse sorting of the polygons, for building hierarchies, and for casting without those.
    pub sort_s: f64,
    /// See [`sort_s`](Self::sort_s).
    pub build_s: f64,
    /// See [`sort_s`](Self::sort_s).
    pub cast_s: f64,
    /// Bytes of the receiver points, of the largest hierarchy and of the masks that were in use at once.
    pub points_bytes: usize,
    /// See [`points_bytes`](Self::points_bytes).
    pub hierarchy_bytes: usize,
    /// See [`points_bytes`](Self::points_bytes).
    pub masks_bytes: usize,
    /// How often the hierarchy was built.
    pub builds: u32,
}

impl PaperSeen {
    /// The mask of every receiver, one bit a sample, set where it is blocked.
    #[must_use]
    pub fn masks(&self) -> Vec<u32> {
        let mut all = vec![u32::MAX; self.point_of.len() * self.groups];
        for (mask, point) in all.chunks_mut(self.groups).zip(&self.point_of) {
            let Some(point) = *point else { continue };
            match self.masks.existing(point) {
                Some(known) => mask.copy_from_slice(known),
                None => mask.fill(0),
            }
            for (group, word) in mask.iter_mut().enumerate() {
                if self.umbra[point as usize] >> group & 1 == 1 {
                    *word = u32::MAX;
                }
                if let Some(horizon) = &self.horizons[point as usize] {
                    *word |= horizon[group];
                }
            }
        }
        all
    }
}

/// Below a receiver's horizon nothing counts, whatever blocks it.
fn below_horizon(caster: &Caster, point: &Point) -> Option<Vec<u32>> {
    if point.normal == [0.; 3] {
        return None;
    }
    let light = caster.light();
    let horizon = horizon(point.at, point.normal);
    let below = |sample: u32| horizon.value(light.local_sample(point.set, sample)) < horizon.least;
    let mut words = vec![0; light.groups()];
    for sample in (0..light.sampling().samples).filter(|sample| below(*sample)) {
        words[sample as usize / 32] |= 1 << (sample % 32);
    }
    words.iter().any(|word| *word != 0).then_some(words)
}

impl Caster {
    /// Casts in the paper's order, on one thread: the same masks as any other way, to the bit.
    #[must_use]
    pub fn cast_in_papers_order(&self, receivers: &Receivers, order: &PaperOrder) -> PaperSeen {
        let light = self.light();
        let mut point_of = vec![None; receivers.len()];
        let mut points = Vec::with_capacity(receivers.len());
        for (index, place) in point_of.iter_mut().enumerate() {
            let point = Point::new(light, receivers, index, |own| self.key(own));
            if point.may_see(light) {
                *place = Some(points.len() as u32);
                points.push(point);
            }
        }
        let horizons = points.iter().map(|p| below_horizon(self, p)).collect();
        let start = Instant::now();
        let blockers = self.blockers_in_order(order.sort_blockers);
        let sort_s = start.elapsed().as_secs_f64();

        let start = Instant::now();
        let mut process = Process::new(self, &points, order);
        for (part, index) in blockers {
            process.blocker(part, &self.parts[part as usize].blockers[index as usize]);
        }
        let all_s = start.elapsed().as_secs_f64();
        PaperSeen {
            groups: light.groups(),
            point_of,
            horizons,
            sort_s,
            build_s: process.build_s,
            cast_s: all_s - process.build_s,
            points_bytes: size_of_val(&points[..]),
            hierarchy_bytes: process.hierarchy_bytes,
            masks_bytes: process.masks.peak_bytes(),
            builds: process.builds,
            umbra: process.umbra,
            masks: process.masks,
        }
    }

    /// Part and number of every polygon: opaque ones in buckets of falling area, then those with holes.
    fn blockers_in_order(&self, sorted: bool) -> Vec<(u32, u32)> {
        let all = self.parts.iter().enumerate().flat_map(|(part, p)| {
            (0..p.blockers.len()).map(move |index| (part as u32, index as u32))
        });
        let all: Vec<(u32, u32)> = all.collect();
        if !sorted {
            return all;
        }
        let bucket = |(part, index): (u32, u32)| {
            process::bucket(&self.parts[part as usize].blockers[index as usize])
        };
        let mut ends = [0usize; process::BUCKETS + 1];
        for blocker in &all {
            ends[bucket(*blocker) + 1] += 1;
        }
        for i in 1..ends.len() {
            ends[i] += ends[i - 1];
        }
        let mut sorted = vec![(0, 0); all.len()];
        for blocker in all {
            let place = &mut ends[bucket(blocker)];
            sorted[*place] = blocker;
            *place += 1;
        }
        sorted
    }
}
