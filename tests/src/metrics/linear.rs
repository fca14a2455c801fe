//! Point-wise metrics. Sizes are taken as equal: [`super::score`] checks them.

use crate::picture::Picture;

/// Offset of the denominator of relMSE, in squared linear units, as in the viewer tev.
const REL_MSE_EPSILON: f64 = 0.01;

fn pairs<'a>(test: &'a Picture, reference: &'a Picture) -> impl Iterator<Item = (f64, f64)> + 'a {
    let flat = |p: &'a Picture| p.rgb().iter().flatten().map(|v| f64::from(*v));
    flat(test).zip(flat(reference))
}

/// Root of the mean squared difference of linear values.
pub fn rmse(test: &Picture, reference: &Picture) -> f64 {
    let squares: f64 = pairs(test, reference).map(|(t, r)| (t - r).powi(2)).sum();
    (squares / (3 * test.rgb().len()) as f64).sqrt()
}

/// d² / (ref² + 0.01) of every linear value: the terms of relMSE.
pub fn relative_squares(test: &Picture, reference: &Picture) -> Vec<f64> {
    pairs(test, reference)
        .map(|(t, r)| (t - r).powi(2) / (r * r + REL_MSE_EPSILON))
        .collect()
}

/// Arithmetic mean; 0 for no values.
pub fn mean(values: &[f64]) -> f64 {
    if values.is_empty() {
        0.0
    } else {
        values.iter().sum::<f64>() / values.len() as f64
    }
}

/// Mean of `values` without the largest `share` of them (rounded down).
pub fn mean_without_top(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let dropped = (values.len() as f64 * share) as usize;
    mean(&values[..values.len() - dropped.min(values.len())])
}

/// Peak signal-to-noise ratio in dB of sRGB values clamped to [0, 1], peak 1; infinite for equal pictures.
pub fn psnr_db(test: &Picture, reference: &Picture) -> f64 {
    let (test, reference) = (test.to_srgb(), reference.to_srgb());
    let squares: f64 = test
        .iter()
        .flatten()
        .zip(reference.iter().flatten())
        .map(|(t, r)| (f64::from(*t) - f64::from(*r)).powi(2))
        .sum();
    -10.0 * (squares / (3 * test.len()) as f64).log10()
}

/// Mean linear value over all pixels and channels.
pub fn mean_value(picture: &Picture) -> f64 {
    let sum: f64 = picture.rgb().iter().flatten().map(|v| f64::from(*v)).sum();
    sum / (3 * picture.rgb().len()) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(values: &[f32]) -> Picture {
        let rgb = values.iter().map(|v| [*v; 3]).collect();
        Picture::from_linear([values.len() as u32, 1], rgb).unwrap()
    }

    #[test]
    fn known_values() {
        let (test, reference) = (picture(&[1.0, 0.0]), picture(&[0.0, 0.0]));
        assert!((rmse(&test, &reference) - 0.5_f64.sqrt()).abs() < 1e-12);
        // One of two pixels is off by 1 in linear and in sRGB: 1 / 0.01 halved, and -10 log10(1/2).
        assert!((mean(&relative_squares(&test, &reference)) - 50.0).abs() < 1e-9);
        assert!((psnr_db(&test, &reference) - 3.010_299_956).abs() < 1e-6);
        assert_eq!(mean_value(&test), 0.5);
    }

    #[test]
    fn relative_error_divides_by_the_reference() {
        let terms = relative_squares(&picture(&[0.0]), &picture(&[2.0]));
        assert!((terms[0] - 4.0 / 4.01).abs() < 1e-12);
    }

    #[test]
    fn equal_pictures_have_no_error() {
        let p = picture(&[0.1, 3.0, 0.7]);
        assert_eq!(rmse(&p, &p), 0.0);
        assert_eq!(psnr_db(&p, &p), f64::INFINITY);
    }

    #[test]
    fn trimming_drops_exactly_the_top_share() {
        let mut values = vec![1.0; 2000];
        values[77] = 1e9;
        values[1999] = 1e6;
        assert_eq!(mean_without_top(values.clone(), 0.001), 1.0);
        assert!(mean_without_top(values, 0.0005) > 1.0);
        assert_eq!(mean_without_top(vec![], 0.001), 0.0);
    }
}
