//! Light that has been reflected more than once: at the sites of the coarsest cells that fit, by one set of rays for all orders.
//!
//! What a site receives after k reflections is what its rays met after k − 1, so the rays are traced once and say for each
//! order where they ended. That is as coarse as it may be: it only ever reaches a picture through another hemisphere of rays.

use std::sync::{Arc, OnceLock};

use glam::Vec3;

use super::{
    IrradianceCache,
    bounce::{Arrival, Gatherer},
    hemisphere::{Strata, frame},
    interpolate::connected,
    lattice::Place,
};
use crate::{lights::Receiver, random::Stream, stage::Stage};

/// Reflections between a light's first and the surface seen: a path tracer has them all at depth 6.
pub(crate) const REFLECTIONS: usize = 4;

/// Rays of a site.
const STRATA: Strata = Strata {
    rings: 8,
    sectors: 16,
};

/// Free way taken to be above a point that was met, as a share of the spacing.
const CLOSE: f32 = 0.1;

/// Levels that are tried, two places each: where things are close together the coarsest cells have no site that fits.
const LEVELS: u8 = 4;

/// Tells streams of random numbers for different purposes apart.
const SALT: u64 = 0xFA2;

/// A site of the far field.
#[derive(Debug, Default)]
pub(crate) struct FarSite {
    pub(crate) ends: OnceLock<Arc<Ends>>,
    /// Irradiance after one, two, ... reflections.
    orders: [OnceLock<Vec3>; REFLECTIONS - 1],
}

/// Where a site's rays ended.
#[derive(Debug)]
pub(crate) struct Ends {
    surfaces: Vec<End>,
    /// Irradiance from where there is nothing.
    background: Vec3,
    /// Of each ray, for telling which moves matter.
    pub(crate) distances_m: Vec<f32>,
    pub(crate) met: Vec<u32>,
}

/// Where one ray ended.
#[derive(Debug)]
struct End {
    albedo: Vec3,
    direct: Vec3,
    beyond: Option<Place>,
}

impl FarSite {
    /// Keeps the rays, forgets what came of them.
    pub(crate) fn with(ends: Arc<Ends>) -> Self {
        let site = Self::default();
        // It has just been made: nothing is there yet.
        let _ = site.ends.set(ends);
        site
    }
}

/// A direction of a hemisphere in world space, on the side of the face that is seen.
pub(crate) fn towards(
    strata: &Strata,
    site: &Receiver,
    index: usize,
    stream: &mut Stream,
) -> glam::DVec3 {
    let local = strata.direction(index / strata.sectors, index % strata.sectors, stream);
    let [u, v] = frame(site.normal);
    let direction = u * local.x + v * local.y + site.normal * local.z;
    // The shading normal's hemisphere reaches below the face, where there is nothing to see: turn such rays up.
    let face = site.face_normal.as_dvec3();
    let below = direction.dot(face) * if site.is_front() { -1. } else { 1. };
    if below > 0. {
        let up = if site.is_front() { face } else { -face };
        direction + up * (2. * below)
    } else {
        direction
    }
}

/// The directions of a far site's rays.
pub(crate) fn directions(place: Place, site: &Receiver) -> impl Iterator<Item = glam::DVec3> {
    (0..STRATA.count()).map(move |index| {
        let mut stream = place.stream(SALT).part(index as u64);
        towards(&STRATA, site, index, &mut stream)
    })
}

impl IrradianceCache {
    /// Irradiance at a place of the coarsest level after at most `order` reflections.
    pub(crate) fn far(&self, stage: &Stage, place: Place, order: usize) -> Vec3 {
        let Some(slot) = order.checked_sub(1).filter(|i| *i < REFLECTIONS - 1) else {
            return Vec3::ZERO;
        };
        let site = self.far.value(place, FarSite::default);
        *site.orders[slot].get_or_init(|| {
            let ends = site
                .ends
                .get_or_init(|| Arc::new(self.trace_far(stage, place)));
            let ambient = Vec3::from(stage.shading().ambient);
            let share = std::f32::consts::PI / STRATA.count() as f32;
            let mut sum = ends.background;
            for end in &ends.surfaces {
                let beyond = end
                    .beyond
                    .map_or(Vec3::ZERO, |place| self.far(stage, place, order - 1));
                sum += end.albedo
                    * (((end.direct + beyond) * std::f32::consts::FRAC_1_PI + ambient) * share);
            }
            sum
        })
    }

    /// Indirect irradiance at a point that is only met by another ray: as coarse as the far field.
    pub(crate) fn reflected_before(
        &self,
        stage: &Stage,
        at: &Receiver,
        stream: &mut Stream,
    ) -> Vec3 {
        let place = self.beyond(stage, at, stream);
        place.map_or(Vec3::ZERO, |place| self.far(stage, place, REFLECTIONS - 1))
    }

    fn trace_far(&self, stage: &Stage, place: Place) -> Ends {
        let mut ends = Ends {
            surfaces: Vec::new(),
            background: Vec3::ZERO,
            distances_m: Vec::with_capacity(STRATA.count()),
            met: Vec::new(),
        };
        let Some(site) = self.site(stage, place) else {
            return ends;
        };
        let share = std::f32::consts::PI / STRATA.count() as f32;
        let mut gatherer = Gatherer::new(stage);
        for index in 0..STRATA.count() {
            let mut stream = place.stream(SALT).part(index as u64);
            let direction = towards(&STRATA, &site.receiver, index, &mut stream);
            let arrival = gatherer.follow(&site.receiver, direction, &mut stream);
            ends.distances_m.push(arrival.distance_m);
            match arrival {
                Arrival {
                    bounce: Some(bounce),
                    ..
                } => ends.surfaces.push(End {
                    albedo: bounce.albedo,
                    direct: bounce.direct,
                    beyond: self.beyond(stage, &bounce.receiver, &mut stream),
                }),
                Arrival { instance: None, .. } => {
                    ends.background += Vec3::from(stage.shading().background) * share;
                }
                Arrival { .. } => {}
            }
        }
        self.count_rays(gatherer.rays());
        ends.met = gatherer.met;
        ends
    }

    /// The place of the far field that stands for a point: one of those around it at random, so that on the mean the far
    /// field is smooth.
    pub(crate) fn beyond(
        &self,
        stage: &Stage,
        at: &Receiver,
        stream: &mut Stream,
    ) -> Option<Place> {
        let orientation = at.orientation();
        let [u, v] = frame(at.normal);
        for attempt in 0..2 * LEVELS {
            let level = attempt / 2;
            let spacing = self.lattice.spacing_m(level);
            let shift = (stream.square() - 0.5).as_dvec2() * spacing;
            let place = at.position + u * shift.x + v * shift.y;
            let cell = self.lattice.cell(level, place);
            let sites = self.sites(stage, cell);
            let own = sites.iter().find(|(known, _)| *known == orientation);
            // A site may be hidden, below furniture or behind a wall: light is not the same there.
            let near = CLOSE * spacing as f32;
            if own.is_some_and(|(_, site)| connected(stage, at, near, site, spacing)) {
                return Some(Place { cell, orientation });
            }
        }
        // Nothing around faces the same way: the site of its own cell that does so most.
        let cell = self.lattice.cell(0, at.position);
        let sites = self.sites(stage, cell);
        let alike = |site: &super::Site| site.receiver.normal.dot(at.normal);
        sites
            .iter()
            .max_by(|a, b| alike(&a.1).total_cmp(&alike(&b.1)))
            .map(|(orientation, _)| Place {
                cell,
                orientation: *orientation,
            })
    }
}
