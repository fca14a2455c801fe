//! Glossy reflection: of lights, and of other objects with their light.
//!
//! Directions are sampled both where the surface reflects and where lights are, and weighed by how likely each was to give
//! them (Veach and Guibas 1995, balance heuristic). Points and lines have no extent that a reflected ray could meet: they
//! are sampled alone. What a reflected ray meets shows its direct light, its indirect light where the scene has it, and its
//! own specular reflection as if that were diffuse: mirrors do not show mirrors.

use glam::{DVec3, Vec2, Vec3};
use rays::Recent;

use super::{Shader, microfacet::Gloss};
use crate::{
    irradiance::{hemisphere::frame, leaving},
    lights::{Emitter, PolygonShape, Receiver, Shape},
    random::Stream,
    shadows,
    stage::Surface,
};

/// Reflected rays along each side of the square that they are stratified in, for the smoothest and the roughest surface.
const FEWEST: f32 = 4.;
const MOST: f32 = 9.;

/// Places of a light asked for along each side of the square that they are stratified in.
const PLACES: usize = 4;

/// Tells the streams for reflection from those of the lights' shadows.
const SALT: u64 = 0x0061_055e;

/// A glossy surface in its own frame.
pub(super) struct Reflector<'a> {
    receiver: &'a Receiver,
    axes: [DVec3; 3],
    pub(super) gloss: Gloss,
    /// Reflected rays along a side of their square.
    side: usize,
}

impl<'a> Reflector<'a> {
    /// Nothing for surfaces without specular reflection.
    pub(super) fn new(surface: &Surface, receiver: &'a Receiver, towards: DVec3) -> Option<Self> {
        if surface.specular.max_element() <= 0. {
            return None;
        }
        let [u, v] = frame(receiver.normal);
        let axes = [u, v, receiver.normal];
        let view = into(&axes, towards);
        let side = FEWEST + (MOST - FEWEST) * surface.roughness.sqrt();
        Some(Self {
            receiver,
            axes,
            gloss: Gloss::new(surface.specular, surface.roughness, view),
            side: side.round() as usize,
        })
    }

    fn count(&self) -> f32 {
        (self.side * self.side) as f32
    }
}

fn into(axes: &[DVec3; 3], v: DVec3) -> Vec3 {
    Vec3::from_array(axes.map(|axis| axis.dot(v) as f32))
}

