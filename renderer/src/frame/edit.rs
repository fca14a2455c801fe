//! Moving things while the picture stays up.
//!
//! An edit throws away nothing but what it has made wrong for certain. Points of a moved object travel with it; points that
//! it may have darkened or lit are [due](crate::points::due::Due): they count for little beside new samples and are asked
//! for before everything else until a new sample takes their place (section 7 of the Render Cache paper ages them; that
//! alone leaves ghosts for as long as the cache lives).

use glam::{DVec3, Vec3};
use protocol::messages::flags;
use protocol::scene::{Affine, Light};
use rays::Ray;

use super::Display;
use super::placed::{Changes, Edit, Thing, shines_on, wide};
use crate::camera::View;
use crate::points::pixels::NO_POINT;
use crate::points::project::for_each_in_image;
use crate::stats::Stage;

/// What a due point counts for beside a valid one. Nothing at all would leave holes where no new sample is near. Measured at 2 % a
/// frame when a light of chains goes out, FLIP after 5, 10 and 15 frames: 0.403, 0.296, 0.185 at 0.02; 0.191, 0.048, 0.017 at 1e-5;
/// 0.108, 0.020, 0.012 at 1e-8.
const DUE_COUNT: f32 = 1e-8;

/// Factor of that for each further edit since the point was shaded: of two wrong points the newer one is nearer to what is
/// right. Measured on objects dragged for 20 frames at 2 % a frame, FLIP at 0.02 for all due points and as it is: grid 0.286,
/// 0.169; torus 0.050, 0.049; chains 0.0441, 0.0436.
const DUE_AGAIN: f32 = 0.01;

/// Factor of a due pixel's priority. Measured on a dragged link of chains at 2 % a frame: FLIP after 30 frames 0.050
/// without, 0.038 at 30, 0.039 at 100, 0.057 at 10,000, where nothing else gets samples any more.
const DUE_FIRST: f32 = 30.0;

/// Frames that a due point is older than it would be.
const DUE_AGE: u8 = 64;

impl Display {
    /// Takes an edit over, which begins this epoch: samples of another one are dropped from now on. Gives what changed, for
    /// whatever else keeps something of the scene.
    pub fn edit(&mut self, epoch: u32, edit: &Edit) -> Changes {
        let mut ms = std::mem::take(&mut self.stage_ms);
        let changes = ms.time(Stage::Reproject, || self.take_edit(epoch, edit));
        self.stage_ms = ms;
        changes
    }

    fn take_edit(&mut self, epoch: u32, edit: &Edit) -> Changes {
        self.epoch = epoch;
        let changes = self.placed.apply(edit);
        if changes.is_empty() {
            return changes;
        }
        self.edges.edit(&self.placed, &changes);
        self.note_uncovered(&changes);
        if self.choices.due_first.is_on() {
            self.mark_shadows(&changes);
        }
        self.carry_points(&changes);
        self.doubt_behind(&changes);
        self.still.clear();
        (self.stale, self.displaced) = (true, true);
        changes
    }

    /// What is seen at image point (x, y) px of a view, and where, world space. Nothing too where the choices need no rays,
    /// since there is no scene for them then.
    pub fn pick(&self, view: &View, (x, y): (f32, f32)) -> Option<(Thing, Vec3)> {
        let ray = Ray {
            origin: view.eye,
            direction: view.direction(x, y),
        };
        let hit = self.edges.world()?.closest(&ray, f32::INFINITY)?;
        let thing = self.placed.thing(hit.instance)?;
        Some((thing, ray.origin + ray.direction * hit.t))
    }

    /// The epoch of the samples that are taken.
    pub fn epoch(&self) -> u32 {
        self.epoch
    }

    /// Samples dropped since the start because they were of another epoch.
    pub fn late(&self) -> u64 {
        self.late
    }

    /// Points that an edit may have made wrong and no sample has replaced yet.
    pub fn due(&self) -> usize {
        self.due.count()
    }

