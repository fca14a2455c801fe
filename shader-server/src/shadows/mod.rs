//! How much of a light a point sees.
//!
//! One question, [`Visibility::fraction`], with room for several methods behind it; shadow rays are the one that fits
//! everything.

mod area;
mod cover;
mod shadow_rays;

pub use self::shadow_rays::ShadowRays;

use glam::DVec3;
use rays::Recent;

use crate::{
    lights::{Emitter, Receiver, Shape},
    random::Stream,
    stage::Stage,
};

/// What one question about visibility came to.
#[derive(Clone, Debug, Default)]
pub struct Shadows {
    /// Instances that blocked the light being asked about, each once.
    pub blockers: Vec<u32>,
    /// Rays traced since this was made.
    pub rays: u64,
    /// Faces that may be between a receiver and a light, as (instance, face).
    pub(crate) between: Vec<(u32, u32)>,
    /// What blocked last; blockers of one light and point are often the same.
    pub(crate) recent: Recent,
}

impl Shadows {
    pub(crate) fn block(&mut self, instance: u32) {
        if !self.blockers.contains(&instance) {
            self.blockers.push(instance);
        }
    }
}

/// Whether `receiver` sees a random place of `light`, each piece of which is as likely as any other of its size.
pub(crate) fn sees_somewhere(
    stage: &Stage,
    receiver: &Receiver,
    light: &Emitter,
    stream: &mut Stream,
    shadows: &mut Shadows,
) -> bool {
    let place = light.shape.somewhere(stream);
    place.is_some_and(|place| sees_place(stage, receiver, light, place, shadows))
}

/// Whether `receiver` sees `place`, a place of `light`.
pub(crate) fn sees_place(
    stage: &Stage,
    receiver: &Receiver,
    light: &Emitter,
    place: DVec3,
    shadows: &mut Shadows,
) -> bool {
    let instance = match &light.shape {
        Shape::Polygon(shape) => Some(shape.instance),
        Shape::Point(_) | Shape::Segment(..) => None,
    };
    shadow_rays::sees(stage, receiver, place, instance, shadows)
}

/// A way to find out how much of a light can be seen.
pub trait Visibility: Send + Sync {
    /// The share of `light`'s unoccluded irradiance that reaches `receiver`, in [0, 1]. Adds to `shadows` what blocks.
    fn fraction(
        &self,
        stage: &Stage,
        light: &Emitter,
        receiver: &Receiver,
        stream: &mut Stream,
        shadows: &mut Shadows,
    ) -> f32;
}
