//! Starved pixels near edges: colours flow from pixel to pixel along the image's rows and columns, never across an edge.
//!
//! A starved pixel's colour is the mean of what its own few samples say, weighted as interpolation weighted them, and of
//! its reachable neighbours' colours, a small weight each: a membrane that is pinned where there are samples. It is found by
//! relaxation, sweeping down and up the image, so that a colour crosses the picture in one sweep.

use fearless_simd::{Level, dispatch, prelude::*};
use fearless_simd_macros::simd;

use super::interpolate::Interpolated;
use crate::epi::grid::Grid;

/// Weight of a neighbour's colour, in units of [`super::interpolate::weight`].
const FLOW: f32 = 0.05;

/// Sweeps, down and up by turns.
const SWEEPS: usize = 6;

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

/// Scratch, kept from frame to frame.
#[derive(Clone, Debug)]
pub struct Diffusion {
    grid: Grid,
    /// Plane: the pixel has a colour.
    known: Vec<u64>,
    /// Colours from a pixel's own samples, times their weight.
    own: [Vec<f32>; 3],
    row: [Vec<f32>; 3],
}

impl Diffusion {
    /// Room for an image of this layout.
    pub fn new(grid: Grid) -> Self {
        let plane = || vec![0.0; grid.elements()];
        let row = || vec![0.0; grid.stride];
        Self {
            grid,
            known: vec![0; grid.plane_words()],
            own: [plane(), plane(), plane()],
            row: [row(), row(), row()],
        }
    }

    /// Replaces the colours of the pixels in the plane `starved`, and takes those that get one out of `out.bare`.
    pub fn fill(
        &mut self,
        level: Level,
        near: Neighbours<'_>,
        starved: &[u64],
        out: &mut Interpolated,
    ) {
        let grid = self.grid;
        for (i, (known, bare)) in self.known.iter_mut().zip(&out.bare).enumerate() {
            *known = !bare & grid.valid(i % grid.words);
        }
        for y in 0..grid.height {
            dispatch!(level, simd => self.pin_row(simd, starved, y, out));
        }
        for sweep in 0..SWEEPS {
            for k in 0..grid.height {
                let y = if sweep % 2 == 0 {
                    k
                } else {
                    grid.height - 1 - k
                };
                if starved[y * grid.words..][..grid.words]
                    .iter()
                    .any(|&w| w != 0)
                {
                    dispatch!(level, simd => self.relax_row(simd, near, starved, y, out));
                }
            }
        }
        for (bare, known) in out.bare.iter_mut().zip(&self.known) {
            *bare &= !known;
        }
    }

    #[simd]
    fn pin_row<S: Simd>(&mut self, simd: S, starved: &[u64], y: usize, out: &Interpolated) {
        let (grid, lanes) = (self.grid, S::f32s::LEN);
        for word in 0..grid.words {
            let bits = starved[y * grid.words + word];
            for group in (0..64).step_by(lanes) {
                if bits >> group & ((1u64 << lanes) - 1) == 0 {
                    continue;
                }
                let at = grid.at(word * 64 + group, y);
                let weight = S::f32s::from_slice(simd, &out.weight[at..at + lanes]);
                for (own, rgb) in self.own.iter_mut().zip(&out.rgb) {
                    let colour = S::f32s::from_slice(simd, &rgb[at..at + lanes]);
                    (weight * colour).store_slice(&mut own[at..at + lanes]);
                }
            }
        }
    }

