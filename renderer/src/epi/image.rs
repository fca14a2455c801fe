//! The edge-and-point image itself: codes, bit planes, and which region of a pixel is primary.

use super::code::{Class, CodeTables, EdgeCode, Places, Side};
use super::grid::Grid;

/// How many pixels there are of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Pixels that no edge crosses.
    pub empty: usize,
    /// Pixels that one edge stands for.
    pub simple: usize,
    /// All other pixels.
    pub complex: usize,
}

/// Where the samples of a frame lie, at most one a pixel.
#[derive(Clone, Copy, Debug)]
pub struct SamplePlaces<'a> {
    /// Bit plane: the pixel has a sample.
    pub present: &'a [u64],
    /// Element array: place in the pixel, x to the right, [0, 1), read only where a sample is present.
    pub x: &'a [f32],
    /// The same, y down.
    pub y: &'a [f32],
}

/// The edge-and-point image (paper section 4.4) in structure-of-arrays form.
///
/// Bit planes have [`Grid::plane_words`] words and are zero beyond the image. Corners are numbered clockwise from the
/// top left: 0 top left, 1 top right, 2 bottom right, 3 bottom left.
#[derive(Clone, Debug)]
pub struct Epi {
    /// Layout of everything below.
    pub grid: Grid,
    /// Element array of [`EdgeCode`]s; margins are empty.
    pub code: Vec<u16>,
    /// Bit plane: simple pixels.
    pub simple: Vec<u64>,
    /// Bit plane: complex pixels.
    pub complex: Vec<u64>,
    /// Bit plane: the inner region is the primary one. Simple pixels only.
    pub primary_inner: Vec<u64>,
    /// Bit planes: the corner lies in the secondary region. Simple pixels only.
    pub corner: [Vec<u64>; 4],
    /// Bit plane: the pixel has a sample that lies in its primary region for certain (all samples of pixels that are
    /// not simple do).
    pub has_sample: Vec<u64>,
    /// Bit plane: the pixel has a sample of which the side of the edge is not known.
    pub ambiguous: Vec<u64>,
    /// Element arrays: centroid of the primary region, x and y, pixels from the pixel's top-left corner.
    pub centre_px: [Vec<f32>; 2],
    /// Pixels of each kind.
    pub counts: Counts,
    /// Bit planes: corners 1, 2 and 3 lie in the inner region (corner 0 never does). Simple pixels only.
    pub(super) inner_corner: [Vec<u64>; 3],
    /// Bit plane: the inner region is the larger one. Simple pixels only.
    pub(super) inner_larger: Vec<u64>,
    tables: CodeTables,
}

impl Epi {
    /// An image of empty pixels, for samples whose places are known this finely.
    pub fn new(width: usize, height: usize, places: Places) -> Self {
        let mut epi = Self {
            grid: Grid::new(0, 0),
            code: Vec::new(),
            simple: Vec::new(),
            complex: Vec::new(),
            primary_inner: Vec::new(),
            corner: Default::default(),
            has_sample: Vec::new(),
            ambiguous: Vec::new(),
            centre_px: Default::default(),
            counts: Counts::default(),
            inner_corner: Default::default(),
            inner_larger: Vec::new(),
            tables: CodeTables::new(places),
        };
        epi.resize(width, height);
        epi
    }

    /// Makes every pixel of an image of this size empty; does nothing if the size is the present one.
    pub fn resize(&mut self, width: usize, height: usize) {
        let grid = Grid::new(width, height);
        if grid == self.grid {
            return;
        }
        self.grid = grid;
        self.code.clear();
        self.code.resize(grid.elements(), EdgeCode::EMPTY.0);
        for centre in &mut self.centre_px {
            centre.clear();
            centre.resize(grid.elements(), 0.5);
        }
        let planes = [
            &mut self.simple,
            &mut self.complex,
            &mut self.primary_inner,
            &mut self.has_sample,
            &mut self.ambiguous,
            &mut self.inner_larger,
        ];
        let corners = self.corner.iter_mut().chain(self.inner_corner.iter_mut());
        for plane in planes.into_iter().chain(corners) {
            plane.clear();
            plane.resize(grid.plane_words(), 0);
        }
        self.counts = Counts {
            empty: width * height,
            ..Counts::default()
        };
    }

