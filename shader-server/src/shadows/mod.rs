//! How much of a light a point sees.
//!
//! One question, [`Visibility::ask`], about any number of receivers at once, with several methods behind it; shadow rays
//! are the one that fits everything.

mod area;
mod automatic;
mod casting;
mod chosen;
mod cover;
mod mapping;
mod pilot;
mod shadow_rays;
pub mod survey;

pub use self::{
    chosen::{Chosen, ShadowOptions, Wish},
    shadow_rays::ShadowRays,
};

use glam::DVec3;
use rays::Recent;

use crate::{
    lights::{Emitter, Receiver, Shape},
    random::Stream,
    stage::Stage,
};

/// What was done to find visibility.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Work {
    /// Shadow rays.
    pub(crate) rays: u64,
    /// Faces drawn onto lights.
    pub(crate) drawn: u64,
    /// Penumbrae cast.
    pub(crate) casting: penumbra::Counts,
}

/// What one question about visibility came to.
#[derive(Clone, Debug, Default)]
pub struct Shadows {
    /// Instances that blocked the light from the receiver being asked about, each once.
    pub blockers: Vec<u32>,
    /// What blocked the light being asked about from what: (receiver, blocker) instances, some more than once.
    pub met: Vec<(u32, u32)>,
    /// Rays traced since this was made.
    pub rays: u64,
    /// Faces that may be between a receiver and a light, as (instance, face).
    pub(crate) between: Vec<(u32, u32)>,
    /// Faces drawn onto lights, and penumbrae cast, since this was made.
    pub(crate) drawn: u64,
    pub(crate) cast: penumbra::Counts,
    /// What blocked last; blockers of one light and point are often the same.
    pub(crate) recent: Recent,
}

impl Shadows {
    pub(crate) fn work(&self) -> Work {
        Work {
            rays: self.rays,
            drawn: self.drawn,
            casting: self.cast,
        }
    }

    pub(crate) fn block(&mut self, instance: u32) {
        if !self.blockers.contains(&instance) {
            self.blockers.push(instance);
        }
    }

    /// All blockers so far were met on the way to `receiver`, an instance.
    pub(crate) fn met_from(&mut self, receiver: u32) {
        let pairs = self.blockers.drain(..).map(|blocker| (receiver, blocker));
        self.met.extend(pairs);
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

/// One receiver in a question about a light, and the answer.
#[derive(Clone, Debug)]
pub struct Asked {
    /// The point that light falls on.
    pub receiver: Receiver,
    /// Its random numbers for this light.
    pub stream: Stream,
    /// Which of the questions of its batch it belongs to: the asker's own number.
    pub index: usize,
    /// Irradiance from all of the light for a strength of 1; above zero.
    pub unoccluded: f32,
    /// The answer: the share of the light's unoccluded irradiance that reaches the receiver, in [0, 1].
    pub seen: f32,
}

/// A way to find out how much of a light can be seen.
///
/// What it answers about a receiver is a function of the scene, the light, the receiver and its stream alone, whatever else is
/// in the batch.
pub trait Visibility: Send + Sync {
    /// Receivers that it likes to be asked about at once: more gain nothing.
    fn batch(&self) -> usize;

    /// Answers each of `asked` about the light with index `light`. Notes in `shadows` what blocks.
    fn ask(&self, stage: &Stage, light: usize, asked: &mut [Asked], shadows: &mut Shadows);
}
