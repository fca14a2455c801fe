//! The filter for complex pixels (paper section 5.4).
//!
//! The crossings with the lines through the middle of each pixel cut the 3x3 neighbourhood of a complex pixel into 6x6
//! sub-pixels. Edges are reconstructed in these as in pixels, and each region of the pixel's own four sub-pixels is
//! interpolated from what it reaches. What stays complex or reaches nothing keeps the estimate that ignored edges.
//!
//! The paper interpolates from samples alone. Few complex pixels have one within reach when samples are sparse, but
//! their neighbours have been reconstructed from twenty-five pixels each: a neighbour that is not complex lends its
//! colour to the sub-pixels at the corners of its primary region.

mod subpixels;
mod tables;

use crate::edges::crossings::Crossings;
use crate::epi::Epi;
use crate::epi::grid::Grid;
use crate::maps::paint::Paint;
use crate::points::PixelSamples;
use subpixels::{Subpixels, WINDOWS, at_corner, bits};
use tables::{PIXEL_OF, SubTables};

/// Where the colours of sub-pixels come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Sources {
    /// The paper's: samples within reach.
    Samples,
    /// Samples and the colours of neighbours that are not complex.
    #[default]
    SamplesAndNeighbours,
}

/// What the filter reads.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    /// Classes and primary regions of pixels.
    pub epi: &'a Epi,
    /// Crossings, half boundaries included.
    pub crossings: &'a Crossings,
    /// Samples of this frame.
    pub samples: &'a PixelSamples,
    /// Bit plane: the pixel's colour is not founded on samples and must not be lent.
    pub bare: &'a [u64],
    /// Maps that samples were shaded without and pixels wear.
    pub paint: Option<&'a Paint>,
    /// What may be interpolated.
    pub sources: Sources,
}

/// What became of the regions of the complex pixels' sub-pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Complex pixels.
    pub pixels: usize,
    /// Regions with a colour of their own.
    pub interpolated: usize,
    /// Regions that kept the pixel's estimate.
    pub kept: usize,
}

/// Weight of a neighbour's colour against a sample's at the same distance, being a mean of samples already. The error is
/// the same from 0.01 to 2 (a test checks it): what counts is that there is a colour at all.
const LENT_WEIGHT: f32 = 0.25;

/// The filter and its tables.
#[derive(Clone, Debug)]
pub struct ComplexFilter {
    tables: SubTables,
    lent_weight: f32,
}

impl Default for ComplexFilter {
    fn default() -> Self {
        Self {
            tables: SubTables::default(),
            lent_weight: LENT_WEIGHT,
        }
    }
}

/// What the sub-pixels of a neighbourhood can be interpolated from. Pixels are numbered row by row.
struct Seeds {
    /// Regions (outer, inner) that hold a sample.
    sampled: [u64; 2],
    /// Regions that hold a corner of the primary region of a pixel with a colour to lend.
    lent: [u64; 2],
    /// Colours of the nine pixels' samples, where there are any that count.
    of_samples: [[f32; 3]; 9],
    /// Colours that the nine pixels lend, where they do.
    to_lend: [[f32; 3]; 9],
}

impl ComplexFilter {
    /// Reconstructs every complex pixel in place. `colours` (element arrays, linear radiance) hold the estimates of
    /// complex pixels and the primary regions' colours of all others; no other pixel is written.
    pub fn apply(&self, inputs: &Inputs, colours: &mut [Vec<f32>; 3]) -> Outcome {
        let grid = inputs.epi.grid;
        let mut outcome = Outcome::default();
        for (i, &complex) in inputs.epi.complex.iter().enumerate() {
            let (y, first) = (i / grid.words, i % grid.words * 64);
            for x in bits(complex).map(|bit| first + bit) {
                outcome.pixels += 1;
                let rgb = self.pixel(inputs, colours, (x, y), &mut outcome);
                for (plane, value) in colours.iter_mut().zip(rgb) {
                    plane[grid.at(x, y)] = value;
                }
            }
        }
        outcome
    }

    fn pixel(
        &self,
        inputs: &Inputs,
        colours: &[Vec<f32>; 3],
        place: (usize, usize),
        outcome: &mut Outcome,
    ) -> [f32; 3] {
        let at = inputs.epi.grid.at(place.0, place.1);
        let estimate = colours.each_ref().map(|plane| plane[at]);
        let sub = Subpixels::load(inputs.crossings, place);
        let seeds = self.seeds(inputs, colours, &sub, place);
        if seeds.sampled == [0; 2] && seeds.lent == [0; 2] {
            outcome.kept += 4;
            return estimate;
        }
        let mut sum = [0.0f32; 3];
        for (index, window) in WINDOWS.iter().enumerate() {
            let inner_area = self.tables.inner_area(&sub, window.centre);
            for (region, area) in [1.0 - inner_area, inner_area].into_iter().enumerate() {
                if area == 0.0 {
                    continue;
                }
                let colour = if sub.is_open(window.centre) {
                    let reached = sub.reach(window, region);
                    self.interpolate(&seeds, index, reached)
                } else {
                    None
                };
                outcome.interpolated += usize::from(colour.is_some());
                outcome.kept += usize::from(colour.is_none());
                let colour = colour.unwrap_or(estimate);
                sum = std::array::from_fn(|k| sum[k] + area * colour[k]);
            }
        }
        sum.map(|c| c * 0.25)
    }