    /// The tables that this image's codes index.
    pub fn tables(&self) -> &CodeTables {
        &self.tables
    }

    /// Code of a pixel.
    #[inline]
    pub fn code_at(&self, x: usize, y: usize) -> EdgeCode {
        EdgeCode(self.code[self.grid.at(x, y)])
    }

    /// Class of a pixel, primary region included.
    pub fn class_at(&self, x: usize, y: usize) -> Class {
        let (word, bit) = self.grid.bit(x, y);
        Class::new(self.code_at(x, y), self.primary_inner[word] >> bit & 1 != 0)
    }

    /// Whether a corner of a simple pixel, clockwise from the top left, lies in its inner region.
    pub fn is_inner_corner(&self, (x, y): (usize, usize), corner: usize) -> bool {
        let (word, bit) = self.grid.bit(x, y);
        // The top left one never does.
        corner > 0 && self.inner_corner[corner - 1][word] >> bit & 1 != 0
    }

    /// Makes a simple pixel complex.
    pub(super) fn make_complex(&mut self, x: usize, y: usize) {
        let ((word, bit), at) = (self.grid.bit(x, y), self.grid.at(x, y));
        self.code[at] = EdgeCode::COMPLEX.0;
        self.complex[word] |= 1 << bit;
        let [a, b, c] = &mut self.inner_corner;
        for plane in [&mut self.simple, &mut self.inner_larger, a, b, c] {
            plane[word] &= !(1 << bit);
        }
        for centre in &mut self.centre_px {
            centre[at] = 0.5;
        }
        self.counts.simple -= 1;
        self.counts.complex += 1;
    }

    /// Settles which region of each simple pixel is primary (paper section 5.1): the one that its sample lies in, or the
    /// larger one if there is no sample or its side is not known. Call after classification, once a frame.
    pub fn set_primary(&mut self, samples: &SamplePlaces) {
        for y in 0..self.grid.height {
            for word in 0..self.grid.words {
                self.set_primary_in_word(samples, y, word);
            }
        }
        for (i, &simple) in self.simple.iter().enumerate() {
            let primary = self.primary_inner[i];
            self.corner[0][i] = simple & primary;
            for (corner, inner) in self.corner[1..].iter_mut().zip(&self.inner_corner) {
                corner[i] = simple & (inner[i] ^ primary);
            }
        }
    }

    fn set_primary_in_word(&mut self, samples: &SamplePlaces, y: usize, word: usize) {
        let i = y * self.grid.words + word;
        let present = samples.present[i] & self.grid.valid(word);
        let mut primary = self.inner_larger[i];
        let mut ambiguous = 0;
        let mut left = self.simple[i];
        while left != 0 {
            let bit = left & left.wrapping_neg();
            let at = self.grid.at(64 * word + left.trailing_zeros() as usize, y);
            let code = EdgeCode(self.code[at]);
            if present & bit != 0 {
                let cell = self.tables.places().cell(samples.x[at], samples.y[at]);
                match self.tables.side(code, cell) {
                    Side::Inner => primary |= bit,
                    Side::Outer => primary &= !bit,
                    Side::Ambiguous => ambiguous |= bit,
                }
            }
            let centre = self.tables.centroid_px(code, primary & bit != 0);
            self.centre_px[0][at] = centre[0];
            self.centre_px[1][at] = centre[1];
            left ^= bit;
        }
        self.primary_inner[i] = primary;
        self.ambiguous[i] = ambiguous;
        self.has_sample[i] = present & !ambiguous;
    }
}

#[cfg(test)]
mod tests;
