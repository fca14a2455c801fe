//! The inner loops: a shaft against sixteen boxes, sixteen receivers against a polygon, a receiver against groups of samples.
//!
//! Every value is computed as in [`predicate`](crate::predicate), operation by operation; nothing is fused or reordered, so
//! every instruction set gives the same bits.

use fearless_simd::{f32x8, f32x16, mask32x16, prelude::*, u32x16};

use crate::{
    blocker::{Blocker, CUTS, FROM_BEHIND, FROM_FRONT, REVERSED},
    lanes::{LANES, LEAST},
    light::{Box3, GROUP_LANES, GroupChunk, SampleRow},
    paper::HardRow,
    predicate::{CONDITIONS, Pair},
    receivers::Leaf,
    tree::Node,
};

/// Coefficients of each condition for each receiver of a leaf: condition; x, y, z, constant; lane.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Coefficients {
    rows: [[[f32; LANES]; 4]; CONDITIONS],
    count: usize,
    /// Of each condition, whether lanes that the polygon faces must be above zero, and those that see its back.
    strict: [[bool; 2]; CONDITIONS],
    /// Lanes that are behind the polygon.
    behind: u32,
}

impl Default for Coefficients {
    fn default() -> Self {
        Self {
            rows: [[[0.; LANES]; 4]; CONDITIONS],
            count: 0,
            strict: [[false; 2]; CONDITIONS],
            behind: 0,
        }
    }
}

/// The conditions that one receiver sets, ready to be tried on many samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Conditions {
    values: [[f32; 4]; CONDITIONS],
    least: [f32; CONDITIONS],
    count: usize,
}

impl Conditions {
    #[inline(always)]
    pub(crate) fn from_pair(pair: &Pair) -> Self {
        let mut conditions = Self {
            values: [[0.; 4]; CONDITIONS],
            least: [0.; CONDITIONS],
            count: pair.count,
        };
        for (i, c) in pair.conditions[..pair.count].iter().enumerate() {
            conditions.values[i] = [c.x, c.y, c.z, c.constant];
            conditions.least[i] = c.least;
        }
        conditions
    }
}

impl Coefficients {
    #[inline(always)]
    pub(crate) fn of(&self, lane: usize) -> Conditions {
        let behind = (self.behind >> lane & 1) as usize;
        let mut conditions = Conditions {
            values: [[0.; 4]; CONDITIONS],
            least: [0.; CONDITIONS],
            count: self.count,
        };
        for i in 0..self.count {
            for k in 0..4 {
                conditions.values[i][k] = self.rows[i][k][lane & (LANES - 1)];
            }
            conditions.least[i] = if self.strict[i][behind] { LEAST } else { 0. };
        }
        conditions
    }
}

/// What is the same for all polygons that a leaf meets.
#[derive(Clone, Debug)]
pub(crate) struct View {
    pub(crate) planar: bool,
    pub(crate) light: Box3,
    pub(crate) receivers: Box3,
}

/// Runs where the processor has the instructions of `S`.
#[derive(Clone, Copy)]
pub(crate) struct Kernel<S>(pub(crate) S);

type Three<S> = [f32x16<S>; 3];

// No closures around vector code here: they would be compiled for instructions that every processor has.
impl<S: Simd> Kernel<S> {
    #[inline(always)]
    fn all(self, value: f32) -> f32x16<S> {
        f32x16::splat(self.0, value)
    }

    #[inline(always)]
    fn row(self, row: &[f32; LANES]) -> f32x16<S> {
        f32x16::simd_from(self.0, *row)
    }

    #[inline(always)]
    fn three(self, rows: &[[f32; LANES]; 3]) -> Three<S> {
        [self.row(&rows[0]), self.row(&rows[1]), self.row(&rows[2])]
    }

    /// Lanes of `node` that may meet the hull of any receiver and the light.
    #[inline(always)]
    pub(crate) fn node(self, view: &View, node: &Node) -> u32 {
        let rows = &node.bounds;
        let mut keep = mask32x16::splat(self.0, true);
        let (receivers, light) = (&view.receivers, &view.light);
        if !view.planar {
            for axis in 0..3 {
                let high = receivers.max[axis].max(light.max[axis]);
                let low = receivers.min[axis].min(light.min[axis]);
                keep &= self.row(&rows[axis]).simd_le(self.all(high));
                keep &= self.row(&rows[axis + 3]).simd_ge(self.all(low));
            }
            return keep.to_bitmask() as u32;
        }
        let zero = self.all(0.);
        let (near, far) = (self.row(&rows[2]), self.row(&rows[5]));
        keep &= far.simd_gt(zero);
        keep &= near.simd_le(self.all(receivers.max[2]));
        let near = near.max(zero);
        let (z0, z1) = (self.all(receivers.min[2]), self.all(receivers.max[2]));
        for axis in 0..2 {
            let right = self.all(receivers.max[axis] - light.max[axis]);
            let left = self.all(receivers.min[axis] - light.min[axis]);
            let start = self.row(&rows[axis]) - self.all(light.max[axis]);
            let end = self.row(&rows[axis + 3]) - self.all(light.min[axis]);
            keep &= (start * z0)
                .min(start * z1)
                .simd_le((right * near).max(right * far));
            keep &= (end * z0)
                .max(end * z1)
                .simd_ge((left * near).min(left * far));
        }
        keep.to_bitmask() as u32
    }

