//! Error metrics between a test picture and a reference, and between two sequences.

pub mod flip;
pub mod linear;
pub mod temporal;

use serde::Serialize;

use crate::picture::{Picture, PictureError};
pub use flip::{FlipMap, edge_mask};

/// All single-picture metrics of one pair, as `compare` prints them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Scores {
    /// Mean of the FLIP map, 0 to 1, at 67 pixels a degree, on 8-bit sRGB.
    pub flip: f64,
    /// Mean of the same map over pixels at a luminance step of the reference; none if there is no step.
    pub flip_edges: Option<f64>,
    /// Root mean square error of linear RGB.
    pub rmse: f64,
    /// Mean of d² / (ref² + 0.01) over linear values.
    pub rel_mse: f64,
    /// The same without the largest 0.1 % of terms.
    pub rel_mse_trimmed: f64,
    /// Peak signal-to-noise ratio in dB on sRGB values clamped to [0, 1]; infinite when they are equal.
    #[serde(serialize_with = "finite_or_null")]
    pub psnr_db: f64,
    /// Mean linear value of the test picture over all channels.
    pub mean_test: f64,
    /// Mean linear value of the reference over all channels.
    pub mean_reference: f64,
    /// Pixels of the test picture with a NaN or an infinity; scored as black.
    pub non_finite_pixels: usize,
}

fn finite_or_null<S: serde::Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    if value.is_finite() {
        serializer.serialize_f64(*value)
    } else {
        serializer.serialize_none()
    }
}

/// Scores of `test` against `reference`, and the FLIP map they rest on.
///
/// # Errors
/// [`PictureError::SizeMismatch`] when the sizes differ.
pub fn score(test: &Picture, reference: &Picture) -> Result<(Scores, FlipMap), PictureError> {
    test.check_same_size(reference)?;
    let (test, non_finite_pixels) = test.clone().without_non_finite();
    let (reference, _) = reference.clone().without_non_finite();
    let map = FlipMap::between(&test, &reference)?;
    let relative = linear::relative_squares(&test, &reference);
    let scores = Scores {
        flip: map.mean(),
        flip_edges: map.mean_over(&edge_mask(&reference)),
        rmse: linear::rmse(&test, &reference),
        rel_mse: linear::mean(&relative),
        rel_mse_trimmed: linear::mean_without_top(relative, 0.001),
        psnr_db: linear::psnr_db(&test, &reference),
        mean_test: linear::mean_value(&test),
        mean_reference: linear::mean_value(&reference),
        non_finite_pixels,
    };
    Ok((scores, map))
}
