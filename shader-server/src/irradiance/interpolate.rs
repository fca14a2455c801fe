//! Irradiance between records.
//!
//! Levels are gone through from coarse to fine. At each, the records around the point say how far they can be relied on, and
//! so how near they should lie; where that is nearer than they do, the next level takes over, gradually, so that what is
//! interpolated has no steps. Which records are asked depends on the point and the pixel's size alone.

use glam::{DVec3, IVec3, Vec3};
use rays::Ray;

use super::{
    IrradianceCache, Patience, Site,
    hemisphere::Strata,
    lattice::{Cell, DEEPEST, Place, is_front},
    record::Record,
};
use crate::{lights::Receiver, random::Stream, stage::Stage};

/// How near records should lie as a share of how far they can be relied on: Ward's accuracy.
const ACCURACY: f64 = 0.3;

/// How near records should lie as a share of the distance to the nearest thing: what is thin says little to the harmonic mean, and
/// much to its own surroundings.
const NEARBY: f64 = 0.5;

/// Spacing of records at least and at most, pixels as wide as they are at the point (Tabellion and Lamorlette 2004).
const LEAST_PX: f64 = 4.;
const MOST_PX: f64 = 64.;

/// Where records do not fit the point, levels so much finer are tried.
const THIN_PX: f64 = 1.5;

/// Records within so many spacings count.
const SUPPORT: f64 = 1.5;

/// Records whose normals differ by an angle of this cosine or less count for nothing.
const LEAST_COSINE: f64 = 0.7;

/// Records farther above or below the tangent plane than this many spacings count for nothing.
const OFF_PLANE: f64 = 0.6;

/// A sum of weights that is enough not to look for finer records.
const ENOUGH: f64 = 0.8;

/// Records are doubted whose middle is so many spacings aside of the point, from no doubt to full: what is beyond them may be
/// hidden from all, or different.
const ASIDE: [f64; 2] = [0.35, 0.55];

/// Records are doubted that differ by such a share in what they say of the point, from no doubt to full. Noise is less.
const AT_ODDS: [f64; 2] = [0.05, 0.15];

/// Height at which the way to a record is looked along, spacings.
const LIFT: f64 = 0.1;

/// Rays where no record fits at all.
const ALONE: Strata = Strata {
    rings: 8,
    sectors: 20,
};

/// Indirect irradiance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Indirect {
    /// W/m².
    pub irradiance: Vec3,
    /// Whether a better value is being computed.
    pub is_provisional: bool,
}

/// What the records of one level say.
#[derive(Clone, Copy, Debug, Default)]
struct Estimate {
    weight: f64,
    irradiance: Vec3,
    reach_m: f64,
    /// How far it is to the nearest thing that a record sees, metres.
    nearest_m: f64,
    /// How far the records' middle is from the point, metres.
    aside_m: f64,
    /// Deviation of what single records say, as a share of their mean.
    at_odds: f64,
    is_provisional: bool,
}

/// Weighted sums over records around a point.
#[derive(Default)]
struct Sums {
    weight: f64,
    /// As each has it at its site, turned to the point's normal.
    at_sites: DVec3,
    /// As each expects it at the point.
    expected: DVec3,
    /// Square of the mean of that over channels.
    squared: f64,
    by_place: [DVec3; 3],
    /// From the point to the sites.
    offset: DVec3,
    reach_m: f64,
}

impl Sums {
    /// `trust` is the share of the record's change by place that counts.
    fn add(&mut self, record: &Record, at: &Receiver, weight: f64, trust: f32) {
        let expected = record.extrapolate(at, trust).as_dvec3();
        self.weight += weight;
        self.at_sites += record.extrapolate(at, 0.).as_dvec3() * weight;
        self.expected += expected * weight;
        self.squared += (expected.element_sum() / 3.).powi(2) * weight;
        for (sum, own) in self.by_place.iter_mut().zip(record.gathered.by_place) {
            *sum += own.as_dvec3() * (weight * f64::from(trust));
        }
        self.offset += (record.site.position - at.position) * weight;
        self.reach_m += weight * f64::from(record.reach_m());
    }

