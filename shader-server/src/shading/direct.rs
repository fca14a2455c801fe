//! Light straight from the lights.

use glam::Vec3;
use protocol::messages::Triple;
use rays::Recent;

use super::Shader;
use crate::{lights::Receiver, random::Stream};

impl Shader<'_> {
    /// Irradiance from every light, W/m²; notes the shadows met.
    pub(super) fn direct(&mut self, stream: &Stream, receiver: &Receiver) -> Vec3 {
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
        irradiance
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
