//! From priorities to requests: exactly as many pixels as the budget allows, spread evenly.
//!
//! A pixel's turn comes at its blue-noise threshold divided by its priority; those whose turn comes first are chosen. Where
//! priorities are equal this is ordered dithering, so that requests keep their distance; no pixel is chosen twice, and the
//! count is exact. (The Render Cache diffuses errors instead, which starts badly at low densities and only nearly meets
//! its budget.)

use super::blue_noise::{BlueNoise, SIDE};
use super::place::hash;
use crate::epi::grid::Grid;

/// Buckets of turns: the top 16 bits of a positive float.
const BUCKETS: usize = 1 << 15;

/// Chooses pixels; keeps its scratch memory and the mask.
#[derive(Clone, Debug, Default)]
pub struct Chooser {
    mask: BlueNoise,
    turns: Vec<f32>,
    histogram: Vec<u32>,
    border: Vec<(f32, u32)>,
}

impl Chooser {
    /// Puts `budget` pixels of positive priority (all such, if those are fewer) into `chosen`, in scan order but for the
    /// last few. `priority` is by [`Grid`], finite, not negative; `key` shifts the mask, and differs from frame to frame.
    pub fn choose(
        &mut self,
        grid: Grid,
        priority: &[f32],
        budget: usize,
        key: u64,
        chosen: &mut Vec<(u16, u16)>,
    ) {
        chosen.clear();
        let positive = self.compute_turns(grid, priority, key);
        let budget = budget.min(positive);
        if budget == 0 {
            return;
        }
        let bucket = |turn: f32| (turn.to_bits() >> 16) as usize;
        let (mut last, mut before) = (0, 0usize);
        for (i, &n) in self.histogram.iter().enumerate() {
            if before + n as usize >= budget {
                last = i;
                break;
            }
            before += n as usize;
        }
        self.border.clear();
        let pixels =
            (0..grid.height).flat_map(|y| (0..grid.width).map(move |x| (x as u16, y as u16)));
        for (i, (pixel, &turn)) in pixels.zip(&self.turns).enumerate() {
            if turn < f32::INFINITY {
                match bucket(turn).cmp(&last) {
                    std::cmp::Ordering::Less => chosen.push(pixel),
                    std::cmp::Ordering::Equal => self.border.push((turn, i as u32)),
                    std::cmp::Ordering::Greater => {}
                }
            }
        }
        let missing = budget - before;
        let by_turn = |a: &(f32, u32), b: &(f32, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        if missing < self.border.len() {
            self.border.select_nth_unstable_by(missing, by_turn);
            self.border.truncate(missing);
        }
        self.border.sort_unstable_by(by_turn);
        let width = grid.width as u32;
        chosen.extend(
            self.border
                .iter()
                .map(|&(_, i)| ((i % width) as u16, (i / width) as u16)),
        );
    }

    /// Each pixel's turn and how many fall into each bucket; gives how many pixels have one.
    fn compute_turns(&mut self, grid: Grid, priority: &[f32], key: u64) -> usize {
        let random = hash(0x51f7, key) as usize;
        let shift = (random % SIDE, random / SIDE % SIDE);
        self.turns.clear();
        self.histogram.clear();
        self.histogram.resize(BUCKETS, 0);
        let mut positive = 0;
        for y in 0..grid.height {
            let row = &priority[grid.at(0, y)..][..grid.width];
            for (x, &p) in row.iter().enumerate() {
                if p > 0.0 {
                    let turn = (self.mask.threshold(x, y, shift) / p).min(f32::MAX);
                    self.histogram[(turn.to_bits() >> 16) as usize] += 1;
                    self.turns.push(turn);
                    positive += 1;
                } else {
                    self.turns.push(f32::INFINITY);
                }
            }
        }
        positive
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(grid: Grid, priority: &[f32], budget: usize, key: u64) -> Vec<(u16, u16)> {
        let mut chosen = Vec::new();
        Chooser::default().choose(grid, priority, budget, key, &mut chosen);
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
            chooser.choose(grid, &priority, budget, frame as u64, &mut chosen);
            for &(x, y) in &chosen {
                priority[grid.at(x.into(), y.into())] = 1e-3;
            }
        }
        let left = (0..128 * 128)
            .filter(|i| priority[grid.at(i % 128, i / 128)] > 0.5)
            .count();
        assert_eq!(left, 0);
    }
}
