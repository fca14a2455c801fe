//! The inner loops: a shaft against sixteen boxes, sixteen receivers against a polygon, a receiver against groups of samples.
//!
//! Every value is computed as in [`predicate`](crate::predicate), operation by operation; nothing is fused or reordered, so
//! every instruction set gives the same bits.

use fearless_simd::{f32x16, mask32x16, prelude::*, u32x16};

use crate::{
    blocker::{Blocker, CUTS, FROM_BEHIND, FROM_FRONT, REVERSED},
    lanes::{LANES, LEAST},
    light::{Box3, RowBounds, SampleRow},
    paper::HardRow,
    predicate::{CONDITIONS, Condition, Pair},
    receivers::Leaf,
    tree::Node,
};

/// Coefficients of each condition for each receiver of a leaf: condition; x, y, constant, least, z; lane.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Coefficients {
    rows: [[[f32; LANES]; 5]; CONDITIONS],
    pub(crate) count: usize,
}

impl Default for Coefficients {
    fn default() -> Self {
        Self {
            rows: [[[0.; LANES]; 5]; CONDITIONS],
            count: 0,
        }
    }
}

/// A condition ready to be tried on many samples: x, y, constant, least, z.
type Linear = [f32; 5];

/// The conditions that one receiver sets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Conditions {
    linear: [Linear; CONDITIONS],
    count: usize,
}

impl Conditions {
    pub(crate) fn from_pair(pair: &Pair) -> Self {
        Self {
            linear: pair
                .conditions
                .map(|c| [c.x, c.y, c.constant, c.least, c.z]),
            count: pair.count,
        }
    }

    pub(crate) fn of_one(c: &Condition) -> Self {
        let mut conditions = Self {
            linear: [[0.; 5]; CONDITIONS],
            count: 1,
        };
        conditions.linear[0] = [c.x, c.y, c.constant, c.least, c.z];
        conditions
    }
}

