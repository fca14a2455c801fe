//! Maps put on: which map each pixel wears, and what it multiplies the pixel's colour by.
//!
//! A pixel wears the map of about the nearest sample that it reaches (city-block steps through primary regions, never across
//! an edge), if that has one: the pixel's own ray meets the plane of that sample's face somewhere on the map, and the map is averaged
//! there over the pixel. On a plane this is exact wherever the sample lies; on a curved surface it is as good as the plane
//! of a face nearby.

use rayon::ThreadPool;

use super::factors::{self, Worn};
use super::{Maps, NO_FACE};
use crate::camera::View;
use crate::epi::grid::Grid;
use crate::filters::interpolate::Neighbours;
use crate::frame::Placed;
use crate::points::pixels::NO_POINT;
use crate::points::{PixelSamples, PointCache};

/// Steps counted at most: farther than samples are ever apart.
const FAR: u8 = u8::MAX;

/// Steps that are few enough not to look for a nearer sample on the other sides.
const NEAR: u8 = 3;

/// What each pixel wears; kept from frame to frame.
#[derive(Clone, Debug)]
pub struct Paint {
    grid: Grid,
    /// Slot of the point whose map a pixel wears; [`NO_POINT`] where the nearest sample has none.
    source: Vec<u32>,
    /// Steps to that sample's pixel.
    steps: Vec<u8>,
    /// Plane: the pixel wears a map.
    worn: Vec<u64>,
    /// Plane: no sample was found above or to the left within [`NEAR`] steps.
    far: Vec<u64>,
    /// What the map multiplies a worn pixel's colour by.
    factor: [Vec<f32>; 3],
}

/// What painting reads.
pub struct Inputs<'a> {
    /// The view that is drawn.
    pub view: &'a View,
    /// Each pixel's sample.
    pub samples: &'a PixelSamples,
    /// The points that they are.
    pub cache: &'a PointCache,
    /// Which neighbours reach each other.
    pub near: Neighbours<'a>,
    /// Where the objects are.
    pub placed: &'a Placed,
}

impl Paint {
    /// Room for an image of this layout.
    pub fn new(grid: Grid) -> Self {
        let plane = || vec![1.0; grid.elements()];
        Self {
            grid,
            source: vec![NO_POINT; grid.elements()],
            steps: vec![FAR; grid.elements()],
            worn: vec![0; grid.plane_words()],
            far: vec![0; grid.plane_words()],
            factor: [plane(), plane(), plane()],
        }
    }

    /// Finds the map that each pixel wears and what it multiplies the pixel's colour by, which is shared among the threads of
    /// a pool where one is given.
    pub fn find(&mut self, pool: Option<&ThreadPool>, maps: &Maps, inputs: &Inputs<'_>) {
        self.seed(inputs);
        for y in 0..self.grid.height {
            self.sweep_down(y, inputs.near);
        }
        for y in (0..self.grid.height).rev() {
            self.sweep_up(y, inputs.near);
        }
        let worn = Worn {
            grid: self.grid,
            source: &self.source,
            worn: &self.worn,
        };
        factors::fill(pool, maps, inputs, worn, &mut self.factor);
    }

    /// Multiplies the colours of the pixels that wear a map.
    pub fn apply(&self, image: &mut [Vec<f32>; 3]) {
        for (i, &worn) in self.worn.iter().enumerate() {
            let first = self.grid.at(i % self.grid.words * 64, i / self.grid.words);
            let mut left = worn;
            while left != 0 {
                let at = first + left.trailing_zeros() as usize;
                left &= left - 1;
                for (colours, factor) in image.iter_mut().zip(&self.factor) {
                    colours[at] *= factor[at];
                }
            }
        }
    }

    /// What the map multiplies the colour of the pixel with this element by; 1 where it wears none.
    #[inline]
    pub fn factor(&self, at: usize) -> [f32; 3] {
        if self.source[at] == NO_POINT {
            return [1.0; 3];
        }
        self.factor.each_ref().map(|plane| plane[at])
    }

