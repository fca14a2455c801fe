//! Colours for pixels that find too few samples in their 5x5 neighbourhood: the nearest samples that can be reached on
//! foot, never across an edge.
//!
//! Far from edges [`super::open`] serves whole tiles. Near them each starved pixel, or block of 2x2 pixels that no edge
//! touches, grows the set of pixels that it reaches step by step, 64 columns in a word, until it holds enough samples.
//! Pixels that reach none in so many steps take the colour of the nearest pixel that can be reached and has one. Where an
//! edge cuts them off from all samples they take the mean of the smallest power-of-two block around them that has any:
//! wrong across the edge, but the first to be asked for.

use fearless_simd::Level;

use super::bare::fill_bare;
use super::diffuse::Neighbours;
use super::grow::{MOST, grow};
use super::interpolate::{Interpolated, SLOPE_RIDGE};
use super::open;
use crate::epi::grid::Grid;
use crate::points::PixelSamples;

/// Fewest samples to fit a plane to; fewer are averaged.
const FEWEST_FOR_A_PLANE: usize = 3;

/// The even columns of a word.
const EVEN: u64 = 0x5555_5555_5555_5555;

/// How starved pixels near edges are served.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Care {
    /// A plane through the nearest samples that can be reached, for each block or pixel: for a picture that stands still.
    Planes,
    /// The colours around flow in: a quarter of the cost, and no worse where many samples are old and about to be replaced.
    Membrane,
}

/// Scratch, kept from frame to frame.
#[derive(Clone, Debug)]
pub struct Spread {
    grid: Grid,
    left: Vec<u64>,
    edges: Vec<u64>,
    gathered: open::Gathered,
    found: Vec<u32>,
    diffusion: super::diffuse::Diffusion,
    queue: Vec<u32>,
}

impl Spread {
    /// Room for an image of this layout.
    pub fn new(grid: Grid) -> Self {
        Self {
            grid,
            left: vec![0; grid.plane_words()],
            edges: vec![0; grid.plane_words()],
            gathered: open::Gathered::default(),
            found: Vec::with_capacity(MOST),
            diffusion: super::diffuse::Diffusion::new(grid),
            queue: Vec::with_capacity(grid.width * grid.height),
        }
    }

    /// Fills in the colours of starved pixels. `wanted_x`, `wanted_y` are where in its pixel each colour is wanted.
    pub fn fill(
        &mut self,
        (level, care): (Level, Care),
        samples: &PixelSamples,
        near: Neighbours<'_>,
        (wanted_x, wanted_y): (&[f32], &[f32]),
        out: &mut Interpolated,
    ) {
        let mut left = std::mem::take(&mut self.left);
        left.copy_from_slice(&out.starved);
        for (edges, (simple, complex)) in self
            .edges
            .iter_mut()
            .zip(near.simple.iter().zip(near.complex))
        {
            *edges = simple | complex;
        }
        let planes = open::Planes {
            edges: &self.edges,
            has: near.has,
        };
        open::fill(level, samples, planes, &mut left, &mut self.gathered, out);
        if left.iter().any(|&w| w != 0) {
            match care {
                Care::Planes => {
                    self.fill_near_edges(samples, near, (wanted_x, wanted_y), &left, out);
                }
                Care::Membrane => {
                    for (left, complex) in left.iter_mut().zip(near.complex) {
                        *left &= !complex;
                    }
                    self.diffusion.fill(level, near, &left, out);
                }
            }
            if out.bare.iter().any(|&w| w != 0) {
                fill_bare(samples, near, &mut self.edges, &mut self.queue, out);
            }
        }
        self.left = left;
    }

    fn fill_near_edges(
        &mut self,
        samples: &PixelSamples,
        near: Neighbours<'_>,
        (wanted_x, wanted_y): (&[f32], &[f32]),
        starved: &[u64],
        out: &mut Interpolated,
    ) {
        let grid = self.grid;
        for y in (0..grid.height).step_by(2) {
            for word in 0..grid.words {
                let i = y * grid.words + word;
                let below = if y + 1 < grid.height {
                    i + grid.words
                } else {
                    i
                };
                let rows = [
                    starved[i] & !near.complex[i],
                    starved[below] & !near.complex[below],
                ];
                let empty = !(self.edges[i] | self.edges[below]) & grid.valid(word);
                let mut blocks = if below == i {
                    0
                } else {
                    empty & empty >> 1 & EVEN
                };
                let clean = blocks | blocks << 1;
                let any = rows[0] | rows[1];
                blocks &= any | any >> 1;
                while blocks != 0 {
                    let bit = blocks.trailing_zeros() as usize;
                    blocks &= blocks - 1;
                    self.fill_block(samples, near, (word, bit, y), rows, out);
                }
                for (row, bits) in rows
                    .into_iter()
                    .enumerate()
                    .take(1 + usize::from(below != i))
                {
                    let mut left = bits & !clean;
                    while left != 0 {
                        let x = word * 64 + left.trailing_zeros() as usize;
                        left &= left - 1;
                        let at = grid.at(x, y + row);
                        let wanted = (wanted_x[at], wanted_y[at]);
                        self.fill_pixel(samples, near, (x, y + row), wanted, out);
                    }
                }
            }
        }
    }

