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

/// The few rows that are in work, so that they stay in the nearest memory. All but sums have margins.
#[derive(Clone, Debug)]
struct Rows {
    /// Red, green and blue, row y in places 3 (y % 2) and after.
    encoded: [Vec<f32>; 6],
    /// Greatest difference of any channel between each pixel and the one to its right.
    right: Vec<f32>,
    /// The same with the pixels below, below to the right and below to the left, row y in places 3 (y % 2) and after.
    below: [Vec<f32>; 6],
    /// Contrast in one row; 0 in the margins.
    contrast: Vec<f32>,
    /// Contrast summed over five pixels of a row, row y in place y % 5; 0 outside the image.
    sums: [Vec<f32>; 5],
}

impl Priorities {
    /// Room for an image of this layout.
    pub fn new(grid: Grid) -> Self {
        let row = || vec![0.0; grid.stride + 2 * MARGIN];
        let rows = Rows {
            encoded: std::array::from_fn(|_| row()),
            right: row(),
            below: std::array::from_fn(|_| row()),
            contrast: row(),
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
            compare_row(simd, y, y + 1 < grid.height, rows);
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
        let to = &mut rows.encoded[3 * (y % 2) + c][MARGIN..][..grid.stride];
        for x in (0..grid.stride).step_by(lanes) {
            let v = S::f32s::from_slice(simd, &from[x..x + lanes]);
            let clamped = v.max(zero).min(one).sqrt();
            clamped.store_slice(&mut to[x..x + lanes]);
        }
    }
}

/// Compares a row with itself and, if there is one, with the row below.
#[inline(always)]
fn compare_row<S: Simd>(simd: S, y: usize, below: bool, rows: &mut Rows) {
    let (here, next) = (3 * (y % 2), 3 * ((y + 1) % 2));
    let here_rows = &rows.encoded[here..here + 3];
    compare(simd, here_rows, here_rows, MARGIN + 1, &mut rows.right);
    if below {
        let next_rows = &rows.encoded[next..next + 3];
        for (k, first) in [MARGIN, MARGIN + 1, MARGIN - 1].into_iter().enumerate() {
            compare(simd, here_rows, next_rows, first, &mut rows.below[here + k]);
        }
    }
}

/// Greatest difference of any channel between a row and another one, read from element `first` on.
#[inline(always)]
fn compare<S: Simd>(simd: S, a: &[Vec<f32>], b: &[Vec<f32>], first: usize, out: &mut [f32]) {
    let lanes = S::f32s::LEN;
    let stride = out.len() - 2 * MARGIN;
    let out = &mut out[MARGIN..MARGIN + stride];
    let [a0, a1, a2] = [0, 1, 2].map(|c| &a[c][MARGIN..MARGIN + stride]);
    let [b0, b1, b2] = [0, 1, 2].map(|c| &b[c][first..first + stride]);
    for x in (0..stride).step_by(lanes) {
        let to = x + lanes;
        let red = S::f32s::from_slice(simd, &a0[x..to]) - S::f32s::from_slice(simd, &b0[x..to]);
        let green = S::f32s::from_slice(simd, &a1[x..to]) - S::f32s::from_slice(simd, &b1[x..to]);
        let blue = S::f32s::from_slice(simd, &a2[x..to]) - S::f32s::from_slice(simd, &b2[x..to]);
        let most = red.abs().max(green.abs()).max(blue.abs());
        most.store_slice(&mut out[x..to]);
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
    // What is between a pixel and one above or to its left is stored at that one.
    let (here, above) = (3 * (y % 2), 3 * ((y + 1) % 2));
    let steps: [&[f32]; 8] = [
        &rows.right[first..first + 64],
        &rows.right[first - 1..first + 63],
        &rows.below[here][first..first + 64],
        &rows.below[above][first..first + 64],
        &rows.below[here + 1][first..first + 64],
        &rows.below[here + 2][first..first + 64],
        &rows.below[above + 2][first + 1..first + 65],
        &rows.below[above + 1][first - 1..first + 63],
    ];
    let contrast = &mut rows.contrast[first..first + 64];
    for group in (0..64).step_by(lanes) {
        let mut most = zero;
        for (mask, step) in masks[1..].iter().zip(steps) {
            let bits = mask >> group & ((1u64 << lanes) - 1);
            let counted = S::mask32s::from_bitmask(simd, bits);
            let step = S::f32s::from_slice(simd, &step[group..group + lanes]);
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
    use crate::sampling::place::{hash, hash_unit};

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

    /// Pixels reach one another as a hash of where they are says, the same both ways.
    struct Chance(Grid);

    impl Chance {
        fn joins(&self, a: [usize; 2], b: [usize; 2]) -> bool {
            let [a, b] = [a.min(b), a.max(b)].map(|p| (p[1] * self.0.width + p[0]) as u64);
            !hash(a, b).is_multiple_of(4)
        }
    }

    impl Reach for Chance {
        fn reachable(&self, (dx, dy): (i32, i32), word: usize, y: usize) -> u64 {
            (0..64).fold(0, |bits, k| {
                let x = word * 64 + k;
                let to = [
                    x.wrapping_add_signed(dx as isize),
                    y.wrapping_add_signed(dy as isize),
                ];
                let inside = x < self.0.width && to[0] < self.0.width && to[1] < self.0.height;
                bits | u64::from(inside && self.joins([x, y], to)) << k
            })
        }
    }

    #[test]
    fn priorities_are_those_of_looking_at_every_neighbour() {
        for (width, height) in [(130, 11), (64, 5), (1, 1), (3, 2)] {
            let grid = Grid::new(width, height);
            let value = |at: usize, c: u64| 1.4 * hash_unit(c, at as u64) - 0.2;
            let rgb = [0, 1, 2].map(|c| (0..grid.elements()).map(|at| value(at, c)).collect());
            let weight: Vec<f32> = (0..grid.elements()).map(|at| value(at, 3).abs()).collect();
            let complex: Vec<u64> = (0..grid.plane_words())
                .map(|i| hash(7, i as u64) & hash(8, i as u64) & grid.valid(i % grid.words))
                .collect();
            let reach = Chance(grid);
            let step = |a: [usize; 2], b: [usize; 2]| {
                let [a, b] = [a, b].map(|p| grid.at(p[0], p[1]));
                let encoded = |plane: &Vec<f32>, at: usize| plane[at].clamp(0.0, 1.0).sqrt();
                let steps = rgb.iter().map(|p| (encoded(p, a) - encoded(p, b)).abs());
                steps.fold(0.0, f32::max)
            };
            let around = |x: usize, y: usize, r: usize| {
                (y.saturating_sub(r)..(y + r + 1).min(height)).flat_map(move |v| {
                    (x.saturating_sub(r)..(x + r + 1).min(width)).map(move |u| [u, v])
                })
            };
            let contrast = |[x, y]: [usize; 2]| {
                let (word, bit) = grid.bit(x, y);
                let all = complex[word] >> bit & 1 == 1;
                let near = around(x, y, 1).filter(|n| *n != [x, y]);
                near.filter(|n| all || reach.joins([x, y], *n))
                    .map(|n| step([x, y], n))
                    .fold(0.0, f32::max)
            };
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
                for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
                    let mean = around(x, y, 2).map(contrast).sum::<f32>() / 25.0;
                    let at = grid.at(x, y);
                    let wanted = (mean + LEAST_CONTRAST) / (weight[at] + WEIGHT_FLOOR);
                    let found = p.priority[at];
                    assert!(
                        (found / wanted - 1.0).abs() < 1e-5,
                        "{x} {y}: {found} {wanted}"
                    );
                }
            }
        }
    }
}
