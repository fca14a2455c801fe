//! The GGX microfacet reflection and its energy.
//!
//! Distribution and masking: Walter et al. 2007; height-correlated masking: Heitz 2014; sampling of visible normals: Heitz
//! 2018; what single scattering loses is given back in proportion (Turquin 2019); the diffuse part gets what the specular
//! one lets through.

use std::{f32::consts::PI, sync::LazyLock};

use glam::{Vec2, Vec3, vec3};

/// A specular surface as seen from one direction. Directions are in a frame with z along the normal.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gloss {
    alpha: f32,
    /// Reflectance at normal incidence.
    facing: Vec3,
    /// Towards the viewer.
    view: Vec3,
    /// What single scattering has to be multiplied by.
    compensation: Vec3,
    /// Share of light that the specular part reflects.
    pub(super) albedo: Vec3,
}

/// Cosines below this are taken to be this.
const LEAST_COSINE: f32 = 1e-3;

impl Gloss {
    /// Of reflectance `facing` and GGX alpha `roughness`, seen from the unit direction `view`.
    #[must_use]
    pub(super) fn new(facing: Vec3, roughness: f32, view: Vec3) -> Self {
        let view = view.with_z(view.z.max(LEAST_COSINE)).normalize();
        let alpha = roughness.clamp(0.01, 1.);
        let [scale, bias] = ENERGY.at(view.z, alpha);
        let compensation = Vec3::ONE + facing * (1. / (scale + bias) - 1.);
        Self {
            alpha,
            facing,
            view,
            compensation,
            albedo: ((facing * scale + bias) * compensation).min(Vec3::ONE),
        }
    }

    /// BRDF times the cosine of `light`, a unit direction, and the density with which [`Gloss::sample`] gives it.
    #[must_use]
    pub(super) fn evaluate(&self, light: Vec3) -> (Vec3, f32) {
        let half = (light + self.view).normalize_or_zero();
        if light.z <= 0. || half.z <= 0. {
            return (Vec3::ZERO, 0.);
        }
        let d = distribution(half.z, self.alpha);
        let (at_view, at_light) = (lambda(self.view.z, self.alpha), lambda(light.z, self.alpha));
        let both = 1. / (1. + at_view + at_light);
        let fresnel = schlick(self.facing, self.view.dot(half));
        let value = fresnel * self.compensation * (d * both / (4. * self.view.z));
        let density = d / (1. + at_view) / (4. * self.view.z);
        (value, density)
    }

    /// A direction of light for a place in the unit square, and what its radiance counts for; nothing if it goes below.
    #[must_use]
    pub(super) fn sample(&self, place: Vec2) -> Option<(Vec3, Vec3)> {
        let half = visible_normal(self.view, self.alpha, place);
        let light = half * (2. * self.view.dot(half)) - self.view;
        if light.z <= 0. {
            return None;
        }
        let (at_view, at_light) = (lambda(self.view.z, self.alpha), lambda(light.z, self.alpha));
        let unmasked = (1. + at_view) / (1. + at_view + at_light);
        let fresnel = schlick(self.facing, self.view.dot(half));
        Some((light, fresnel * self.compensation * unmasked))
    }
}

fn schlick(facing: Vec3, cosine: f32) -> Vec3 {
    facing + (Vec3::ONE - facing) * (1. - cosine.clamp(0., 1.)).powi(5)
}

fn distribution(cosine: f32, alpha: f32) -> f32 {
    let squared = alpha * alpha;
    // In this form nothing cancels at cosines near 1.
    let width = squared + (1. - squared) * (1. - cosine) * (1. + cosine);
    squared / (PI * width * width)
}

fn lambda(cosine: f32, alpha: f32) -> f32 {
    let cosine = cosine.max(LEAST_COSINE);
    let tangent = (1. - cosine * cosine).max(0.) / (cosine * cosine);
    0.5 * ((1. + alpha * alpha * tangent).sqrt() - 1.)
}

/// A normal in proportion to how much of it is seen (Heitz, "Sampling the GGX Distribution of Visible Normals", 2018).
fn visible_normal(view: Vec3, alpha: f32, place: Vec2) -> Vec3 {
    let stretched = vec3(alpha * view.x, alpha * view.y, view.z).normalize();
    let across = stretched.x * stretched.x + stretched.y * stretched.y;
    let u = if across > 0. {
        vec3(-stretched.y, stretched.x, 0.) / across.sqrt()
    } else {
        Vec3::X
    };
    let v = stretched.cross(u);
    let (sin, cos) = (2. * PI * place.y).sin_cos();
    let (x, y) = (place.x.sqrt() * cos, place.x.sqrt() * sin);
    let share = 0.5 * (1. + stretched.z);
    let y = (1. - share) * (1. - x * x).max(0.).sqrt() + share * y;
    let up = (1. - x * x - y * y).max(0.).sqrt();
    let normal = u * x + v * y + stretched * up;
    vec3(alpha * normal.x, alpha * normal.y, normal.z.max(0.)).normalize_or(Vec3::Z)
}

/// Share of light that single scattering reflects, as `facing · scale + bias`, by cosine of the view and roughness.
struct Energy {
    table: Vec<[f32; 2]>,
}

