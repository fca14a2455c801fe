//! From a ray to a sample.

use glam::Vec3;
use protocol::{
    limits::clamp_radiance,
    messages::{NO_OBJECT, Sample, Triple, flags},
};
use rays::{Ray, Recent};

use crate::{
    lights::{Receiver, Shape},
    random::Stream,
    shadows::{Shadows, Visibility},
    stage::{Stage, Surface},
};

/// Shades rays; one a thread and chunk of work, so that nothing is allocated from sample to sample.
pub struct Shader<'a> {
    stage: &'a Stage,
    visibility: &'a dyn Visibility,
    seed: u64,
    shadows: Shadows,
    rays: u64,
    triples: Vec<Triple>,
}

impl<'a> Shader<'a> {
    /// A shader of `stage` whose random numbers come from `seed` and each request's id.
    #[must_use]
    pub fn new(stage: &'a Stage, visibility: &'a dyn Visibility, seed: u64) -> Self {
        let (shadows, triples) = (Shadows::default(), Vec::new());
        Self {
            stage,
            visibility,
            seed,
            shadows,
            rays: 0,
            triples,
        }
    }

    /// Rays traced so far.
    #[must_use]
    pub fn rays(&self) -> u64 {
        self.rays + self.shadows.rays
    }

    /// Shadows met since the last call, each once; blockers that are lights are left out.
    pub fn take_triples(&mut self) -> Vec<Triple> {
        std::mem::take(&mut self.triples)
    }

    /// The sample that `ray` finds: direct light from every light, reflected diffusely.
    ///
    /// Surfaces reflect on both sides, with the shading normal turned to the viewer; the cosine at the surface is the shading
    /// normal's, visibility the geometry's alone.
    pub fn shade(&mut self, id: u64, ray: &Ray) -> Sample {
        self.rays += 1;
        let Some(hit) = self.stage.world().closest(ray, f32::INFINITY) else {
            return Sample {
                id,
                position: ray.direction.normalize_or_zero().to_array(),
                object: NO_OBJECT,
                radiance: self.stage.shading().background,
                flags: flags::MISS,
            };
        };
        if let Some(light) = self.stage.light_of(hit.instance) {
            return Sample {
                id,
                position: ray.at(hit.t).to_array(),
                object: light,
                radiance: self.emitted(light, ray).to_array(),
                flags: flags::LIGHT,
            };
        }
        let surface = self.stage.surface(&hit);
        let radiance = surface.as_ref().map_or(Vec3::ZERO, |surface| {
            let receiver = receiver(surface, ray, &hit);
            self.reflected(id, surface, &receiver)
        });
        Sample {
            id,
            position: surface
                .map_or(ray.at(hit.t), |s| s.position.as_vec3())
                .to_array(),
            object: hit.instance,
            radiance: radiance.to_array(),
            flags: 0,
        }
    }

    fn emitted(&self, light: u32, ray: &Ray) -> Vec3 {
        match self.stage.emitters().get(light as usize) {
            Some(emitter) => match &emitter.shape {
                Shape::Polygon(shape) if shape.faces(ray.origin.as_dvec3()) => emitter.strength,
                _ => Vec3::ZERO,
            },
            None => Vec3::ZERO,
        }
    }

    fn reflected(&mut self, id: u64, surface: &Surface, receiver: &Receiver) -> Vec3 {
        let stream = Stream::new(self.seed, id);
        let mut irradiance = Vec3::ZERO;
        for (index, emitter) in self.stage.emitters().iter().enumerate() {
            let unoccluded = emitter.unoccluded(receiver) as f32;
            if unoccluded <= 0. {
                continue;
            }
            let mut stream = stream.part(index as u64);
            // Which blocker is found must not depend on what was shaded before.
            self.shadows.recent = Recent::default();
            let seen = self.visibility.fraction(
                self.stage,
                emitter,
                receiver,
                &mut stream,
                &mut self.shadows,
            );
            irradiance += emitter.strength * (unoccluded * seen);
            self.report(index as u32, receiver.instance);
        }
        let ambient = Vec3::from(self.stage.shading().ambient);
        let radiance = surface.diffuse * (irradiance * std::f32::consts::FRAC_1_PI + ambient);
        clamp_radiance(radiance.to_array()).into()
    }

    fn report(&mut self, light: u32, receiver: u32) {
        for blocker in self.shadows.blockers.drain(..) {
            let triple = Triple {
                light,
                blocker,
                receiver,
            };
            if self.stage.light_of(blocker).is_none() && !self.triples.contains(&triple) {
                self.triples.push(triple);
            }
        }
    }
}

fn receiver(surface: &Surface, ray: &Ray, hit: &rays::Hit) -> Receiver {
    let towards_viewer = -ray.direction.as_dvec3();
    let faces_viewer = surface.normal.dot(towards_viewer) >= 0.;
    Receiver {
        position: surface.position,
        normal: if faces_viewer {
            surface.normal
        } else {
            -surface.normal
        },
        face_normal: surface.face_normal,
        clearance: surface.clearance,
        instance: hit.instance,
        face: hit.face,
    }
}
