//! Light straight from the lights.

use std::mem::take;

use protocol::messages::Triple;

use super::{Met, Shader};
use crate::shadows::Asked;

impl Shader<'_> {
    /// Adds the irradiance from every light, W/m², to what is met; notes the shadows.
    pub(super) fn direct(&mut self, met: &mut [Met]) {
        let mut asked = take(&mut self.asked);
        for (light, emitter) in self.stage.emitters().iter().enumerate() {
            asked.clear();
            for (index, met) in met.iter().enumerate() {
                let unoccluded = emitter.unoccluded(&met.receiver) as f32;
                if unoccluded > 0. {
                    asked.push(Asked {
                        receiver: met.receiver,
                        stream: met.stream.part(light as u64),
                        index,
                        unoccluded,
                        seen: 0.,
                    });
                }
            }
            self.visibility
                .ask(self.stage, light, &mut asked, &mut self.shadows);
            for asked in &asked {
                let share = asked.unoccluded * asked.seen;
                met[asked.index].irradiance += emitter.strength * share;
            }
            self.report(light as u32);
        }
        self.asked = asked;
    }

    fn report(&mut self, light: u32) {
        for (receiver, blocker) in self.shadows.met.drain(..) {
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