/// Entries along each side of the table, and directions along each side of the square that an entry is summed over.
const ENTRIES: usize = 32;
const SUMMED: usize = 32;

static ENERGY: LazyLock<Energy> = LazyLock::new(Energy::new);

impl Energy {
    fn new() -> Self {
        let share = |i: usize| i as f32 / (ENTRIES - 1) as f32;
        let entry = |i: usize| {
            let cosine = share(i % ENTRIES).powi(2).max(LEAST_COSINE);
            Self::sum(cosine, share(i / ENTRIES).max(0.01))
        };
        Self {
            table: (0..ENTRIES * ENTRIES).map(entry).collect(),
        }
    }

    fn sum(cosine: f32, alpha: f32) -> [f32; 2] {
        let view = vec3((1. - cosine * cosine).max(0.).sqrt(), 0., cosine);
        let mut sums = [0.; 2];
        for i in 0..SUMMED * SUMMED {
            let cell = Vec2::new((i % SUMMED) as f32, (i / SUMMED) as f32);
            let half = visible_normal(view, alpha, (cell + 0.5) / SUMMED as f32);
            let light = half * (2. * view.dot(half)) - view;
            if light.z > 0. {
                let (at_view, at_light) = (lambda(cosine, alpha), lambda(light.z, alpha));
                let weight = (1. + at_view) / (1. + at_view + at_light);
                let grazing = (1. - view.dot(half).clamp(0., 1.)).powi(5);
                sums[0] += weight * (1. - grazing);
                sums[1] += weight * grazing;
            }
        }
        sums.map(|s| s / (SUMMED * SUMMED) as f32)
    }

    fn at(&self, cosine: f32, alpha: f32) -> [f32; 2] {
        let last = (ENTRIES - 1) as f32;
        let place = [
            cosine.clamp(0., 1.).sqrt() * last,
            alpha.clamp(0., 1.) * last,
        ];
        let low = place.map(|p| (p as usize).min(ENTRIES - 2));
        let [x, y] = [place[0] - low[0] as f32, place[1] - low[1] as f32];
        let entry = |dx: usize, dy: usize| self.table[(low[1] + dy) * ENTRIES + low[0] + dx];
        std::array::from_fn(|k| {
            let row = |dy: usize| entry(0, dy)[k] * (1. - x) + entry(1, dy)[k] * x;
            row(0) * (1. - y) + row(1) * y
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 512;

    fn places() -> impl Iterator<Item = Vec2> {
        (0..SIDE * SIDE)
            .map(|i| (Vec2::new((i % SIDE) as f32, (i / SIDE) as f32) + 0.5) / SIDE as f32)
    }

    fn views() -> impl Iterator<Item = (f32, Vec3)> {
        [0.05, 0.2, 0.5, 1.].into_iter().flat_map(|alpha| {
            [0.15f32, 0.5, 0.9, 1.]
                .into_iter()
                .map(move |cosine| (alpha, vec3((1. - cosine * cosine).sqrt(), 0., cosine)))
        })
    }

    /// In a furnace a surface that reflects all light of every colour shows just the furnace's radiance.
    #[test]
    fn a_white_metal_loses_nothing() {
        for (alpha, view) in views() {
            for facing in [Vec3::ONE, Vec3::splat(0.04), vec3(0.9, 0.5, 0.1)] {
                let gloss = Gloss::new(facing, alpha, view);
                let sum: Vec3 = places()
                    .filter_map(|place| Some(gloss.sample(place)?.1))
                    .sum();
                let share = sum / (SIDE * SIDE) as f32;
                assert!(
                    (share - gloss.albedo).abs().max_element() < 0.006,
                    "alpha {alpha} {view} {facing}: {share} {}",
                    gloss.albedo
                );
                if facing == Vec3::ONE {
                    assert!(
                        (share - 1.).abs().max_element() < 0.006,
                        "{alpha} {view}: {share}"
                    );
                }
            }
        }
    }

    /// The closed form integrates over the hemisphere to what sampling gives, and the density to the share above it.
    #[test]
    fn values_and_densities_agree_with_sampling() {
        for (alpha, view) in views().filter(|v| v.0 >= 0.2) {
            let gloss = Gloss::new(vec3(1., 0.5, 0.04), alpha, view);
            let (mut value, mut density) = (Vec3::ZERO, 0.);
            for place in places() {
                let (sin, cos) = (2. * PI * place.y).sin_cos();
                let sine = (1. - place.x * place.x).sqrt();
                let (v, d) = gloss.evaluate(vec3(sine * cos, sine * sin, place.x));
                value += v;
                density += d;
            }
            let whole = 2. * PI / (SIDE * SIDE) as f32;
            let (mut sampled, mut above) = (Vec3::ZERO, 0.);
            for (_, weight) in places().filter_map(|place| gloss.sample(place)) {
                sampled += weight;
                above += 1.;
            }
            let all = (SIDE * SIDE) as f32;
            assert!(
                (value * whole - sampled / all).abs().max_element() < 0.01,
                "alpha {alpha} {view}: {} {}",
                value * whole,
                sampled / all
            );
            assert!(
                (density * whole - above / all).abs() < 0.01,
                "alpha {alpha} {view}"
            );
        }
    }
}
