//! Starved pixels far from every edge: all samples around a tile serve all of its pixels, with no reachability to ask about.
//!
//! Where no edge crosses a tile or its surroundings, every sample there is reachable from every pixel. The samples are
//! gathered once a tile, and a plane is fitted to them for each pixel, a row of the tile at a time.

use fearless_simd::{Level, dispatch, prelude::*};
use fearless_simd_macros::simd;

use super::interpolate::{Interpolated, SLOPE_RIDGE, reciprocal};
use crate::epi::grid::Grid;
use crate::points::PixelSamples;

/// Columns of a tile, pixels; divides a word, and is a multiple of every vector's length.
const TILE_COLUMNS: usize = 16;

/// Rows of a tile, pixels.
const TILE_ROWS: usize = 8;

/// How far around a tile samples are looked for, pixels; the first that finds [`FEWEST`] is taken.
const MARGINS: [usize; 4] = [2, 5, 10, 20];

/// Samples that a tile needs.
const FEWEST: u32 = 6;

/// Most samples around a tile: one in every pixel of the largest surroundings.
const MOST: usize = (TILE_COLUMNS + 2 * MARGINS[3]) * (TILE_ROWS + 2 * MARGINS[3]);

/// Bit planes that say where this works.
#[derive(Clone, Copy)]
pub struct Planes<'a> {
    /// Pixels with edges, simple and complex.
    pub edges: &'a [u64],
    /// Pixels with a sample.
    pub has: &'a [u64],
}

/// Samples around a tile, relative to its first pixel's corner.
#[derive(Clone, Debug)]
pub struct Gathered {
    x: Vec<f32>,
    y: Vec<f32>,
    count: Vec<f32>,
    rgb: [Vec<f32>; 3],
    low: [f32; 3],
    high: [f32; 3],
}

impl Default for Gathered {
    fn default() -> Self {
        let plane = || Vec::with_capacity(MOST);
        Self {
            x: plane(),
            y: plane(),
            count: plane(),
            rgb: [plane(), plane(), plane()],
            low: [0.0; 3],
            high: [0.0; 3],
        }
    }
}

/// A part of the image: columns and rows, the ends not included.
#[derive(Clone, Copy, Debug)]
struct Window {
    columns: (usize, usize),
    rows: (usize, usize),
}

impl Window {
    fn around(grid: Grid, (x, y): (usize, usize), margin: usize) -> Self {
        Self {
            columns: (
                x.saturating_sub(margin),
                (x + TILE_COLUMNS + margin).min(grid.width),
            ),
            rows: (
                y.saturating_sub(margin),
                (y + TILE_ROWS + margin).min(grid.height),
            ),
        }
    }

    /// Bits of a row of a plane in the window, its first column in bit 0. Windows are at most 64 pixels wide.
    fn bits(&self, grid: Grid, plane: &[u64], y: usize) -> u64 {
        let (from, to) = self.columns;
        let (word, shift) = (y * grid.words + from / 64, from % 64);
        let mut bits = plane[word] >> shift;
        if shift > 0 && from / 64 + 1 < grid.words {
            bits |= plane[word + 1] << (64 - shift);
        }
        bits & (!0 >> (64 - (to - from)))
    }

    fn count(&self, grid: Grid, plane: &[u64]) -> u32 {
        (self.rows.0..self.rows.1)
            .map(|y| self.bits(grid, plane, y).count_ones())
            .sum()
    }
}

