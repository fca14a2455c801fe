//! Constrained interpolation: each pixel's primary region from the samples around it that no edge separates from it
//! (paper section 5.3).
//!
//! Two methods. [`Method::FixedWeights`] is the paper's: a weight an offset, renormalised over what is reachable (the
//! paper's own weights are in a lost figure; any sharply peaked set does). [`Method::LinearFit`] knows where in its
//! pixel each sample lies and fits a plane to them. Both work on blocks of pixels (`blocks`).

use fearless_simd::{Level, dispatch};
use rayon::ThreadPool;
use rayon::prelude::*;

use super::bare::fill_bare;
use super::blocks::{Worker, reconstruct};
use super::fit::BLOCK;
use crate::epi::grid::Grid;
use crate::points::PixelSamples;

/// How samples become a colour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// The paper's: weights by pixel distance alone.
    FixedWeights,
    /// Weighted least-squares plane through the samples at their true places, kept to their range.
    #[default]
    LinearFit,
}

/// Weight of a sample at squared distance `d2` pixels²: (1/4 + d²)⁻³, sharply peaked.
#[inline]
pub fn weight(d2: f32) -> f32 {
    let q = 0.25 + d2;
    1.0 / (q * q * q)
}

/// Which direct neighbours no edge separates, and what is in the pixels; bit planes.
#[derive(Clone, Copy)]
pub struct Neighbours<'a> {
    /// Primary regions reach that of the pixel at x + 1.
    pub right: &'a [u64],
    /// Primary regions reach that of the pixel at y + 1.
    pub down: &'a [u64],
    /// Simple pixels.
    pub simple: &'a [u64],
    /// Complex pixels: nothing passes.
    pub complex: &'a [u64],
    /// Pixels whose sample may be used: it surely lies in the primary region.
    pub has: &'a [u64],
}

/// What interpolation reads.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    /// How samples become a colour.
    pub method: Method,
    /// Samples a pixel.
    pub samples: &'a PixelSamples,
    /// Which of them may be used where.
    pub near: Neighbours<'a>,
    /// Where in its pixel each primary region's middle lies, x, by [`Grid`]: where the colour is wanted.
    pub centre_x: &'a [f32],
    /// The same, y.
    pub centre_y: &'a [f32],
}

/// Colours and how well they are founded, by [`Grid`].
#[derive(Clone, Debug)]
pub struct Interpolated {
    /// Linear radiance of primary regions.
    pub rgb: [Vec<f32>; 3],
    /// Sum of weights before renormalising.
    pub weight: Vec<f32>,
    /// Plane: no sample was reachable; the colour is borrowed.
    pub bare: Vec<u64>,
}

impl Interpolated {
    /// Room for an image of this layout.
    pub fn new(grid: Grid) -> Self {
        let plane = || vec![0.0; grid.elements()];
        Self {
            rgb: [plane(), plane(), plane()],
            weight: plane(),
            bare: vec![0; grid.plane_words()],
        }
    }
}

/// Some rows of [`Interpolated`].
pub(super) struct Rows<'a> {
    /// The first of them.
    pub(super) top: usize,
    pub(super) rgb: [&'a mut [f32]; 3],
    pub(super) weight: &'a mut [f32],
    pub(super) bare: &'a mut [u64],
}

/// Interpolation and its scratch, kept from frame to frame.
#[derive(Clone, Debug)]
pub struct Interpolator {
    grid: Grid,
    workers: Vec<Worker>,
    left: Vec<u64>,
    queue: Vec<u32>,
}

impl Interpolator {
    /// Room for images of this layout.
    pub fn new(grid: Grid) -> Self {
        Self {
            grid,
            workers: vec![Worker::new(grid)],
            left: vec![0; grid.plane_words()],
            queue: Vec::with_capacity(grid.width * grid.height),
        }
    }

    /// Reconstructs every pixel's primary region, rows shared among the threads of a pool where one is given. Results do
    /// not depend on `level` or threads.
    pub fn interpolate(
        &mut self,
        level: Level,
        pool: Option<&ThreadPool>,
        inputs: &Inputs<'_>,
        out: &mut Interpolated,
    ) {
        let grid = self.grid;
        let parts = pool.map_or(1, |pool| 4 * pool.current_num_threads());
        self.workers.resize_with(parts, || Worker::new(grid));
        let rows = grid.height.div_ceil(BLOCK * parts) * BLOCK;
        let elements = grid.origin..grid.origin + grid.height * grid.stride;
        let [red, green, blue] = &mut out.rgb;
        let planes = [red, green, blue, &mut out.weight];
        let [red, green, blue, weight] = planes.map(|plane| &mut plane[elements.clone()]);
        let run = |worker: &mut Worker, mut rows: Rows<'_>| {
            dispatch!(level, simd => reconstruct(simd, inputs, worker, &mut rows));
        };
        match pool {
            None => run(
                &mut self.workers[0],
                Rows {
                    top: 0,
                    rgb: [red, green, blue],
                    weight,
                    bare: &mut out.bare,
                },
            ),
            Some(pool) => pool.install(|| {
                let n = rows * grid.stride;
                let colours = red
                    .par_chunks_mut(n)
                    .zip(green.par_chunks_mut(n))
                    .zip(blue.par_chunks_mut(n));
                let planes = weight
                    .par_chunks_mut(n)
                    .zip(out.bare.par_chunks_mut(rows * grid.words));
                let parts = colours.zip(planes).zip(&mut self.workers).enumerate();
                parts.for_each(|(part, ((((red, green), blue), (weight, bare)), worker))| {
                    let top = part * rows;
                    let rgb = [red, green, blue];
                    run(
                        worker,
                        Rows {
                            top,
                            rgb,
                            weight,
                            bare,
                        },
                    );
                });
            }),
        }
        if out.bare.iter().any(|&w| w != 0) {
            fill_bare(
                inputs.samples,
                inputs.near,
                &mut self.left,
                &mut self.queue,
                out,
            );
        }
    }
}

#[cfg(test)]
mod tests;
