//! Irradiance and its gradients from a stratified hemisphere (Ward and Heckbert, "Irradiance Gradients", 1992).

use std::f64::consts::TAU;

use glam::{DVec3, Vec3, dvec3};

use crate::random::Stream;

/// Directions by the cosine: rings of equal share between the normal and the horizon, each of so many sectors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Strata {
    /// From the normal to the horizon.
    pub rings: usize,
    /// Around the normal.
    pub sectors: usize,
}

/// What one direction brought.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Incoming {
    /// Radiance.
    pub radiance: Vec3,
    /// Distance, metres; infinite where there is nothing.
    pub distance_m: f32,
}

/// What a hemisphere brought.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gathered {
    /// Irradiance, W/m², by channel.
    pub irradiance: Vec3,
    /// By channel: the change of irradiance when the normal becomes n + δ is the product with δ. In the tangent plane.
    pub by_normal: [Vec3; 3],
    /// By channel: the change of irradiance a metre, in the tangent plane.
    pub by_place: [Vec3; 3],
    /// Harmonic mean of the distances, metres.
    pub mean_distance_m: f32,
    /// How far it is straight up, at least; metres.
    pub headroom_m: f32,
}

/// Distances count in gradients as at least this share of their harmonic mean: a ray that grazes a bent surface ends at once,
/// and says nothing of what is farther off than that.
const NEAREST: f64 = 0.1;

/// Two unit vectors that make a right-handed frame with `normal`.
#[must_use]
pub fn frame(normal: DVec3) -> [DVec3; 2] {
    let (u, v) = normal.any_orthonormal_pair();
    [u, v]
}

impl Strata {
    /// Directions in all.
    #[must_use]
    pub fn count(&self) -> usize {
        self.rings * self.sectors
    }

    /// A random unit direction of stratum (ring, sector), z along the normal.
    #[must_use]
    pub fn direction(&self, ring: usize, sector: usize, stream: &mut Stream) -> DVec3 {
        let place = stream.square().as_dvec2();
        let squared_sine = (ring as f64 + place.x) / self.rings as f64;
        let (sin, cos) = (TAU * (sector as f64 + place.y) / self.sectors as f64).sin_cos();
        let sine = squared_sine.sqrt();
        dvec3(sine * cos, sine * sin, (1. - squared_sine).max(0.).sqrt())
    }

    /// Sums what [`Strata::count`] directions brought, ring by ring, around `normal`, in the frame that [`frame`] gives.
    #[must_use]
    pub fn sum(&self, normal: DVec3, incoming: &[Incoming]) -> Gathered {
        let share = std::f64::consts::PI / self.count() as f64;
        let mut total = DVec3::ZERO;
        let (mut inverse, mut headroom) = (0., f32::INFINITY);
        for (i, one) in incoming.iter().enumerate() {
            total += one.radiance.as_dvec3() * share;
            inverse += 1. / f64::from(one.distance_m);
            let sine = ((i / self.sectors) as f64 + 0.5) / self.rings as f64;
            if sine < 0.5 {
                headroom = headroom.min(one.distance_m * (1. - sine).sqrt() as f32);
            }
        }
        let mean_distance = incoming.len() as f64 / inverse;
        Gathered {
            irradiance: total.as_vec3(),
            by_normal: self.by_normal(normal, incoming),
            by_place: self.by_place(normal, incoming, NEAREST * mean_distance),
            mean_distance_m: mean_distance as f32,
            headroom_m: headroom,
        }
    }

    /// Sine of the polar angle where ring `ring` begins.
    fn inner_sine(&self, ring: usize) -> f64 {
        (ring as f64 / self.rings as f64).sqrt()
    }

    /// Turning the normal towards a direction brings its radiance times the sine: by the cosine's measure, the tangent.
    fn by_normal(&self, normal: DVec3, incoming: &[Incoming]) -> [Vec3; 3] {
        let [u, v] = frame(normal);
        let share = std::f64::consts::PI / self.count() as f64;
        let mut sums = [DVec3::ZERO; 3];
        for (i, one) in incoming.iter().enumerate() {
            let (ring, sector) = (i / self.sectors, i % self.sectors);
            let squared_sine = (ring as f64 + 0.5) / self.rings as f64;
            let tangent = (squared_sine / (1. - squared_sine)).sqrt();
            let (sin, cos) = (TAU * (sector as f64 + 0.5) / self.sectors as f64).sin_cos();
            let towards = (u * cos + v * sin) * (tangent * share);
            for (sum, radiance) in sums.iter_mut().zip(one.radiance.to_array()) {
                *sum += towards * f64::from(radiance);
            }
        }
        sums.map(|s| s.as_vec3())
    }

    /// What is nearer moves faster: a border between two strata lets the farther one's radiance in or takes it away.
    fn by_place(&self, normal: DVec3, incoming: &[Incoming], least: f64) -> [Vec3; 3] {
        let [u, v] = frame(normal);
        let width = TAU / self.sectors as f64;
        let mut sums = [DVec3::ZERO; 3];
        let mut add = |direction: DVec3, one: &Incoming, other: &Incoming, rate: f64| {
            let nearest = f64::from(one.distance_m.min(other.distance_m)).max(least);
            if nearest > 0. && nearest.is_finite() {
                let step = direction * (rate / nearest);
                for (channel, sum) in sums.iter_mut().enumerate() {
                    *sum += step * f64::from(one.radiance[channel] - other.radiance[channel]);
                }
            }
        };
        for ring in 0..self.rings {
            let (inner, outer) = (self.inner_sine(ring), self.inner_sine(ring + 1));
            for sector in 0..self.sectors {
                let here = &incoming[ring * self.sectors + sector];
                if ring > 0 {
                    let (sin, cos) = (width * (sector as f64 + 0.5)).sin_cos();
                    let inward = &incoming[(ring - 1) * self.sectors + sector];
                    let rate = width * inner * (1. - inner * inner);
                    add(u * cos + v * sin, here, inward, rate);
                }
                let before = (sector + self.sectors - 1) % self.sectors;
                let aside = &incoming[ring * self.sectors + before];
                let (sin, cos) = (width * sector as f64).sin_cos();
                add(v * cos - u * sin, here, aside, outer - inner);
            }
        }
        sums.map(|s| s.as_vec3())
    }
}
