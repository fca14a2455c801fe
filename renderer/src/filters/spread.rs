//! Colours for pixels that find too few samples in their 5x5 neighbourhood: samples are handed on from pixel to pixel,
//! never across an edge, until each such pixel knows the few nearest.
//!
//! A breadth-first flood of all samples at once: each pixel keeps the first [`NEAREST`] that reach it, so that the work
//! is in proportion to the pixels that need it. Pixels that nothing reaches take the mean of the smallest
//! power-of-two block around them that has samples, edges or not: wrong across an edge, but the first to be asked for.

use fearless_simd::Level;

use super::interpolate::{Interpolated, SLOPE_RIDGE};
use super::open;
use crate::epi::grid::Grid;
use crate::points::PixelSamples;

/// Samples that a pixel collects.
pub const NEAREST: usize = 6;

/// Fewest samples to fit a plane to; fewer are averaged.
const FEWEST_FOR_A_PLANE: usize = 3;

/// Primary-to-primary reachability of direct neighbours, as bit planes.
#[derive(Clone, Copy)]
pub struct Neighbours<'a> {
    /// To the pixel at x + 1.
    pub right: &'a [u64],
    /// To the pixel at y + 1.
    pub down: &'a [u64],
    /// Simple pixels.
    pub simple: &'a [u64],
    /// Complex pixels: nothing passes.
    pub complex: &'a [u64],
    /// Pixels whose sample may be used.
    pub has: &'a [u64],
}

/// Scratch of the flood, kept from frame to frame.
#[derive(Clone, Debug)]
pub struct Spread {
    grid: Grid,
    lists: Vec<[u32; NEAREST]>,
    counts: Vec<u8>,
    area: Vec<u64>,
    rows: Vec<u64>,
    queue: Vec<(u32, u32)>,
    blocks: Blocks,
    left: Vec<u64>,
    edges: Vec<u64>,
    gathered: open::Gathered,
}

impl Spread {
    /// Room for an image of this layout.
    pub fn new(grid: Grid) -> Self {
        Self {
            grid,
            lists: vec![[0; NEAREST]; grid.elements()],
            counts: vec![0; grid.elements()],
            area: vec![0; grid.plane_words()],
            rows: vec![0; grid.plane_words()],
            queue: Vec::new(),
            blocks: Blocks::default(),
            left: vec![0; grid.plane_words()],
            edges: vec![0; grid.plane_words()],
            gathered: open::Gathered::default(),
        }
    }

    /// Fills in the colours of starved pixels. `wanted_x`, `wanted_y` are where in its pixel each colour is wanted.
    pub fn fill(
        &mut self,
        level: Level,
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
            self.fill_near_edges(samples, near, (wanted_x, wanted_y), &left, out);
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
        self.find_area(starved, near.complex);
        self.flood(near);
        let grid = self.grid;
        let mut lost = false;
        for y in 0..grid.height {
            for word in 0..grid.words {
                let i = y * grid.words + word;
                let mut left = starved[i] & !near.complex[i];
                while left != 0 {
                    let bit = left.trailing_zeros() as usize;
                    left &= left - 1;
                    let (x, at) = (word * 64 + bit, grid.at(word * 64 + bit, y));
                    let list = &self.lists[at][..usize::from(self.counts[at])];
                    if list.is_empty() {
                        lost |= out.bare[i] >> bit & 1 == 1;
                        continue;
                    }
                    let wanted = [x as f32 + wanted_x[at], y as f32 + wanted_y[at]];
                    let rgb = fit(grid, samples, list, wanted);
                    for (plane, value) in out.rgb.iter_mut().zip(rgb) {
                        plane[at] = value;
                    }
                    out.bare[i] &= !(1 << bit);
                }
                lost |= out.bare[i] & near.complex[i] != 0;
            }
        }
        if lost {
            self.blocks.fill(samples, out);
        }
    }

    /// Pixels that samples pass through: the starved and all within two pixels of them, but no complex ones.
    fn find_area(&mut self, starved: &[u64], complex: &[u64]) {
        let (words, height) = (self.grid.words, self.grid.height);
        for y in 0..height {
            for word in 0..words {
                let near =
                    (-2..=2).map(|dx| super::taps::shifted(starved, words, word, y, (dx, 0)));
                self.rows[y * words + word] = near.fold(0, |a, b| a | b);
            }
        }
        for y in 0..height {
            for word in 0..words {
                let near =
                    (-2..=2).map(|dy| super::taps::shifted(&self.rows, words, word, y, (0, dy)));
                let i = y * words + word;
                self.area[i] = near.fold(0, |a, b| a | b) & self.grid.valid(word) & !complex[i];
            }
        }
    }

