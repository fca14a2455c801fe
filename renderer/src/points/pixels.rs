//! The sample that each pixel has, as the filters read it.

use crate::epi::grid::Grid;

/// Index that stands for "no point" in [`PixelSamples::point`].
pub const NO_POINT: u32 = u32::MAX;

/// At most one sample a pixel, as structure of arrays in the layout of [`Grid`]. Elements of pixels without a sample hold
/// stale but finite values.
#[derive(Clone, Debug)]
pub struct PixelSamples {
    /// The layout.
    pub grid: Grid,
    /// Plane: the pixel has a sample.
    pub has: Vec<u64>,
    /// Place in the pixel, x to the right, [0, 1).
    pub x: Vec<f32>,
    /// Place in the pixel, y down, [0, 1).
    pub y: Vec<f32>,
    /// Linear radiance, red, green, blue.
    pub rgb: [Vec<f32>; 3],
    /// How many raw samples the value is the mean of; scales its weight.
    pub count: Vec<f32>,
    /// Depth along the line of sight, metres; infinite where no point is.
    pub depth: Vec<f32>,
    /// Index of the point in the cache, or [`NO_POINT`].
    pub point: Vec<u32>,
    /// Plane: the point was not seen in the frame before, or its turn has come to be checked again.
    pub doubtful: Vec<u64>,
}

impl PixelSamples {
    /// No samples, for an image of this layout.
    pub fn new(grid: Grid) -> Self {
        let n = grid.elements();
        Self {
            grid,
            has: vec![0; grid.plane_words()],
            x: vec![0.5; n],
            y: vec![0.5; n],
            rgb: std::array::from_fn(|_| vec![0.0; n]),
            count: vec![1.0; n],
            depth: vec![f32::INFINITY; n],
            point: vec![NO_POINT; n],
            doubtful: vec![0; grid.plane_words()],
        }
    }

    /// Whether a pixel has a sample.
    #[inline]
    pub fn has_sample(&self, x: usize, y: usize) -> bool {
        let (word, bit) = self.grid.bit(x, y);
        self.has[word] >> bit & 1 == 1
    }

    /// Takes a pixel's sample away.
    #[inline]
    pub fn remove(&mut self, x: usize, y: usize) {
        let (word, bit) = self.grid.bit(x, y);
        self.has[word] &= !(1 << bit);
    }

    /// Pixels with a sample.
    pub fn visible(&self) -> usize {
        self.has.iter().map(|w| w.count_ones() as usize).sum()
    }
}
