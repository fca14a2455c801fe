//! Reachability on bit planes: the fast path (paper section 5.2).
//!
//! Every corner of a pixel lies in its primary or its secondary region. Two pixels that share a side are joined wherever
//! the corners that meet at one end of that side lie in the regions asked for, unless either pixel is complex. Chaining is
//! then a product of 2x2 boolean matrices and combining an OR, done for 64 pixels a word. A row's relations are
//! computed once, kept in the shifts that are needed, and used for the two rows above too.
//!
//! Layout: plane `i` of [`ReachMap`] has bit x of row y set if the primary regions of pixel (x, y) and of the pixel at
//! offset `OFFSETS[i]` reach each other. Relations are in the order `PP, PS, SP, SS` of [`reach_tables`](super::reach_tables).

use std::ops::{BitAnd, BitOr};

use super::dispatch::{Kernel, dispatch};
use super::grid::Grid;
use super::image::Epi;
use super::reach_tables::{OFFSETS, PP, PS, SP, SS};

/// Words that are worked on together.
const LANES: usize = 4;

/// Relations of each pixel with its right and its lower neighbour, one bit plane for each of `PP, PS, SP, SS`.
#[derive(Clone, Debug, Default)]
pub struct Steps {
    /// With the pixel at x + 1.
    pub right: [Vec<u64>; 4],
    /// With the pixel at y + 1.
    pub down: [Vec<u64>; 4],
}

/// What is reachable from where, and the room to compute it in.
#[derive(Clone, Debug)]
pub struct ReachMap {
    /// Layout of the planes.
    pub grid: Grid,
    /// Primary-to-primary reachability for each of [`OFFSETS`].
    pub planes: [Vec<u64>; 12],
    /// Relations of neighbours.
    pub steps: Steps,
    rows: RowCache,
}

impl ReachMap {
    /// A map in which nothing is reachable.
    pub fn new(width: usize, height: usize) -> Self {
        let mut map = Self {
            grid: Grid::new(0, 0),
            planes: Default::default(),
            steps: Steps::default(),
            rows: RowCache::default(),
        };
        map.resize(Grid::new(width, height));
        map
    }

    /// Makes room for this layout; does nothing if it is the present one.
    pub fn resize(&mut self, grid: Grid) {
        if grid == self.grid {
            return;
        }
        self.grid = grid;
        let steps = self
            .steps
            .right
            .iter_mut()
            .chain(self.steps.down.iter_mut());
        for plane in self.planes.iter_mut().chain(steps) {
            plane.clear();
            plane.resize(grid.plane_words(), 0);
        }
        self.rows.resize(grid.words);
    }

    /// Finds what is reachable in an image whose primary regions are settled. Resizes the map if need be.
    pub fn compute(&mut self, epi: &Epi) {
        self.resize(epi.grid);
        dispatch(Reach { epi, map: self });
    }

    /// Do the primary regions of a pixel and of the one at an offset of at most two pixels either way reach each other?
    /// False for the offset (0, 0), for larger offsets, and for pixels outside the image.
    pub fn reachable(&self, x: usize, y: usize, dx: i32, dy: i32) -> bool {
        let find = |offset| OFFSETS.iter().position(|&o| o == offset);
        let (plane, from) = match (find((dx, dy)), find((-dx, -dy))) {
            (Some(plane), _) => (plane, (Some(x), Some(y))),
            (None, Some(plane)) => (
                plane,
                (
                    x.checked_add_signed(dx as isize),
                    y.checked_add_signed(dy as isize),
                ),
            ),
            (None, None) => return false,
        };
        match from {
            (Some(x), Some(y)) if x < self.grid.width && y < self.grid.height => {
                let (word, bit) = self.grid.bit(x, y);
                self.planes[plane][word] >> bit & 1 != 0
            }
            _ => false,
        }
    }
}

/// [`LANES`] words side by side.
#[derive(Clone, Copy, Debug, Default)]
struct Lanes([u64; LANES]);

impl BitAnd for Lanes {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] & other.0[i]))
    }
}

impl BitOr for Lanes {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] | other.0[i]))
    }
}

/// A row's relations in every shift that is needed: `right[2 + s]` and `down[2 + s]` have at bit x those of pixel x + s.
#[derive(Clone, Copy, Debug, Default)]
struct Shifted {
    right: [[Lanes; 4]; 4],
    down: [[Lanes; 4]; 5],
}

/// Shifts kept of `right` start at this one, and so do those of `down`.
const FIRST_SHIFT: i32 = -2;

