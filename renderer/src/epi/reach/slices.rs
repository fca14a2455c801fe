//! The kernel of the bit-sliced path. A row's relations are computed once, kept in all the shifts that are needed, and
//! used for the two rows above too.

use std::ops::{BitAnd, BitOr};

use fearless_simd::prelude::*;
use fearless_simd_macros::simd;

use super::ReachMap;
use crate::epi::Epi;
use crate::epi::grid::Grid;
use crate::epi::reach_tables::{PP, PS, SP, SS};

/// Words a block: as many as the widest vectors hold.
const BLOCK: usize = 8;

/// First of the shifts that are kept: [`Shifted`]'s arrays begin there.
const FIRST_SHIFT: i32 = -2;

/// Relations of a block in every shift that is needed: `right[2 + s]` and `down[2 + s]` have at bit x those of pixel
/// x + s.
#[derive(Clone, Copy, Debug, Default)]
struct Shifted {
    right: [[[u64; BLOCK]; 4]; 4],
    down: [[[u64; BLOCK]; 4]; 5],
}

/// Corner planes of one row and `open` (inside the image and not complex), padded to whole blocks with a word more.
#[derive(Clone, Debug, Default)]
struct Corners {
    corner: [Vec<u64>; 4],
    open: Vec<u64>,
}

/// What is kept from row to row.
#[derive(Clone, Debug, Default)]
pub(super) struct RowCache {
    /// Relations of row y at index y % 3.
    shifted: [Vec<Shifted>; 3],
    /// The upper and the lower row.
    corners: [Corners; 2],
    /// Relations of one row (right, then down), with a word of margin at both ends.
    relations: [Vec<u64>; 8],
}

impl RowCache {
    pub(super) fn resize(&mut self, grid: Grid) {
        let blocks = grid.words.div_ceil(BLOCK);
        for row in &mut self.shifted {
            row.clear();
            row.resize(blocks, Shifted::default());
        }
        let corners = self.corners.iter_mut();
        let rows = corners.flat_map(|c| c.corner.iter_mut().chain([&mut c.open]));
        for row in rows.chain(&mut self.relations) {
            row.clear();
            row.resize(blocks * BLOCK + 2, 0);
        }
    }
}

/// Computes a whole map of the right size.
#[simd]
pub(super) fn reach<S: Simd>(simd: S, epi: &Epi, map: &mut ReachMap) {
    let height = epi.grid.height;
    map.rows.corners[1].load(epi, 0);
    // Row y's reachability needs the relations of rows y, y + 1 and y + 2.
    for y in 0..height + 2 {
        if y < height {
            map.rows.corners.swap(0, 1);
            map.rows.corners[1].load(epi, y + 1);
            let RowCache {
                corners,
                relations,
                shifted,
            } = &mut map.rows;
            relate(simd, corners, relations);
            shift(simd, relations, &mut shifted[y % 3]);
            store_steps(map, y);
        } else {
            map.rows.shifted[y % 3].fill(Shifted::default());
        }
        if let Some(y) = y.checked_sub(2) {
            propagate(simd, map, y);
        }
    }
}

impl Corners {
    /// Copies a row of an image. All is complex below the image.
    #[inline(always)]
    fn load(&mut self, epi: &Epi, y: usize) {
        let words = epi.grid.words;
        if y >= epi.grid.height {
            self.open.fill(0);
            return;
        }
        let range = y * words..(y + 1) * words;
        for (row, plane) in self.corner.iter_mut().zip(&epi.corner) {
            copy(&mut row[..words], &plane[range.clone()]);
        }
        for (i, (open, complex)) in self.open.iter_mut().zip(&epi.complex[range]).enumerate() {
            *open = epi.grid.valid(i) & !complex;
        }
    }
}

