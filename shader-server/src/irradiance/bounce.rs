//! What a ray that gathers light brings back.

use glam::{DVec3, Vec3};
use rays::{Hit, Ray, Recent};

use crate::{
    lights::{Emitter, Receiver, Shape},
    random::Stream,
    shadows::{self, Shadows},
    stage::Stage,
};

/// Square of the distance, in radii, within which a light is not taken for its middle.
const NEAR_LIGHT: f64 = 9.;

/// Height above the horizon that a low light's middle is taken to have at least, radii.
const LOW: f64 = 0.25;

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

/// An area light as its middle sees it.
struct Size {
    middle: DVec3,
    radius_m: f64,
    area_m2: f64,
}

impl Size {
    fn of(emitter: &Emitter) -> Self {
        let vertices = match &emitter.shape {
            Shape::Polygon(shape) => shape.vertices.as_slice(),
            Shape::Point(_) | Shape::Segment(..) => &[],
        };
        let middle = vertices.iter().sum::<DVec3>() / vertices.len().max(1) as f64;
        let radius = |v: &DVec3| v.distance(middle);
        let corners = vertices
            .windows(2)
            .zip(vertices.first().into_iter().cycle());
        let area: DVec3 = corners
            .map(|(v, first)| (v[0] - first).cross(v[1] - first))
            .sum();
        Self {
            middle,
            radius_m: vertices.iter().map(radius).fold(0., f64::max),
            area_m2: 0.5 * area.length(),
        }
    }

    /// About what a light of strength 1 would give; nothing only where it gives nothing.
    fn about(&self, emitter: &Emitter, receiver: &Receiver) -> f32 {
        let Shape::Polygon(shape) = &emitter.shape else {
            return emitter.unoccluded(receiver) as f32;
        };
        let to = self.middle - receiver.position;
        let squared = to.length_squared();
        let radius = self.radius_m;
        if squared < NEAR_LIGHT * radius * radius {
            return emitter.unoccluded(receiver) as f32;
        }
        let (up, out) = (to.dot(receiver.normal), -to.dot(shape.normal));
        if up < -radius || out <= 0. {
            return 0.;
        }
        // Low lights are partly above the horizon.
        let up = up.max(LOW * radius);
        (self.area_m2 * up * out / (squared * squared)) as f32
    }
}

/// Traces gathering rays; notes which instances had a say.
pub(crate) struct Gatherer<'a> {
    stage: &'a Stage,
    shadows: Shadows,
    /// Instances met by rays and by shadow rays, each once.
    pub(crate) met: Vec<u32>,
    /// The same as a set, a bit each.
    seen: Vec<u64>,
    /// By light.
    sizes: Vec<Size>,
    /// About what each light would give to the point at hand, W/m².
    chances: Vec<f32>,
    rays: u64,
}

impl<'a> Gatherer<'a> {
    pub(crate) fn new(stage: &'a Stage) -> Self {
        Self {
            stage,
            shadows: Shadows::default(),
            met: Vec::new(),
            seen: vec![0; stage.world().len().div_ceil(64)],
            sizes: stage.emitters().iter().map(Size::of).collect(),
            chances: vec![0.; stage.emitters().len()],
            rays: 0,
        }
    }

    /// Rays traced so far.
    pub(crate) fn rays(&self) -> u64 {
        self.rays + self.shadows.rays
    }

    /// What a ray in a unit direction from `from` meets.
    pub(crate) fn follow(&mut self, from: &Receiver, direction: DVec3) -> Option<Hit> {
        self.rays += 1;
        let ray = leaving(from, direction);
        let hit = self.stage.world().closest(&ray, f32::INFINITY)?;
        self.note(hit.instance);
        Some(hit)
    }

    /// The surface at a hit, with the direct light that falls there; nothing at a light.
    pub(crate) fn bounce(
        &mut self,
        hit: &Hit,
        direction: DVec3,
        stream: &mut Stream,
    ) -> Option<Bounce> {
        let surface = self.stage.surface(hit)?;
        let receiver = surface.seen_along(direction, hit.instance, hit.face);
        let direct = self.direct(&receiver, stream);
        Some(Bounce {
            receiver,
            albedo: surface.albedo(),
            direct,
        })
    }

    /// Direct irradiance at `receiver`: a light is picked in about the proportion of what it would give, and one ray asks a
    /// random place of it whether it is seen.
    fn direct(&mut self, receiver: &Receiver, stream: &mut Stream) -> Vec3 {
        let emitters = self.stage.emitters();
        let mut total = 0.;
        for ((chance, emitter), seen) in self.chances.iter_mut().zip(emitters).zip(&self.sizes) {
            *chance = seen.about(emitter, receiver) * emitter.strength.max_element();
            total += *chance;
        }
        let wanted = stream.unit() * total;
        let mut before = 0.;
        let picked = emitters.iter().zip(&self.chances).find(|(_, chance)| {
            before += **chance;
            before > wanted
        });
        let Some((emitter, &chance)) = picked else {
            return Vec3::ZERO;
        };
        self.shadows.recent = Recent::default();
        let sees =
            shadows::sees_somewhere(self.stage, receiver, emitter, stream, &mut self.shadows);
        while let Some(blocker) = self.shadows.blockers.pop() {
            self.note(blocker);
        }
        if sees {
            emitter.strength * (emitter.unoccluded(receiver) as f32 * total / chance)
        } else {
            Vec3::ZERO
        }
    }

    /// Notes that an instance had a say.
    pub(crate) fn note(&mut self, instance: u32) {
        let (word, bit) = (instance as usize / 64, 1u64 << (instance % 64));
        if let Some(seen) = self.seen.get_mut(word)
            && *seen & bit == 0
        {
            *seen |= bit;
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
