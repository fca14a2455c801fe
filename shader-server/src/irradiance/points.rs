//! Direct light on a patch.

use glam::{DVec2, Vec2, Vec3};
use rays::Recent;

use super::patch::Piece;
use crate::{lights::Receiver, random::Stream, shadows, stage::Stage};

/// Points of a patch, and what they receive.
pub(crate) struct Points {
    piece: Piece,
    stream: Stream,
    pub(crate) count: usize,
    /// Sums over points.
    pub(crate) albedo: Vec3,
    pub(crate) reflected: Vec3,
    /// By light: at how many points it shines, and how many of those see it.
    seen: Vec<[usize; 2]>,
    pub(crate) shadows: shadows::Shadows,
}

/// The place in the square of a patch's point: a sequence that is even however long it is (Roberts' R2, of the plastic number), shifted at
/// random.
pub(crate) fn place(piece: &Piece, index: usize) -> Vec2 {
    let shift = piece.stream().square().as_dvec2();
    let step = DVec2::new(0.754_877_666_246_693, 0.569_840_290_998_053);
    let at = shift + step * index as f64;
    (at - at.floor()).as_vec2().min(Vec2::splat(0.999_999_9))
}

impl Points {
    pub(crate) fn new(stage: &Stage, piece: Piece) -> Self {
        Self {
            piece,
            stream: piece.stream(),
            count: 0,
            albedo: Vec3::ZERO,
            reflected: Vec3::ZERO,
            seen: vec![[0; 2]; stage.emitters().len()],
            shadows: shadows::Shadows::default(),
        }
    }

    /// Adds points until there are so many.
    pub(crate) fn fill(&mut self, stage: &Stage, count: usize) {
        for index in self.count..count {
            if let Some((receiver, albedo)) = self.piece.point(stage, place(&self.piece, index)) {
                let direct = self.direct_at(stage, &receiver);
                self.albedo += albedo;
                self.reflected += albedo * direct;
            }
        }
        self.count = self.count.max(count);
    }

    /// Direct irradiance, each light asked at one random place whether it is seen.
    fn direct_at(&mut self, stage: &Stage, receiver: &Receiver) -> Vec3 {
        let mut sum = Vec3::ZERO;
        for (index, emitter) in stage.emitters().iter().enumerate() {
            let unoccluded = emitter.unoccluded(receiver) as f32;
            if unoccluded <= 0. {
                continue;
            }
            let mut stream = self.stream.part(index as u64);
            self.stream.bits();
            self.shadows.recent = Recent::default();
            let sees =
                shadows::sees_somewhere(stage, receiver, emitter, &mut stream, &mut self.shadows);
            self.seen[index][0] += 1;
            if sees {
                self.seen[index][1] += 1;
                sum += emitter.strength * unoccluded;
            }
        }
        sum
    }

    /// Whether every light is seen by all points or by none.
    pub(crate) fn agree(&self) -> bool {
        let alike =
            |[shines, sees]: &[usize; 2]| *sees == 0 || (sees == shines && *shines == self.count);
        self.seen.iter().all(alike)
    }
}