/// Copies a few words; a call of `memcpy` would cost more than the copy.
#[inline(always)]
fn copy(to: &mut [u64], from: &[u64]) {
    for (to, from) in to.chunks_mut(BLOCK).zip(from.chunks(BLOCK)) {
        if let (Ok(to), Ok(from)) = (
            <&mut [u64; BLOCK]>::try_from(&mut *to),
            <&[u64; BLOCK]>::try_from(from),
        ) {
            *to = *from;
        } else {
            to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
        }
    }
}

/// Relations of a row with itself and the next one, from the corners that meet.
#[inline(always)]
fn relate<S: Simd>(simd: S, corners: &[Corners; 2], relations: &mut [Vec<u64>; 8]) {
    let lanes = S::u64s::LEN;
    let [upper, lower] = corners;
    let words = upper.open.len() - 2;
    for at in (0..words).step_by(lanes) {
        let load = |row: &[u64]| S::u64s::from_slice(simd, &row[at..at + lanes]);
        let next = |row: &[u64]| {
            load(row) >> 1 | S::u64s::from_slice(simd, &row[at + 1..at + 1 + lanes]) << 63
        };
        let [top_left, top_right, bottom_right, bottom_left] = &upper.corner;
        let (open, bottom_right) = (load(&upper.open), load(bottom_right));
        let right = join(
            [load(top_right), bottom_right],
            [next(top_left), next(bottom_left)],
            open & next(&upper.open),
        );
        let down = join(
            [load(bottom_left), bottom_right],
            [load(&lower.corner[0]), load(&lower.corner[1])],
            open & load(&lower.open),
        );
        for (k, relation) in right.into_iter().chain(down).enumerate() {
            relation.store_slice(&mut relations[k][at + 1..at + 1 + lanes]);
        }
    }
}

/// Regions joined at either end of a shared side, given which of the corners there are secondary.
#[inline(always)]
fn join<V>([a0, a1]: [V; 2], [b0, b1]: [V; 2], open: V) -> [V; 4]
where
    V: Copy + BitAnd<Output = V> + BitOr<Output = V> + std::ops::Not<Output = V>,
{
    [
        !((a0 | b0) & (a1 | b1)) & open,
        (!a0 & b0 | !a1 & b1) & open,
        (a0 & !b0 | a1 & !b1) & open,
        (a0 & b0 | a1 & b1) & open,
    ]
}

#[inline(always)]
fn store_steps(map: &mut ReachMap, y: usize) {
    let words = map.grid.words;
    let steps = map.steps.right.iter_mut().chain(map.steps.down.iter_mut());
    for (plane, row) in steps.zip(&map.rows.relations) {
        copy(&mut plane[y * words..(y + 1) * words], &row[1..=words]);
    }
}

#[inline(always)]
fn shift<S: Simd>(simd: S, relations: &[Vec<u64>; 8], blocks: &mut [Shifted]) {
    let lanes = S::u64s::LEN;
    for (block, shifted) in blocks.iter_mut().enumerate() {
        for lane in (0..BLOCK).step_by(lanes) {
            let at = 1 + block * BLOCK + lane;
            for (k, row) in relations.iter().enumerate() {
                let load = |at: usize| S::u64s::from_slice(simd, &row[at..at + lanes]);
                let (before, here, after) = (load(at - 1), load(at), load(at + 1));
                let by = |shift: i32| match shift {
                    0 => here,
                    1.. => here >> shift as u32 | after << (64 - shift) as u32,
                    _ => here << -shift as u32 | before >> (64 + shift) as u32,
                };
                if k < 4 {
                    for (by_this, out) in (FIRST_SHIFT..).zip(&mut shifted.right) {
                        by(by_this).store_slice(&mut out[k][lane..lane + lanes]);
                    }
                } else {
                    for (by_this, out) in (FIRST_SHIFT..).zip(&mut shifted.down) {
                        by(by_this).store_slice(&mut out[k - 4][lane..lane + lanes]);
                    }
                }
            }
        }
    }
}

/// Relations of one step, in the order `PP, PS, SP, SS`.
type Step<V> = [V; 4];