    /// One plane for the starved pixels of a block that no edge touches.
    fn fill_block(
        &mut self,
        samples: &PixelSamples,
        near: Neighbours<'_>,
        (word, bit, y): (usize, usize, usize),
        rows: [u64; 2],
        out: &mut Interpolated,
    ) {
        let grid = self.grid;
        let x = word * 64 + bit;
        grow(grid, near, (x, y), [3, 3], &mut self.found);
        if self.found.is_empty() {
            return;
        }
        let plane = fit(grid, samples, &self.found, [x as f32 + 1.0, y as f32 + 1.0]);
        for (row, bits) in rows.into_iter().enumerate() {
            for column in 0..2 {
                if bits >> (bit + column) & 1 == 1 {
                    let at = grid.at(x + column, y + row);
                    let rgb = plane.at([column as f32 - 0.5, row as f32 - 0.5]);
                    for (colours, value) in out.rgb.iter_mut().zip(rgb) {
                        colours[at] = value;
                    }
                    out.bare[(y + row) * grid.words + word] &= !(1 << (bit + column));
                }
            }
        }
    }

    /// A plane of its own for a starved pixel beside an edge.
    fn fill_pixel(
        &mut self,
        samples: &PixelSamples,
        near: Neighbours<'_>,
        (x, y): (usize, usize),
        wanted: (f32, f32),
        out: &mut Interpolated,
    ) {
        grow(self.grid, near, (x, y), [1, 0], &mut self.found);
        if self.found.is_empty() {
            return;
        }
        let place = [x as f32 + wanted.0, y as f32 + wanted.1];
        let plane = fit(self.grid, samples, &self.found, place);
        for (colours, value) in out.rgb.iter_mut().zip(plane.at([0.0, 0.0])) {
            colours[self.grid.at(x, y)] = value;
        }
        let (word, bit) = self.grid.bit(x, y);
        out.bare[word] &= !(1 << bit);
    }
}

/// A colour and its slopes around a place, and the range that it keeps to.
struct Plane {
    value: [f32; 3],
    right: [f32; 3],
    down: [f32; 3],
    low: [f32; 3],
    high: [f32; 3],
}

impl Plane {
    /// The colour at an offset, pixels.
    fn at(&self, [x, y]: [f32; 2]) -> [f32; 3] {
        std::array::from_fn(|k| {
            let value = self.value[k] + x * self.right[k] + y * self.down[k];
            value.max(self.low[k]).min(self.high[k])
        })
    }
}

