//! FLIP (Andersson et al. 2020) on 8-bit sRGB, and its mean near the reference's edges.

use image::RgbImage;
use nv_flip::{DEFAULT_PIXELS_PER_DEGREE, FlipImageFloat, FlipImageRgb8};

use crate::picture::{Picture, PictureError};

/// A step of the logarithm of luminance above which a pixel counts as lying at an edge.
const EDGE_LOG_STEP: f32 = 0.15;
/// Luminance below which differences are not seen as steps.
const LUMINANCE_FLOOR: f32 = 1e-3;

/// The perceived difference of every pixel, 0 (none) to 1.
pub struct FlipMap {
    size_px: [u32; 2],
    values: Vec<f32>,
}

impl FlipMap {
    /// The map between two pictures, clamped and sRGB-encoded to 8 bits, at 67 pixels a degree.
    ///
    /// # Errors
    /// [`PictureError::SizeMismatch`] when the sizes differ.
    pub fn between(test: &Picture, reference: &Picture) -> Result<Self, PictureError> {
        test.check_same_size(reference)?;
        let [width, height] = test.size_px();
        let to_flip = |p: &Picture| FlipImageRgb8::with_data(width, height, &p.to_srgb8());
        let map = nv_flip::flip(to_flip(reference), to_flip(test), DEFAULT_PIXELS_PER_DEGREE);
        Ok(Self {
            size_px: [width, height],
            values: map.to_vec(),
        })
    }

    /// Mean over all pixels.
    pub fn mean(&self) -> f64 {
        self.values.iter().map(|v| f64::from(*v)).sum::<f64>() / self.values.len() as f64
    }

    /// Mean over the pixels whose entry in `mask` is set; none when no entry is.
    pub fn mean_over(&self, mask: &[bool]) -> Option<f64> {
        let mut sum = 0.0;
        let mut count = 0_usize;
        for (value, _) in self.values.iter().zip(mask).filter(|(_, set)| **set) {
            sum += f64::from(*value);
            count += 1;
        }
        (count > 0).then(|| sum / count as f64)
    }

    /// Row-major values from the top left.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// The map in the magma palette, dark where the pictures agree.
    pub fn to_magma(&self) -> RgbImage {
        let [width, height] = self.size_px;
        let map = FlipImageFloat::with_data(width, height, &self.values);
        let colours = map.apply_color_lut(&nv_flip::magma_lut()).to_vec();
        RgbImage::from_raw(width, height, colours)
            .expect("the colour map has exactly width * height * 3 values by construction")
    }
}

/// Pixels whose luminance (mean of linear channels, at least 1e-3) differs from the left or the upper
/// neighbour's by more than 0.15 in natural logarithm: the "near edges" of `references/README.md`.
pub fn edge_mask(reference: &Picture) -> Vec<bool> {
    let width = reference.size_px()[0] as usize;
    let log_luminance: Vec<f32> = reference
        .rgb()
        .iter()
        .map(|[r, g, b]| ((r + g + b) / 3.0).max(LUMINANCE_FLOOR).ln())
        .collect();
    let step = |i: usize, j: usize| (log_luminance[i] - log_luminance[j]).abs() > EDGE_LOG_STEP;
    (0..log_luminance.len())
        .map(|i| (i % width > 0 && step(i, i - 1)) || (i >= width && step(i, i - width)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disc of brightness `inside` on 0.1, its centre moved right by `shift_px`.
    fn disc(inside: f32, shift_px: f32) -> Picture {
        let value = |i: usize| {
            let (x, y) = ((i % 64) as f32 - 32.0 - shift_px, (i / 64) as f32 - 32.0);
            if x.hypot(y) < 16.0 {
                [inside; 3]
            } else {
                [0.1; 3]
            }
        };
        Picture::from_linear([64, 64], (0..64 * 64).map(value).collect()).unwrap()
    }

    #[test]
    fn zero_for_equal_pictures_and_growing_with_the_shift() {
        let reference = disc(0.5, 0.0);
        let at = |shift| {
            FlipMap::between(&disc(0.5, shift), &reference)
                .unwrap()
                .mean()
        };
        assert_eq!(at(0.0), 0.0);
        let shifts = [at(1.0), at(2.0), at(4.0)];
        assert!(shifts[0] > 0.005 && shifts.is_sorted(), "{shifts:?}");
    }

    #[test]
    fn black_against_white_is_close_to_one() {
        let flat = |v| Picture::from_linear([32, 32], vec![[v; 3]; 1024]).unwrap();
        let map = FlipMap::between(&flat(0.0), &flat(1.0)).unwrap();
        assert!(map.mean() > 0.9, "{}", map.mean());
    }

    #[test]
    fn a_shifted_edge_scores_higher_near_edges() {
        let reference = disc(0.5, 0.0);
        let map = FlipMap::between(&disc(0.5, 1.0), &reference).unwrap();
        let near = map.mean_over(&edge_mask(&reference)).unwrap();
        assert!(near > 3.0 * map.mean(), "{near} against {}", map.mean());
    }

    #[test]
    fn the_mask_marks_the_right_and_lower_side_of_a_step() {
        let rgb = [0.1, 0.1, 0.2, 0.1, 0.1, 0.2, 0.2, 0.2, 0.2]
            .map(|v| [v; 3])
            .to_vec();
        let mask = edge_mask(&Picture::from_linear([3, 3], rgb).unwrap());
        assert_eq!(
            mask,
            [false, false, true, false, false, true, true, true, false]
        );
    }

    #[test]
    fn steps_are_relative_and_floored() {
        let row = |a: f32, b: f32| Picture::from_linear([2, 1], vec![[a; 3], [b; 3]]).unwrap();
        assert!(!edge_mask(&row(1.0, 1.16))[1]);
        assert!(edge_mask(&row(1.0, 1.17))[1]);
        assert!(!edge_mask(&row(1e-6, 1e-3))[1]);
    }

    #[test]
    fn no_edges_means_no_mean() {
        let flat = Picture::from_linear([4, 4], vec![[0.3; 3]; 16]).unwrap();
        let map = FlipMap::between(&flat, &flat).unwrap();
        assert_eq!(map.mean_over(&edge_mask(&flat)), None);
    }
}
