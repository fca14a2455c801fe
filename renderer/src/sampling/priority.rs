//! How much each pixel wants a sample.
//!
//! [`Rule::MissingWeight`] is the paper's (section 5.3, after the Render Cache): what interpolation lacked.
//! [`Rule::Contrast`] also asks where the picture so far varies between pixels that no edge separates: a sample in a
//! smooth place says little that its neighbours have not said.

use fearless_simd::{Level, dispatch, prelude::*};
use fearless_simd_macros::simd;

use crate::epi::grid::Grid;
use crate::filters::taps::{INNER, OFFSETS, Reach};

/// How priorities are made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rule {
    /// Inverse to the weight that interpolation found.
    MissingWeight,
    /// Local contrast over that weight.
    #[default]
    Contrast,
}

/// Contrast that every pixel is taken to have at least: a fraction of a display step (1/255).
const LEAST_CONTRAST: f32 = 0.001;

/// Added to weights, in units of [`crate::filters::interpolate::weight`]: about one sample at a distance of one pixel.
const WEIGHT_FLOOR: f32 = 0.5;

/// What priorities are made from; arrays by [`Grid`].
pub struct Inputs<'a, R> {
    /// The layout.
    pub grid: Grid,
    /// Reconstructed linear radiance of primary regions.
    pub rgb: &'a [Vec<f32>; 3],
    /// Sum of interpolation weights.
    pub weight: &'a [f32],
    /// Which primary regions reach which.
    pub reach: &'a R,
    /// Plane of complex pixels.
    pub complex: &'a [u64],
}

/// Priorities and the rows that they are made through.
#[derive(Clone, Debug)]
pub struct Priorities {
    /// What each pixel wants, by [`Grid`]; 0 to infinity, finite.
    pub priority: Vec<f32>,
    rows: Rows,
}

/// Room beside each row, so that loads a pixel or two away stay inside.
const MARGIN: usize = 64;

/// The few rows that are in work, so that they stay in the nearest memory.
#[derive(Clone, Debug)]
struct Rows {
    /// Red, green and blue of the rows above, here and below, row y in place y % 3.
    encoded: [Vec<f32>; 9],
    /// Contrast in one row; 0 in the margins.
    contrast: Vec<f32>,
    /// Contrast summed over five pixels of a row, row y in place y % 5; 0 outside the image.
    sums: [Vec<f32>; 5],
}

impl Priorities {
    /// Room for an image of this layout.
    pub fn new(grid: Grid) -> Self {
        let pitch = grid.stride + 2 * MARGIN;
        let rows = Rows {
            encoded: std::array::from_fn(|_| vec![0.0; pitch]),
            contrast: vec![0.0; pitch],
            sums: std::array::from_fn(|_| vec![0.0; grid.stride]),
        };
        Self {
            priority: vec![0.0; grid.elements()],
            rows,
        }
    }

    /// Computes [`Priorities::priority`]. Results do not depend on `level`.
    pub fn compute<R: Reach>(&mut self, level: Level, rule: Rule, inputs: &Inputs<'_, R>) {
        match rule {
            Rule::MissingWeight => {
                for (p, w) in self.priority.iter_mut().zip(inputs.weight) {
                    *p = 1.0 / (w + WEIGHT_FLOOR);
                }
            }
            Rule::Contrast => {
                let Self { priority, rows } = self;
                dispatch!(level, simd => from_contrast(simd, inputs, rows, priority));
            }
        }
    }
}

