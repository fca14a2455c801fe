//! From linear radiance to what a display shows: clamped to [0, 1] and sRGB-encoded (IEC 61966-2-1).

use crate::epi::grid::Grid;

/// Steps of the look-up table over [0, 1].
const STEPS: usize = 4096;

/// The encoding as a table, a byte for each of `STEPS` + 1 linear values.
///
/// Linear values near 0 are encoded steeply: below 1/64 a second table with 64 times the resolution is used, so that the
/// result is never more than one step of 255 away from the exact one.
#[derive(Clone, Debug)]
pub struct ToneMap {
    coarse: Vec<u8>,
    fine: Vec<u8>,
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
    /// Computes the tables.
    pub fn new() -> Self {
        let table = |top: f32| {
            (0..=STEPS)
                .map(|i| (srgb(top * i as f32 / STEPS as f32) * 255.0).round() as u8)
                .collect()
        };
        Self {
            coarse: table(1.0),
            fine: table(1.0 / 64.0),
        }
    }

    /// Encodes one value; NaN becomes 0.
    #[inline]
    pub fn encode(&self, linear: f32) -> u8 {
        let v = if linear > 0.0 { linear.min(1.0) } else { 0.0 };
        if v < 1.0 / 64.0 {
            self.fine[(v * (64 * STEPS) as f32 + 0.5) as usize]
        } else {
            self.coarse[(v * STEPS as f32 + 0.5) as usize]
        }
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