#[derive(Clone, Debug, Default)]
struct RowCache {
    /// Blocks of rows y % 3.
    shifted: [Vec<Shifted>; 3],
    /// Corners 0..4, not complex: one row of each with a word of margin at both ends, upper and lower row.
    corners: [[Vec<u64>; 5]; 2],
    /// Relations of one row (`right`, then `down`), with a word of margin at both ends.
    relations: [Vec<u64>; 8],
}

impl RowCache {
    fn resize(&mut self, words: usize) {
        let blocks = words.div_ceil(LANES);
        for row in &mut self.shifted {
            row.clear();
            row.resize(blocks, Shifted::default());
        }
        for row in self.corners.iter_mut().flatten().chain(&mut self.relations) {
            row.clear();
            row.resize(blocks * LANES + 2, 0);
        }
    }
}

struct Reach<'a> {
    epi: &'a Epi,
    map: &'a mut ReachMap,
}

impl Kernel for Reach<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { epi, map } = self;
        let height = epi.grid.height;
        if height == 0 {
            return;
        }
        load_corners(epi, 0, &mut map.rows.corners[1]);
        // Row y's reachability needs the relations of rows y, y + 1 and y + 2.
        for y in 0..height + 2 {
            if y < height {
                map.rows.corners.swap(0, 1);
                load_corners(epi, y + 1, &mut map.rows.corners[1]);
                relate(&mut map.rows);
                store_steps(map, y);
                shift(&map.rows.relations, &mut map.rows.shifted[y % 3]);
            } else {
                map.rows.shifted[y % 3].fill(Shifted::default());
            }
            if let Some(y) = y.checked_sub(2) {
                propagate(map, y);
            }
        }
    }
}

/// Copies a row of corner planes; a row below the image is all complex.
#[inline(always)]
fn load_corners(epi: &Epi, y: usize, rows: &mut [Vec<u64>; 5]) {
    let words = epi.grid.words;
    if y >= epi.grid.height {
        rows[4].fill(0);
        return;
    }
    let range = y * words..(y + 1) * words;
    for (row, plane) in rows.iter_mut().zip(&epi.corner) {
        row[1..=words].copy_from_slice(&plane[range.clone()]);
    }
    for (i, (open, complex)) in rows[4][1..].iter_mut().zip(&epi.complex[range]).enumerate() {
        *open = epi.grid.valid(i) & !complex;
    }
}

/// Relations of a row with itself and the next one, from the corners that meet.
#[inline(always)]
fn relate(rows: &mut RowCache) {
    let RowCache {
        corners: [upper, lower],
        relations,
        ..
    } = rows;
    let [top_left, top_right, bottom_right, bottom_left, open] = &*upper;
    let [lower_top_left, lower_top_right, _, _, lower_open] = &*lower;
    let next = |row: &[u64], i: usize| row[i] >> 1 | row[i + 1] << 63;
    let last = open.len() - 1;
    for i in 1..last {
        let joined = join(
            [top_right[i], bottom_right[i]],
            [next(top_left, i), next(bottom_left, i)],
            open[i] & next(open, i),
        );
        for (row, relation) in relations[..4].iter_mut().zip(joined) {
            row[i] = relation;
        }
        let joined = join(
            [bottom_left[i], bottom_right[i]],
            [lower_top_left[i], lower_top_right[i]],
            open[i] & lower_open[i],
        );
        for (row, relation) in relations[4..].iter_mut().zip(joined) {
            row[i] = relation;
        }
    }
}

/// Regions joined at either end of a shared side, given which of the corners there are secondary.
#[inline(always)]
fn join(a: [u64; 2], b: [u64; 2], open: u64) -> [u64; 4] {
    [
        (!(a[0] | b[0]) | !(a[1] | b[1])) & open,
        (!a[0] & b[0] | !a[1] & b[1]) & open,
        (a[0] & !b[0] | a[1] & !b[1]) & open,
        (a[0] & b[0] | a[1] & b[1]) & open,
    ]
}

#[inline(always)]
fn store_steps(map: &mut ReachMap, y: usize) {
    let words = map.grid.words;
    let steps = map.steps.right.iter_mut().chain(map.steps.down.iter_mut());
    for (plane, row) in steps.zip(&map.rows.relations) {
        plane[y * words..(y + 1) * words].copy_from_slice(&row[1..=words]);
    }
}

/// A word of the row moved so that bit x is that of pixel x + `by`.
#[inline(always)]
fn shifted_lanes(row: &[u64], first: usize, by: i32) -> Lanes {
    Lanes(std::array::from_fn(|i| {
        let i = first + i;
        match by {
            0 => row[i],
            1.. => row[i] >> by | row[i + 1] << (64 - by),
            _ => row[i] << -by | row[i - 1] >> (64 + by),
        }
    }))
}