    /// Marks points that what moved may have darkened or lit, and those that changed lights shine on.
    fn mark_shadows(&mut self, changes: &Changes) {
        let shifts = self.placed.shifts(changes);
        self.marks.clear();
        self.marks.resize(self.cache.capacity(), 0);
        for volume in self.placed.shadows(changes, &shifts) {
            volume.mark(self.level, &self.cache, &mut self.marks);
        }
        for slot in 0..self.cache.capacity() as u32 {
            // Nothing shines on points at infinity; NaN is an empty slot.
            let is_surface = self.cache.w[slot as usize] == 1.0;
            let is_light = self.cache.info[slot as usize].flags & flags::LIGHT != 0;
            if !is_surface || is_light {
                continue;
            }
            let p = self.cache.point(slot);
            let lit = |(_, before, after): &(u32, Light, Light)| {
                shines_on(before, p) || shines_on(after, p)
            };
            if self.marks[slot as usize] != 0 || changes.lights.iter().any(lit) {
                self.make_due(slot);
            }
        }
    }

    fn make_due(&mut self, slot: u32) {
        self.due.set(slot);
        let age = &mut self.cache.age[slot as usize];
        *age = age.saturating_add(DUE_AGE);
    }

    /// Moves the points of what moved; those that cannot follow go.
    fn carry_points(&mut self, changes: &Changes) {
        let objects = changes
            .objects
            .iter()
            .map(|(object, before, after)| (*object, 0, Carry::between(before, after)));
        let lights = changes
            .lights
            .iter()
            .map(|(light, before, after)| (*light, flags::LIGHT, Carry::of_light(before, after)));
        for (index, kind, carry) in objects.chain(lights) {
            for slot in 0..self.cache.capacity() as u32 {
                let info = self.cache.info[slot as usize];
                let own = info.object == index && info.flags & flags::LIGHT == kind;
                if !own || self.cache.w[slot as usize] != 1.0 {
                    continue;
                }
                match carry.map(|c| c.apply(self.cache.point(slot))) {
                    Some(p) if p.is_finite() => {
                        for (plane, value) in self.cache.position.iter_mut().zip(p.to_array()) {
                            plane[slot as usize] = value;
                        }
                        self.cache.doubt(slot);
                        if self.choices.due_first.is_on() {
                            self.make_due(slot);
                        }
                    }
                    _ => {
                        self.cache.remove(slot);
                        self.due.clear(slot);
                    }
                }
            }
        }
    }

    /// Has the points looked at anew that what moved may hide, or have hidden, from where the last frame was seen.
    fn doubt_behind(&mut self, changes: &Changes) {
        let Some(view) = self.view else { return };
        self.marks.clear();
        self.marks.resize(self.cache.capacity(), 0);
        for shift in self.placed.shifts(changes) {
            for volume in shift.before_the_eye(view.eye).into_iter().flatten() {
                volume.mark(self.level, &self.cache, &mut self.marks);
            }
        }
        for (slot, mark) in (0u32..).zip(&self.marks) {
            if *mark != 0 {
                self.cache.doubt(slot);
            }
        }
    }

    /// Marks the pixels that show what moves, before it does.
    fn note_uncovered(&mut self, changes: &Changes) {
        if self.displaced {
            return;
        }
        let grid = self.grid;
        self.revealed.fill(0);
        for y in 0..grid.height {
            for x in 0..grid.width {
                let point = self.pixels.point[grid.at(x, y)];
                if point == NO_POINT {
                    continue;
                }
                let info = self.cache.info[point as usize];
                let light = info.flags & flags::LIGHT != 0;
                let moves = if light {
                    changes.lights.iter().any(|c| c.0 == info.object)
                } else {
                    changes.objects.iter().any(|c| c.0 == info.object)
                };
                if moves {
                    let (word, bit) = grid.bit(x, y);
                    self.revealed[word] |= 1 << bit;
                }
            }
        }
    }

    /// Finds anew which point each pixel of the last frame has, if points have moved since: samples that come and requests
    /// that are made before the next frame then meet things where they are.
    pub(super) fn relocate(&mut self) {
        if !std::mem::take(&mut self.displaced) {
            return;
        }
        let Some(view) = self.view else { return };
        let (grid, pixels) = (self.grid, &mut self.pixels);
        pixels.point.fill(NO_POINT);
        pixels.depth.fill(f32::INFINITY);
        let (level, cache, batch) = (self.level, &self.cache, &mut self.batch);
        for_each_in_image(level, cache, &view, batch, |slot, [x, y], depth| {
            let at = grid.at((x >> 8) as usize, (y >> 8) as usize);
            let depth = f32::from_bits(depth);
            if depth < pixels.depth[at] {
                (pixels.depth[at], pixels.point[at]) = (depth, slot as u32);
            }
        });
        for y in 0..grid.height {
            for x in 0..grid.width {
                if pixels.point[grid.at(x, y)] != NO_POINT {
                    let (word, bit) = grid.bit(x, y);
                    self.revealed[word] &= !(1 << bit);
                }
            }
        }
    }

