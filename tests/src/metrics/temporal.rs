//! Metrics over sequences: flicker, shimmer, recovery and ghosts. All work on display (sRGB) values
//! clamped to [0, 1], since they measure what a viewer sees.

use crate::picture::{Picture, PictureError};

/// Mean |(fₜ − fₜ₋₁) − (rₜ − rₜ₋₁)| over pixels and channels: change that the reference does not have.
/// A constantly wrong picture scores 0, so it is always reported beside the error itself.
///
/// # Errors
/// [`PictureError::SizeMismatch`] when the four pictures differ in size.
pub fn flicker(test: [&Picture; 2], reference: [&Picture; 2]) -> Result<f64, PictureError> {
    for picture in [test[1], reference[0], reference[1]] {
        test[0].check_same_size(picture)?;
    }
    let [t0, t1, r0, r1] = [test[0], test[1], reference[0], reference[1]].map(Picture::to_srgb);
    let mut sum = 0.0;
    for i in 0..t0.len() {
        for c in 0..3 {
            sum += f64::from(((t1[i][c] - t0[i][c]) - (r1[i][c] - r0[i][c])).abs());
        }
    }
    Ok(sum / (3 * t0.len()) as f64)
}

/// Mean over pixels and channels of the standard deviation over `frames` of a still view.
///
/// # Errors
/// [`PictureError::SizeMismatch`] when the frames differ in size; 0 for fewer than two frames.
pub fn shimmer(frames: &[Picture]) -> Result<f64, PictureError> {
    let Some(first) = frames.first() else {
        return Ok(0.0);
    };
    let values = 3 * first.rgb().len();
    let (mut sums, mut squares) = (vec![0.0_f64; values], vec![0.0_f64; values]);
    for frame in frames {
        first.check_same_size(frame)?;
        for (i, v) in frame.to_srgb().into_iter().flatten().enumerate() {
            sums[i] += f64::from(v);
            squares[i] += f64::from(v) * f64::from(v);
        }
    }
    let n = frames.len() as f64;
    let deviation = |(s, q): (&f64, &f64)| (q / n - (s / n).powi(2)).max(0.0).sqrt();
    Ok(sums.iter().zip(&squares).map(deviation).sum::<f64>() / values as f64)
}

/// Frames after a step at index `step` until the error is at most 1.1 times its settled value, which is
/// the mean of the last `settle` errors; none when that never happens or there are too few frames.
pub fn recovery_frames(errors: &[f64], step: usize, settle: usize) -> Option<usize> {
    let tail = errors.get(errors.len().checked_sub(settle)?..)?;
    let settled = super::linear::mean(tail);
    errors.get(step..)?.iter().position(|e| *e <= 1.1 * settled)
}

/// Share of pixels, 0 to 1, whose colour is nearer to the picture before a change than to the one after.
/// Pixels that the change does not touch never count.
///
/// # Errors
/// [`PictureError::SizeMismatch`] when the sizes differ.
pub fn ghost_share(test: &Picture, old: &Picture, new: &Picture) -> Result<f64, PictureError> {
    test.check_same_size(old)?;
    test.check_same_size(new)?;
    let [test, old, new] = [test, old, new].map(Picture::to_srgb);
    let distance =
        |a: [f32; 3], b: [f32; 3]| (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum::<f64>();
    let ghosts = (0..test.len())
        .filter(|&i| distance(test[i], old[i]) < distance(test[i], new[i]))
        .count();
    Ok(ghosts as f64 / test.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::srgb_to_linear;

    /// A one-row picture whose display values are `values`.
    fn display(values: &[f32]) -> Picture {
        let rgb = values.iter().map(|v| [srgb_to_linear(*v); 3]).collect();
        Picture::from_linear([values.len() as u32, 1], rgb).unwrap()
    }

    #[test]
    fn flicker_ignores_constant_error_and_true_change() {
        let reference = [&display(&[0.2, 0.4]), &display(&[0.3, 0.4])];
        let offset = [&display(&[0.3, 0.5]), &display(&[0.4, 0.5])];
        assert!(flicker(offset, reference).unwrap() < 1e-6);
        let frozen = [&display(&[0.2, 0.4]), &display(&[0.2, 0.4])];
        assert!((flicker(frozen, reference).unwrap() - 0.05).abs() < 1e-6);
    }

    #[test]
    fn shimmer_is_the_standard_deviation() {
        let frames = [display(&[0.2, 0.5]), display(&[0.4, 0.5])];
        assert!((shimmer(&frames).unwrap() - 0.05).abs() < 1e-6);
        assert_eq!(shimmer(&[]).unwrap(), 0.0);
    }

    #[test]
    fn recovery_counts_from_the_step() {
        let errors = [0.1, 0.1, 0.9, 0.5, 0.115, 0.1, 0.1, 0.1];
        assert_eq!(recovery_frames(&errors, 2, 2), Some(3));
        assert_eq!(recovery_frames(&errors, 9, 2), None);
        assert_eq!(recovery_frames(&errors, 0, 9), None);
    }

    #[test]
    fn ghosts_are_pixels_nearer_to_the_old_scene() {
        let (old, new) = (display(&[0.1, 0.1, 0.5]), display(&[0.9, 0.9, 0.5]));
        let share = ghost_share(&display(&[0.2, 0.8, 0.1]), &old, &new).unwrap();
        assert!((share - 1.0 / 3.0).abs() < 1e-9);
    }
}
