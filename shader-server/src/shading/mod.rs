//! From a ray to a sample.
//!
//! Every scene has direct light (`direct`). Where the scene asks for it, glossy reflection (`glossy`) and indirect light
//! ([`crate::irradiance`]) are added; others pay nothing for them.

mod direct;
mod glossy;
mod microfacet;

use std::mem::take;

use glam::Vec3;
use protocol::{
    limits::clamp_radiance,
    messages::{NO_OBJECT, Sample, Texel, Triple, flags},
};
use rays::{Hit, Ray};

use self::glossy::Reflector;
use crate::{
    lights::{Receiver, Shape},
    mapped::Beam,
    random::Stream,
    shadows::{Asked, Shadows, Visibility},
    stage::{Stage, Surface},
};

/// Share of a pixel's width over which a sample averages maps: so little that the mean of a pixel's samples is hardly wider
/// than the pixel, and enough to calm a single one where texels are much smaller than pixels.
const BEAM_SHARE: f32 = 0.25;

/// A shaded ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shaded {
    /// The sample.
    pub sample: Sample,
    /// What the diffuse map of the surface did to it, where there is one.
    pub texel: Option<Texel>,
}

impl From<Sample> for Shaded {
    fn from(sample: Sample) -> Self {
        Self {
            sample,
            texel: None,
        }
    }
}

/// Shades rays; one a thread and chunk of work, so that nothing is allocated from sample to sample.
pub struct Shader<'a> {
    stage: &'a Stage,
    visibility: &'a dyn Visibility,
    seed: u64,
    shadows: Shadows,
    /// Width of a pixel a metre away, metres.
    pixel_slope: f64,
    rays: u64,
    triples: Vec<Triple>,
    met: Vec<Met>,
    asked: Vec<Asked>,
}

/// What a ray met, being shaded.
struct Met {
    /// Which of the batch it is.
    index: usize,
    direction: Vec3,
    hit: Hit,
    surface: Surface,
    receiver: Receiver,
    stream: Stream,
    /// W/m², from the lights.
    irradiance: Vec3,
}

/// Width of a pixel a metre away unless told otherwise: of an image 512 pixels high that spans 45 degrees.
const PIXEL_SLOPE: f64 = 1.6e-3;

impl<'a> Shader<'a> {
    /// A shader of `stage` whose random numbers come from `seed` and each request's id.
    #[must_use]
    pub fn new(stage: &'a Stage, visibility: &'a dyn Visibility, seed: u64) -> Self {
        Self {
            stage,
            visibility,
            seed,
            shadows: Shadows::default(),
            pixel_slope: PIXEL_SLOPE,
            rays: 0,
            triples: Vec::new(),
            met: Vec::new(),
            asked: Vec::new(),
        }
    }

    /// Says how wide a pixel is a metre away, metres: what is interpolated need not be finer than that, and maps are averaged
    /// over a part of it.
    #[must_use]
    pub fn with_pixel(mut self, pixel_slope: f64) -> Self {
        self.pixel_slope = pixel_slope;
        self
    }

    /// Rays traced so far.
    #[must_use]
    pub fn rays(&self) -> u64 {
        self.rays + self.shadows.rays
    }

    /// Shadows met since the last call, each once; blockers that are lights are left out.
    pub fn take_triples(&mut self) -> Vec<Triple> {
        take(&mut self.triples)
    }

    /// Rays that it likes to be given at once: more gain nothing.
    #[must_use]
    pub fn batch(&self) -> usize {
        self.visibility.batch()
    }

    /// The sample that a ray finds, `id` being its request's.
    ///
    /// Surfaces reflect on both sides, with the shading normal turned to the viewer; the cosine at the surface is the shading
    /// normal's, visibility the geometry's alone.
    pub fn shade(&mut self, id: u64, ray: &Ray) -> Shaded {
        let mut shaded = Vec::with_capacity(1);
        self.shade_each(&[(id, *ray)], &mut shaded);
        shaded[0]
    }

