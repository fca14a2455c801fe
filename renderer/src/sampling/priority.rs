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

/// Priorities and the planes that they are made through, by [`Grid`].
#[derive(Clone, Debug)]
pub struct Priorities {
    /// What each pixel wants; 0 to infinity, finite.
    pub priority: Vec<f32>,
    encoded: [Vec<f32>; 3],
    contrast: Vec<f32>,
    blurred: Vec<f32>,
}

impl Priorities {
    /// Room for an image of this layout.
    pub fn new(grid: Grid) -> Self {
        let plane = || vec![0.0; grid.elements()];
        Self {
            priority: plane(),
            encoded: [plane(), plane(), plane()],
            contrast: plane(),
            blurred: plane(),
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
                let grid = inputs.grid;
                for (encoded, rgb) in self.encoded.iter_mut().zip(inputs.rgb) {
                    for y in 0..grid.height {
                        let row = grid.at(0, y)..grid.at(grid.width, y);
                        dispatch!(level, simd => encode_row(simd, &rgb[row.clone()], &mut encoded[row]));
                    }
                }
                for y in 0..grid.height {
                    for word in 0..grid.words {
                        dispatch!(level, simd => contrast_word(simd, &self.encoded, inputs, (word, y), &mut self.contrast));
                    }
                }
                dispatch!(level, simd => blur(simd, grid, &self.contrast, &mut self.blurred, &mut self.priority, inputs.weight));
            }
        }
    }

    /// Contrast before blurring, for looking at.
    pub fn contrast(&self) -> &[f32] {
        &self.contrast
    }
}

/// Linear to about what a display shows: the square root, clamped.
#[simd]
fn encode_row<S: Simd>(_simd: S, from: &[f32], to: &mut [f32]) {
    for (e, &c) in to.iter_mut().zip(from) {
        *e = c.clamp(0.0, 1.0).sqrt();
    }
}

/// Greatest difference of any channel to the 8 neighbours that no edge separates; complex pixels count all of them.
#[simd]
fn contrast_word<S: Simd, R: Reach>(
    simd: S,
    encoded: &[Vec<f32>; 3],
    inputs: &Inputs<'_, R>,
    (word, y): (usize, usize),
    out: &mut [f32],
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
    let first = grid.at(word * 64, y);
    let zero = S::f32s::splat(simd, 0.0);
    for group in (0..64).step_by(lanes) {
        let at = first + group;
        let load = |c: usize, i: usize| S::f32s::from_slice(simd, &encoded[c][i..i + lanes]);
        let here: [S::f32s; 3] = std::array::from_fn(|c| load(c, at));
        let mut most = zero;
        for (mask, &(dx, dy)) in masks.iter().zip(&OFFSETS).skip(1) {
            let bits = mask >> group & ((1u64 << lanes) - 1);
            if bits == 0 {
                continue;
            }
            let from = (at as isize + dy as isize * grid.stride as isize + dx as isize) as usize;
            let mut step = (here[0] - load(0, from)).abs();
            for (c, &here) in here.iter().enumerate().skip(1) {
                step = step.max((here - load(c, from)).abs());
            }
            let counted = S::mask32s::from_bitmask(simd, bits);
            most = most.max(counted.select(step, zero));
        }
        most.store_slice(&mut out[at..at + lanes]);
    }
}

/// Mean over 5x5 (fewer at the border count as zeros), then contrast over weight.
#[simd]
fn blur<S: Simd>(
    _simd: S,
    grid: Grid,
    contrast: &[f32],
    rows: &mut [f32],
    priority: &mut [f32],
    weight: &[f32],
) {
    for y in 0..grid.height {
        let start = grid.at(0, y);
        let from = &contrast[start - 2..start + grid.stride + 2];
        let sums = &mut rows[start..start + grid.stride];
        for (k, sum) in sums.iter_mut().enumerate() {
            *sum = from[k] + from[k + 1] + from[k + 2] + from[k + 3] + from[k + 4];
        }
    }
    for y in 0..grid.height {
        let start = grid.at(0, y);
        let row = |dy: isize| {
            let at = (start as isize + dy * grid.stride as isize) as usize;
            &rows[at..at + grid.stride]
        };
        let five = [row(-2), row(-1), row(0), row(1), row(2)];
        let out = &mut priority[start..start + grid.stride];
        let weight = &weight[start..start + grid.stride];
        for (k, p) in out.iter_mut().enumerate() {
            let mean =
                (five[0][k] + five[1][k] + five[2][k] + five[3][k] + five[4][k]) * (1.0 / 25.0);
            *p = (mean + LEAST_CONTRAST) / (weight[k] + WEIGHT_FLOOR);
        }
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
            let contrast: Vec<f32> = (0..9).map(|x| p.contrast()[grid.at(x, 3)]).collect();
            assert_eq!(contrast, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0]);
            assert!(p.priority[grid.at(6, 3)] > p.priority[grid.at(1, 3)] * 50.0);
        }
    }
}
