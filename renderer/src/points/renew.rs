//! Points that want another sample though nothing moved: those that were only provisional, and those that were seen from
//! elsewhere and look different from here.

use glam::Vec3;
use protocol::messages::flags;
use protocol::scene::{Model, Scene};

use super::cache::PointInfo;

/// Frames after which a provisional point is asked for again: what was wanting for it has had time to be computed.
const PATIENCE: u32 = 6;

/// Share of a surface's roughness that the direction it is seen from may change by, as the sine of the angle: reflections
/// then move by a part of their own blur. The greatest change at all, for surfaces that are hardly glossy.
const SHARE: f32 = 0.25;
const MOST: f32 = 0.15;

/// What the points' flags ask for. Takes no memory before the first flag comes.
#[derive(Clone, Debug, Default)]
pub struct Renewal {
    frame: u32,
    /// By slot: the frame in which it came.
    came: Vec<u32>,
    /// By slot: the eye that it was seen from, world space.
    eye: Vec<Vec3>,
    /// By object: greatest sine of the angle between two directions from which it looks the same.
    tolerance: Vec<f32>,
}

impl Renewal {
    /// For points on the objects of this scene.
    pub fn new(scene: &Scene) -> Self {
        let glossy = scene.shading.model != Model::Direct;
        let objects = scene.objects.iter().filter(|_| glossy);
        let tolerance = objects.map(|object| {
            let faces = scene.meshes.get(object.mesh as usize);
            let own = faces.map_or(&[][..], |m| &m.face_materials);
            std::iter::once(&object.material)
                .chain(own)
                .filter_map(|i| scene.materials.get(*i as usize))
                .filter(|m| m.specular.iter().any(|s| *s > 0.0))
                .map(|m| SHARE * m.roughness)
                .fold(MOST, f32::min)
        });
        Self {
            tolerance: tolerance.collect(),
            ..Self::default()
        }
    }

    /// Whether any flag has come.
    pub fn is_needed(&self) -> bool {
        !self.came.is_empty()
    }

    /// Begins a frame.
    pub fn next_frame(&mut self) {
        self.frame = self.frame.wrapping_add(1);
    }

    /// A sample with these flags, seen from `eye`, has come into a slot of a cache of `capacity`.
    pub fn note(&mut self, slot: u32, bits: u32, eye: Vec3, capacity: usize) {
        if bits & (flags::PROVISIONAL | flags::VIEW_DEPENDENT) == 0 {
            return;
        }
        if self.came.len() < capacity {
            self.came.resize(capacity, 0);
            self.eye.resize(capacity, Vec3::ZERO);
        }
        self.came[slot as usize] = self.frame;
        self.eye[slot as usize] = eye;
    }

    /// Whether the point in a slot, at `position`, wants another sample when seen from `eye`.
    pub fn is_wanted(&self, slot: u32, info: PointInfo, position: Vec3, eye: Vec3) -> bool {
        let i = slot as usize;
        let waited = || self.frame.wrapping_sub(self.came[i]) >= PATIENCE;
        if info.flags & flags::PROVISIONAL != 0 && waited() {
            return true;
        }
        if info.flags & flags::VIEW_DEPENDENT == 0 {
            return false;
        }
        let (then, now) = (self.eye[i] - position, eye - position);
        let tolerance = self.tolerance.get(info.object as usize).unwrap_or(&MOST);
        let squared = then.length_squared() * now.length_squared();
        then.dot(now) < 0.0 || then.cross(now).length_squared() > tolerance * tolerance * squared
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn info(flags: u32) -> PointInfo {
        PointInfo { object: 0, flags }
    }

    #[test]
    fn provisional_points_are_asked_for_again_after_a_while() {
        let mut renewal = Renewal::default();
        assert!(!renewal.is_needed());
        renewal.note(2, 0, Vec3::ZERO, 4);
        assert!(!renewal.is_needed());
        renewal.note(2, flags::PROVISIONAL, Vec3::ZERO, 4);
        assert!(renewal.is_needed());
        let wanted = |r: &Renewal| r.is_wanted(2, info(flags::PROVISIONAL), Vec3::X, Vec3::ZERO);
        for _ in 0..PATIENCE {
            assert!(!wanted(&renewal));
            renewal.next_frame();
        }
        assert!(wanted(&renewal));
        assert!(!renewal.is_wanted(2, info(0), Vec3::X, Vec3::ZERO));
        renewal.note(2, flags::PROVISIONAL, Vec3::ZERO, 4);
        assert!(!wanted(&renewal));
    }

    #[test]
    fn glossy_points_are_asked_for_again_when_seen_from_elsewhere() {
        let mut renewal = Renewal {
            tolerance: vec![0.1],
            ..Renewal::default()
        };
        let glossy = info(flags::VIEW_DEPENDENT);
        renewal.note(0, glossy.flags, Vec3::new(0.0, 0.0, 2.0), 1);
        let wanted = |eye: Vec3| renewal.is_wanted(0, glossy, Vec3::ZERO, eye);
        // Nearer or farther is the same direction.
        assert!(!wanted(Vec3::Z) && !wanted(Vec3::Z * 9.0));
        assert!(!wanted(Vec3::new(0.09, 0.0, 1.0)) && wanted(Vec3::new(0.12, 0.0, 1.0)));
        assert!(wanted(-Vec3::Z));
        let rough = PointInfo {
            object: 7,
            ..glossy
        };
        assert!(!renewal.is_wanted(0, rough, Vec3::ZERO, Vec3::new(0.12, 0.0, 1.0)));
    }
}
