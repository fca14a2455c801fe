//! From linear radiance to what a display shows: clamped to [0, 1] and sRGB-encoded (IEC 61966-2-1).

use fearless_simd::{Level, dispatch, prelude::*};
use fearless_simd_macros::simd;

use crate::epi::grid::Grid;

/// Where encoding turns from a line to a power.
const LINE: f32 = 0.003_130_8;

/// The power's part of the encoding, 0.055 included, as a polynomial in the root of the linear value, lowest power first:
/// the best one of its degree on [`LINE`]..1, at most 0.04 steps of 255 from the exact encoding.
const ROOT: [f32; 7] = [
    -0.042_231_94,
    1.575_270_6,
    -1.899_474_4,
    3.898_433_8,
    -5.003_155,
    3.418_675_4,
    -0.947_667_7,
];

/// The encoding in steps of 255, without a table. The result is within half a step and a twentieth of the exact one.
#[derive(Clone, Copy, Debug)]
pub struct ToneMap {
    level: Level,
}

/// sRGB encoding of a linear value in [0, 1].
pub fn srgb(linear: f32) -> f32 {
    if linear <= LINE {
        12.92 * linear
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    }
}

/// The linear value that an sRGB-encoded one in [0, 1] stands for.
pub fn linear(encoded: f32) -> f32 {
    if encoded <= 12.92 * 0.003_130_8 {
        encoded / 12.92
    } else {
        ((encoded + 0.055) / 1.055).powf(2.4)
    }
}

impl Default for ToneMap {
    fn default() -> Self {
        Self::new()
    }
}

impl ToneMap {
    /// For this machine.
    pub fn new() -> Self {
        Self::at(Level::new())
    }

    /// With the instructions of a level; results do not depend on it.
    pub fn at(level: Level) -> Self {
        Self { level }
    }

    /// Encodes one value; NaN becomes 0.
    pub fn encode(&self, linear: f32) -> u8 {
        // The operations of `encode_lanes`, in their order.
        let clamped = if linear > 0.0 { linear.min(1.0) } else { 0.0 };
        let root = clamped.sqrt();
        let [rest @ .., highest] = ROOT;
        let power = rest.iter().rev().fold(highest, |sum, c| sum * root + c);
        let encoded = if clamped > LINE {
            power
        } else {
            clamped * 12.92
        };
        (encoded * 255.0 + 0.5) as u8
    }

    /// Encodes an image (planes by [`Grid`]) as 0x00RRGGBB, row by row without padding.
    pub fn map(&self, grid: Grid, rgb: &[Vec<f32>; 3], out: &mut Vec<u32>) {
        out.resize(grid.width * grid.height, 0);
        dispatch!(self.level, simd => map_rows(simd, grid, rgb, out));
    }
}

#[simd]
fn map_rows<S: Simd>(simd: S, grid: Grid, rgb: &[Vec<f32>; 3], out: &mut [u32]) {
    let lanes = S::f32s::LEN;
    for y in 0..grid.height {
        let row = &mut out[y * grid.width..(y + 1) * grid.width];
        let planes = [0, 1, 2].map(|c| &rgb[c][grid.at(0, y)..][..grid.stride]);
        let whole = grid.width - grid.width % lanes;
        for x in (0..whole).step_by(lanes) {
            colours(simd, planes, x).store_slice(&mut row[x..x + lanes]);
        }
        if whole < grid.width {
            // Rows are padded to whole words, of which a vector is a part.
            let mut last = [0; 64];
            colours(simd, planes, whole).store_slice(&mut last[..lanes]);
            row[whole..].copy_from_slice(&last[..grid.width - whole]);
        }
    }
}

/// Encodes as many pixels of a row as a vector holds.
#[inline(always)]
fn colours<S: Simd>(simd: S, planes: [&[f32]; 3], x: usize) -> S::u32s {
    let to = x + S::f32s::LEN;
    let r = encode_lanes(simd, S::f32s::from_slice(simd, &planes[0][x..to]));
    let g = encode_lanes(simd, S::f32s::from_slice(simd, &planes[1][x..to]));
    let b = encode_lanes(simd, S::f32s::from_slice(simd, &planes[2][x..to]));
    r << 16 | g << 8 | b
}

#[inline(always)]
fn encode_lanes<S: Simd>(simd: S, linear: S::f32s) -> S::u32s {
    let splat = |v: f32| S::f32s::splat(simd, v);
    let (zero, one) = (splat(0.0), splat(1.0));
    let clamped = linear.simd_gt(zero).select(linear, zero).min(one);
    let root = clamped.sqrt();
    let mut power = splat(ROOT[ROOT.len() - 1]);
    for k in (0..ROOT.len() - 1).rev() {
        power = power * root + splat(ROOT[k]);
    }
    let line = clamped * splat(12.92);
    let encoded = clamped.simd_gt(splat(LINE)).select(power, line);
    S::u32s::truncate_from(encoded * splat(255.0) + splat(0.5))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encoding_is_within_a_twentieth_of_a_step_of_rounding() {
        let tone = ToneMap::new();
        for i in 0..=400_000 {
            let v = i as f32 / 400_000.0;
            let exact = srgb(v) * 255.0;
            assert!((f32::from(tone.encode(v)) - exact).abs() <= 0.55, "{v}");
        }
        assert_eq!(
            [tone.encode(f32::NAN), tone.encode(-1.0), tone.encode(9.0)],
            [0, 0, 255]
        );
    }

    #[test]
    fn bytes_come_back_as_they_were() {
        let tone = ToneMap::new();
        for byte in 0..=255u8 {
            let v = f32::from(byte) / 255.0;
            let linear = if v <= 0.040_45 {
                v / 12.92
            } else {
                ((v + 0.055) / 1.055).powf(2.4)
            };
            assert_eq!(tone.encode(linear), byte);
        }
    }

    #[test]
    fn images_are_encoded_value_by_value_at_every_level() {
        let special = [f32::NAN, -1.0, 0.0, 1e-40, LINE, 1.0, 7.0, f32::INFINITY];
        for width in [1, 15, 64, 83] {
            let grid = Grid::new(width, 5);
            let value = |at: usize, c: usize| match at % 11 {
                k @ 0..8 => special[(k + c) % 8],
                _ => (at * 7 + c * 31) as f32 % 251.0 / 250.0,
            };
            let rgb = [0, 1, 2].map(|c| (0..grid.elements()).map(|at| value(at, c)).collect());
            let (mut mapped, mut wanted) = (vec![9; 7], Vec::new());
            let one = ToneMap::new();
            for y in 0..5 {
                for x in 0..width {
                    let [r, g, b] =
                        [0, 1, 2].map(|c| u32::from(one.encode(value(grid.at(x, y), c))));
                    wanted.push(r << 16 | g << 8 | b);
                }
            }
            for level in [Level::new(), Level::baseline()] {
                ToneMap::at(level).map(grid, &rgb, &mut mapped);
                assert_eq!(mapped, wanted, "{width}");
            }
        }
    }
}