    /// The mean of two interpolations that are both exact where irradiance changes evenly. Where it bends, its tangents at the
    /// sites are all on one side of it, and the plane through the sites is as far on the other: half of each, as in Hermite
    /// interpolation, leaves only what comes of the sites' lying aside.
    fn irradiance(&self) -> DVec3 {
        let share = self.weight.recip();
        let change = self.by_place.map(|slope| -slope.dot(self.offset) * share);
        let by_sites = (self.at_sites + DVec3::from_array(change)) * share;
        (self.expected * share).midpoint(by_sites.max(DVec3::ZERO))
    }

    fn at_odds(&self) -> f64 {
        let mean = self.expected.element_sum() / 3. / self.weight;
        let variance = (self.squared / self.weight - mean * mean).max(0.);
        if mean > 0. {
            variance.sqrt() / mean
        } else {
            0.
        }
    }
}

impl Estimate {
    /// From 0 to 1, how much records this far apart are to be doubted for what they themselves say.
    fn doubt(&self, spacing: f64) -> f64 {
        let share = |x: f64, [none, full]: [f64; 2]| ((x - none) / (full - none)).clamp(0., 1.);
        share(self.aside_m / spacing, ASIDE).max(share(self.at_odds, AT_ODDS))
    }
}

impl IrradianceCache {
    /// Indirect irradiance at a point of which a pixel is `pixel_m` wide. Computes what is missing, or has it computed, by its
    /// [`Patience`].
    #[must_use]
    pub fn irradiance(&self, stage: &Stage, at: &Receiver, pixel_m: f64) -> Indirect {
        let pixel = pixel_m.max(1e-9);
        let (least, most) = (LEAST_PX * pixel, MOST_PX * pixel);
        let headroom = super::headroom_m(stage, at);
        let mut answer = Indirect::default();
        let (mut known, mut left) = (false, 1.);
        for level in 0..=DEEPEST {
            let spacing = self.lattice.spacing_m(level);
            // All would be left to the next level anyway.
            if spacing >= 2. * most && level < DEEPEST {
                continue;
            }
            let estimate = self.estimate(stage, at, level, headroom);
            answer.is_provisional |= estimate.is_provisional;
            if estimate.weight <= 0. && estimate.is_provisional {
                break;
            }
            let wanted = (ACCURACY * estimate.reach_m)
                .min(NEARBY * estimate.nearest_m)
                .clamp(least, most.max(least));
            let too_far = (spacing / wanted).log2().clamp(0., 1.);
            let doubt = estimate.doubt(spacing) * (spacing / least).log2().clamp(0., 1.);
            let can_refine = level < DEEPEST && spacing > THIN_PX * pixel;
            let too_few = 1. - (estimate.weight / ENOUGH).min(1.);
            let finer = match (estimate.weight > 0., can_refine) {
                (true, true) => too_far.max(too_few).max(doubt),
                (true, false) => 0.,
                (false, _) => 1.,
            };
            answer.irradiance += estimate.irradiance * (left * (1. - finer)) as f32;
            known |= estimate.weight > 0.;
            if finer > 0. && !can_refine {
                answer.irradiance += self.alone(stage, at) * left as f32;
                left = 0.;
                break;
            }
            left *= finer;
            if left < 1e-3 {
                break;
            }
        }
        self.settle(&mut answer, known, left as f32);
        answer
    }

    /// What is left when levels have not been gone through to the end counts as what is there; with nothing there, as what
    /// records have on the mean.
    fn settle(&self, answer: &mut Indirect, known: bool, left: f32) {
        if known && left < 0.999 {
            answer.irradiance /= 1. - left;
        } else if left > 0. {
            answer.irradiance = self.mean();
        }
    }

    /// Gathered at the point itself.
    fn alone(&self, stage: &Stage, at: &Receiver) -> Vec3 {
        self.count_alone();
        let bits = at.position.to_array().map(f64::to_bits);
        let stream = bits
            .into_iter()
            .fold(Stream::new(0, 0xA10), |stream, part| stream.part(part));
        self.gather_at(stage, at, &ALONE, &stream)
            .gathered
            .irradiance
    }

