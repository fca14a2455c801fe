//! Reachability on bit planes: the fast path (paper section 5.2).
//!
//! Every corner of a pixel lies in its primary or its secondary region. Two pixels that share a side are joined wherever
//! the corners that meet at one end of that side lie in the regions asked for, unless either pixel is complex. Chaining is
//! then a product of 2x2 boolean matrices and combining an OR, done for a whole vector of 64-pixel words at once.
//!
//! Layout: plane `i` of [`ReachMap`] has bit x of row y set if the primary regions of pixel (x, y) and of the pixel at
//! offset `OFFSETS[i]` reach each other. Relations are in the order `PP, PS, SP, SS` of [`reach_tables`](super::reach_tables).

mod slices;

use fearless_simd::{Level, dispatch};

use super::grid::Grid;
use super::image::Epi;
use super::reach_tables::{PP, PS, SP, SS};
use crate::filters::taps;
use slices::RowCache;

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
    /// Primary-to-primary reachability for each of [`OFFSETS`](super::reach_tables::OFFSETS).
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
        self.rows.resize(grid);
    }

    /// Finds what is reachable in an image whose primary regions are settled. Resizes the map if need be. The result does
    /// not depend on `level`.
    pub fn compute(&mut self, level: Level, epi: &Epi) {
        self.resize(epi.grid);
        dispatch!(level, simd => slices::reach(simd, epi, self));
    }

    /// Do the primary regions of a pixel and of the one at an offset of at most two pixels either way reach each other?
    /// False for the offset (0, 0), for larger offsets, and for pixels outside the image.
    pub fn reachable_at(&self, (x, y): (usize, usize), (dx, dy): (i32, i32)) -> bool {
        let inside = x < self.grid.width && y < self.grid.height;
        inside && taps::Reach::reachable(self, (dx, dy), x / 64, y) >> (x % 64) & 1 != 0
    }

    /// How the regions of a pixel are joined to those of a neighbour one step along x or y, as a mask of bits `PP`, `PS`,
    /// `SP`, `SS`; 0 if either lies outside the image.
    #[inline]
    pub fn step(&self, (x, y): (usize, usize), (dx, dy): (i32, i32)) -> u8 {
        let backward = dx + dy < 0;
        let planes = if dy == 0 {
            &self.steps.right
        } else {
            &self.steps.down
        };
        // A step back is stored at the pixel that it leads to.
        let from = if backward {
            (
                x.wrapping_add_signed(dx as isize),
                y.wrapping_add_signed(dy as isize),
            )
        } else {
            (x, y)
        };
        if from.0 >= self.grid.width || from.1 >= self.grid.height {
            return 0;
        }
        let (word, bit) = self.grid.bit(from.0, from.1);
        let at = |relation: usize| (planes[relation][word] >> bit & 1) as u8;
        let (ps, sp) = if backward { (SP, PS) } else { (PS, SP) };
        at(PP) << PP | at(ps) << PS | at(sp) << SP | at(SS) << SS
    }
}

impl taps::Reach for ReachMap {
    #[inline]
    fn reachable(&self, (dx, dy): (i32, i32), word: usize, y: usize) -> u64 {
        if let Some(plane) = plane_of((dx, dy)) {
            return self.planes[plane][y * self.grid.words + word];
        }
        // By symmetry: the bit is stored at the other pixel.
        plane_of((-dx, -dy)).map_or(0, |plane| {
            taps::shifted(&self.planes[plane], self.grid.words, word, y, (dx, dy))
        })
    }
}

/// Index of an offset in [`OFFSETS`](super::reach_tables::OFFSETS).
#[inline]
fn plane_of((dx, dy): (i32, i32)) -> Option<usize> {
    match (dx, dy) {
        (1 | 2, 0) => Some(dx as usize - 1),
        (-2..=2, 1 | 2) => Some((5 * dy + dx - 1) as usize),
        _ => None,
    }
}

#[cfg(test)]
mod tests;
