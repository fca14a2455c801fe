//! Whether a polygon blocks a sample from a receiver: the one rule that every way of casting follows to the bit.
//!
//! For a receiver r and an edge from a to b, a sample l is on one side or the other of the plane through all three by the sign
//! of `((a - r) x (b - a)) . (l - r)`: for each receiver and edge a function that is linear in the sample's coordinates, of
//! which three numbers (four where a light has depth) are computed once. All is single precision without fused operations, in
//! an order that is the same for both polygons that share an edge, which are thus told apart with opposite signs. Where the
//! value is zero the sample belongs to just one of the two sides, so that no light leaks between neighbours and nothing is
//! counted twice. A receiver or a sample in a polygon's own plane is not blocked by it.
//!
//! Rounding keeps the order of sums and products, so the function at the corners of a box bounds it in the box: groups of
//! samples are passed over or taken as a whole with no doubt about any of them. The same holds for boxes around polygons:
//! a polygon blocks only if its box meets the hull of receiver and light, and that too is part of the rule.

use crate::{
    blocker::{Blocker, CUTS, FROM_BEHIND, FROM_FRONT, MIRRORED, REVERSED},
    lanes::LEAST,
    light::{Box3, Light},
    mesh::BlockerMesh,
};

/// Most linear conditions a polygon sets: four edges and its plane.
pub(crate) const CONDITIONS: usize = 5;

/// A sample is inside where `((x · u + y · v) + z · w) + constant` is at least `least`.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Condition {
    pub(crate) x: f32,
    pub(crate) y: f32,
    pub(crate) z: f32,
    pub(crate) constant: f32,
    pub(crate) least: f32,
}

impl Condition {
    #[inline(always)]
    pub(crate) fn value(&self, [u, v, w]: [f32; 3]) -> f32 {
        ((self.x * u + self.y * v) + self.z * w) + self.constant
    }
}

/// What a polygon blocks from one receiver.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pair {
    pub(crate) conditions: [Condition; CONDITIONS],
    pub(crate) count: usize,
}

impl Pair {
    /// None if the polygon can block nothing from there. The receiver is in light space, and in front of the light.
    pub(crate) fn new(light: &Light, at: [f32; 3], blocker: &Blocker) -> Option<Self> {
        if !meets_hull(light, at, &blocker.bounds) {
            return None;
        }
        let height = blocker.height(at);
        let behind = height < 0. && blocker.flags & FROM_BEHIND != 0;
        let before = height > 0. && blocker.flags & FROM_FRONT != 0;
        if !behind && !before {
            return None;
        }
        let turn: f32 = if behind { 1. } else { -1. };
        let mut pair = Self {
            conditions: [Condition::default(); CONDITIONS],
            count: blocker.edges(),
        };
        for i in 0..pair.count {
            let [low, high] = blocker.edge(i).map(|corner| blocker.corners[corner]);
            let reversed = blocker.flags >> i & REVERSED != 0;
            let way: f32 = if reversed { -1. } else { 1. };
            let e: [f32; 3] = std::array::from_fn(|axis| (high[axis] - low[axis]) * way);
            let p: [f32; 3] = std::array::from_fn(|axis| (low[axis] - at[axis]) * turn);
            let x = p[1] * e[2] - p[2] * e[1];
            let y = p[2] * e[0] - p[0] * e[2];
            let z = p[0] * e[1] - p[1] * e[0];
            pair.conditions[i] = Condition {
                x,
                y,
                z,
                constant: -((x * at[0] + y * at[1]) + z * at[2]),
                least: if reversed != before { LEAST } else { 0. },
            };
        }
        if blocker.flags & CUTS != 0 {
            let [x, y, z] = blocker.normal.map(|n| n * turn);
            pair.conditions[pair.count] = Condition {
                x,
                y,
                z,
                constant: -blocker.offset * turn,
                least: LEAST,
            };
            pair.count += 1;
        }
        Some(pair)
    }

    pub(crate) fn blocks(&self, sample: [f32; 3]) -> bool {
        self.conditions[..self.count]
            .iter()
            .all(|condition| condition.value(sample) >= condition.least)
    }

    /// Whether the place where a sample that [is blocked](Self::blocks) is met is opaque.
    pub(crate) fn is_opaque(
        &self,
        mesh: &BlockerMesh,
        polygon: u32,
        blocker: &Blocker,
        sample: [f32; 3],
    ) -> bool {
        let Some(alpha) = &mesh.alpha else {
            return true;
        };
        // A corner weighs what the edge across from it says.
        let [ab, bc, ca] = [0, 1, 2].map(|i| self.conditions[i].value(sample));
        let weights = if blocker.flags & MIRRORED == 0 {
            [bc, ca, ab]
        } else {
            [ab, ca, bc]
        };
        let face = mesh.polygons[polygon as usize].alpha_face;
        alpha.blocks(face as usize, weights)
    }
}

/// Whether a box meets the hull of a receiver and the light.
pub(crate) fn meets_hull(light: &Light, at: [f32; 3], bounds: &Box3) -> bool {
    let whole = &light.bounds;
    if !light.is_planar() {
        return (0..3).all(|axis| {
            bounds.min[axis] <= at[axis].max(whole.max[axis])
                && bounds.max[axis] >= at[axis].min(whole.min[axis])
        });
    }
    let z = at[2];
    let [near, far] = [bounds.min[2].max(0.), bounds.max[2]];
    bounds.max[2] > 0.
        && bounds.min[2] <= z
        && (0..2).all(|axis| {
            let right = at[axis] - whole.max[axis];
            let left = at[axis] - whole.min[axis];
            (bounds.min[axis] - whole.max[axis]) * z <= (right * near).max(right * far)
                && (bounds.max[axis] - whole.min[axis]) * z >= (left * near).min(left * far)
        })
}

/// What a receiver's own surface hides: samples where this is not above zero.
pub(crate) fn horizon(at: [f32; 3], [x, y, z]: [f32; 3]) -> Condition {
    Condition {
        x,
        y,
        z,
        constant: -((x * at[0] + y * at[1]) + z * at[2]),
        least: LEAST,
    }
}
