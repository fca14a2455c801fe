//! How much of a light a point sees.
//!
//! One question, [`Visibility::fraction`], with room for several methods behind it; shadow rays are the one that fits
//! everything.

mod area;
mod shadow_rays;

pub use self::shadow_rays::ShadowRays;

use rays::Recent;

use crate::{
    lights::{Emitter, Receiver},
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