    fn estimate(&self, stage: &Stage, at: &Receiver, level: u8, headroom_m: f32) -> Estimate {
        let spacing = self.lattice.spacing_m(level);
        let mut sum = Estimate {
            reach_m: f64::INFINITY,
            nearest_m: f64::INFINITY,
            ..Estimate::default()
        };
        let mut sums = Sums::default();
        let centre = self.lattice.cell(level, at.position);
        for shift in (0..27).map(|i| IVec3::new(i % 3, i / 3 % 3, i / 9) - 1) {
            let cell = Cell {
                level,
                at: centre.at.saturating_add(shift),
            };
            if self.is_out_of_reach(cell, at) {
                continue;
            }
            for (orientation, site) in self.sites(stage, cell).iter() {
                let weight = weight(at, &site.receiver, *orientation, spacing);
                if weight <= 0. || !connected(stage, at, headroom_m, site, spacing) {
                    continue;
                }
                let place = Place {
                    cell,
                    orientation: *orientation,
                };
                let (record, is_provisional) = self.record(stage, place, &site.receiver);
                sum.is_provisional |= is_provisional;
                let Some(record) = record else { continue };
                let distance = (at.position - site.receiver.position).length();
                let own_reach = f64::from(record.reach_m());
                // What is far for one record is near for another (Ward's weight).
                let weight = weight * own_reach / (own_reach + 2. * distance);
                let trust = (own_reach / (SUPPORT * spacing)).min(1.) as f32;
                sums.add(&record, at, weight, trust);
                let nearest = (record.nearest - at.position).length();
                sum.nearest_m = sum.nearest_m.min(nearest);
                // No point can be relied on much farther than its neighbour is (Křivánek et al. 2006, neighbour clamping).
                sum.reach_m = sum.reach_m.min(own_reach + distance / weight);
            }
        }
        if sums.weight > 0. {
            sum.weight = sums.weight;
            sum.irradiance = sums.irradiance().as_vec3();
            sum.reach_m = sum.reach_m.min(sums.reach_m / sums.weight);
            sum.aside_m = sums.offset.length() / sums.weight;
            sum.at_odds = sums.at_odds();
        }
        sum
    }

    /// Whether no site of a cell can count.
    fn is_out_of_reach(&self, cell: Cell, at: &Receiver) -> bool {
        let spacing = self.lattice.spacing_m(cell.level);
        let [low, high] = self.lattice.corners(cell);
        let outside = (low - at.position).max(at.position - high).max(DVec3::ZERO);
        let height = (low + 0.5 * spacing - at.position).dot(at.normal).abs();
        let extent = 0.5 * spacing * at.normal.abs().element_sum();
        outside.length() >= SUPPORT * spacing || height - extent >= OFF_PLANE * spacing
    }

    /// The record of a place if it is there, and whether a better one is being computed.
    fn record(
        &self,
        stage: &Stage,
        place: Place,
        site: &Receiver,
    ) -> (Option<std::sync::Arc<Record>>, bool) {
        let slot = self.records.value(place, Default::default);
        match self.patience {
            Patience::Final => (Some(self.fresh(stage, place, site, &slot)), false),
            Patience::AtOnce => match (slot.fresh.get(), &slot.old) {
                (Some(record), _) => (Some(record.clone()), false),
                (None, Some(old)) if !slot.is_stale => (Some(old.clone()), false),
                (None, old) => {
                    self.want(place, &slot);
                    (old.clone(), true)
                }
            },
        }
    }
}

/// What a record counts for at a point: falls to nothing with the distance along the surface, the angle between the normals
/// and the height above the tangent plane.
fn weight(at: &Receiver, site: &Receiver, orientation: u8, spacing: f64) -> f64 {
    if is_front(orientation) != at.is_front() {
        return 0.;
    }
    let to = site.position - at.position;
    let near = 1. - to.length() / (SUPPORT * spacing);
    let cosine = at.normal.dot(site.normal);
    let alike = 1. - ((1. - cosine).max(0.) / (1. - LEAST_COSINE)).sqrt();
    let height = to.dot((at.normal + site.normal) * 0.5).abs();
    let level = 1. - height / (OFF_PLANE * spacing);
    near.max(0.) * alike.max(0.) * level.max(0.)
}

/// Whether the way from above a point to above a site is free.
fn connected(stage: &Stage, at: &Receiver, headroom_m: f32, site: &Site, spacing: f64) -> bool {
    let above = |receiver: &Receiver, headroom_m: f32| {
        let lift = (LIFT * spacing)
            .min(0.5 * f64::from(headroom_m))
            .max(f64::from(receiver.clearance));
        receiver.position + receiver.normal * lift
    };
    let from = above(at, headroom_m).as_vec3();
    let to = above(&site.receiver, site.headroom_m).as_vec3();
    let ray = Ray {
        origin: from,
        direction: to - from,
    };
    stage.world().occluder(&ray, 1.).is_none()
}