    /// Of the receivers `alive`, those from which the polygon may block something, with their coefficients.
    #[inline(always)]
    pub(crate) fn polygon(
        self,
        view: &View,
        leaf: &Leaf,
        blocker: &Blocker,
        alive: u32,
        out: &mut Coefficients,
    ) -> u32 {
        let at = self.three(&leaf.at);
        let own = u32x16::simd_from(self.0, leaf.own);
        let mut keep = !own.simd_eq(u32x16::splat(self.0, blocker.key));
        keep &= self.meets_hull(view, at, &blocker.bounds);
        let zero = self.all(0.);
        let [nx, ny, nz] = blocker.normal;
        let height = (self.all(nx) * at[0] + self.all(ny) * at[1]) + self.all(nz) * at[2];
        let height = height - self.all(blocker.offset);
        let behind = height.simd_lt(zero);
        let mut sided = mask32x16::splat(self.0, false);
        if blocker.flags & FROM_BEHIND != 0 {
            sided |= behind;
        }
        if blocker.flags & FROM_FRONT != 0 {
            sided |= height.simd_gt(zero);
        }
        keep &= sided;
        if keep.to_bitmask() as u32 & alive == 0 {
            return 0;
        }
        out.behind = behind.to_bitmask() as u32;
        let turn = behind.select(self.all(1.), self.all(-1.));
        out.count = blocker.edges();
        for i in 0..out.count {
            let [low, high] = blocker.edge(i);
            let [low, high] = [&blocker.corners[low], &blocker.corners[high]];
            let reversed = blocker.flags >> i & REVERSED != 0;
            let way: f32 = if reversed { -1. } else { 1. };
            let ex = self.all((high[0] - low[0]) * way);
            let ey = self.all((high[1] - low[1]) * way);
            let ez = self.all((high[2] - low[2]) * way);
            let px = (self.all(low[0]) - at[0]) * turn;
            let py = (self.all(low[1]) - at[1]) * turn;
            let pz = (self.all(low[2]) - at[2]) * turn;
            let x = py * ez - pz * ey;
            let y = pz * ex - px * ez;
            let z = px * ey - py * ex;
            let constant = -((x * at[0] + y * at[1]) + z * at[2]);
            keep &= self.highest(view, [x, y, z], constant).simd_ge(zero);
            out.strict[i] = [!reversed, reversed];
            x.store_slice(&mut out.rows[i][0]);
            y.store_slice(&mut out.rows[i][1]);
            z.store_slice(&mut out.rows[i][2]);
            constant.store_slice(&mut out.rows[i][3]);
        }
        if blocker.flags & CUTS != 0 {
            let i = out.count;
            out.count += 1;
            let [x, y, z] = [
                self.all(nx) * turn,
                self.all(ny) * turn,
                self.all(nz) * turn,
            ];
            let constant = self.all(-blocker.offset) * turn;
            out.strict[i] = [true; 2];
            x.store_slice(&mut out.rows[i][0]);
            y.store_slice(&mut out.rows[i][1]);
            z.store_slice(&mut out.rows[i][2]);
            constant.store_slice(&mut out.rows[i][3]);
        }
        keep.to_bitmask() as u32 & alive
    }

    /// Highest value of a condition over the light.
    #[inline(always)]
    fn highest(self, view: &View, [x, y, z]: Three<S>, constant: f32x16<S>) -> f32x16<S> {
        let light = &view.light;
        let along_x = (x * self.all(light.min[0])).max(x * self.all(light.max[0]));
        let along_y = (y * self.all(light.min[1])).max(y * self.all(light.max[1]));
        let mut sum = along_x + along_y;
        if !view.planar {
            sum = sum + (z * self.all(light.min[2])).max(z * self.all(light.max[2]));
        }
        sum + constant
    }