impl Shader<'_> {
    /// Radiance that a glossy surface reflects specularly.
    pub(super) fn specular(&mut self, reflector: &Reflector<'_>, stream: &Stream) -> Vec3 {
        let stream = stream.part(SALT);
        let mut sum = self.mirrored(reflector, &stream);
        for (index, emitter) in self.stage.emitters().iter().enumerate() {
            if emitter.unoccluded(reflector.receiver) > 0. {
                let mut stream = stream.part(1 + index as u64);
                sum += self.highlight(reflector, emitter, &mut stream);
            }
        }
        sum
    }

    /// By reflected rays.
    fn mirrored(&mut self, reflector: &Reflector<'_>, stream: &Stream) -> Vec3 {
        let mut sum = Vec3::ZERO;
        let side = reflector.side;
        for i in 0..side * side {
            let mut stream = stream.part(u64::MAX - i as u64);
            let cell = Vec2::new((i % side) as f32, (i / side) as f32);
            let place = (cell + stream.square()) / side as f32;
            let Some((light, weight)) = reflector.gloss.sample(place) else {
                continue;
            };
            let [u, v, n] = reflector.axes;
            let l = light.as_dvec3();
            let direction = (u * l.x + v * l.y + n * l.z).normalize();
            sum += weight * self.met(reflector, light, direction, &mut stream);
        }
        sum / reflector.count()
    }

    /// What a reflected ray brings.
    fn met(
        &mut self,
        reflector: &Reflector<'_>,
        light: Vec3,
        direction: DVec3,
        stream: &mut Stream,
    ) -> Vec3 {
        let ray = leaving(reflector.receiver, direction);
        self.rays += 1;
        let Some(hit) = self.stage.world().closest(&ray, f32::INFINITY) else {
            return self.stage.shading().background.into();
        };
        if let Some(index) = self.stage.light_of(hit.instance) {
            return self.emitted(index, &ray)
                * self.share_of_reflected(reflector, light, index, direction);
        }
        let Some(surface) = self.stage.surface(&hit) else {
            return Vec3::ZERO;
        };
        let receiver = surface.seen_along(direction, hit.instance, hit.face);
        let mut irradiance = Vec3::ZERO;
        for emitter in self.stage.emitters() {
            let unoccluded = emitter.unoccluded(&receiver) as f32;
            if unoccluded > 0. {
                self.shadows.recent = Recent::default();
                let seen = shadows::sees_somewhere(
                    self.stage,
                    &receiver,
                    emitter,
                    stream,
                    &mut self.shadows,
                );
                irradiance += emitter.strength * (unoccluded * f32::from(u8::from(seen)));
            }
        }
        // Shadows in reflections are not shadows on the surface seen.
        self.shadows.blockers.clear();
        if let Some(cache) = self.stage.irradiance() {
            irradiance += cache.reflected_before(self.stage, &receiver);
        }
        let ambient = Vec3::from(self.stage.shading().ambient);
        surface.albedo() * (irradiance * std::f32::consts::FRAC_1_PI + ambient)
    }

    /// What light met by a reflected ray counts for beside the same light asked for on purpose.
    fn share_of_reflected(
        &self,
        reflector: &Reflector<'_>,
        light: Vec3,
        index: u32,
        direction: DVec3,
    ) -> f32 {
        let emitter = self.stage.emitters().get(index as usize);
        let Some(Shape::Polygon(shape)) = emitter.map(|e| &e.shape) else {
            return 0.;
        };
        let asked = density(reflector.receiver, shape, direction) * (PLACES * PLACES) as f32;
        let reflected = reflector.gloss.evaluate(light).1 * reflector.count();
        if reflected + asked > 0. {
            reflected / (reflected + asked)
        } else {
            0.
        }
    }

    /// By asking the light.
    fn highlight(
        &mut self,
        reflector: &Reflector<'_>,
        emitter: &Emitter,
        stream: &mut Stream,
    ) -> Vec3 {
        let places = match emitter.shape {
            Shape::Point(_) => 1,
            Shape::Segment(..) | Shape::Polygon(_) => PLACES * PLACES,
        };
        let mut sum = Vec3::ZERO;
        for i in 0..places {
            let Some(place) = stratified(&emitter.shape, i, stream) else {
                continue;
            };
            let to = place - reflector.receiver.position;
            let squared = to.length_squared();
            if squared <= 0. {
                continue;
            }
            let direction = to / squared.sqrt();
            let light = into(&reflector.axes, direction);
            let (value, by_reflection) = reflector.gloss.evaluate(light);
            let share = match &emitter.shape {
                Shape::Point(_) => 1. / squared as f32,
                Shape::Segment(from, to) => ((*to - *from).length() / squared) as f32,
                Shape::Polygon(shape) => {
                    let asked = density(reflector.receiver, shape, direction);
                    let all = asked * places as f32 + by_reflection * reflector.count();
                    // The balance heuristic's weight over the density.
                    places as f32 / all.max(f32::MIN_POSITIVE) * f32::from(u8::from(asked > 0.))
                }
            };
            let given = value * share;
            if given.max_element() > 0. && self.sees_place(reflector.receiver, emitter, place) {
                sum += emitter.strength * given;
            }
        }
        sum / places as f32
    }

    fn sees_place(&mut self, receiver: &Receiver, emitter: &Emitter, place: DVec3) -> bool {
        self.shadows.recent = Recent::default();
        let seen = shadows::sees_place(self.stage, receiver, emitter, place, &mut self.shadows);
        // The diffuse part asks the same light, and reports what hides it.
        self.shadows.blockers.clear();
        seen
    }
}

/// Density by solid angle with which places of the light that are equally likely by area lie in `direction`; 0 beside it.
fn density(receiver: &Receiver, shape: &PolygonShape, direction: DVec3) -> f32 {
    let cosine = -direction.dot(shape.normal);
    let Some(first) = shape.vertices.first().filter(|_| cosine > 0.) else {
        return 0.;
    };
    let distance = -(*first - receiver.position).dot(shape.normal) / cosine;
    if distance <= 0. {
        return 0.;
    }
    (distance * distance / (cosine * shape.area_m2())) as f32
}

/// Place number `i` of `PLACES²` of a light.
fn stratified(shape: &Shape, i: usize, stream: &mut Stream) -> Option<DVec3> {
    let random = stream.square();
    match shape {
        Shape::Point(position) => Some(*position),
        Shape::Segment(from, to) => {
            let at = (i as f32 + random.x) / (PLACES * PLACES) as f32;
            Some(from.lerp(*to, f64::from(at)))
        }
        Shape::Polygon(polygon) if polygon.fills_square() => {
            let cell = Vec2::new((i % PLACES) as f32, (i / PLACES) as f32);
            polygon.at((cell + random) / PLACES as f32)
        }
        Shape::Polygon(_) => shape.somewhere(stream),
    }
}