#[inline(always)]
fn shift(relations: &[Vec<u64>; 8], blocks: &mut [Shifted]) {
    for (block, shifted) in blocks.iter_mut().enumerate() {
        let first = 1 + block * LANES;
        for (by, lanes) in (FIRST_SHIFT..).zip(&mut shifted.right) {
            *lanes = std::array::from_fn(|k| shifted_lanes(&relations[k], first, by));
        }
        for (by, lanes) in (FIRST_SHIFT..).zip(&mut shifted.down) {
            *lanes = std::array::from_fn(|k| shifted_lanes(&relations[4 + k], first, by));
        }
    }
}

/// What the centre's primary region reaches of another pixel.
#[derive(Clone, Copy)]
struct Front {
    primary: Lanes,
    secondary: Lanes,
}

impl Front {
    /// What is reached across the first step, right or down.
    #[inline(always)]
    fn start(step: &[Lanes; 4]) -> Self {
        Self {
            primary: step[PP],
            secondary: step[PS],
        }
    }

    /// What is reached across the first step to the left: the step of the pixel there, seen from its other end.
    #[inline(always)]
    fn start_left(step: &[Lanes; 4]) -> Self {
        Self {
            primary: step[PP],
            secondary: step[SP],
        }
    }

    /// One step on, right or down.
    #[inline(always)]
    fn chain(self, step: &[Lanes; 4]) -> Self {
        Self {
            primary: self.primary & step[PP] | self.secondary & step[SP],
            secondary: self.primary & step[PS] | self.secondary & step[SS],
        }
    }

    /// One step on to the left.
    #[inline(always)]
    fn chain_left(self, step: &[Lanes; 4]) -> Self {
        Self {
            primary: self.primary & step[PP] | self.secondary & step[PS],
            secondary: self.primary & step[SP] | self.secondary & step[SS],
        }
    }
}

impl BitOr for Front {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self {
            primary: self.primary | other.primary,
            secondary: self.secondary | other.secondary,
        }
    }
}

#[inline(always)]
fn propagate(map: &mut ReachMap, y: usize) {
    let words = map.grid.words;
    let blocks = map.rows.shifted[0].len();
    for block in 0..blocks {
        let [row0, row1, row2] = [0, 1, 2].map(|d| &map.rows.shifted[(y + d) % 3][block]);
        let reached = propagate_block(row0, row1, row2);
        let first = block * LANES;
        let count = LANES.min(words - first);
        for (plane, lanes) in map.planes.iter_mut().zip(&reached) {
            let at = y * words + first;
            if count == LANES {
                plane[at..at + LANES].copy_from_slice(&lanes.0);
            } else {
                plane[at..at + count].copy_from_slice(&lanes.0[..count]);
            }
        }
    }
}

/// Primary regions reached at each of [`OFFSETS`], always stepping away from the centre.
#[inline(always)]
fn propagate_block(row0: &Shifted, row1: &Shifted, row2: &Shifted) -> [Lanes; 12] {
    // Steps are stored at the pixel on their left or upper end; `[2 + s]` is the one at x + s.
    let (right0, down0) = (&row0.right, &row0.down);
    let (right1, down1) = (&row1.right, &row1.down);
    let right2 = &row2.right;

    let r1 = Front::start(&right0[2]);
    let r2 = r1.chain(&right0[3]);
    let l1 = Front::start_left(&right0[1]);
    let l2 = l1.chain_left(&right0[0]);

    let d1 = Front::start(&down0[2]);
    let d1r1 = r1.chain(&down0[3]) | d1.chain(&right1[2]);
    let d1r2 = r2.chain(&down0[4]) | d1r1.chain(&right1[3]);
    let d1l1 = l1.chain(&down0[1]) | d1.chain_left(&right1[1]);
    let d1l2 = l2.chain(&down0[0]) | d1l1.chain_left(&right1[0]);

    let d2 = d1.chain(&down1[2]);
    let d2r1 = d1r1.chain(&down1[3]) | d2.chain(&right2[2]);
    let d2r2 = d1r2.chain(&down1[4]) | d2r1.chain(&right2[3]);
    let d2l1 = d1l1.chain(&down1[1]) | d2.chain_left(&right2[1]);
    let d2l2 = d1l2.chain(&down1[0]) | d2l1.chain_left(&right2[0]);

    [
        r1, r2, d1l2, d1l1, d1, d1r1, d1r2, d2l2, d2l1, d2, d2r1, d2r2,
    ]
    .map(|front| front.primary)
}

#[cfg(test)]
mod tests;