/// What the centre's primary region reaches of another pixel.
#[derive(Clone, Copy)]
struct Front<V> {
    primary: V,
    secondary: V,
}

impl<V: Copy + BitAnd<Output = V> + BitOr<Output = V>> Front<V> {
    /// What is reached across the first step, right or down.
    #[inline(always)]
    fn start(step: Step<V>) -> Self {
        Self {
            primary: step[PP],
            secondary: step[PS],
        }
    }

    /// One step on, right or down.
    #[inline(always)]
    fn chain(self, step: Step<V>) -> Self {
        Self {
            primary: self.primary & step[PP] | self.secondary & step[SP],
            secondary: self.primary & step[PS] | self.secondary & step[SS],
        }
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self {
            primary: self.primary | other.primary,
            secondary: self.secondary | other.secondary,
        }
    }
}

#[inline(always)]
fn propagate<S: Simd>(simd: S, map: &mut ReachMap, y: usize) {
    let words = map.grid.words;
    for block in 0..map.rows.shifted[0].len() {
        let rows = [0, 1, 2].map(|d| &map.rows.shifted[(y + d) % 3][block]);
        let first = block * BLOCK;
        let at = y * words + first;
        for lane in (0..BLOCK.min(words - first)).step_by(S::u64s::LEN) {
            let reached = propagate_lanes(simd, rows, lane);
            let count = S::u64s::LEN.min(words - first - lane);
            for (plane, lanes) in map.planes.iter_mut().zip(reached) {
                let out = &mut plane[at + lane..at + lane + count];
                if count == S::u64s::LEN {
                    lanes.store_slice(out);
                } else {
                    out.iter_mut()
                        .zip(lanes.as_slice())
                        .for_each(|(out, lane)| *out = *lane);
                }
            }
        }
    }
}

/// Primary regions reached at each of `OFFSETS`, always stepping away from the centre.
#[inline(always)]
fn propagate_lanes<S: Simd>(simd: S, rows: [&Shifted; 3], lane: usize) -> [S::u64s; 12] {
    let load = |words: &[u64; BLOCK]| S::u64s::from_slice(simd, &words[lane..lane + S::u64s::LEN]);
    // Steps are stored at the pixel on their left or upper end; the index 2 + s is that of x + s.
    let right = |row: usize, at: usize| rows[row].right[at].each_ref().map(load);
    let down = |row: usize, at: usize| rows[row].down[at].each_ref().map(load);
    let left = |row: usize, at: usize| {
        let [pp, ps, sp, ss] = right(row, at);
        [pp, sp, ps, ss]
    };

    let r1 = Front::start(right(0, 2));
    let r2 = r1.chain(right(0, 3));
    let l1 = Front::start(left(0, 1));
    let l2 = l1.chain(left(0, 0));

    let d1 = Front::start(down(0, 2));
    let d1r1 = r1.chain(down(0, 3)).or(d1.chain(right(1, 2)));
    let d1r2 = r2.chain(down(0, 4)).or(d1r1.chain(right(1, 3)));
    let d1l1 = l1.chain(down(0, 1)).or(d1.chain(left(1, 1)));
    let d1l2 = l2.chain(down(0, 0)).or(d1l1.chain(left(1, 0)));

    let d2 = d1.chain(down(1, 2));
    let d2r1 = d1r1.chain(down(1, 3)).or(d2.chain(right(2, 2)));
    let d2r2 = d1r2.chain(down(1, 4)).or(d2r1.chain(right(2, 3)));
    let d2l1 = d1l1.chain(down(1, 1)).or(d2.chain(left(2, 1)));
    let d2l2 = d1l2.chain(down(1, 0)).or(d2l1.chain(left(2, 0)));

    [
        r1, r2, d1l2, d1l1, d1, d1r1, d1r2, d2l2, d2l1, d2, d2r1, d2r2,
    ]
    .map(|front| front.primary)
}