    /// [`predicate::meets_hull`](crate::predicate::meets_hull) for each receiver.
    #[inline(always)]
    fn meets_hull(self, view: &View, at: Three<S>, bounds: &Box3) -> mask32x16<S> {
        let light = &view.light;
        let mut keep = mask32x16::splat(self.0, true);
        if !view.planar {
            for axis in 0..3 {
                let high = at[axis].max(self.all(light.max[axis]));
                let low = at[axis].min(self.all(light.min[axis]));
                keep &= self.all(bounds.min[axis]).simd_le(high);
                keep &= self.all(bounds.max[axis]).simd_ge(low);
            }
            return keep;
        }
        let z = at[2];
        let near = self.all(bounds.min[2].max(0.));
        let far = self.all(bounds.max[2]);
        keep &= self.all(bounds.min[2]).simd_le(z);
        for axis in 0..2 {
            let right = at[axis] - self.all(light.max[axis]);
            let left = at[axis] - self.all(light.min[axis]);
            let start = self.all(bounds.min[axis] - light.max[axis]);
            let end = self.all(bounds.max[axis] - light.min[axis]);
            keep &= (start * z).simd_le((right * near).max(right * far));
            keep &= (end * z).simd_ge((left * near).min(left * far));
        }
        keep
    }

    /// Groups of a chunk of which something may be inside, and those that are inside as a whole.
    #[inline(always)]
    pub(crate) fn groups(
        self,
        planar: bool,
        chunk: &GroupChunk,
        conditions: &Conditions,
    ) -> (u32, u32) {
        let mut met = f32x8::splat(self.0, 0.).simd_eq(f32x8::splat(self.0, 0.));
        let mut inside = met;
        let axes = if planar { 2 } else { 3 };
        for (value, least) in conditions.values[..conditions.count]
            .iter()
            .zip(&conditions.least)
        {
            let mut high = f32x8::splat(self.0, 0.);
            let mut low = high;
            for axis in 0..axes {
                let factor = f32x8::splat(self.0, value[axis]);
                let up = usize::from(value[axis] >= 0.);
                let rows: &[[f32; GROUP_LANES]; 2] = &chunk.rows[axis];
                let to = factor * f32x8::simd_from(self.0, rows[up]);
                let from = factor * f32x8::simd_from(self.0, rows[1 - up]);
                if axis == 0 {
                    (high, low) = (to, from);
                } else {
                    high = high + to;
                    low = low + from;
                }
            }
            let constant = f32x8::splat(self.0, value[3]);
            let least = f32x8::splat(self.0, *least);
            met &= (high + constant).simd_ge(least);
            inside &= (low + constant).simd_ge(least);
        }
        (met.to_bitmask() as u32, inside.to_bitmask() as u32)
    }

    /// Samples of a group that are inside.
    #[inline(always)]
    pub(crate) fn samples(self, planar: bool, rows: &[SampleRow], conditions: &Conditions) -> u32 {
        let mut word = 0;
        for (half, row) in rows[..2].iter().enumerate() {
            let [u, v, w] = self.three(&row.0);
            let mut inside = mask32x16::splat(self.0, true);
            for (value, least) in conditions.values[..conditions.count]
                .iter()
                .zip(&conditions.least)
            {
                let mut sum = self.all(value[0]) * u + self.all(value[1]) * v;
                if !planar {
                    sum = sum + self.all(value[2]) * w;
                }
                inside &= (sum + self.all(value[3])).simd_ge(self.all(*least));
            }
            word |= (inside.to_bitmask() as u32) << (LANES * half);
        }
        word
    }

    /// Of sixteen samples, those from whose hard shadow volumes a receiver is surely inside, and those from which it is surely
    /// outside.
    #[inline(always)]
    pub(crate) fn hard_row(self, row: &HardRow, at: [f32; 3], turn: f32, sure: f32) -> (u32, u32) {
        let mut inside = mask32x16::splat(self.0, true);
        let mut outside = mask32x16::splat(self.0, false);
        let [x, y, z] = [at[0] * turn, at[1] * turn, at[2] * turn];
        for planes in &row.planes[..row.count] {
            let sum = self.row(&planes[0]) * self.all(x)
                + self.row(&planes[1]) * self.all(y)
                + self.row(&planes[2]) * self.all(z)
                + self.row(&planes[3]) * self.all(turn);
            inside &= sum.simd_gt(self.all(sure));
            outside |= sum.simd_lt(self.all(-sure));
        }
        (inside.to_bitmask() as u32, outside.to_bitmask() as u32)
    }

    /// Samples of a group that are above a receiver's horizon.
    #[inline(always)]
    pub(crate) fn above_horizon(
        self,
        planar: bool,
        rows: &[SampleRow],
        horizon: &crate::predicate::Condition,
    ) -> u32 {
        let mut conditions = Conditions {
            values: [[0.; 4]; CONDITIONS],
            least: [LEAST; CONDITIONS],
            count: 1,
        };
        conditions.values[0] = [horizon.x, horizon.y, horizon.z, horizon.constant];
        self.samples(planar, rows, &conditions)
    }
}
