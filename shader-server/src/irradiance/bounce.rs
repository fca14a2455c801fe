//! What a ray that gathers light brings back.

use glam::{DVec3, Vec3};
use rays::{Ray, Recent};

use crate::{
    lights::{Emitter, Receiver},
    random::Stream,
    shadows::{self, Shadows},
    stage::Stage,
};

/// A surface that a gathering ray met.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounce {
    /// The point met, its normal on the side met.
    pub(crate) receiver: Receiver,
    /// Share of light reflected, taken to be diffuse.
    pub(crate) albedo: Vec3,
    /// Direct irradiance, W/m²: exact in its amount, from one light in proportion, seen or not by one ray.
    pub(crate) direct: Vec3,
}

/// A gathering ray's end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Arrival {
    /// Metres, infinite where nothing is met.
    pub(crate) distance_m: f32,
    /// What is met, object or light.
    pub(crate) instance: Option<u32>,
    /// The surface, unless that is a light or nothing.
    pub(crate) bounce: Option<Bounce>,
}

/// Traces gathering rays; notes which instances had a say.
pub(crate) struct Gatherer<'a> {
    stage: &'a Stage,
    shadows: Shadows,
    /// Instances met by rays and by shadow rays, each once.
    pub(crate) met: Vec<u32>,
    /// What each light would give to the point at hand, W/m² for strength 1.
    unoccluded: Vec<f32>,
    rays: u64,
}

impl<'a> Gatherer<'a> {
    pub(crate) fn new(stage: &'a Stage) -> Self {
        Self {
            stage,
            shadows: Shadows::default(),
            met: Vec::new(),
            unoccluded: Vec::new(),
            rays: 0,
        }
    }

    /// Rays traced so far.
    pub(crate) fn rays(&self) -> u64 {
        self.rays + self.shadows.rays
    }

    /// Follows a unit direction from `from`.
    pub(crate) fn follow(
        &mut self,
        from: &Receiver,
        direction: DVec3,
        stream: &mut Stream,
    ) -> Arrival {
        let ray = leaving(from, direction);
        self.rays += 1;
        let Some(hit) = self.stage.world().closest(&ray, f32::INFINITY) else {
            return Arrival {
                distance_m: f32::INFINITY,
                instance: None,
                bounce: None,
            };
        };
        self.note(hit.instance);
        let bounce = if self.stage.light_of(hit.instance).is_some() {
            None
        } else {
            self.stage.surface(&hit).map(|surface| {
                let receiver = surface.seen_along(direction, hit.instance, hit.face);
                let direct = self.direct(&receiver, stream);
                Bounce {
                    receiver,
                    albedo: surface.albedo(),
                    direct,
                }
            })
        };
        Arrival {
            distance_m: hit.t,
            instance: Some(hit.instance),
            bounce,
        }
    }

    /// Direct irradiance at `receiver`: a light is picked in proportion to what it would give, and one ray asks a random
    /// place of it whether it is seen. Bounded by what all lights give, so that no single ray is far too bright.
    fn direct(&mut self, receiver: &Receiver, stream: &mut Stream) -> Vec3 {
        let emitters = self.stage.emitters();
        self.unoccluded.clear();
        let given = emitters.iter().map(|e| e.unoccluded(receiver) as f32);
        self.unoccluded.extend(given);
        let amounts = || emitters.iter().zip(&self.unoccluded);
        let weight = |(e, u): (&Emitter, &f32)| u * e.strength.max_element();
        let total: f32 = amounts().map(weight).sum();
        let wanted = stream.unit() * total;
        let mut before = 0.;
        let picked = amounts().find(|pair| {
            before += weight(*pair);
            before > wanted
        });
        let Some((emitter, &unoccluded)) = picked else {
            return Vec3::ZERO;
        };
        let share = weight((emitter, &unoccluded)) / total;
        self.shadows.recent = Recent::default();
        let seen =
            shadows::sees_somewhere(self.stage, receiver, emitter, stream, &mut self.shadows);
        while let Some(blocker) = self.shadows.blockers.pop() {
            self.note(blocker);
        }
        if seen {
            emitter.strength * (unoccluded / share)
        } else {
            Vec3::ZERO
        }
    }

    fn note(&mut self, instance: u32) {
        if !self.met.contains(&instance) {
            self.met.push(instance);
        }
    }
}

/// The ray from a point of a surface in a unit direction, lifted clear of the face to the side that it leaves to.
pub(crate) fn leaving(from: &Receiver, direction: DVec3) -> Ray {
    let direction = direction.as_vec3();
    let side = if direction.dot(from.face_normal) < 0. {
        -1.
    } else {
        1.
    };
    Ray {
        origin: from.position.as_vec3() + from.face_normal * (side * from.clearance),
        direction,
    }
}