/// Row by row: encoded one ahead of the contrast, which is blurred two behind.
#[simd]
fn from_contrast<S: Simd, R: Reach>(
    simd: S,
    inputs: &Inputs<'_, R>,
    rows: &mut Rows,
    priority: &mut [f32],
) {
    let grid = inputs.grid;
    rows.sums.iter_mut().for_each(|row| row.fill(0.0));
    encode_row(simd, inputs.rgb, grid, 0, rows);
    for y in 0..grid.height + 2 {
        if y + 1 < grid.height {
            encode_row(simd, inputs.rgb, grid, y + 1, rows);
        }
        if y < grid.height {
            for word in 0..grid.words {
                contrast_word(simd, inputs, (word, y), rows);
            }
            sum_row(simd, &rows.contrast, &mut rows.sums[y % 5]);
        } else {
            rows.sums[y % 5].fill(0.0);
        }
        if y >= 2 {
            let row = grid.at(0, y - 2)..grid.at(0, y - 1);
            let weight = &inputs.weight[row.clone()];
            finish_row(simd, &rows.sums, weight, &mut priority[row]);
        }
    }
}

/// Linear to about what a display shows: the square root, clamped.
#[inline(always)]
fn encode_row<S: Simd>(simd: S, rgb: &[Vec<f32>; 3], grid: Grid, y: usize, rows: &mut Rows) {
    let lanes = S::f32s::LEN;
    let (zero, one) = (S::f32s::splat(simd, 0.0), S::f32s::splat(simd, 1.0));
    for (c, plane) in rgb.iter().enumerate() {
        let from = &plane[grid.at(0, y)..][..grid.stride];
        let to = &mut rows.encoded[3 * (y % 3) + c][MARGIN..][..grid.stride];
        for x in (0..grid.stride).step_by(lanes) {
            let v = S::f32s::from_slice(simd, &from[x..x + lanes]);
            let clamped = v.max(zero).min(one).sqrt();
            clamped.store_slice(&mut to[x..x + lanes]);
        }
    }
}

/// Greatest difference of any channel to the 8 neighbours that no edge separates; complex pixels count all of them.
#[inline(always)]
fn contrast_word<S: Simd, R: Reach>(
    simd: S,
    inputs: &Inputs<'_, R>,
    (word, y): (usize, usize),
    rows: &mut Rows,
) {
    let grid = inputs.grid;
    let open = inputs.complex[y * grid.words + word];
    let inside = |(dx, dy): (i32, i32)| {
        let row = y
            .checked_add_signed(dy as isize)
            .is_some_and(|r| r < grid.height);
        let valid = grid.valid(word);
        let columns = match dx {
            0 => valid,
            1 if grid.width <= (word + 1) * 64 => valid >> 1,
            -1 if word == 0 => valid & !1,
            _ => valid,
        };
        if row { columns } else { 0 }
    };
    let mut masks = [0u64; INNER];
    for (mask, &offset) in masks.iter_mut().zip(&OFFSETS).skip(1) {
        *mask = (inputs.reach.reachable(offset, word, y) | open) & inside(offset);
    }
    let lanes = S::f32s::LEN;
    let first = MARGIN + word * 64;
    let zero = S::f32s::splat(simd, 0.0);
    // The rows above, here and below.
    let [above, level, below] = [y + 2, y, y + 1].map(|y| 3 * (y % 3));
    let three = [above, level, below].map(|place| &rows.encoded[place..place + 3]);
    let contrast = &mut rows.contrast[first..first + 64];
    for group in (0..64).step_by(lanes) {
        let here: [S::f32s; 3] = std::array::from_fn(|c| {
            let at = first + group;
            S::f32s::from_slice(simd, &three[1][c][at..at + lanes])
        });
        let mut most = zero;
        for (mask, &(dx, dy)) in masks.iter().zip(&OFFSETS).skip(1) {
            let bits = mask >> group & ((1u64 << lanes) - 1);
            if bits == 0 {
                continue;
            }
            let at = (first + group).wrapping_add_signed(dx as isize);
            let there = three[(dy + 1) as usize];
            let mut step = zero;
            for c in 0..3 {
                let value = S::f32s::from_slice(simd, &there[c][at..at + lanes]);
                step = step.max((here[c] - value).abs());
            }
            let counted = S::mask32s::from_bitmask(simd, bits);
            most = most.max(counted.select(step, zero));
        }
        most.store_slice(&mut contrast[group..group + lanes]);
    }
}