/// Fills in the starved pixels of all tiles that have no edge near, and takes their bits out of `left` and `out.bare`.
/// Results do not depend on `level`.
pub fn fill(
    level: Level,
    samples: &PixelSamples,
    planes: Planes<'_>,
    left: &mut [u64],
    gathered: &mut Gathered,
    out: &mut Interpolated,
) {
    let grid = samples.grid;
    for y in (0..grid.height).step_by(TILE_ROWS) {
        let rows = TILE_ROWS.min(grid.height - y);
        for word in 0..grid.words {
            let any = (y..y + rows).fold(0, |bits, row| bits | left[row * grid.words + word]);
            for part in 0..64 / TILE_COLUMNS {
                if any >> (part * TILE_COLUMNS) & TILE_BITS == 0 {
                    continue;
                }
                let x = word * 64 + part * TILE_COLUMNS;
                let Some(window) = open_window(grid, planes, (x, y)) else {
                    continue;
                };
                gathered.gather(samples, planes.has, window, (x, y));
                for row in y..y + rows {
                    let i = row * grid.words + word;
                    let wanted = left[i] >> (part * TILE_COLUMNS) & TILE_BITS;
                    if wanted != 0 {
                        let at = grid.at(x, row);
                        let down = (row - y) as f32;
                        dispatch!(level, simd => fit_row(simd, gathered, (at, down), wanted, out));
                        left[i] &= !(wanted << (part * TILE_COLUMNS));
                        out.bare[i] &= !(wanted << (part * TILE_COLUMNS));
                    }
                }
            }
        }
    }
}

/// The bits of one tile's columns.
const TILE_BITS: u64 = (1 << TILE_COLUMNS) - 1;

/// The smallest surroundings of a tile with enough samples, if no edge crosses them.
fn open_window(grid: Grid, planes: Planes<'_>, tile: (usize, usize)) -> Option<Window> {
    for margin in MARGINS {
        let window = Window::around(grid, tile, margin);
        if window.count(grid, planes.edges) > 0 {
            return None;
        }
        if window.count(grid, planes.has) >= FEWEST {
            return Some(window);
        }
    }
    None
}