    /// Every sample's pixel wears its map or none; the others do not know yet.
    fn seed(&mut self, inputs: &Inputs<'_>) {
        self.steps.fill(FAR);
        self.source.fill(NO_POINT);
        let (grid, samples) = (self.grid, inputs.samples);
        for (i, &has) in inputs.near.has.iter().enumerate() {
            let first = grid.at(i % grid.words * 64, i / grid.words);
            let mut left = has;
            self.worn[i] = 0;
            while left != 0 {
                let bit = left.trailing_zeros();
                left &= left - 1;
                let at = first + bit as usize;
                let slot = samples.point[at];
                self.steps[at] = 0;
                if slot != NO_POINT && inputs.cache.texel(slot).face != NO_FACE {
                    self.source[at] = slot;
                    self.worn[i] |= 1 << bit;
                }
            }
        }
    }

    /// Maps spread to the right and down, in words that some map is in or next to.
    fn sweep_down(&mut self, y: usize, near: Neighbours<'_>) {
        let words = self.grid.words;
        for word in 0..words {
            let i = y * words + word;
            let (up, left) = (y > 0, word > 0);
            let from_above = if up { near.down[i - words] } else { 0 };
            let carry = if left { near.right[i - 1] >> 63 } else { 0 };
            let from_left = near.right[i] << 1 | carry;
            let above = if up {
                self.worn[i - words] & from_above
            } else {
                0
            };
            let beside = if left {
                self.worn[i - 1] >> 63 & carry
            } else {
                0
            };
            let mut todo = self.grid.valid(word) & !near.has[i];
            self.far[i] = todo;
            if self.worn[i] | above | beside == 0 {
                continue;
            }
            todo &= from_left | from_above;
            while todo != 0 {
                let bit = todo.trailing_zeros();
                todo &= todo - 1;
                let at = self.grid.at(word * 64 + bit as usize, y);
                if from_left >> bit & 1 == 1 {
                    self.take(at, at - 1);
                }
                if from_above >> bit & 1 == 1 {
                    self.take(at, at - self.grid.stride);
                }
                self.note(at, i, bit);
            }
        }
    }

    /// Maps spread to the left and up, likewise, to pixels that know of no sample nearby.
    fn sweep_up(&mut self, y: usize, near: Neighbours<'_>) {
        let words = self.grid.words;
        for word in (0..words).rev() {
            let i = y * words + word;
            let (down, right) = (y + 1 < self.grid.height, word + 1 < words);
            let from_below = if down { near.down[i] } else { 0 };
            let below = if down {
                self.worn[i + words] & from_below
            } else {
                0
            };
            let beside = if right {
                self.worn[i + 1] & near.right[i] >> 63
            } else {
                0
            };
            if self.worn[i] | below | beside == 0 {
                continue;
            }
            let mut todo = self.far[i] & (near.right[i] | from_below);
            while todo != 0 {
                let bit = 63 - todo.leading_zeros();
                todo &= !(1 << bit);
                let at = self.grid.at(word * 64 + bit as usize, y);
                if near.right[i] >> bit & 1 == 1 {
                    self.take(at, at + 1);
                }
                if from_below >> bit & 1 == 1 {
                    self.take(at, at + self.grid.stride);
                }
                self.note(at, i, bit);
            }
        }
    }

    /// Keeps the planes of a pixel up to what it took.
    #[inline]
    fn note(&mut self, at: usize, word: usize, bit: u32) {
        let worn = u64::from(self.source[at] != NO_POINT);
        let far = u64::from(self.steps[at] > NEAR);
        self.worn[word] = self.worn[word] & !(1 << bit) | worn << bit;
        self.far[word] = self.far[word] & !(1 << bit) | far << bit;
    }

    #[inline]
    fn take(&mut self, at: usize, from: usize) {
        let steps = self.steps[from].saturating_add(1);
        if steps < self.steps[at] {
            self.steps[at] = steps;
            self.source[at] = self.source[from];
        }
    }
}
