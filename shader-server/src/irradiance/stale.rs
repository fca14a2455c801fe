//! What becomes of records when something moves.
//!
//! A record is stale if a ray of its own, or a shadow ray at one's end, met what moved, or if a ray meets it now; and if a
//! light changed. Light that was reflected before that may change with anything: of the far field the rays are kept by the
//! same rule, and what they bring is summed afresh.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use rays::Bounds;

use super::{IrradianceCache, Patience, Slot, lattice::Place, patch::Patches, record};
use crate::{
    lights::{Receiver, Shape},
    stage::Stage,
};

/// What an edit moved.
#[derive(Clone, Debug, Default)]
pub(crate) struct Moved {
    /// Instances, with their bounds before and after, world space.
    pub(crate) instances: Vec<(u32, Bounds, Bounds)>,
    /// Whether any light is another than before.
    pub(crate) lights: bool,
}

impl IrradianceCache {
    /// The cache for the scene after an edit. One that is to give final answers begins anew, since with four reflections
    /// everything depends on everything; one that answers at once keeps its records until they are replaced.
    pub(crate) fn after(
        &self,
        [before, after]: [&Stage; 2],
        moved: &Moved,
        diagonal_m: f64,
    ) -> Self {
        let mut next = Self::new(diagonal_m, self.patience);
        if self.patience == Patience::Final {
            return next;
        }
        // Sites stay where they are.
        next.lattice = self.lattice;
        let touched = |place: &Place| {
            moved
                .instances
                .iter()
                .any(|(_, old, new)| [old, new].iter().any(|b| self.lattice.meets(place.cell, b)))
        };
        let lights: Vec<DVec3> = before.emitters().iter().map(|e| middle(&e.shape)).collect();
        self.cells.each(|cell, sites| {
            let place = Place {
                cell: *cell,
                orientation: 0,
            };
            if !touched(&place) {
                next.cells.put(*cell, Arc::clone(sites));
            }
        });
        let total = *self
            .total
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner);
        next.total = total.into();
        self.records.each(|place, slot| {
            let Some(record) = slot.fresh.get().or(slot.old.as_ref()) else {
                return;
            };
            // Its site may be another one now.
            if touched(place) {
                return;
            }
            let rays = Rays {
                site: &record.site,
                distances_m: &record.distances_m,
                met: &record.met,
            };
            let was_stale = slot.fresh.get().is_none() && slot.is_stale;
            let directions = || record::directions(*place, &record.site);
            let slot = Slot {
                old: Some(Arc::clone(record)),
                is_stale: was_stale || rays.concern(moved, &lights, directions),
                ..Slot::default()
            };
            next.records.put(*place, Arc::new(slot));
        });
        next.keep_patches(self, [before, after], moved, &lights);
        next
    }

    /// Keeps of the far field what an edit does not concern.
    fn keep_patches(
        &self,
        old: &Self,
        [before, after]: [&Stage; 2],
        moved: &Moved,
        lights: &[DVec3],
    ) {
        let Some(old) = old.patches.get() else {
            return;
        };
        let patches = Patches::new(after, self.lattice.spacing_m(0));
        if patches.is_laid_out_as(old) && !moved.lights {
            for (slot, (from, to)) in old.slots.iter().zip(&patches.slots).enumerate() {
                let Some(patch) = from.get() else { continue };
                let Some(ends) = patch.ends() else { continue };
                let piece = old.piece(slot as u32);
                let has_moved = |instance: &u32| moved.instances.iter().any(|m| m.0 == *instance);
                let mut concerned = has_moved(&piece.instance)
                    || ends.met.iter().any(has_moved)
                    || patch.shaded_by().iter().any(has_moved);
                concerned = concerned
                    || patch.rays(before, piece).zip(&ends.distances_m).any(
                        |((from, towards), distance)| {
                            let from = from.position.as_vec3();
                            let shaded = |(_, _, now): &(u32, Bounds, Bounds)| {
                                lights.iter().any(|l| passes(from, l.as_vec3(), now))
                            };
                            moved.instances.iter().any(shaded)
                                || crosses(from, towards, *distance, moved, lights)
                        },
                    );
                if !concerned {
                    // It has just been made: nothing is there yet.
                    let _ = to.set(Box::new(patch.kept()));
                }
            }
        }
        let _ = self.patches.set(patches);
    }
}

/// The rays that something rests on.
struct Rays<'a> {
    site: &'a Receiver,
    distances_m: &'a [f32],
    met: &'a [u32],
}

impl Rays<'_> {
    /// Whether what moved has changed what they bring.
    fn concern<D: Iterator<Item = DVec3>>(
        &self,
        moved: &Moved,
        lights: &[DVec3],
        directions: impl Fn() -> D,
    ) -> bool {
        if moved.lights || moved.instances.iter().any(|(i, ..)| self.met.contains(i)) {
            return true;
        }
        let from = self.site.position.as_vec3();
        directions()
            .zip(self.distances_m)
            .any(|(towards, distance)| crosses(from, towards, *distance, moved, lights))
    }
}

/// Whether what moved is now in the way of a ray, or of light to its end.
fn crosses(from: Vec3, towards: DVec3, distance_m: f32, moved: &Moved, lights: &[DVec3]) -> bool {
    moved.instances.iter().any(|(_, _, now)| {
        let end = from + towards.as_vec3() * distance_m.min(1e9);
        passes(from, end, now)
            || distance_m.is_finite() && lights.iter().any(|l| passes(end, l.as_vec3(), now))
    })
}

fn middle(shape: &Shape) -> DVec3 {
    match shape {
        Shape::Point(position) => *position,
        Shape::Segment(from, to) => (*from + *to) * 0.5,
        Shape::Polygon(shape) => {
            shape.vertices.iter().sum::<DVec3>() / shape.vertices.len().max(1) as f64
        }
    }
}

/// Whether the segment meets the box.
fn passes(from: Vec3, to: Vec3, bounds: &Bounds) -> bool {
    let inverse = (to - from).recip();
    let (a, b) = ((bounds.min - from) * inverse, (bounds.max - from) * inverse);
    // NaN, from a segment in the plane of a side, counts as inside.
    let enter = a.x.min(b.x).max(a.y.min(b.y)).max(a.z.min(b.z)).max(0.);
    let leave = a.x.max(b.x).min(a.y.max(b.y)).min(a.z.max(b.z)).min(1.);
    enter <= leave
}
