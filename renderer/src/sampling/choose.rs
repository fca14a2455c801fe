//! From priorities to requests: exactly as many pixels as the budget allows, spread evenly.
//!
//! A pixel's turn comes at its blue-noise threshold divided by its priority; those whose turn comes first are chosen. Where
//! priorities are equal this is ordered dithering, so that requests keep their distance; no pixel is chosen twice, and the
//! count is exact. (The Render Cache diffuses errors instead, which starts badly at low densities and only nearly meets
//! its budget.)
//!
//! What is compared is the inverse of the turn, the pixel's urgency. How urgent the last chosen pixel of a frame was tells
//! about where the next frame's choice will end: less urgent pixels than that are passed over a vector at a time. If too
//! few are left, the bar was too high, and they are looked at again with a lower one: the choice does not depend on it.

use fearless_simd::{Level, dispatch, prelude::*};
use fearless_simd_macros::simd;

use super::blue_noise::{BlueNoise, SIDE};
use super::place::hash;
use crate::epi::grid::Grid;

/// Where the bar lies for the next frame, as a share of the last urgency that was chosen.
const MARGIN: f32 = 0.7;

/// By how much the bar is lowered when it was too high.
const LOWER: f32 = 0.25;

/// Times that it is lowered before it is taken away.
const TRIES: usize = 3;

/// Chooses pixels; keeps its scratch memory and the mask.
#[derive(Clone, Debug)]
pub struct Chooser {
    /// One over the mask's thresholds, each row twice, so that a row can be read from any column on.
    inverse: Vec<[f32; 2 * SIDE]>,
    /// Pixels above the bar, the most urgent one the least: bits of the urgency, inverted, and index.
    keys: Vec<u64>,
    bar: f32,
}

impl Default for Chooser {
    fn default() -> Self {
        let mask = BlueNoise::new();
        let cell = |x: usize, y: usize| 1.0 / mask.threshold(x % SIDE, y, (0, 0));
        let row = |y: usize| std::array::from_fn(|x| cell(x, y));
        Self {
            inverse: (0..SIDE).map(row).collect(),
            keys: Vec::new(),
            bar: 0.0,
        }
    }
}

impl Chooser {
    /// Puts `budget` pixels of positive priority (all such, if those are fewer) into `chosen`, those of the highest priority
    /// first and equals in scan order. `priority` is by [`Grid`], finite, not negative; `key` shifts the mask, and differs
    /// from frame to frame. The result does not depend on `level`.
    pub fn choose(
        &mut self,
        level: Level,
        (grid, priority): (Grid, &[f32]),
        budget: usize,
        key: u64,
        chosen: &mut Vec<(u16, u16)>,
    ) {
        chosen.clear();
        if budget == 0 {
            return;
        }
        let random = hash(0x51f7, key) as usize;
        let shift = (random % SIDE, random / SIDE % SIDE);
        let Self { inverse, keys, bar } = self;
        for tries in 0.. {
            keys.clear();
            dispatch!(level, simd => above(simd, (grid, priority), (inverse, shift), *bar, keys));
            if keys.len() >= budget || *bar == 0.0 {
                break;
            }
            *bar = if tries < TRIES { *bar * LOWER } else { 0.0 };
        }
        if keys.len() > budget {
            keys.select_nth_unstable(budget);
            keys.truncate(budget);
        }
        let least = keys.iter().copied().max().unwrap_or(u64::MAX);
        *bar = f32::from_bits(!(least >> 32) as u32) * MARGIN;
        let width = grid.width as u32;
        let place = |key: u64| (key as u32 % width, key as u32 / width);
        for key in keys.iter_mut() {
            let (x, y) = place(*key);
            let bits = priority[grid.at(x as usize, y as usize)].to_bits();
            *key = u64::from(!bits) << 32 | *key & u64::from(u32::MAX);
        }
        keys.sort_unstable();
        chosen.extend(keys.iter().map(|&key| {
            let (x, y) = place(key);
            (x as u16, y as u16)
        }));
    }
}