impl Coefficients {
    /// Condition `i` of the receiver in a lane.
    #[inline(always)]
    fn linear(&self, i: usize, lane: usize) -> Linear {
        let [x, y, constant, least, z] = &self.rows[i];
        let lane = lane & (LANES - 1);
        [x[lane], y[lane], constant[lane], least[lane], z[lane]]
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
        let turn = behind.select(self.all(1.), self.all(-1.));
        // Of an edge that runs in order, and of one that is reversed.
        let leasts = [
            behind.select(zero, self.all(LEAST)),
            behind.select(self.all(LEAST), zero),
        ];
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
            let least = if reversed { &leasts[1] } else { &leasts[0] };
            x.store_slice(&mut out.rows[i][0]);
            y.store_slice(&mut out.rows[i][1]);
            constant.store_slice(&mut out.rows[i][2]);
            least.store_slice(&mut out.rows[i][3]);
            z.store_slice(&mut out.rows[i][4]);
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
            x.store_slice(&mut out.rows[i][0]);
            y.store_slice(&mut out.rows[i][1]);
            constant.store_slice(&mut out.rows[i][2]);
            self.all(LEAST).store_slice(&mut out.rows[i][3]);
            z.store_slice(&mut out.rows[i][4]);
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
            sum += (z * self.all(light.min[2])).max(z * self.all(light.max[2]));
        }
        sum + constant
    }

    /// [`predicate::meets_hull`](crate::predicate::meets_hull) for each receiver.
    #[inline(always)]
    fn meets_hull(self, view: &View, at: Three<S>, bounds: &Box3) -> mask32x16<S> {
        let light = &view.light;
        let mut keep = mask32x16::splat(self.0, true);
        if !view.planar {
            for (axis, at) in at.into_iter().enumerate() {
                let high = at.max(self.all(light.max[axis]));
                let low = at.min(self.all(light.min[axis]));
                keep &= self.all(bounds.min[axis]).simd_le(high);
                keep &= self.all(bounds.max[axis]).simd_ge(low);
            }
            return keep;
        }
        let z = at[2];
        let near = self.all(bounds.min[2].max(0.));
        let far = self.all(bounds.max[2]);
        keep &= self.all(bounds.min[2]).simd_le(z);
        for (axis, at) in at.into_iter().take(2).enumerate() {
            let right = at - self.all(light.max[axis]);
            let left = at - self.all(light.min[axis]);
            let start = self.all(bounds.min[axis] - light.max[axis]);
            let end = self.all(bounds.max[axis] - light.min[axis]);
            keep &= (start * z).simd_le((right * near).max(right * far));
            keep &= (end * z).simd_ge((left * near).min(left * far));
        }
        keep
    }

    /// Of sixteen rows of samples, those of which something may be inside all `N` conditions of a lane.
    #[inline(always)]
    pub(crate) fn rows_met<const N: usize>(
        self,
        planar: bool,
        bounds: &RowBounds,
        of: (&Coefficients, usize),
    ) -> u32 {
        let mut met = mask32x16::splat(self.0, true);
        for i in 0..N {
            let linear = of.0.linear(i, of.1);
            let at = |n: f32| usize::from(n >= 0.);
            let corner = [at(linear[0]), at(linear[1]), at(linear[4])];
            met &= self.condition(planar, bounds, corner, linear);
        }
        met.to_bitmask() as u32
    }

    /// Of sixteen rows of samples, those that are inside as a whole.
    #[inline(always)]
    pub(crate) fn rows_inside<const N: usize>(
        self,
        planar: bool,
        bounds: &RowBounds,
        of: (&Coefficients, usize),
    ) -> u32 {
        let mut inside = mask32x16::splat(self.0, true);
        for i in 0..N {
            let linear = of.0.linear(i, of.1);
            let at = |n: f32| usize::from(n < 0.);
            let corner = [at(linear[0]), at(linear[1]), at(linear[4])];
            inside &= self.condition(planar, bounds, corner, linear);
        }
        inside.to_bitmask() as u32
    }

    /// Rows that keep a condition in one corner of their bounds: low or high in each coordinate.
    #[inline(always)]
    fn condition(
        self,
        planar: bool,
        bounds: &RowBounds,
        corner: [usize; 3],
        [x, y, constant, least, z]: Linear,
    ) -> mask32x16<S> {
        let [us, vs, ws] = &bounds.rows;
        let mut sum =
            self.all(x) * self.row(&us[corner[0]]) + self.all(y) * self.row(&vs[corner[1]]);
        if !planar {
            sum += self.all(z) * self.row(&ws[corner[2]]);
        }
        (sum + self.all(constant)).simd_ge(self.all(least))
    }

    /// Samples of a row that are inside all `N` conditions of a lane.
    #[inline(always)]
    pub(crate) fn samples_of<const N: usize>(
        self,
        planar: bool,
        row: &SampleRow,
        of: (&Coefficients, usize),
    ) -> u32 {
        let mut inside = mask32x16::splat(self.0, true);
        for i in 0..N {
            inside &= self.sample_condition(planar, row, of.0.linear(i, of.1));
        }
        inside.to_bitmask() as u32
    }

    /// Samples of a row that are inside.
    #[inline(always)]
    pub(crate) fn samples(self, planar: bool, row: &SampleRow, conditions: &Conditions) -> u32 {
        let mut inside = mask32x16::splat(self.0, true);
        for linear in &conditions.linear[..conditions.count.min(CONDITIONS)] {
            inside &= self.sample_condition(planar, row, *linear);
        }
        inside.to_bitmask() as u32
    }

    #[inline(always)]
    fn sample_condition(
        self,
        planar: bool,
        row: &SampleRow,
        [x, y, constant, least, z]: Linear,
    ) -> mask32x16<S> {
        let mut sum = self.all(x) * self.row(&row.0[0]) + self.all(y) * self.row(&row.0[1]);
        if !planar {
            sum += self.all(z) * self.row(&row.0[2]);
        }
        (sum + self.all(constant)).simd_ge(self.all(least))
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
}
