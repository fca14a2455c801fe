//! Taking samples in.

use protocol::messages::{Sample, Texel, flags};

use super::Display;
use crate::camera::View;
use crate::epi::code::Side;
use crate::maps::PointTexel;
use crate::points::pixels::NO_POINT;
use crate::points::project::FAR_DEPTH;
use crate::points::still::Colours;
use crate::stats::Stage;

/// A sample and the view that it was asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Received {
    /// Number of the view.
    pub view: u32,
    /// The epoch in which it was shaded.
    pub epoch: u32,
    /// The sample.
    pub sample: Sample,
    /// What a diffuse map did to it, if the server said so.
    pub texel: Option<Texel>,
}

/// How near in depth a new sample must lie to the point of its pixel to take its slot, as a share of the depth.
const SAME_SURFACE: f32 = 0.05;

impl Display {
    /// Takes samples into the cache, and into the means of a still camera where they were asked for in the last frame's view
    /// and that is the view of the next one, `view_number`, too. The order matters: lockstep gives them in the order of
    /// their ids. Samples of another epoch than that of the last [edit](Display::edit) are dropped.
    pub fn receive(&mut self, samples: &[Received], view_number: u32) {
        let mut ms = std::mem::take(&mut self.stage_ms);
        ms.time(Stage::Drain, || {
            self.relocate();
            for received in samples {
                self.take(received, view_number);
            }
        });
        self.stage_ms = ms;
        self.samples_new += samples.len();
    }

    fn take(&mut self, received: &Received, view_number: u32) {
        if received.epoch != self.epoch {
            self.late += 1;
            return;
        }
        let (sample, texel) = self.flatten(received);
        let sample = &sample;
        let Some(view) = self.view else {
            self.insert(sample, texel, None);
            return;
        };
        let Some((x_px, y_px, depth)) = place(&view, sample) else {
            self.insert(sample, texel, None);
            return;
        };
        let (x, y) = (x_px as usize, y_px as usize);
        let at = self.grid.at(x, y);
        let there = self.pixels.point[at];
        let same = (depth - self.pixels.depth[at]).abs() <= SAME_SURFACE * depth;
        let replaced = (there != NO_POINT && same).then_some(there);
        if there != NO_POINT && !same && self.due.missed(there) {
            self.cache.remove(there);
            self.pixels.point[at] = NO_POINT;
            self.pixels.depth[at] = f32::INFINITY;
        }
        let slot = self.insert(sample, texel, replaced);
        if let Some(slot) = slot.filter(|_| same || depth < self.pixels.depth[at]) {
            self.pixels.point[at] = slot;
            self.pixels.depth[at] = depth;
        }
        let lasts = received.view == self.view_number && self.view_number == view_number;
        if lasts && self.choices.settle.is_on() {
            let offset = [x_px - x as f32, y_px - y as f32];
            let colours = Colours {
                rgb: received.sample.radiance,
                flat: sample.radiance,
            };
            let code = self.epi.code_at(x, y);
            let region = code.is_simple().then(|| {
                let tables = self.epi.tables();
                match tables.side(code, tables.places().cell(offset[0], offset[1])) {
                    Side::Outer => Some((code.0, 0)),
                    Side::Inner => Some((code.0, 1)),
                    Side::Ambiguous => None,
                }
            });
            if sample.flags & flags::PROVISIONAL != 0 {
                self.still.add_provisional((x, y), offset, colours);
            } else {
                self.still.add((x, y), offset, colours, region.flatten());
            }
        }
    }

    /// The sample without its map, and what its point remembers of that.
    fn flatten(&self, received: &Received) -> (Sample, PointTexel) {
        let sample = received.sample;
        let flat = received.texel.as_ref().zip(self.maps.as_ref());
        let flat =
            flat.and_then(|(texel, maps)| maps.flatten(sample.object, sample.radiance, texel));
        let (radiance, texel) = flat.unwrap_or((sample.radiance, PointTexel::NONE));
        (Sample { radiance, ..sample }, texel)
    }

    fn insert(&mut self, sample: &Sample, texel: PointTexel, replaced: Option<u32>) -> Option<u32> {
        let slot = self.cache.insert(sample, replaced)?;
        self.cache.set_texel(slot, texel);
        self.due.clear(slot);
        let eye = self.view.map_or(glam::Vec3::ZERO, |view| view.eye);
        self.renewal
            .note(slot, sample.flags, eye, self.cache.capacity());
        Some(slot)
    }
}

/// Where in the image a sample lies: x px, y px, depth.
fn place(view: &View, sample: &Sample) -> Option<(f32, f32, f32)> {
    let position = glam::Vec3::from(sample.position);
    let miss = sample.flags & flags::MISS != 0;
    let (x, y, depth) = view.project(if miss { view.eye + position } else { position })?;
    let inside = x >= 0.0 && y >= 0.0 && x < view.width as f32 && y < view.height as f32;
    inside.then_some((
        x,
        y,
        if miss {
            FAR_DEPTH * depth.min(1.0)
        } else {
            depth
        },
    ))
}