impl Gathered {
    fn gather(
        &mut self,
        samples: &PixelSamples,
        has: &[u64],
        window: Window,
        (x0, y0): (usize, usize),
    ) {
        let planes = [&mut self.x, &mut self.y, &mut self.count];
        planes.into_iter().chain(&mut self.rgb).for_each(Vec::clear);
        (self.low, self.high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        let grid = samples.grid;
        for y in window.rows.0..window.rows.1 {
            let mut bits = window.bits(grid, has, y);
            while bits != 0 {
                let x = window.columns.0 + bits.trailing_zeros() as usize;
                bits &= bits - 1;
                let at = grid.at(x, y);
                self.x.push(x as f32 - x0 as f32 + samples.x[at]);
                self.y.push(y as f32 - y0 as f32 + samples.y[at]);
                self.count.push(samples.count[at]);
                for k in 0..3 {
                    let value = samples.rgb[k][at];
                    self.rgb[k].push(value);
                    self.low[k] = self.low[k].min(value);
                    self.high[k] = self.high[k].max(value);
                }
            }
        }
    }
}

/// Fits a plane for each pixel of a tile's row that is wanted. `at` is the row's first element, `down` its place in the tile.
#[simd]
fn fit_row<S: Simd>(
    simd: S,
    from: &Gathered,
    (at, down): (usize, f32),
    wanted: u64,
    out: &mut Interpolated,
) {
    let lanes = S::f32s::LEN;
    let splat = |v: f32| S::f32s::splat(simd, v);
    let zero = splat(0.0);
    let steps: [f32; TILE_COLUMNS] = std::array::from_fn(|i| i as f32 + 0.5);
    for group in (0..TILE_COLUMNS).step_by(lanes) {
        let bits = wanted >> group & ((1u64 << lanes) - 1);
        if bits == 0 {
            continue;
        }
        let middle = S::f32s::from_slice(simd, &steps[group..group + lanes]);
        let [mut w0, mut wx, mut wy, mut wxx, mut wxy, mut wyy] = [zero; 6];
        let [mut c0, mut cx, mut cy] = [[zero; 3]; 3];
        for i in 0..from.x.len() {
            let x = splat(from.x[i]) - middle;
            let y = splat(from.y[i] - down - 0.5);
            let q = splat(0.25) + x * x + y * y;
            let r = reciprocal(simd, q);
            let w = splat(from.count[i]) * (r * r);
            let (ux, uy) = (w * x, w * y);
            w0 += w;
            wx += ux;
            wy += uy;
            wxx += ux * x;
            wxy += ux * y;
            wyy += uy * y;
            for k in 0..3 {
                let c = splat(from.rgb[k][i]);
                c0[k] += w * c;
                cx[k] += ux * c;
                cy[k] += uy * c;
            }
        }
        let inv = splat(1.0) / w0;
        let (x, y, xy) = (wx * inv, wy * inv, wxy * inv);
        let ridge = splat(SLOPE_RIDGE) * (splat(1.0) + (wxx + wyy) * inv);
        let (xx, yy) = (wxx * inv + ridge, wyy * inv + ridge);
        let k0 = xx * yy - xy * xy;
        let kx = y * xy - x * yy;
        let ky = x * xy - y * xx;
        let scale = inv / (k0 + x * kx + y * ky);
        let used = S::mask32s::from_bitmask(simd, bits);
        for k in 0..3 {
            let value = (k0 * c0[k] + kx * cx[k] + ky * cy[k]) * scale;
            let value = value.max(splat(from.low[k])).min(splat(from.high[k]));
            let place = &mut out.rgb[k][at + group..at + group + lanes];
            let before = S::f32s::from_slice(simd, place);
            used.select(value, before).store_slice(place);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::place::hash_unit;

    fn scene(grid: Grid, share: f32) -> PixelSamples {
        let mut samples = PixelSamples::new(grid);
        for y in 0..grid.height {
            for x in 0..grid.width {
                if hash_unit(3, (y * 1000 + x) as u64) < share {
                    let at = grid.at(x, y);
                    for k in 0..3 {
                        samples.rgb[k][at] =
                            0.1 + 0.002 * (x as f32 + 0.5) + 0.003 * (y as f32 + 0.5);
                    }
                    samples.has[grid.bit(x, y).0] |= 1 << grid.bit(x, y).1;
                }
            }
        }
        samples
    }

    fn run(level: Level, samples: &PixelSamples, edges: &[u64]) -> (Interpolated, Vec<u64>) {
        let grid = samples.grid;
        let mut out = Interpolated::new(grid);
        let mut left: Vec<u64> = (0..grid.plane_words())
            .map(|i| grid.valid(i % grid.words))
            .collect();
        out.bare.copy_from_slice(&left);
        let planes = Planes {
            edges,
            has: &samples.has,
        };
        fill(
            level,
            samples,
            planes,
            &mut left,
            &mut Gathered::default(),
            &mut out,
        );
        (out, left)
    }

    #[test]
    fn a_plane_is_found_again_at_every_level_alike() {
        let grid = Grid::new(150, 61);
        let samples = scene(grid, 0.04);
        let edges = vec![0; grid.plane_words()];
        let (out, left) = run(Level::new(), &samples, &edges);
        assert!(left.iter().all(|&w| w == 0) && out.bare.iter().all(|&w| w == 0));
        for y in 8..50 {
            for x in 8..140 {
                let exact = 0.1 + 0.002 * (x as f32 + 0.5) + 0.003 * (y as f32 + 0.5);
                assert!((out.rgb[0][grid.at(x, y)] - exact).abs() < 0.02, "{x} {y}");
            }
        }
        let (plain, _) = run(Level::baseline(), &samples, &edges);
        assert_eq!(out.rgb, plain.rgb);
    }

    #[test]
    fn tiles_with_an_edge_near_are_left_alone() {
        let grid = Grid::new(128, 64);
        let samples = scene(grid, 0.04);
        let mut edges = vec![0; grid.plane_words()];
        edges[grid.bit(70, 30).0] |= 1 << grid.bit(70, 30).1;
        let (_, left) = run(Level::new(), &samples, &edges);
        let is_left = |x, y| left[grid.bit(x, y).0] >> grid.bit(x, y).1 & 1 == 1;
        assert!(is_left(70, 30) && is_left(65, 25) && !is_left(10, 5));
        let (_, left) = run(Level::new(), &PixelSamples::new(grid), &edges);
        assert!(left.iter().all(|&w| w == !0));
    }
}