/// Appends the pixels whose urgency is above the bar, in scan order.
#[simd]
fn above<S: Simd>(
    simd: S,
    (grid, priority): (Grid, &[f32]),
    (inverse, shift): (&[[f32; 2 * SIDE]], (usize, usize)),
    bar: f32,
    keys: &mut Vec<u64>,
) {
    let lanes = S::f32s::LEN;
    let limit = S::f32s::splat(simd, bar);
    for y in 0..grid.height {
        let inverse = &inverse[(y + shift.1) % SIDE][shift.0..shift.0 + SIDE];
        for word in 0..grid.words {
            let first = grid.at(word * 64, y);
            let priority = &priority[first..first + 64];
            let mut left = 0;
            for group in (0..64).step_by(lanes) {
                let load = |from: &[f32]| S::f32s::from_slice(simd, &from[group..group + lanes]);
                let urgent = (load(priority) * load(inverse)).simd_gt(limit);
                left |= urgent.to_bitmask() << group;
            }
            left &= grid.valid(word);
            while left != 0 {
                let k = left.trailing_zeros() as usize;
                left &= left - 1;
                let urgency = (priority[k] * inverse[k]).min(f32::MAX);
                let index = (y * grid.width + word * 64 + k) as u64;
                keys.push(u64::from(!urgency.to_bits()) << 32 | index);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(grid: Grid, priority: &[f32], budget: usize, key: u64) -> Vec<(u16, u16)> {
        let mut chosen = Vec::new();
        let image = (grid, priority);
        Chooser::default().choose(Level::new(), image, budget, key, &mut chosen);
        let unique: std::collections::HashSet<_> = chosen.iter().collect();
        assert_eq!(unique.len(), chosen.len(), "a pixel was chosen twice");
        chosen
    }

    #[test]
    fn flat_hot_and_full_priorities_give_exactly_the_budget() {
        let grid = Grid::new(100, 70);
        let flat = vec![0.3; grid.elements()];
        let mut hot = vec![1e-6; grid.elements()];
        hot[grid.at(50, 35)] = 1e6;
        for budget in [0, 1, 7, 140, 3500, 6999, 7000, 9000] {
            assert_eq!(run(grid, &flat, budget, 1).len(), budget.min(7000));
            let chosen = run(grid, &hot, budget, 2);
            assert_eq!(chosen.len(), budget.min(7000));
            assert!(budget == 0 || chosen.contains(&(50, 35)), "{budget}");
        }
    }

    #[test]
    fn pixels_of_no_priority_are_never_chosen() {
        let grid = Grid::new(64, 64);
        let mut priority = vec![0.0; grid.elements()];
        for x in 0..64 {
            priority[grid.at(x, 10)] = 1.0;
        }
        let chosen = run(grid, &priority, 1000, 3);
        assert_eq!(chosen.len(), 64);
        assert!(chosen.iter().all(|&(_, y)| y == 10));
    }

    #[test]
    fn a_flat_image_is_covered_evenly_and_all_of_it_in_time() {
        let grid = Grid::new(128, 128);
        let budget = 128 * 128 / 50;
        let priority = vec![1.0; grid.elements()];
        let chosen = run(grid, &priority, budget, 4);
        let mut blocks = [0; 16];
        for (x, y) in &chosen {
            blocks[usize::from(*y) / 32 * 4 + usize::from(*x) / 32] += 1;
        }
        assert!(blocks.iter().all(|&n| (14..=27).contains(&n)), "{blocks:?}");
        // Pixels asked for lose their priority: then every pixel is asked for within ceil(pixels/budget) frames.
        let mut priority = priority;
        let mut chooser = Chooser::default();
        let mut chosen = Vec::new();
        for frame in 0..128 * 128 / budget + 1 {
            let image = (grid, &priority[..]);
            chooser.choose(Level::new(), image, budget, frame as u64, &mut chosen);
            for &(x, y) in &chosen {
                priority[grid.at(x.into(), y.into())] = 1e-3;
            }
        }
        let left = (0..128 * 128)
            .filter(|i| priority[grid.at(i % 128, i / 128)] > 0.5)
            .count();
        assert_eq!(left, 0);
    }

    /// Every pixel's urgency, sorted.
    fn plain(grid: Grid, priority: &[f32], budget: usize, key: u64) -> Vec<(u16, u16)> {
        let mask = BlueNoise::new();
        let random = hash(0x51f7, key) as usize;
        let shift = (random % SIDE, random / SIDE % SIDE);
        let mut all = Vec::new();
        for y in 0..grid.height {
            for x in 0..grid.width {
                let p = priority[grid.at(x, y)];
                if p > 0.0 {
                    all.push((p * (1.0 / mask.threshold(x, y, shift)), p, (y, x)));
                }
            }
        }
        all.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.2.cmp(&b.2)));
        all.truncate(budget);
        all.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.2.cmp(&b.2)));
        all.iter()
            .map(|&(_, _, (y, x))| (x as u16, y as u16))
            .collect()
    }

    #[test]
    fn choices_are_those_of_sorting_all_pixels_whatever_came_before() {
        let grid = Grid::new(130, 40);
        let mut choosers = [Level::new(), Level::baseline()].map(|l| (l, Chooser::default()));
        let (mut chosen, mut priority) = (Vec::new(), vec![f32::MAX; grid.elements()]);
        // From frame to frame priorities rise and fall by orders, vanish in places, and some are equal; budgets vary.
        for frame in 0..40u64 {
            let scale = 10f32.powi((hash(1, frame) % 13) as i32 - 6);
            for y in 0..grid.height {
                for x in 0..grid.width {
                    let steps = hash(frame, (y * grid.width + x) as u64) % 50;
                    priority[grid.at(x, y)] = scale * (steps / (1 + frame % 9)) as f32;
                }
            }
            let budget = [1, 50, 104, 2000, 5200, 9000][hash(2, frame) as usize % 6];
            let wanted = plain(grid, &priority, budget, frame);
            for (level, chooser) in &mut choosers {
                chooser.choose(*level, (grid, &priority), budget, frame, &mut chosen);
                assert_eq!(chosen, wanted, "frame {frame}, budget {budget}");
            }
        }
    }
}
