//! The point cache: a fixed number of recent samples as coloured points in the scene (Render Cache; paper section 4.3).

use glam::Vec3;
use protocol::messages::{Sample, flags};

use crate::maps::PointTexel;

/// Frames for which a point that was found visible, or has just come in, is taken to be so.
const TRUSTED: u8 = 6;

/// Frames after which every point has been asked about that was in sight all the while.
pub const ALL_ASKED: u8 = TRUSTED + SPREAD as u8;

/// Slots that are trusted for a frame more or less than each other, so that not all are asked about at once.
const SPREAD: u32 = 5;

/// Bit of [`PointCache::sight`]: a pixel kept the point in the last frame.
const SEEN: u8 = 0x80;

/// Bits of [`PointCache::sight`]: how often in a row neighbours vouched for the point.
const VOUCHED: u8 = 0x70;

/// One of them.
const VOUCHED_ONCE: u8 = 0x10;

/// Bits of [`PointCache::sight`]: for how many more frames in sight nothing is taken to hide the point.
const FRAMES: u8 = 0x0f;

/// Age that a point gains whenever a nearer surface is found to hide it.
const HIDDEN_AGE: u8 = 24;

/// What the cache holds of a point besides its place and colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PointInfo {
    /// Object index as the server named it, or light index with the light flag.
    pub object: u32,
    /// Bits of [`protocol::messages::flags`].
    pub flags: u32,
}

/// Points as structure of arrays. A slot is in use if its `w` is not NaN.
///
/// A point at `position` has `w` = 1; one at infinity, where a ray hit nothing, has its unit direction and `w` = 0, so
/// that `position − w·eye` is the vector to it from any eye.
#[derive(Clone, Debug)]
pub struct PointCache {
    /// World position or direction.
    pub position: [Vec<f32>; 3],
    /// 1, 0 at infinity, NaN in an empty slot.
    pub w: Vec<f32>,
    /// Linear radiance, a point's three together: they are only ever read at once.
    pub rgb: Vec<[f32; 3]>,
    /// Object and flags.
    pub info: Vec<PointInfo>,
    /// What each point remembers of its surface's map; empty in a scene without maps.
    texels: Vec<PointTexel>,
    /// Grows each frame from 0 (new) to 255 (the next to be evicted).
    pub age: Vec<u8>,
    /// What is known of whether the point is hidden: see [`SEEN`], [`VOUCHED`] and [`FRAMES`].
    sight: Vec<u8>,
    free: Vec<u32>,
    /// No slot from here on was ever used.
    reach: usize,
    hand: usize,
    used: usize,
    evicted: u64,
}

impl PointCache {
    /// An empty cache of fixed size.
    pub fn new(capacity: usize) -> Self {
        let plane = || vec![0.0; capacity];
        Self {
            position: [plane(), plane(), plane()],
            w: vec![f32::NAN; capacity],
            rgb: vec![[0.0; 3]; capacity],
            info: vec![
                PointInfo {
                    object: 0,
                    flags: 0
                };
                capacity
            ],
            texels: Vec::new(),
            age: vec![0; capacity],
            sight: vec![0; capacity],
            free: (0..capacity as u32).rev().collect(),
            reach: 0,
            hand: 0,
            used: 0,
            evicted: 0,
        }
    }

    /// Makes room for what points remember of maps.
    pub fn remember_maps(&mut self) {
        self.texels = vec![PointTexel::NONE; self.capacity()];
    }

    /// What a point remembers of its surface's map.
    #[inline]
    pub fn texel(&self, slot: u32) -> &PointTexel {
        self.texels.get(slot as usize).unwrap_or(&PointTexel::NONE)
    }

    /// Has a point remember its surface's map, if there is [room](PointCache::remember_maps).
    pub fn set_texel(&mut self, slot: u32, texel: PointTexel) {
        if let Some(here) = self.texels.get_mut(slot as usize) {
            *here = texel;
        }
    }

    /// Slots in all.
    pub fn capacity(&self) -> usize {
        self.w.len()
    }

