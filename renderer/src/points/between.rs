//! Telling hidden points from visible ones by their neighbours and the edges of the frame, so that few rays are needed.
//!
//! Where no edge runs between pixels they show one surface. A point there that lies well behind those known to be visible
//! is hidden, and shows through a gap between samples; one that lies among them is visible, as far as they are: something
//! may have come before all of them since they were last asked about, which is why a point is vouched for a few times
//! only before a ray is asked again ([`PointCache::vouch`](super::PointCache::vouch)).

use fearless_simd::{Level, dispatch};

use super::PixelSamples;
use super::around::{Around, Verdict};
use super::sweep::Rows;
use crate::epi::Epi;
use crate::epi::code::Side;
use crate::epi::grid::Grid;

/// How far neighbours reach, pixels.
const REACH: usize = 2;

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
    pub(super) free: Vec<u64>,
    /// Those without an edge within two pixels.
    open: Vec<u64>,
    /// One over the depth of what is known to be visible in free pixels; 0 elsewhere.
    pub(super) sure: Vec<f32>,
    pub(super) rows: Rows,
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
