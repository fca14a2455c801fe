//! A record: indirect irradiance at a site, how it changes around it, and what it depends on.

use glam::{DVec3, Vec3};

use super::{
    IrradianceCache,
    bounce::Gatherer,
    far::towards,
    hemisphere::{Gathered, Incoming, Strata},
    lattice::Place,
};
use crate::{lights::Receiver, random::Stream, stage::Stage};

/// Rays of a record. Those of coarse levels are few and each shows over many pixels, so they have more.
fn strata(level: u8) -> Strata {
    let (rings, sectors) = match level {
        0..=2 => (24, 60),
        3 => (17, 42),
        _ => (12, 30),
    };
    Strata { rings, sectors }
}

/// Sine of the angle above the tangent plane below which what is near does not count: it may be the surface itself, bent.
const LOW: f64 = 0.17;

const SALT: u64 = 0x4EC;

/// Indirect irradiance at a site.
#[derive(Debug)]
pub(crate) struct Record {
    pub(crate) site: Receiver,
    pub(crate) gathered: Gathered,
    /// The nearest thing met, but for what is low above the tangent plane; world space, infinite if there is none.
    pub(crate) nearest: DVec3,
    /// Of each ray, for telling which moves matter.
    pub(crate) distances_m: Vec<f32>,
    /// Instances that its rays and their shadow rays met, each once.
    pub(crate) met: Vec<u32>,
}

/// The directions of a record's rays.
pub(crate) fn directions(place: Place, site: &Receiver) -> impl Iterator<Item = DVec3> {
    let strata = strata(place.cell.level);
    (0..strata.count()).map(move |index| {
        let mut stream = place.stream(SALT).part(index as u64);
        towards(&strata, site, index, &mut stream)
    })
}

impl Record {
    /// How far from its site a record can be relied on, before any factor, metres: the harmonic mean of the distances, or less
    /// where irradiance changes faster than that lets expect (Křivánek et al. 2006).
    pub(crate) fn reach_m(&self) -> f32 {
        let mean = |v: Vec3| v.element_sum() / 3.;
        let slope: Vec3 = self.gathered.by_place.iter().sum::<Vec3>() / 3.;
        let (level, slope) = (mean(self.gathered.irradiance), slope.length());
        let distance = self.gathered.mean_distance_m.min(1e9);
        if slope * distance > level {
            level / slope
        } else {
            distance
        }
    }

    /// Irradiance at another place and normal, to first order; never negative. Beyond its reach by place a record knows
    /// less, so `trust` scales that part.
    pub(crate) fn extrapolate(&self, at: &Receiver, trust: f32) -> Vec3 {
        let by = (at.position - self.site.position).as_vec3() * trust;
        let normal = at.normal.as_vec3();
        let Gathered {
            irradiance,
            by_normal,
            by_place,
            ..
        } = &self.gathered;
        let change = |channel: usize| by_place[channel].dot(by) + by_normal[channel].dot(normal);
        let value = *irradiance + Vec3::new(change(0), change(1), change(2));
        value.clamp(Vec3::ZERO, *irradiance * 3.)
    }
}

impl IrradianceCache {
    /// Computes the record of a place.
    pub(crate) fn gather(&self, stage: &Stage, place: Place, site: &Receiver) -> Record {
        let stream = place.stream(SALT);
        self.gather_at(stage, site, &strata(place.cell.level), &stream)
    }

    /// Indirect irradiance at any point of a surface by rays from there alone, as records have it at their sites.
    #[must_use]
    pub fn by_rays(
        &self,
        stage: &Stage,
        at: &Receiver,
        strata: &Strata,
        stream: &Stream,
    ) -> Gathered {
        self.gather_at(stage, at, strata, stream).gathered
    }

    /// Gathers with these strata at any point of a surface.
    pub(crate) fn gather_at(
        &self,
        stage: &Stage,
        site: &Receiver,
        strata: &Strata,
        stream: &Stream,
    ) -> Record {
        let background = Vec3::from(stage.shading().background);
        let mut gatherer = Gatherer::new(stage);
        let (mut nearest, mut nearest_m) = (DVec3::INFINITY, f64::INFINITY);
        let incoming: Vec<Incoming> = (0..strata.count())
            .map(|index| {
                let mut stream = stream.part(index as u64);
                let direction = towards(strata, site, index, &mut stream);
                let hit = gatherer.follow(site, direction);
                if let Some(hit) = &hit
                    && f64::from(hit.t) < nearest_m
                    && direction.dot(site.normal) > LOW
                {
                    nearest_m = hit.t.into();
                    nearest = site.position + direction * nearest_m;
                }
                let radiance = match &hit {
                    None => background,
                    // What a light gives is direct light.
                    Some(hit) if stage.light_of(hit.instance).is_some() => Vec3::ZERO,
                    Some(hit) => {
                        self.reflected_by(stage, &mut gatherer, hit, direction, &mut stream)
                    }
                };
                Incoming {
                    radiance,
                    distance_m: hit.map_or(f32::INFINITY, |hit| hit.t),
                }
            })
            .collect();
        self.count_rays(gatherer.rays());
        Record {
            site: *site,
            gathered: strata.sum(site.normal, &incoming),
            distances_m: incoming.iter().map(|i| i.distance_m).collect(),
            nearest,
            met: gatherer.met,
        }
    }
}