    /// Slots in use.
    pub fn len(&self) -> usize {
        self.used
    }

    /// Slots that may be in use are those before this one.
    pub fn reach(&self) -> usize {
        self.reach
    }

    /// Whether no slot is in use.
    pub fn is_empty(&self) -> bool {
        self.used == 0
    }

    /// Points thrown out for newer ones since the start.
    pub fn evicted(&self) -> u64 {
        self.evicted
    }

    /// Puts a sample into `replaced` if given, else into a free slot, else into that of an old point; gives the slot, or
    /// nothing where the cache has no slots at all.
    pub fn insert(&mut self, sample: &Sample, replaced: Option<u32>) -> Option<u32> {
        let slot = match replaced.filter(|&p| !self.w[p as usize].is_nan()) {
            Some(point) => point,
            None => self.take_slot()?,
        };
        let i = slot as usize;
        for axis in 0..3 {
            self.position[axis][i] = sample.position[axis];
        }
        self.rgb[i] = sample.radiance;
        self.w[i] = if sample.flags & flags::MISS != 0 {
            0.0
        } else {
            1.0
        };
        self.info[i] = PointInfo {
            object: sample.object,
            flags: sample.flags,
        };
        self.age[i] = 0;
        self.sight[i] = SEEN;
        self.trust(slot);
        Some(slot)
    }

    /// Empties a slot.
    pub fn remove(&mut self, slot: u32) {
        let w = &mut self.w[slot as usize];
        if !w.is_nan() {
            *w = f32::NAN;
            self.free.push(slot);
            self.used -= 1;
        }
    }

    /// World position (or direction, if at infinity) of a point.
    pub fn point(&self, slot: u32) -> Vec3 {
        let i = slot as usize;
        Vec3::new(
            self.position[0][i],
            self.position[1][i],
            self.position[2][i],
        )
    }

    fn take_slot(&mut self) -> Option<u32> {
        if let Some(slot) = self.free.pop() {
            self.used += 1;
            self.reach = self.reach.max(slot as usize + 1);
            return Some(slot);
        }
        // A clock hand finds the oldest among the next few slots: O(1), and never the same slot twice in a row.
        let n = self.w.len();
        let oldest = (0..n.min(32))
            .map(|k| (self.hand + k) % n)
            .max_by_key(|&i| self.age[i])?;
        self.hand = (self.hand + 32) % n;
        self.evicted += 1;
        Some(oldest as u32)
    }

    /// Forgets which points were seen. Those that were are trusted for a frame less, the others no more: what hides a point
    /// may have come between.
    pub fn start_frame(&mut self) {
        for sight in &mut self.sight[..self.reach] {
            let trusted = u8::from(*sight & FRAMES != 0);
            *sight = if *sight & SEEN == 0 {
                0
            } else {
                (*sight & !SEEN) - trusted
            };
        }
    }

    /// Says that it is not known any more of any point whether something hides it.
    pub fn doubt_all(&mut self) {
        for sight in &mut self.sight[..self.reach] {
            *sight &= SEEN;
        }
    }

    /// Marks a point as seen; says whether it is time to ask if something hides it.
    #[inline]
    pub fn keep(&mut self, slot: usize) -> bool {
        let sight = &mut self.sight[slot];
        let doubtful = *sight & FRAMES == 0;
        *sight |= SEEN;
        doubtful
    }

    /// Whether a pixel kept the point in the last frame, and nothing was found to hide it.
    pub fn is_seen(&self, slot: u32) -> bool {
        self.sight[slot as usize] & SEEN != 0
    }

    /// Says that nothing hides a point now.
    pub fn trust(&mut self, slot: u32) {
        let sight = &mut self.sight[slot as usize];
        *sight = (*sight & SEEN) | trusted_for(slot);
    }

    /// Says that a point lies among others that nothing hides. True if that is enough to trust it: after a few times in a row
    /// it is not.
    pub fn vouch(&mut self, slot: u32) -> bool {
        let sight = &mut self.sight[slot as usize];
        if *sight & VOUCHED == VOUCHED {
            return false;
        }
        *sight = (*sight & (SEEN | VOUCHED)) + VOUCHED_ONCE + trusted_for(slot);
        true
    }

