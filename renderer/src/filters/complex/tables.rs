//! What is looked up by the edge code of a sub-pixel: as in a pixel, but with four segments a side.

use super::subpixels::{Subpixels, WINDOWS, sub_bit};
use crate::epi::geometry::Boundary;

/// Segments a side of a sub-pixel: 4, each half of them 2 units long, so that the centres of the cells are integer.
const SQUARE: Boundary = Boundary::new(4, 2);
/// Cells along a side of a sub-pixel in which samples are placed.
const CELLS: i32 = 8;

/// Tables by `16 a + b`, segments `a < b` clockwise from the top-left corner.
#[derive(Clone, Debug)]
pub(super) struct SubTables {
    /// Area of the inner region, share of the sub-pixel.
    inner_area: Vec<f32>,
    /// Cells (bit `8 · row + column`) whose centre lies in the inner region.
    inner_cells: Vec<u64>,
    /// Cells that an edge with this code may cut.
    ambiguous_cells: Vec<u64>,
    /// Weight of a source by its sub-pixel's bit, for each of the pixel's own four sub-pixels.
    weights: [[f32; 64]; 4],
}

/// Which of the nine pixels, row by row, a sub-pixel's bit belongs to.
pub(super) const PIXEL_OF: [u8; 64] = {
    let mut pixel_of = [0; 64];
    let mut bit = 0;
    while bit < 48 {
        if bit % 8 < 6 {
            pixel_of[bit] = (bit / 16 * 3 + bit % 8 / 2) as u8;
        }
        bit += 1;
    }
    pixel_of
};

impl Default for SubTables {
    fn default() -> Self {
        let mut tables = Self {
            inner_area: vec![0.0; 256],
            inner_cells: vec![0; 256],
            ambiguous_cells: vec![0; 256],
            weights: [[0.0; 64]; 4],
        };
        for (a, b) in (0..16).flat_map(|a| (a + 1..16).map(move |b| (a, b))) {
            if a / 4 != b / 4 {
                tables.set_code(a, b);
            }
        }
        for (weights, window) in tables.weights.iter_mut().zip(&WINDOWS) {
            let (column, row) = window.centre;
            for (bit, weight) in weights.iter_mut().enumerate() {
                let (dx, dy) = (column.abs_diff(bit % 8), row.abs_diff(bit / 8));
                *weight = super::super::interpolate::weight((dx * dx + dy * dy) as f32);
            }
        }
        tables
    }
}

impl SubTables {
    fn set_code(&mut self, a: i32, b: i32) {
        let code = (16 * a + b) as usize;
        self.inner_area[code] = SQUARE.inner_area(a, b) as f32;
        let size = SQUARE.side() / CELLS;
        for cell in 0..CELLS * CELLS {
            let (x, y) = (cell % CELLS * size, cell / CELLS * size);
            let inner = SQUARE.is_inner(a, b, (x + size / 2, y + size / 2));
            let cut = SQUARE.cuts_cell(a, b, (x, y), (x + size, y + size));
            self.inner_cells[code] |= u64::from(inner) << cell;
            self.ambiguous_cells[code] |= u64::from(cut) << cell;
        }
    }

    /// Area of the inner region of a sub-pixel, share of the sub-pixel; 0 where there is none.
    pub(super) fn inner_area(&self, sub: &Subpixels, place: (usize, usize)) -> f32 {
        sub.code(place).map_or(0.0, |code| self.inner_area[code])
    }

    /// Weights of sources by their sub-pixels' bits, seen from the pixel's own sub-pixel of this number.
    pub(super) fn weights(&self, window: usize) -> &[f32; 64] {
        &self.weights[window]
    }

    /// Bit and region of the sub-pixel in which a sample lies, given its place in one of the nine pixels; `None` if that
    /// is complex or the sample's side of the edge is not known.
    pub(super) fn locate(
        &self,
        sub: &Subpixels,
        (column, row): (usize, usize),
        place: [f32; 2],
    ) -> Option<(u64, usize)> {
        let cells = 2 * CELLS as usize;
        let [x, y] = place.map(|v| ((v * cells as f32) as usize).min(cells - 1));
        let half = CELLS as usize;
        let (column, row) = (2 * column + x / half, 2 * row + y / half);
        if !sub.is_open((column, row)) {
            return None;
        }
        let cell = y % half * half + x % half;
        let region = match sub.code((column, row)) {
            None => 0,
            Some(code) if self.ambiguous_cells[code] >> cell & 1 != 0 => return None,
            Some(code) => (self.inner_cells[code] >> cell & 1) as usize,
        };
        Some((sub_bit(column, row), region))
    }
}
