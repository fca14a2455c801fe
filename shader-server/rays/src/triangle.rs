//! Blocks of eight triangles, tested together.

use glam::Vec3;

use crate::node::WIDTH;

/// Eight triangles as structure of arrays; lanes without a triangle hold NaN, which no ray hits.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Block {
    /// Corner, axis, lane.
    pub(crate) corners: [[[f32; WIDTH]; 3]; 3],
    pub(crate) faces: [u32; WIDTH],
}

impl Block {
    pub(crate) fn empty() -> Self {
        Self {
            corners: [[[f32::NAN; WIDTH]; 3]; 3],
            faces: [u32::MAX; WIDTH],
        }
    }

    pub(crate) fn set(&mut self, lane: usize, face: u32, corners: [Vec3; 3]) {
        self.faces[lane] = face;
        for (rows, corner) in self.corners.iter_mut().zip(corners) {
            for (row, value) in rows.iter_mut().zip(corner.to_array()) {
                row[lane] = value;
            }
        }
    }
}

/// What a ray meets in a block: for each lane with a hit the distance, and the scaled weights of the second and third corner
/// with their divisor.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BlockHits {
    pub(crate) t: [f32; WIDTH],
    pub(crate) v: [f32; WIDTH],
    pub(crate) w: [f32; WIDTH],
    pub(crate) determinant: [f32; WIDTH],
}