/// Sums over five pixels, of a row with margins.
#[inline(always)]
fn sum_row<S: Simd>(simd: S, contrast: &[f32], sums: &mut [f32]) {
    let lanes = S::f32s::LEN;
    for x in (0..sums.len()).step_by(lanes) {
        let from = &contrast[MARGIN + x - 2..][..lanes + 4];
        let mut sum = S::f32s::from_slice(simd, &from[..lanes]);
        for k in 1..5 {
            sum += S::f32s::from_slice(simd, &from[k..k + lanes]);
        }
        sum.store_slice(&mut sums[x..x + lanes]);
    }
}

/// Mean contrast over 5x5 (pixels outside the image count as zeros) over weight.
#[inline(always)]
fn finish_row<S: Simd>(simd: S, sums: &[Vec<f32>; 5], weight: &[f32], priority: &mut [f32]) {
    let lanes = S::f32s::LEN;
    let share = S::f32s::splat(simd, 1.0 / 25.0);
    let least = S::f32s::splat(simd, LEAST_CONTRAST);
    let floor = S::f32s::splat(simd, WEIGHT_FLOOR);
    for x in (0..priority.len()).step_by(lanes) {
        let mut sum = S::f32s::from_slice(simd, &sums[0][x..x + lanes]);
        for row in &sums[1..] {
            sum += S::f32s::from_slice(simd, &row[x..x + lanes]);
        }
        let weight = S::f32s::from_slice(simd, &weight[x..x + lanes]);
        let wanted = (sum * share + least) / (weight + floor);
        wanted.store_slice(&mut priority[x..x + lanes]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every pixel reaches every other but across the line x = 4.
    struct Wall(Grid);

    impl Reach for Wall {
        fn reachable(&self, (dx, dy): (i32, i32), word: usize, y: usize) -> u64 {
            (0..64).fold(0, |bits, k| {
                let x = (word * 64 + k) as i32;
                let (tx, ty) = (x + dx, y as i32 + dy);
                let inside = (0..self.0.width as i32).contains(&tx)
                    && (0..self.0.height as i32).contains(&ty);
                bits | u64::from(inside && (x < 4) == (tx < 4)) << k
            })
        }
    }

    #[test]
    fn a_step_counts_unless_an_edge_explains_it() {
        let grid = Grid::new(9, 7);
        let mut rgb: [Vec<f32>; 3] = std::array::from_fn(|_| vec![0.0; grid.elements()]);
        for y in 0..7 {
            for x in 4..9 {
                rgb[1][grid.at(x, y)] = if x < 7 { 1.0 } else { 0.25 };
            }
        }
        let weight = vec![1.0; grid.elements()];
        let complex = vec![0; grid.plane_words()];
        let reach = Wall(grid);
        let inputs = Inputs {
            grid,
            rgb: &rgb,
            weight: &weight,
            reach: &reach,
            complex: &complex,
        };
        for level in [Level::new(), Level::baseline()] {
            let mut p = Priorities::new(grid);
            p.compute(level, Rule::Contrast, &inputs);
            // Weights are 1: the 5x5 mean of 0.5 in columns 6 and 7.
            let mean = |columns: f32, rows: f32| 0.5 * columns * rows / 25.0 + LEAST_CONTRAST;
            let wanted: [f32; 9] = [0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 2.0, 2.0, 2.0];
            for (x, columns) in wanted.into_iter().enumerate() {
                for (y, rows) in [3.0, 4.0, 5.0, 5.0, 5.0, 4.0, 3.0].into_iter().enumerate() {
                    let priority = p.priority[grid.at(x, y)] * (1.0 + WEIGHT_FLOOR);
                    assert!(
                        (priority - mean(columns, rows)).abs() < 1e-6,
                        "{x} {y}: {priority}"
                    );
                }
            }
            assert!(p.priority[grid.at(6, 3)] > p.priority[grid.at(1, 3)] * 50.0);
        }
    }
}