    fn seeds(
        &self,
        inputs: &Inputs,
        colours: &[Vec<f32>; 3],
        sub: &Subpixels,
        place: (usize, usize),
    ) -> Seeds {
        let (epi, grid) = (inputs.epi, inputs.epi.grid);
        let around = |plane: &[u64]| neighbourhood(grid, plane, place);
        // Where the image ends this is an element of the margin, which is not read.
        let first = grid.at(place.0, place.1) - grid.stride - 1;
        let at = |pixel: usize| first + pixel / 3 * grid.stride + pixel % 3;
        let mut seeds = Seeds {
            sampled: [0; 2],
            lent: [0; 2],
            of_samples: [[0.0; 3]; 9],
            to_lend: [[0.0; 3]; 9],
        };
        for pixel in bits(u64::from(around(&inputs.samples.has))) {
            let at = at(pixel);
            let offset = [inputs.samples.x[at], inputs.samples.y[at]];
            if let Some((bit, region)) = self.tables.locate(sub, (pixel % 3, pixel / 3), offset) {
                seeds.sampled[region] |= bit;
                let factor = inputs.paint.map_or([1.0; 3], |paint| paint.factor(at));
                seeds.of_samples[pixel] =
                    std::array::from_fn(|k| inputs.samples.rgb[k][at] * factor[k]);
            }
        }
        if inputs.sources == Sources::SamplesAndNeighbours {
            let lends = !(around(&epi.complex) | around(inputs.bare)) & 0x1ff;
            for (corner, secondary) in epi.corner.iter().enumerate() {
                // The sub-pixel at a corner of the pixel has that corner at the same place.
                let subpixels = at_corner(lends & !around(secondary), corner);
                let [outer, inner] = sub.corner_regions(subpixels, corner);
                seeds.lent[0] |= outer;
                seeds.lent[1] |= inner;
            }
            for pixel in bits(u64::from(lends)) {
                let at = at(pixel);
                seeds.to_lend[pixel] = colours.each_ref().map(|plane| plane[at]);
            }
        }
        seeds
    }

    /// Mean of the seeds that a region of the pixel's own sub-pixel of this number reaches.
    #[inline]
    fn interpolate(&self, seeds: &Seeds, window: usize, reached: [u64; 2]) -> Option<[f32; 3]> {
        let mut total = 0.0;
        let mut sum = [0.0f32; 3];
        let weights = self.tables.weights(window);
        let both = |seeds: [u64; 2]| bits(reached[0] & seeds[0] | reached[1] & seeds[1]);
        let mut add = |bit: usize, scale: f32, colours: &[[f32; 3]; 9]| {
            let weight = scale * weights[bit & 63];
            let colour = &colours[usize::from(PIXEL_OF[bit & 63])];
            total += weight;
            sum = std::array::from_fn(|k| sum[k] + weight * colour[k]);
        };
        both(seeds.sampled).for_each(|bit| add(bit, 1.0, &seeds.of_samples));
        both(seeds.lent).for_each(|bit| add(bit, self.lent_weight, &seeds.to_lend));
        (total > 0.0).then(|| sum.map(|c| c / total))
    }
}

/// Bits of the 3x3 pixels around one, row by row; 0 outside the image.
#[inline(always)]
fn neighbourhood(grid: Grid, plane: &[u64], (x, y): (usize, usize)) -> u32 {
    let (word, bit) = (x / 64, x % 64);
    if !(1..63).contains(&bit) || y == 0 || y + 1 >= grid.height {
        return neighbourhood_at_seam(grid, plane, (x, y));
    }
    let row = |y: usize| (plane[y * grid.words + word] >> (bit - 1)) as u32 & 7;
    row(y - 1) | row(y) << 3 | row(y + 1) << 6
}

/// The same where words or rows end.
#[cold]
fn neighbourhood_at_seam(grid: Grid, plane: &[u64], (x, y): (usize, usize)) -> u32 {
    let inside = |x: usize, y: usize| x < grid.width && y < grid.height;
    let mut around = 0;
    for pixel in 0..9 {
        let (x, y) = (
            (x + pixel % 3).wrapping_sub(1),
            (y + pixel / 3).wrapping_sub(1),
        );
        if inside(x, y) {
            let (word, bit) = grid.bit(x, y);
            around |= ((plane[word] >> bit & 1) as u32) << pixel;
        }
    }
    around
}

#[cfg(test)]
mod tests;
