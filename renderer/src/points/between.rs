//! Telling hidden points from visible ones by their neighbours and the edges of the frame, so that few rays are needed.
//!
//! Where no edge runs between pixels they show one surface. A point there that lies well behind those known to be visible
//! is hidden, and shows through a gap between samples; one that lies among them is visible, as far as they are: something
//! may have come before all of them since they were last asked about, which is why a point is vouched for a few times
//! only before a ray is asked again ([`PointCache::vouch`](super::PointCache::vouch)).

use fearless_simd::{Level, dispatch, prelude::*};
use fearless_simd_macros::simd;

use super::PixelSamples;
use super::around::{AGREES_PX, Around, BEHIND_ONE_PX, BEHIND_PX, HIDDEN, Verdict};
use crate::epi::Epi;
use crate::epi::code::Side;
use crate::epi::grid::Grid;

/// How far neighbours reach, pixels.
const REACH: usize = 2;

/// How far behind the mean depth of its 3x3 neighbours a point may lie, as a share of that depth, before it is suspected.
const TOLERANCE: f32 = 0.03;

/// What edges and neighbours say of the points of a frame, as bit planes.
#[derive(Clone, Debug)]
pub struct Between {
    /// Points that are certainly hidden.
    pub hidden: Vec<u64>,
    /// Unsure points that lie among visible ones.
    pub vouched: Vec<u64>,
    /// Points well behind the mean depth of the up to 8 around them (Render Cache 2002, "Depth cull").
    pub suspects: Vec<u64>,
    /// These, and points that are [doubtful](PixelSamples::doubtful).
    pub unsure: Vec<u64>,
    grid: Grid,
    /// Pixels without an edge, not at the left and right rim of the picture.
    free: Vec<u64>,
    /// Those without an edge within two pixels.
    open: Vec<u64>,
    /// One over the depth of what is known to be visible in free pixels; 0 elsewhere.
    sure: Vec<f32>,
    rows: Rows,
}

/// The last four rows of what the rows after them need, with a margin of [`MARGIN`] on both sides.
#[derive(Clone, Debug, Default)]
struct Rows {
    pitch: usize,
    /// One over depth.
    inverse: Vec<f32>,
    /// Sum of three in the row, and how many of them there are.
    sum: Vec<f32>,
    count: Vec<f32>,
    /// Greatest and least of three in the row that are sure.
    most: Vec<f32>,
    least: Vec<f32>,
    /// The same over 3x3, of free pixels; one row.
    step_most: Vec<f32>,
    step_least: Vec<f32>,
    /// Greatest and least of three of these in the row.
    far_most: Vec<f32>,
    far_least: Vec<f32>,
}

/// Rows kept.
const KEPT: usize = 4;
const MARGIN: usize = 64;

impl Rows {
    fn start(&mut self, stride: usize) {
        self.pitch = stride + 2 * MARGIN;
        let n = KEPT * self.pitch;
        for (rows, n, empty) in [
            (&mut self.inverse, n, 0.0),
            (&mut self.sum, n, 0.0),
            (&mut self.count, n, 0.0),
            (&mut self.most, n, 0.0),
            (&mut self.least, n, f32::INFINITY),
            (&mut self.step_most, self.pitch, 0.0),
            (&mut self.step_least, self.pitch, f32::INFINITY),
            (&mut self.far_most, n, 0.0),
            (&mut self.far_least, n, f32::INFINITY),
        ] {
            rows.clear();
            rows.resize(n, empty);
        }
    }

    /// Index of column 0 of a row.
    #[inline(always)]
    fn at(&self, row: usize) -> usize {
        row % KEPT * self.pitch + MARGIN
    }

    /// Columns 0 of a row and of those before and after it.
    #[inline(always)]
    fn three(&self, row: usize) -> [usize; 3] {
        [row + KEPT - 1, row, row + 1].map(|r| self.at(r))
    }
}

impl Between {
    /// Room for an image of this layout.
    pub fn new(grid: Grid) -> Self {
        let plane = || vec![0; grid.plane_words()];
        Self {
            hidden: plane(),
            vouched: plane(),
            suspects: plane(),
            unsure: plane(),
            grid,
            free: plane(),
            open: plane(),
            sure: vec![0.0; grid.elements()],
            rows: Rows::default(),
        }
    }

    /// Looks at all points of a frame. `epi` has its edges; without them nothing is known of what neighbours share. `focal_px`
    /// is the view's. Results do not depend on `level`.
    pub fn find(&mut self, level: Level, pixels: &PixelSamples, epi: Option<&Epi>, focal_px: f32) {
        self.rows.start(pixels.grid.stride);
        if let Some(epi) = epi {
            self.find_open(epi);
        } else {
            self.free.fill(0);
            self.open.fill(0);
        }
        dispatch!(level, simd => self.sweep(simd, pixels, 1.0 / focal_px));
    }