    /// The samples that rays find, each with its request's id, in their order; what was in `shaded` is dropped. Each is the
    /// same whatever else is in the batch.
    pub fn shade_each(&mut self, rays: &[(u64, Ray)], shaded: &mut Vec<Shaded>) {
        let mut met = take(&mut self.met);
        met.clear();
        shaded.clear();
        for (index, (id, ray)) in rays.iter().enumerate() {
            let (sample, found) = self.meet(index, *id, ray);
            shaded.push(Shaded::from(sample));
            met.extend(found);
        }
        self.direct(&mut met);
        for met in &met {
            self.finish(met, &mut shaded[met.index]);
        }
        self.met = met;
    }

    /// What a ray meets: a sample that is done but for its radiance where there is a surface to be shaded.
    fn meet(&mut self, index: usize, id: u64, ray: &Ray) -> (Sample, Option<Met>) {
        self.rays += 1;
        let Some(hit) = self.stage.world().closest(ray, f32::INFINITY) else {
            let miss = Sample {
                id,
                position: ray.direction.normalize_or_zero().to_array(),
                object: NO_OBJECT,
                radiance: self.stage.shading().background,
                flags: flags::MISS,
            };
            return (miss, None);
        };
        let mut sample = Sample {
            id,
            position: ray.at(hit.t).to_array(),
            object: hit.instance,
            radiance: [0.; 3],
            flags: 0,
        };
        if let Some(light) = self.stage.light_of(hit.instance) {
            sample.object = light;
            sample.radiance = self.emitted(light, ray).to_array();
            sample.flags = flags::LIGHT;
            return (sample, None);
        }
        let beam = Beam {
            direction: ray.direction,
            width: BEAM_SHARE * self.pixel_slope as f32 * hit.t,
        };
        let Some(surface) = self.stage.surface_in(&hit, Some(&beam)) else {
            return (sample, None);
        };
        sample.position = surface.position.as_vec3().to_array();
        let receiver = surface.seen_along(ray.direction.as_dvec3(), hit.instance, hit.face);
        let met = Met {
            index,
            direction: ray.direction,
            hit,
            surface,
            receiver,
            stream: Stream::new(self.seed, id),
            irradiance: Vec3::ZERO,
        };
        (sample, Some(met))
    }

    /// Shades what was met, its direct light being known.
    fn finish(&mut self, met: &Met, shaded: &mut Shaded) {
        let Met { hit, surface, .. } = met;
        let reflector = Reflector::new(surface, &met.receiver, -met.direction.as_dvec3());
        let (mut reflected, mut bits) = self.diffuse(met);
        let mut specular = Vec3::ZERO;
        if let Some(reflector) = &reflector {
            // What is reflected specularly is not there to be reflected diffusely.
            reflected *= Vec3::ONE - reflector.gloss.albedo;
            specular = self.specular(reflector, &met.stream);
            bits |= flags::VIEW_DEPENDENT;
        }
        shaded.sample.radiance =
            clamp_radiance((surface.diffuse * reflected + specular).to_array());
        shaded.sample.flags = bits;
        shaded.texel = surface.textured.then(|| Texel {
            face: hit.face,
            reflectance: surface.diffuse.to_array(),
            reflected: clamp_radiance(reflected.to_array()),
        });
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

    /// Radiance that a diffuse reflectance of 1 reflects, and the flags of the sample.
    fn diffuse(&self, met: &Met) -> (Vec3, u32) {
        let mut bits = 0;
        let mut irradiance = met.irradiance;
        if let Some(cache) = self.stage.irradiance() {
            let pixel_m = self.pixel_slope * f64::from(met.hit.t);
            let indirect = cache.irradiance(self.stage, &met.receiver, pixel_m);
            irradiance += indirect.irradiance;
            if indirect.is_provisional {
                bits |= flags::PROVISIONAL;
            }
        }
        let ambient = Vec3::from(self.stage.shading().ambient);
        (irradiance * std::f32::consts::FRAC_1_PI + ambient, bits)
    }
}