    fn flood(&mut self, near: Neighbours<'_>) {
        let grid = self.grid;
        self.queue.clear();
        self.counts.fill(0);
        for y in 0..grid.height {
            for word in 0..grid.words {
                let i = y * grid.words + word;
                let mut seeds = near.has[i] & self.area[i];
                while seeds != 0 {
                    let at = grid.at(word * 64 + seeds.trailing_zeros() as usize, y) as u32;
                    seeds &= seeds - 1;
                    self.offer(at, at);
                }
            }
        }
        let mut next = 0;
        while let Some(&(at, sample)) = self.queue.get(next) {
            next += 1;
            let pixel = at as usize - grid.origin;
            let (x, y) = (pixel % grid.stride, pixel / grid.stride);
            let stride = grid.stride as u32;
            // A step to the left or up is the neighbour's step to the right or down.
            let steps = [
                (x + 1 < grid.width)
                    .then(|| (at + 1, grid.bit(x + 1, y), near.right, grid.bit(x, y))),
                (x > 0).then(|| (at - 1, grid.bit(x - 1, y), near.right, grid.bit(x - 1, y))),
                (y + 1 < grid.height)
                    .then(|| (at + stride, grid.bit(x, y + 1), near.down, grid.bit(x, y))),
                (y > 0).then(|| {
                    (
                        at - stride,
                        grid.bit(x, y - 1),
                        near.down,
                        grid.bit(x, y - 1),
                    )
                }),
            ];
            for (to, to_bit, plane, step_bit) in steps.into_iter().flatten() {
                if self.area[to_bit.0] >> to_bit.1 & plane[step_bit.0] >> step_bit.1 & 1 == 1 {
                    self.offer(to, sample);
                }
            }
        }
    }

    #[inline]
    fn offer(&mut self, at: u32, sample: u32) {
        let i = at as usize;
        let count = usize::from(self.counts[i]);
        if count < NEAREST && !self.lists[i][..count].contains(&sample) {
            self.lists[i][count] = sample;
            self.counts[i] += 1;
            self.queue.push((at, sample));
        }
    }
}

/// Weighted plane through samples far and near, or their weighted mean where they are few; weights fall off more gently
/// than in the 5x5 neighbourhood, since all are far away.
fn fit(grid: Grid, samples: &PixelSamples, list: &[u32], wanted: [f32; 2]) -> [f32; 3] {
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
    if list.len() < FEWEST_FOR_A_PLANE {
        return mean;
    }
    let (x, y, xy) = (m[1] * inv, m[2] * inv, m[4] * inv);
    // The ridge grows with the samples' distance, so that it means the same at every scale.
    let ridge = SLOPE_RIDGE * (1.0 + (m[3] + m[5]) * inv);
    let (xx, yy) = (m[3] * inv + ridge, m[5] * inv + ridge);
    let (k0, kx, ky) = (xx * yy - xy * xy, y * xy - x * yy, x * xy - y * xx);
    let scale = inv / (k0 + x * kx + y * ky);
    std::array::from_fn(|k| {
        let value = (k0 * c[0][k] + kx * c[1][k] + ky * c[2][k]) * scale;
        if value.is_finite() {
            value.max(low[k]).min(high[k])
        } else {
            mean[k]
        }
    })
}

/// Means of samples over blocks of 2, 4, 8 ... pixels squared.
#[derive(Clone, Debug, Default)]
struct Blocks {
    levels: Vec<(usize, Vec<[f32; 4]>)>,
}

impl Blocks {
    fn fill(&mut self, samples: &PixelSamples, out: &mut Interpolated) {
        let grid = samples.grid;
        self.build(samples);
        for y in 0..grid.height {
            for word in 0..grid.words {
                let mut left = out.bare[y * grid.words + word];
                while left != 0 {
                    let x = word * 64 + left.trailing_zeros() as usize;
                    left &= left - 1;
                    let block =
                        self.levels
                            .iter()
                            .enumerate()
                            .find_map(|(level, (columns, cells))| {
                                let cell = cells[(y >> (level + 1)) * columns + (x >> (level + 1))];
                                (cell[3] > 0.0).then_some(cell)
                            });
                    if let Some(cell) = block {
                        for (plane, sum) in out.rgb.iter_mut().zip(cell) {
                            plane[grid.at(x, y)] = sum / cell[3];
                        }
                    }
                }
            }
        }
    }

    fn build(&mut self, samples: &PixelSamples) {
        let grid = samples.grid;
        let (mut columns, mut rows) = (grid.width, grid.height);
        let mut level = 0;
        while columns > 1 || rows > 1 {
            let below = columns;
            let (rows_below, columns_below) = (rows, columns);
            (columns, rows) = (columns.div_ceil(2), rows.div_ceil(2));
            if self.levels.len() == level {
                self.levels.push((columns, Vec::new()));
            }
            let (done, rest) = self.levels.split_at_mut(level);
            let (stride, cells) = &mut rest[0];
            *stride = columns;
            cells.clear();
            cells.resize(columns * rows, [0.0; 4]);
            for y in 0..rows_below {
                for x in 0..columns_below {
                    let from = match done.last() {
                        None if samples.has_sample(x, y) => {
                            let at = grid.at(x, y);
                            [
                                samples.rgb[0][at],
                                samples.rgb[1][at],
                                samples.rgb[2][at],
                                1.0,
                            ]
                        }
                        None => continue,
                        Some((_, cells)) => cells[y * below + x],
                    };
                    let cell = &mut cells[y / 2 * columns + x / 2];
                    for (sum, value) in cell.iter_mut().zip(from) {
                        *sum += value;
                    }
                }
            }
            level += 1;
        }
    }
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
        Spread::new(grid).fill(Level::new(), samples, near, (&middle, &middle), &mut out);
        out
    }

    #[test]
    fn a_wall_keeps_colours_apart_however_far_they_travel() {
        let grid = Grid::new(90, 40);
        let mut samples = PixelSamples::new(grid);
        set(&mut samples, 2, 3, 1.0);
        set(&mut samples, 80, 30, 0.0);
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