    /// What is certain of a point by what is known now of the surface that it should lie on: in the pixels around or, where an
    /// edge passes through its own, on its side of it. `place` is where it is in its pixel, `px` one over the focal length.
    pub fn ask(
        &self,
        epi: &Epi,
        p: (usize, usize),
        place: [f32; 2],
        inverse: f32,
        px: f32,
    ) -> Verdict {
        let (word, bit) = self.grid.bit(p.0, p.1);
        let around = if self.open[word] >> bit & 1 == 1 {
            self.around(p, REACH)
        } else if self.free[word] >> bit & 1 == 1 {
            self.around(p, 1)
        } else {
            self.beside(epi, p, place)
        };
        around.judge(inverse, px)
    }

    /// What is sure in a square of free pixels.
    fn around(&self, (x, y): (usize, usize), reach: usize) -> Around {
        let mut around = Around::NOTHING;
        for row in 0..=2 * reach {
            let first =
                self.grid.at(x, y) - reach + row * self.grid.stride - reach * self.grid.stride;
            for &sure in &self.sure[first..=first + 2 * reach] {
                around.most = around.most.max(sure);
                let known = if sure > 0.0 { sure } else { f32::INFINITY };
                around.least = around.least.min(known);
            }
        }
        around
    }

    /// What is sure about the free pixels that the region of a simple pixel borders on in which a place lies.
    fn beside(&self, epi: &Epi, (x, y): (usize, usize), [px, py]: [f32; 2]) -> Around {
        let code = epi.code_at(x, y);
        if !code.is_simple() {
            return Around::NOTHING;
        }
        let is_inner = match epi.tables().side(code, epi.tables().places().cell(px, py)) {
            Side::Inner => true,
            Side::Outer => false,
            Side::Ambiguous => return Around::NOTHING,
        };
        let has_corner = [0, 1, 2, 3].map(|corner| epi.is_inner_corner((x, y), corner) == is_inner);
        // Up, right, down, left: regions go on over a side past one of its ends.
        [(0, -1), (1, 0), (0, 1), (-1, 0)]
            .into_iter()
            .enumerate()
            .filter(|(side, _)| has_corner[*side] || has_corner[(side + 1) % 4])
            .map(|(_, (dx, dy))| (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy)))
            .filter(|&q| self.is_free(q))
            .map(|q| self.around(q, 1))
            .fold(Around::NOTHING, |a, b| Around {
                most: a.most.max(b.most),
                least: a.least.min(b.least),
            })
    }

    fn is_free(&self, (x, y): (usize, usize)) -> bool {
        if x >= self.grid.width || y >= self.grid.height {
            return false;
        }
        let (word, bit) = self.grid.bit(x, y);
        self.free[word] >> bit & 1 == 1
    }

    /// Notes one over the depth of what is seen in a pixel.
    pub fn learn(&mut self, (x, y): (usize, usize), inverse: f32) {
        let (word, bit) = self.grid.bit(x, y);
        if self.free[word] >> bit & 1 == 1 {
            self.sure[self.grid.at(x, y)] = inverse;
        }
    }

    fn find_open(&mut self, epi: &Epi) {
        let (grid, simple, complex) = (epi.grid, &epi.simple, &epi.complex);
        let words = grid.words;
        // Along the row first; the plane of answers is free until it is filled.
        for i in 0..grid.plane_words() {
            let word = i % words;
            let edge = |i: usize| simple[i] | complex[i];
            let here = edge(i);
            let before = if word > 0 { edge(i - 1) } else { 0 };
            let after = if word + 1 < words { edge(i + 1) } else { 0 };
            self.free[i] = inner(grid, word) & !here;
            self.hidden[i] = (1..=REACH).fold(here, |spread, step| {
                let (left, right) = (here << step, here >> step);
                let (from_left, from_right) = (before >> (64 - step), after << (64 - step));
                spread | left | right | from_left | from_right
            });
        }
        for y in 0..grid.height {
            let rows = y.saturating_sub(REACH)..(y + REACH + 1).min(grid.height);
            for word in 0..words {
                let near = rows
                    .clone()
                    .fold(0, |near, row| near | self.hidden[row * words + word]);
                self.open[y * words + word] = inner(grid, word) & !near;
            }
        }
    }

    /// Row after row, each step as soon as the rows that it needs are there, so that all stays in the nearest memory.
    #[simd]
    fn sweep<S: Simd>(&mut self, simd: S, pixels: &PixelSamples, px: f32) {
        for row in 0..pixels.grid.height + 3 {
            self.add_up(simd, pixels, row);
            if row >= 1 {
                self.find_sure(simd, pixels, row - 1);
            }
            if row >= 2 {
                self.step(simd, pixels.grid, row - 2);
            }
            if row >= 3 {
                self.decide(simd, pixels, row - 3, px);
            }
        }
    }

    /// One over depth, summed over three in the row; rows past the last are empty.
    #[simd]
    fn add_up<S: Simd>(&mut self, simd: S, pixels: &PixelSamples, y: usize) {
        let (grid, lanes) = (pixels.grid, S::f32s::LEN);
        let (zero, one) = (S::f32s::splat(simd, 0.0), S::f32s::splat(simd, 1.0));
        let rows = &mut self.rows;
        let to = rows.at(y);
        if y >= grid.height {
            for all in [&mut rows.inverse, &mut rows.sum, &mut rows.count] {
                all[to..to + grid.stride].fill(0.0);
            }
            return;
        }
        let depth = &pixels.depth[grid.at(0, y)..][..grid.stride];
        for x in (0..grid.stride).step_by(lanes) {
            let depth = S::f32s::from_slice(simd, &depth[x..x + lanes]);
            (one / depth).store_slice(&mut rows.inverse[to + x..to + x + lanes]);
        }
        for x in (to..to + grid.stride).step_by(lanes) {
            let load = |at: usize| S::f32s::from_slice(simd, &rows.inverse[at..at + lanes]);
            let [a, b, c] = [load(x - 1), load(x), load(x + 1)];
            let one_if = |v: S::f32s| v.simd_gt(zero).select(one, zero);
            (a + b + c).store_slice(&mut rows.sum[x..x + lanes]);
            (one_if(a) + one_if(b) + one_if(c)).store_slice(&mut rows.count[x..x + lanes]);
        }
    }

    /// Finds what is unsure in a row, and the extremes of what is not over three in the row. Inverse depth is linear over a
    /// plane in the image, so that a slanted plane is no suspect.
    #[simd]
    fn find_sure<S: Simd>(&mut self, simd: S, pixels: &PixelSamples, y: usize) {
        let (grid, lanes) = (pixels.grid, S::f32s::LEN);
        let splat = |v: f32| S::f32s::splat(simd, v);
        let (zero, one) = (splat(0.0), splat(1.0));
        let rows = &mut self.rows;
        let to = rows.at(y);
        if y >= grid.height {
            rows.most[to..to + grid.stride].fill(0.0);
            rows.least[to..to + grid.stride].fill(f32::INFINITY);
            return;
        }
        let three = rows.three(y);
        for word in 0..grid.words {
            let i = y * grid.words + word;
            let mut suspects = 0;
            for group in (0..64).step_by(lanes) {
                let x = word * 64 + group;
                let total = |of: &[f32]| {
                    let [a, b, c] =
                        three.map(|r| S::f32s::from_slice(simd, &of[r + x..r + x + lanes]));
                    a + b + c
                };
                let own = S::f32s::from_slice(simd, &rows.inverse[to + x..to + x + lanes]);
                let others = total(&rows.count) - one;
                let behind =
                    (total(&rows.sum) - own).simd_gt(others * splat(1.0 + TOLERANCE) * own);
                suspects |= behind.to_bitmask() << group;
            }
            self.suspects[i] = pixels.has[i] & suspects;
            self.unsure[i] = pixels.has[i] & (suspects | pixels.doubtful[i]);
            let sure = pixels.has[i] & self.free[i] & !self.unsure[i];
            for group in (0..64).step_by(lanes) {
                let x = word * 64 + group;
                let mask = S::mask32s::from_bitmask(simd, sure >> group & ((1u64 << lanes) - 1));
                let own = S::f32s::from_slice(simd, &rows.inverse[to + x..to + x + lanes]);
                let at = grid.at(x, y);
                mask.select(own, zero)
                    .store_slice(&mut self.sure[at..at + lanes]);
            }
        }
        // Rows touch in memory; the rim between is never sure.
        let from = grid.at(0, y);
        for x in (0..grid.stride).step_by(lanes) {
            let load = |at: usize| S::f32s::from_slice(simd, &self.sure[at..at + lanes]);
            let [a, b, c] = [load(from + x - 1), load(from + x), load(from + x + 1)];
            let known = |v: S::f32s| v.simd_gt(zero).select(v, splat(f32::INFINITY));
            a.max(b)
                .max(c)
                .store_slice(&mut rows.most[to + x..to + x + lanes]);
            let least = known(a).min(known(b)).min(known(c));
            least.store_slice(&mut rows.least[to + x..to + x + lanes]);
        }
    }

    /// Extremes over 3x3 of free pixels, and over three of these in the row.
    #[simd]
    fn step<S: Simd>(&mut self, simd: S, grid: Grid, y: usize) {
        let lanes = S::f32s::LEN;
        let splat = |v: f32| S::f32s::splat(simd, v);
        let rows = &mut self.rows;
        let to = rows.at(y);
        if y >= grid.height {
            rows.far_most[to..to + grid.stride].fill(0.0);
            rows.far_least[to..to + grid.stride].fill(f32::INFINITY);
            return;
        }
        let three = rows.three(y);
        for word in 0..grid.words {
            let free = self.free[y * grid.words + word];
            for group in (0..64).step_by(lanes) {
                let x = word * 64 + group;
                let mask = S::mask32s::from_bitmask(simd, free >> group & ((1u64 << lanes) - 1));
                let load = |of: &[f32]| {
                    three.map(|r| S::f32s::from_slice(simd, &of[r + x..r + x + lanes]))
                };
                let ([a, b, c], [d, e, f]) = (load(&rows.most), load(&rows.least));
                let most = mask.select(a.max(b).max(c), splat(0.0));
                let least = mask.select(d.min(e).min(f), splat(f32::INFINITY));
                most.store_slice(&mut rows.step_most[MARGIN + x..MARGIN + x + lanes]);
                least.store_slice(&mut rows.step_least[MARGIN + x..MARGIN + x + lanes]);
            }
        }
        for x in (0..grid.stride).step_by(lanes) {
            let load = |of: &[f32]| {
                [MARGIN + x - 1, MARGIN + x, MARGIN + x + 1]
                    .map(|at| S::f32s::from_slice(simd, &of[at..at + lanes]))
            };
            let ([a, b, c], [d, e, f]) = (load(&rows.step_most), load(&rows.step_least));
            a.max(b)
                .max(c)
                .store_slice(&mut rows.far_most[to + x..to + x + lanes]);
            d.min(e)
                .min(f)
                .store_slice(&mut rows.far_least[to + x..to + x + lanes]);
        }
    }

    #[simd]
    fn decide<S: Simd>(&mut self, simd: S, pixels: &PixelSamples, y: usize, px: f32) {
        let (grid, lanes) = (pixels.grid, S::f32s::LEN);
        let splat = |v: f32| S::f32s::splat(simd, v);
        let rows = &self.rows;
        let (own_row, three) = (rows.at(y), rows.three(y));
        for word in 0..grid.words {
            let i = y * grid.words + word;
            let candidates = pixels.has[i] & self.free[i];
            let (mut hidden, mut behind, mut agrees) = (0, 0, 0);
            for group in (0..64).step_by(lanes) {
                if candidates >> group & ((1u64 << lanes) - 1) == 0 {
                    continue;
                }
                let x = word * 64 + group;
                let load = |of: &[f32]| {
                    three.map(|r| S::f32s::from_slice(simd, &of[r + x..r + x + lanes]))
                };
                let ([a, b, c], [d, e, f]) = (load(&rows.far_most), load(&rows.far_least));
                let (most, least) = (a.max(b).max(c), d.min(e).min(f));
                let own =
                    S::f32s::from_slice(simd, &rows.inverse[own_row + x..own_row + x + lanes]);
                let known = most.simd_gt(splat(0.0));
                let spread = most - least;
                let room = spread
                    .simd_gt(splat(0.0))
                    .select(splat(BEHIND_PX * px), splat(BEHIND_ONE_PX * px));
                let is_behind = known & own.simd_lt(least - spread - room * least);
                let off = (own - most).max(most - own);
                let near = off.simd_le(splat(AGREES_PX * px) * most);
                let within = own.simd_ge(least)
                    & own.simd_le(most)
                    & spread.simd_le(splat(2.0 * AGREES_PX * px) * most);
                hidden |= own.simd_lt(splat(HIDDEN) * most).to_bitmask() << group;
                behind |= is_behind.to_bitmask() << group;
                agrees |= (known & (near | within)).to_bitmask() << group;
            }
            let unsure = self.unsure[i];
            self.hidden[i] = (hidden | behind & unsure) & candidates;
            self.vouched[i] = agrees & unsure & candidates & !self.hidden[i];
        }
    }
}

/// Pixels of a word that are not within [`REACH`] of the left and right rim.
fn inner(grid: Grid, word: usize) -> u64 {
    let below = |column: usize| {
        let n = column.saturating_sub(word * 64).min(64) as u32;
        1u64.checked_shl(n).map_or(!0, |bit| bit - 1)
    };
    below(grid.width.saturating_sub(REACH)) & !below(REACH)
}

#[cfg(test)]
#[path = "between_tests.rs"]
mod tests;