    /// Says that it is not known any more whether something hides a point.
    pub fn doubt(&mut self, slot: u32) {
        self.sight[slot as usize] &= SEEN;
    }

    /// Says that a point is hidden: it is not seen, and ages. When found hidden a few times over it goes.
    pub fn hide(&mut self, slot: u32) {
        let i = slot as usize;
        self.sight[i] = 0;
        self.age[i] = self.age[i].saturating_add(HIDDEN_AGE);
        if self.age[i] == u8::MAX {
            self.remove(slot);
        }
    }

    /// Ages every point by one frame's worth: those seen by `step`, the others by twice as much, so that points
    /// out of sight are the first to go (Render Cache 2002, "Age"). Ages stop at 255.
    pub fn grow_older(&mut self, step: u8) {
        if step == 0 {
            return;
        }
        for (age, &sight) in self.age[..self.reach].iter_mut().zip(&self.sight) {
            let unseen = if sight & SEEN == 0 { step } else { 0 };
            *age = age.saturating_add(step).saturating_add(unseen);
        }
    }
}

fn trusted_for(slot: u32) -> u8 {
    TRUSTED + (slot % SPREAD) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(id: u64) -> Sample {
        Sample {
            id,
            position: [id as f32, 0.0, -1.0],
            object: 3,
            radiance: [1.0, 2.0, 3.0],
            flags: 0,
        }
    }

    #[test]
    fn a_full_cache_gives_up_its_oldest_point() {
        let mut cache = PointCache::new(4);
        let slots: Vec<u32> = (0..4)
            .filter_map(|i| cache.insert(&sample(i), None))
            .collect();
        assert_eq!((slots.len(), cache.len()), (4, 4));
        cache.age.copy_from_slice(&[1, 9, 2, 3]);
        assert_eq!(cache.insert(&sample(7), None), Some(1));
        assert_eq!((cache.len(), cache.evicted()), (4, 1));
        assert_eq!(cache.point(1).x, 7.0);
    }

    #[test]
    fn points_are_trusted_for_a_while_and_hidden_ones_go() {
        let mut cache = PointCache::new(1);
        cache.insert(&sample(1), None).unwrap();
        for _ in 0..2 {
            let mut frames = 0;
            loop {
                cache.start_frame();
                assert!(!cache.is_seen(0));
                let doubtful = cache.keep(0);
                assert!(cache.is_seen(0));
                if doubtful {
                    break;
                }
                frames += 1;
            }
            assert_eq!(frames, u32::from(TRUSTED) - 1);
            cache.trust(0);
        }
        let vouched = (0..100).take_while(|_| cache.vouch(0)).count();
        assert_eq!(vouched, usize::from(VOUCHED / VOUCHED_ONCE));
        cache.start_frame();
        assert!(!cache.keep(0) && !cache.vouch(0));
        cache.trust(0);
        assert!(cache.vouch(0) && cache.is_seen(0));
        let mut hidden = 0;
        while !cache.is_empty() {
            cache.hide(0);
            assert!(!cache.is_seen(0));
            hidden += 1;
        }
        assert_eq!(hidden, 255_u32.div_ceil(u32::from(HIDDEN_AGE)));
    }

    #[test]
    fn a_removed_slot_is_used_again_and_ages_stop() {
        let mut cache = PointCache::new(2);
        let a = cache.insert(&sample(0), None).unwrap();
        cache.insert(&sample(1), None).unwrap();
        cache.remove(a);
        cache.remove(a);
        assert_eq!((cache.len(), cache.reach()), (1, 2));
        assert_eq!(cache.insert(&sample(2), None), Some(a));
        cache.start_frame();
        cache.keep(0);
        cache.grow_older(100);
        assert_eq!(cache.age, [100, 200]);
        for _ in 0..300 {
            cache.grow_older(100);
        }
        assert_eq!(cache.age, [255, 255]);
        assert_eq!(PointCache::new(0).insert(&sample(0), None), None);
    }
}
