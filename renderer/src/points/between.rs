//! Telling hidden points by the edges of the frame, so that fewer rays are needed.
//!
//! Where no edge passes within two pixels the picture shows one surface. A point there that is far behind a neighbour known
//! to be visible is hidden, and shows through a gap between samples. The opposite is not so: a point as deep as its
//! neighbours may be hidden together with them, by something that has come before all of them since they were last
//! asked about.

use fearless_simd::{Level, dispatch, prelude::*};
use fearless_simd_macros::simd;

use super::PixelSamples;
use crate::epi::grid::Grid;

/// How far neighbours reach, pixels.
const REACH: usize = 2;

/// A point further behind than this, as a share of one over its depth, is hidden. Not nearer to 1: a surface may fall away
/// steeply, as the ground does near the horizon.
const HIDDEN: f32 = 0.6;

/// What edges say of the points of a frame, as bit planes.
#[derive(Clone, Debug)]
pub struct Between {
    /// Points that are certainly hidden.
    pub hidden: Vec<u64>,
    /// Pixels without an edge, or the rim of the picture, within two pixels.
    open: Vec<u64>,
    /// One over the depth of points known to be visible; 0 elsewhere.
    sure: Vec<f32>,
    /// The greatest of these within reach along the row.
    rows: Vec<f32>,
}

impl Between {
    /// Room for an image of this layout.
    pub fn new(grid: Grid) -> Self {
        let plane = || vec![0; grid.plane_words()];
        let elements = || vec![0.0; grid.elements()];
        Self {
            hidden: plane(),
            open: plane(),
            sure: elements(),
            rows: elements(),
        }
    }

    /// Looks at all points of a frame. `edges` are the pixels with edges: simple ones and complex ones. Points that are
    /// [doubtful](PixelSamples::doubtful) say nothing about others.
    pub fn find(&mut self, level: Level, pixels: &PixelSamples, edges: [&[u64]; 2]) {
        self.find_open(pixels.grid, edges);
        dispatch!(level, simd => self.gather(simd, pixels));
        dispatch!(level, simd => self.decide(simd, pixels));
    }

    fn find_open(&mut self, grid: Grid, [simple, complex]: [&[u64]; 2]) {
        let words = grid.words;
        // Along the row first; the plane of answers is free until it is filled.
        for i in 0..grid.plane_words() {
            let word = i % words;
            let edge = |i: usize| simple[i] | complex[i];
            let here = edge(i);
            let before = if word > 0 { edge(i - 1) } else { 0 };
            let after = if word + 1 < words { edge(i + 1) } else { 0 };
            self.hidden[i] = (1..=REACH).fold(here, |spread, step| {
                let (left, right) = (here << step, here >> step);
                let (from_left, from_right) = (before >> (64 - step), after << (64 - step));
                spread | left | right | from_left | from_right
            });
        }
        for y in 0..grid.height {
            let rows = y.saturating_sub(REACH)..(y + REACH + 1).min(grid.height);
            for word in 0..words {
                let near = rows
                    .clone()
                    .fold(0, |near, row| near | self.hidden[row * words + word]);
                let columns = |from: usize, to: usize| {
                    let from = from.saturating_sub(word * 64).min(64) as u32;
                    let to = to.saturating_sub(word * 64).min(64) as u32;
                    let below = |n: u32| 1u64.checked_shl(n).map_or(!0, |bit| bit - 1);
                    below(to) & !below(from)
                };
                let inner = columns(REACH, grid.width.saturating_sub(REACH));
                self.open[y * words + word] = inner & !near;
            }
        }
    }

    #[simd]
    fn gather<S: Simd>(&mut self, simd: S, pixels: &PixelSamples) {
        let (grid, lanes) = (pixels.grid, S::f32s::LEN);
        let (zero, one) = (S::f32s::splat(simd, 0.0), S::f32s::splat(simd, 1.0));
        for y in 0..grid.height {
            for word in 0..grid.words {
                let i = y * grid.words + word;
                let sure = pixels.has[i] & !pixels.doubtful[i];
                for group in (0..64).step_by(lanes) {
                    let at = grid.at(word * 64 + group, y);
                    let bits = sure >> group & ((1u64 << lanes) - 1);
                    let mask = S::mask32s::from_bitmask(simd, bits);
                    let inverse = one / S::f32s::from_slice(simd, &pixels.depth[at..at + lanes]);
                    mask.select(inverse, zero)
                        .store_slice(&mut self.sure[at..at + lanes]);
                }
            }
        }
        for y in 0..grid.height {
            for at in (grid.at(0, y)..grid.at(grid.stride, y)).step_by(lanes) {
                let load = |at: usize| S::f32s::from_slice(simd, &self.sure[at..at + lanes]);
                let most = (1..=REACH).fold(load(at), |most, step| {
                    most.max(load(at - step)).max(load(at + step))
                });
                most.store_slice(&mut self.rows[at..at + lanes]);
            }
        }
    }

