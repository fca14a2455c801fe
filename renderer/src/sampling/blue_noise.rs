//! A dither mask whose every threshold gives evenly spread pixels: void and cluster (Ulichney 1993).

use super::place::hash;

/// Side of the mask, pixels; it repeats in both directions.
pub const SIDE: usize = 64;

const CELLS: usize = SIDE * SIDE;

/// Spread of the energy around a chosen cell, pixels (Ulichney: 1.5).
const SIGMA: f32 = 1.5;

/// Ranks 0..4096, each once, ordered so that the first n cells keep their distance from one another for every n.
#[derive(Clone, Debug)]
pub struct BlueNoise {
    rank: Vec<u16>,
}

/// Cells that are on, and how crowded each cell is.
struct Field<'a> {
    on: Vec<bool>,
    energy: Vec<f32>,
    kernel: &'a [f32],
}

impl Field<'_> {
    fn set(&mut self, cell: usize, on: bool) {
        self.on[cell] = on;
        let sign = if on { 1.0 } else { -1.0 };
        let (cx, cy) = (cell % SIDE, cell / SIDE);
        for y in 0..SIDE {
            let kernel = &self.kernel[(y + SIDE - cy) % SIDE * SIDE..][..SIDE];
            for x in 0..SIDE {
                self.energy[y * SIDE + x] += sign * kernel[(x + SIDE - cx) % SIDE];
            }
        }
    }

    /// The most crowded cell that is on, or the emptiest that is off; the first of equals.
    fn extreme(&self, on: bool) -> usize {
        let sign = if on { -1.0 } else { 1.0 };
        let cells = (0..CELLS).filter(|&c| self.on[c] == on);
        cells
            .min_by(|&a, &b| (sign * self.energy[a]).total_cmp(&(sign * self.energy[b])))
            .unwrap_or(0)
    }
}

impl Default for BlueNoise {
    fn default() -> Self {
        Self::new()
    }
}

impl BlueNoise {
    /// Computes the mask; always the same one.
    pub fn new() -> Self {
        let wrap = |d: usize| d.min(SIDE - d) as f32;
        let kernel: Vec<f32> = (0..CELLS)
            .map(|c| {
                let d2 = wrap(c % SIDE).powi(2) + wrap(c / SIDE).powi(2);
                (-d2 / (2.0 * SIGMA * SIGMA)).exp()
            })
            .collect();
        let mut field = Field {
            on: vec![false; CELLS],
            energy: vec![0.0; CELLS],
            kernel: &kernel,
        };
        let start = CELLS / 10;
        let mut key = 0;
        for _ in 0..start {
            while field.on[hash(1, key) as usize % CELLS] {
                key += 1;
            }
            field.set(hash(1, key) as usize % CELLS, true);
        }
        // Move the tightest cluster into the largest void until that is the same cell.
        loop {
            let cluster = field.extreme(true);
            field.set(cluster, false);
            let void = field.extreme(false);
            field.set(void, true);
            if void == cluster {
                break;
            }
        }
        let mut rank = vec![0; CELLS];
        let first = field.on.clone();
        for r in (0..start).rev() {
            let cluster = field.extreme(true);
            field.set(cluster, false);
            rank[cluster] = r as u16;
        }
        let mut field = Field {
            on: vec![false; CELLS],
            energy: vec![0.0; CELLS],
            kernel: &kernel,
        };
        for cell in (0..CELLS).filter(|&c| first[c]) {
            field.set(cell, true);
        }
        for r in start..CELLS {
            let void = field.extreme(false);
            field.set(void, true);
            rank[void] = r as u16;
        }
        Self { rank }
    }

    /// Threshold of a pixel in (0, 1), with the mask shifted by `shift` pixels.
    #[inline]
    pub fn threshold(&self, x: usize, y: usize, shift: (usize, usize)) -> f32 {
        let cell = (y + shift.1) % SIDE * SIDE + (x + shift.0) % SIDE;
        (f32::from(self.rank[cell]) + 0.5) / CELLS as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rank_comes_once_and_low_ranks_keep_apart() {
        let mask = BlueNoise::new();
        let mut ranks = mask.rank.clone();
        ranks.sort_unstable();
        assert!(ranks.iter().enumerate().all(|(i, &r)| usize::from(r) == i));
        let few: Vec<usize> = (0..CELLS).filter(|&c| mask.rank[c] < 82).collect();
        let nearest = |a: usize| {
            let d = |a: usize, b: usize| {
                let w = |d: usize| d.min(SIDE - d) as f32;
                w((a % SIDE).abs_diff(b % SIDE)).hypot(w((a / SIDE).abs_diff(b / SIDE)))
            };
            few.iter()
                .filter(|&&b| b != a)
                .map(|&b| d(a, b))
                .fold(f32::MAX, f32::min)
        };
        // 82 points on 64x64 would be 7.6 apart in a hexagonal grid; random ones come as near as 0.7 or so.
        assert!(few.iter().map(|&a| nearest(a)).fold(f32::MAX, f32::min) > 3.0);
    }
}