    /// After projection: what due points count for.
    pub(super) fn weigh_due(&mut self) {
        self.revealed.fill(0);
        self.displaced = false;
        if self.due.count() == 0 {
            return;
        }
        let (grid, due, pixels) = (self.grid, &mut self.due, &mut self.pixels);
        for y in 0..grid.height {
            for x in 0..grid.width {
                let at = grid.at(x, y);
                if !due.is_due(pixels.point[at]) {
                    continue;
                }
                if pixels.has_sample(x, y) {
                    let age = self.cache.age[pixels.point[at] as usize];
                    pixels.count[at] = due_count(age);
                } else {
                    // It was found hidden: nothing in this pixel is due.
                    let gone = self.cache.w[pixels.point[at] as usize].is_nan();
                    if gone {
                        due.clear(pixels.point[at]);
                    }
                    (pixels.point[at], pixels.depth[at]) = (NO_POINT, f32::INFINITY);
                }
            }
        }
    }

    /// Raises the priority of pixels whose point is due and of those that were just uncovered.
    pub(super) fn raise_due(&mut self) {
        if !self.choices.due_first.is_on() {
            return;
        }
        let any_revealed = self.revealed.iter().any(|w| *w != 0);
        if self.due.count() == 0 && !any_revealed {
            return;
        }
        let (grid, priority) = (self.grid, &mut self.priorities.priority);
        for y in 0..grid.height {
            for x in 0..grid.width {
                let at = grid.at(x, y);
                let (word, bit) = grid.bit(x, y);
                let revealed = self.revealed[word] >> bit & 1 == 1;
                if revealed || self.due.is_due(self.pixels.point[at]) {
                    priority[at] *= DUE_FIRST;
                }
            }
        }
    }
}

/// What a due point of this age counts for beside a valid one.
fn due_count(age: u8) -> f32 {
    // Every edit adds to the age.
    let edits = i32::from(age / DUE_AGE);
    DUE_COUNT * DUE_AGAIN.powi((edits - 1).max(0))
}

/// How points travel.
#[derive(Clone, Copy, Debug)]
enum Carry {
    /// Exact but for the rounding of the sum.
    By(DVec3),
    Map(glam::DAffine3),
}

impl Carry {
    /// With an object; nothing if it had no volume that points could keep their places in.
    fn between(before: &Affine, after: &Affine) -> Option<Self> {
        let (old, new) = (wide(before), wide(after));
        if old.matrix3 == new.matrix3 {
            return Some(Self::By(new.translation - old.translation));
        }
        let map = new * old.inverse();
        map.is_finite().then_some(Self::Map(map))
    }

    /// With an area light that is shifted as a whole, or only shines otherwise.
    fn of_light(before: &Light, after: &Light) -> Option<Self> {
        let (Light::Area { vertices: old, .. }, Light::Area { vertices: new, .. }) =
            (before, after)
        else {
            return None;
        };
        let shift = |(a, b): (&[f32; 3], &[f32; 3])| Vec3::from(*b) - Vec3::from(*a);
        let by = shift((old.first()?, new.first()?));
        let size = old
            .iter()
            .map(|v| Vec3::from(*v).length())
            .fold(0.0, f32::max)
            + by.length();
        let whole = old.len() == new.len()
            && old
                .iter()
                .zip(new)
                .all(|pair| (shift(pair) - by).length() <= 1e-6 * size);
        whole.then(|| Self::By(by.as_dvec3()))
    }

    fn apply(self, p: Vec3) -> Vec3 {
        match self {
            Self::By(by) => (p.as_dvec3() + by).as_vec3(),
            Self::Map(map) => map.transform_point3(p.as_dvec3()).as_vec3(),
        }
    }
}

#[cfg(test)]
#[path = "edit_tests.rs"]
mod tests;