    #[simd]
    fn decide<S: Simd>(&mut self, simd: S, pixels: &PixelSamples) {
        let (grid, lanes) = (pixels.grid, S::f32s::LEN);
        let splat = |v: f32| S::f32s::splat(simd, v);
        for y in 0..grid.height {
            for word in 0..grid.words {
                let i = y * grid.words + word;
                let candidates = pixels.has[i] & self.open[i];
                let mut hidden = 0;
                for group in (0..64).step_by(lanes) {
                    if candidates >> group & ((1u64 << lanes) - 1) == 0 {
                        continue;
                    }
                    let at = grid.at(word * 64 + group, y);
                    let load = |at: usize| S::f32s::from_slice(simd, &self.rows[at..at + lanes]);
                    let most = (1..=REACH).fold(load(at), |most, step| {
                        let far = step * grid.stride;
                        most.max(load(at - far)).max(load(at + far))
                    });
                    let depth = S::f32s::from_slice(simd, &pixels.depth[at..at + lanes]);
                    // Nothing known all round leaves 0, which hides nothing.
                    let behind = (splat(1.0) / depth).simd_lt(splat(HIDDEN) * most);
                    hidden |= behind.to_bitmask() << group;
                }
                self.hidden[i] = hidden & candidates;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::place::hash_unit;

    /// The same by its definition.
    fn plain(pixels: &PixelSamples, edges: [&[u64]; 2], (x, y): (usize, usize)) -> bool {
        let grid = pixels.grid;
        let mut nearest = 0.0f32;
        if x < 2 || x + 2 >= grid.width {
            return false;
        }
        for dy in -2..=2i64 {
            for dx in -2..=2i64 {
                let (tx, ty) = (x as i64 + dx, y as i64 + dy);
                if tx < 0 || ty < 0 || tx >= grid.width as i64 || ty >= grid.height as i64 {
                    continue;
                }
                let (tx, ty) = (tx as usize, ty as usize);
                let (word, bit) = grid.bit(tx, ty);
                if (edges[0][word] | edges[1][word]) >> bit & 1 == 1 {
                    return false;
                }
                if (pixels.has[word] & !pixels.doubtful[word]) >> bit & 1 == 1 {
                    nearest = nearest.max(1.0 / pixels.depth[grid.at(tx, ty)]);
                }
            }
        }
        1.0 / pixels.depth[grid.at(x, y)] < HIDDEN * nearest
    }

    #[test]
    fn every_level_agrees_with_the_definition() {
        agrees_at(150);
        agrees_at(128);
    }

    fn agrees_at(width: usize) {
        let grid = Grid::new(width, 40);
        let mut pixels = PixelSamples::new(grid);
        let mut edges = [vec![0; grid.plane_words()], vec![0; grid.plane_words()]];
        for y in 0..40 {
            for x in 0..width {
                let random = |salt: u64| hash_unit(salt, (y * width + x) as u64);
                let (word, bit) = grid.bit(x, y);
                if random(1) < 0.4 {
                    pixels.has[word] |= 1 << bit;
                    let depth = [2.0, 2.05, 2.1, 4.0, 1e30][(random(2) * 5.0) as usize];
                    pixels.depth[grid.at(x, y)] = depth;
                    pixels.doubtful[word] |= u64::from(random(3) < 0.5) << bit;
                }
                edges[0][word] |= u64::from(random(4) < 0.006) << bit;
                edges[1][word] |= u64::from(random(5) < 0.003) << bit;
            }
        }
        let edges = edges.each_ref().map(Vec::as_slice);
        for level in [Level::new(), Level::baseline()] {
            let mut between = Between::new(grid);
            between.find(level, &pixels, edges);
            let mut count = 0;
            for y in 0..40 {
                for x in 0..width {
                    let (word, bit) = grid.bit(x, y);
                    let has = pixels.has_sample(x, y);
                    let wanted = has && plain(&pixels, edges, (x, y));
                    assert_eq!(between.hidden[word] >> bit & 1 == 1, wanted, "{x} {y}");
                    count += usize::from(wanted);
                }
            }
            assert!(count > 100, "{count}");
        }
    }
}