/// Weighted plane through samples far and near, or their weighted mean where they are few; weights fall off more gently
/// than in the 5x5 neighbourhood, since all are far away.
fn fit(grid: Grid, samples: &PixelSamples, list: &[u32], wanted: [f32; 2]) -> Plane {
    let mut m = [0.0f32; 6];
    let mut c = [[0.0f32; 3]; 3];
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for &at in list {
        let at = at as usize;
        let pixel = at - grid.origin;
        let x = (pixel % grid.stride) as f32 + samples.x[at] - wanted[0];
        let y = (pixel / grid.stride) as f32 + samples.y[at] - wanted[1];
        let q = 0.25 + x * x + y * y;
        let w = samples.count[at] / (q * q);
        let moments = [w, w * x, w * y, w * x * x, w * x * y, w * y * y];
        for (sum, value) in m.iter_mut().zip(moments) {
            *sum += value;
        }
        for k in 0..3 {
            let value = samples.rgb[k][at];
            for (sum, weight) in c.iter_mut().zip([w, w * x, w * y]) {
                sum[k] += weight * value;
            }
            low[k] = low[k].min(value);
            high[k] = high[k].max(value);
        }
    }
    let inv = 1.0 / m[0];
    let mean: [f32; 3] = std::array::from_fn(|k| c[0][k] * inv);
    let level = Plane {
        value: mean,
        right: [0.0; 3],
        down: [0.0; 3],
        low,
        high,
    };
    if list.len() < FEWEST_FOR_A_PLANE {
        return level;
    }
    // Slopes by the covariances around the weighted middle; the ridge grows with the samples' distance, so that it means
    // the same at every scale.
    let (x, y) = (m[1] * inv, m[2] * inv);
    let ridge = SLOPE_RIDGE * (1.0 + (m[3] + m[5]) * inv);
    let (xx, yy) = (m[3] * inv - x * x + ridge, m[5] * inv - y * y + ridge);
    let xy = m[4] * inv - x * y;
    let determinant = 1.0 / (xx * yy - xy * xy);
    let mut plane = level;
    for k in 0..3 {
        let (cx, cy) = (c[1][k] * inv - x * mean[k], c[2][k] * inv - y * mean[k]);
        let right = (yy * cx - xy * cy) * determinant;
        let down = (xx * cy - xy * cx) * determinant;
        if right.is_finite() && down.is_finite() {
            (plane.right[k], plane.down[k]) = (right, down);
            plane.value[k] = mean[k] - right * x - down * y;
        }
    }
    plane
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(samples: &mut PixelSamples, x: usize, y: usize, value: f32) {
        let at = samples.grid.at(x, y);
        for plane in &mut samples.rgb {
            plane[at] = value;
        }
        let (word, bit) = samples.grid.bit(x, y);
        samples.has[word] |= 1 << bit;
    }

    /// Everything starved, a wall between columns `wall - 1` and `wall`.
    fn run(samples: &PixelSamples, wall: usize) -> Interpolated {
        let grid = samples.grid;
        let mut out = Interpolated::new(grid);
        let all: Vec<u64> = (0..grid.plane_words())
            .map(|i| grid.valid(i % grid.words))
            .collect();
        out.starved.copy_from_slice(&all);
        out.bare.copy_from_slice(&all);
        let mut right = all.clone();
        for y in 0..grid.height {
            let (word, bit) = grid.bit(wall - 1, y);
            right[word] &= !(1 << bit);
        }
        let complex = vec![0; grid.plane_words()];
        // Edges everywhere, so that only the flood is at work.
        let simple = all.clone();
        let near = Neighbours {
            right: &right,
            down: &all,
            simple: &simple,
            complex: &complex,
            has: &samples.has,
        };
        let middle = vec![0.5; grid.elements()];
        Spread::new(grid).fill(
            (Level::new(), Care::Planes),
            samples,
            near,
            (&middle, &middle),
            &mut out,
        );
        out
    }

    #[test]
    fn a_wall_keeps_colours_apart_wherever_they_travel() {
        let grid = Grid::new(90, 40);
        let mut samples = PixelSamples::new(grid);
        for (x, y) in (4..90)
            .step_by(9)
            .flat_map(|x| [(x, 5), (x, 15), (x, 25), (x, 35)])
        {
            set(&mut samples, x, y, if x < 70 { 1.0 } else { 0.0 });
        }
        let out = run(&samples, 70);
        for y in 0..40 {
            for x in 0..90 {
                let wanted = if x < 70 { 1.0 } else { 0.0 };
                assert!((out.rgb[0][grid.at(x, y)] - wanted).abs() < 1e-5, "{x} {y}");
            }
        }
        assert!(out.bare.iter().all(|&w| w == 0));
    }

    #[test]
    fn a_plane_of_colour_is_found_again() {
        let grid = Grid::new(40, 40);
        let mut samples = PixelSamples::new(grid);
        for (x, y) in [(5, 5), (30, 8), (12, 33), (33, 30), (20, 18), (7, 20)] {
            set(&mut samples, x, y, 0.2 + 0.01 * x as f32 + 0.005 * y as f32);
        }
        let out = run(&samples, 40);
        let worst = |x: usize, y: usize| {
            (out.rgb[1][grid.at(x, y)] - (0.2 + 0.01 * x as f32 + 0.005 * y as f32)).abs()
        };
        assert!(
            worst(18, 20) < 0.02 && worst(10, 15) < 0.02,
            "{} {}",
            worst(18, 20),
            worst(10, 15)
        );
    }

    #[test]
    fn with_no_way_to_any_sample_the_neighbourhood_decides() {
        let grid = Grid::new(10, 10);
        let mut samples = PixelSamples::new(grid);
        set(&mut samples, 9, 9, 0.5);
        let out = run(&samples, 5);
        assert_eq!(out.rgb[2][grid.at(0, 0)], 0.5);
        let empty = run(&PixelSamples::new(Grid::new(1, 9)), 1);
        assert!(empty.rgb[0].iter().all(|v| v.is_finite()));
    }
}