    #[simd]
    fn relax_row<S: Simd>(
        &mut self,
        simd: S,
        near: Neighbours<'_>,
        starved: &[u64],
        y: usize,
        out: &mut Interpolated,
    ) {
        let (grid, lanes) = (self.grid, S::f32s::LEN);
        let (words, known) = (grid.words, &self.known);
        let i = y * words;
        let (zero, flow) = (S::f32s::splat(simd, 0.0), S::f32s::splat(simd, FLOW));
        let lane_bits = (1u64 << lanes) - 1;
        for word in 0..words {
            let bits = starved[i + word];
            if bits == 0 {
                continue;
            }
            let at_word = |plane: &[u64], w: Option<usize>| {
                w.filter(|w| *w < words).map_or(0, |w| plane[i + w])
            };
            let before = word.checked_sub(1);
            let joined_left = near.right[i + word] << 1 | at_word(near.right, before) >> 63;
            let known_left = known[i + word] << 1 | at_word(known, before) >> 63;
            let known_right = known[i + word] >> 1 | at_word(known, Some(word + 1)) << 63;
            let above = if y > 0 {
                near.down[i - words + word] & known[i - words + word]
            } else {
                0
            };
            let below = if y + 1 < grid.height {
                near.down[i + word] & known[i + words + word]
            } else {
                0
            };
            let stride = grid.stride as isize;
            let ways = [
                (above, -stride),
                (below, stride),
                (joined_left & known_left, -1),
                (near.right[i + word] & known_right, 1),
            ];
            for group in (0..64).step_by(lanes) {
                let mine = bits >> group & lane_bits;
                if mine == 0 {
                    continue;
                }
                let at = grid.at(word * 64 + group, y);
                let load =
                    |plane: &[f32], at: usize| S::f32s::from_slice(simd, &plane[at..at + lanes]);
                let mut weight = load(&out.weight, at);
                let mut sum: [S::f32s; 3] = std::array::from_fn(|k| load(&self.own[k], at));
                for (mask, step) in ways {
                    let mask = mask >> group & lane_bits;
                    if mask == 0 {
                        continue;
                    }
                    let flow = S::mask32s::from_bitmask(simd, mask).select(flow, zero);
                    weight += flow;
                    let from = (at as isize + step) as usize;
                    for (sum, rgb) in sum.iter_mut().zip(&out.rgb) {
                        *sum += flow * load(rgb, from);
                    }
                }
                let some = weight.simd_gt(zero);
                let inverse =
                    S::f32s::splat(simd, 1.0) / some.select(weight, S::f32s::splat(simd, 1.0));
                let mine = S::mask32s::from_bitmask(simd, mine);
                let to = word * 64 + group..word * 64 + group + lanes;
                for ((sum, rgb), row) in sum.iter().zip(&out.rgb).zip(&mut self.row) {
                    mine.select(*sum * inverse, load(rgb, at))
                        .store_slice(&mut row[to.clone()]);
                }
            }
        }
        for word in 0..words {
            let bits = starved[i + word];
            for group in (0..64).step_by(lanes) {
                if bits >> group & lane_bits == 0 {
                    continue;
                }
                let (at, from) = (grid.at(word * 64 + group, y), word * 64 + group);
                for (rgb, row) in out.rgb.iter_mut().zip(&self.row) {
                    S::f32s::from_slice(simd, &row[from..from + lanes])
                        .store_slice(&mut rgb[at..at + lanes]);
                }
            }
        }
        // Known from now on: those with a known neighbour.
        let mut carry = 0;
        for word in 0..words {
            let was = self.known[i + word];
            let next = if word + 1 < words {
                self.known[i + word + 1]
            } else {
                0
            };
            let before = if word > 0 {
                near.right[i + word - 1] >> 63
            } else {
                0
            };
            let joined_left = near.right[i + word] << 1 | before;
            let sides = (joined_left & (was << 1 | carry))
                | (near.right[i + word] & (was >> 1 | next << 63));
            let above = if y > 0 {
                near.down[i - words + word] & self.known[i - words + word]
            } else {
                0
            };
            let below = if y + 1 < grid.height {
                near.down[i + word] & self.known[i + words + word]
            } else {
                0
            };
            self.known[i + word] = was | (starved[i + word] & (sides | above | below));
            carry = was >> 63;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Colour 1 left of a wall and 0 right of it, known in every ninth column of a few rows only.
    fn filled(level: Level, wall: usize) -> Interpolated {
        let grid = Grid::new(90, 40);
        let mut out = Interpolated::new(grid);
        let valid = |i: usize| grid.valid(i % grid.words);
        let all: Vec<u64> = (0..grid.plane_words()).map(valid).collect();
        let mut starved = all.clone();
        for (x, y) in (4..90).step_by(9).flat_map(|x| [(x, 5), (x, 15), (x, 35)]) {
            let (word, bit) = grid.bit(x, y);
            starved[word] &= !(1 << bit);
            out.weight[grid.at(x, y)] = 1.0;
            for plane in &mut out.rgb {
                plane[grid.at(x, y)] = if x < wall { 1.0 } else { 0.0 };
            }
        }
        out.bare.copy_from_slice(&starved);
        let mut right = all.clone();
        for y in 0..grid.height {
            let (word, bit) = grid.bit(wall - 1, y);
            right[word] &= !(1 << bit);
        }
        let none = vec![0; grid.plane_words()];
        let near = Neighbours {
            right: &right,
            down: &all,
            simple: &none,
            complex: &none,
            has: &none,
        };
        Diffusion::new(grid).fill(level, near, &starved, &mut out);
        out
    }

    #[test]
    fn colours_flow_everywhere_but_through_a_wall() {
        let grid = Grid::new(90, 40);
        for wall in [64, 70] {
            let out = filled(Level::new(), wall);
            for y in 0..40 {
                for x in 0..90 {
                    let wanted = if x < wall { 1.0 } else { 0.0 };
                    let got = out.rgb[0][grid.at(x, y)];
                    assert!((got - wanted).abs() < 1e-5, "{x} {y} {got}");
                }
            }
            assert!(out.bare.iter().all(|&w| w == 0));
            assert_eq!(out.rgb, filled(Level::baseline(), wall).rgb);
        }
    }

    #[test]
    fn a_pixels_own_samples_outweigh_what_flows_in() {
        let grid = Grid::new(3, 1);
        let mut out = Interpolated::new(grid);
        for (x, colour) in [0.0, 1.0, 0.0].into_iter().enumerate() {
            out.rgb[0][grid.at(x, 0)] = colour;
            out.weight[grid.at(x, 0)] = 1.0;
        }
        let (right, none) = (vec![0b011], vec![0]);
        let near = Neighbours {
            right: &right,
            down: &none,
            simple: &none,
            complex: &none,
            has: &none,
        };
        Diffusion::new(grid).fill(Level::new(), near, &[0b010], &mut out);
        let wanted = 1.0 / (1.0 + 2.0 * FLOW);
        assert!((out.rgb[0][grid.at(1, 0)] - wanted).abs() < 1e-6);
        assert_eq!(out.rgb[0][grid.at(0, 0)], 0.0);
    }
}
