//! From linear radiance to what a display shows: clamped to [0, 1] and sRGB-encoded (IEC 61966-2-1).

use crate::epi::grid::Grid;

/// Below 2 to this power a value encodes to less than one step of 255, and is taken for 2 to this power.
const LEAST_EXPONENT: i32 = -12;

/// Bits of a float's mantissa that the table tells apart.
const MANTISSA_BITS: u32 = 8;

/// The encoding as a table, a byte for each exponent and leading bits of the mantissa: as fine in the dark, where encoding is
/// steep, as in the light. The result is never more than one step of 255 away from the exact one.
#[derive(Clone, Debug)]
pub struct ToneMap {
    table: Vec<u8>,
    least: f32,
}

/// sRGB encoding of a linear value in [0, 1].
pub fn srgb(linear: f32) -> f32 {
    if linear <= 0.003_130_8 {
        12.92 * linear
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    }
}

impl Default for ToneMap {
    fn default() -> Self {
        Self::new()
    }
}

impl ToneMap {
    /// Computes the table.
    pub fn new() -> Self {
        let least = 2f32.powi(LEAST_EXPONENT);
        let entries = (-LEAST_EXPONENT as u32) << MANTISSA_BITS;
        let value = |i: u32| {
            let from = least.to_bits() + (i << (23 - MANTISSA_BITS));
            let middle = f32::from_bits(from + (1 << (22 - MANTISSA_BITS)));
            (srgb(middle.min(1.0)) * 255.0).round() as u8
        };
        Self {
            table: std::iter::once(0).chain((1..=entries).map(value)).collect(),
            least,
        }
    }

    /// Encodes one value; NaN becomes 0.
    #[inline]
    pub fn encode(&self, linear: f32) -> u8 {
        let bits = linear.max(self.least).min(1.0).to_bits() - self.least.to_bits();
        self.table[(bits >> (23 - MANTISSA_BITS)) as usize]
    }

    /// Encodes an image (planes by [`Grid`]) as 0x00RRGGBB, row by row without padding.
    pub fn map(&self, grid: Grid, rgb: &[Vec<f32>; 3], out: &mut Vec<u32>) {
        out.clear();
        for y in 0..grid.height {
            let row = grid.at(0, y)..grid.at(grid.width, y);
            let planes = rgb[0][row.clone()]
                .iter()
                .zip(&rgb[1][row.clone()])
                .zip(&rgb[2][row]);
            out.extend(planes.map(|((&r, &g), &b)| {
                u32::from(self.encode(r)) << 16
                    | u32::from(self.encode(g)) << 8
                    | u32::from(self.encode(b))
            }));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_within_a_step_of_the_exact_encoding() {
        let tone = ToneMap::new();
        for i in 0..=200_000 {
            let v = i as f32 / 200_000.0;
            let exact = srgb(v) * 255.0;
            assert!((f32::from(tone.encode(v)) - exact).abs() <= 1.0, "{v}");
        }
        assert_eq!(
            [tone.encode(f32::NAN), tone.encode(-1.0), tone.encode(9.0)],
            [0, 0, 255]
        );
    }
}
