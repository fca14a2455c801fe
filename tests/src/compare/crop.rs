//! Enlarged crops side by side, for looking at pictures.

use image::{Rgb, RgbImage, imageops};

use super::CompareError;

/// Grey columns between two panels, in output pixels.
const GAP_PX: u32 = 4;
/// Largest width or height of the output, pixels.
const MAX_OUTPUT_PX: u64 = 16_384;

/// A part of a picture and how much it is enlarged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Crop {
    /// Left column and top row, pixels.
    pub origin_px: [u32; 2],
    /// Width and height, pixels.
    pub size_px: [u32; 2],
    /// Whole enlargement factor, at least 1.
    pub scale: u32,
}

impl Crop {
    /// Reads `X,Y,W,H,SCALE`.
    ///
    /// # Errors
    /// [`CompareError::BadCrop`] when a number is missing, is no whole number, or is 0 where it must not be.
    pub fn parse(text: &str) -> Result<Self, CompareError> {
        let bad = |reason: &str| CompareError::BadCrop {
            text: text.into(),
            reason: reason.into(),
        };
        let numbers: Vec<u32> = text
            .split(',')
            .map(|n| {
                n.trim()
                    .parse()
                    .map_err(|_| bad("five whole numbers are needed"))
            })
            .collect::<Result<_, _>>()?;
        let [x, y, w, h, scale] = numbers[..] else {
            return Err(bad("five whole numbers are needed"));
        };
        if w == 0 || h == 0 || scale == 0 {
            return Err(bad("width, height and scale are at least 1"));
        }
        Ok(Self {
            origin_px: [x, y],
            size_px: [w, h],
            scale,
        })
    }
}

/// The same part of every panel, each pixel enlarged to a square, side by side.
///
/// # Errors
/// [`CompareError::BadCrop`] when the part is not inside every panel or the result would be huge.
pub fn render_crop(panels: &[RgbImage], crop: Crop) -> Result<RgbImage, CompareError> {
    let [x, y] = crop.origin_px;
    let [w, h] = crop.size_px;
    let bad = |reason: String| CompareError::BadCrop {
        text: format!("{crop:?}"),
        reason,
    };
    let fits = |p: &RgbImage| {
        u64::from(x) + u64::from(w) <= p.width().into()
            && u64::from(y) + u64::from(h) <= p.height().into()
    };
    if let Some(panel) = panels.iter().find(|p| !fits(p)) {
        return Err(bad(format!(
            "the picture has {}x{} pixels",
            panel.width(),
            panel.height()
        )));
    }
    let scaled = |v: u32| u64::from(v) * u64::from(crop.scale);
    let width = (scaled(w) + u64::from(GAP_PX)) * panels.len().max(1) as u64 - u64::from(GAP_PX);
    if width > MAX_OUTPUT_PX || scaled(h) > MAX_OUTPUT_PX {
        return Err(bad(format!(
            "the result would be {width}x{} pixels",
            scaled(h)
        )));
    }
    let mut result = RgbImage::from_pixel(width as u32, scaled(h) as u32, Rgb([96, 96, 96]));
    for (i, panel) in panels.iter().enumerate() {
        let part = imageops::crop_imm(panel, x, y, w, h).to_image();
        let (w, h) = (w * crop.scale, h * crop.scale);
        let large = imageops::resize(&part, w, h, imageops::FilterType::Nearest);
        imageops::replace(&mut result, &large, i64::from((w + GAP_PX) * i as u32), 0);
    }
    Ok(result)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_are_enlarged_pixel_by_pixel() {
        let panel = |base: u8| RgbImage::from_fn(3, 2, |x, y| Rgb([base + x as u8, y as u8, 0]));
        let crop = Crop::parse("1,0,2,2,3").unwrap();
        let result = render_crop(&[panel(10), panel(20)], crop).unwrap();
        assert_eq!(result.dimensions(), (2 * 6 + 4, 6));
        assert_eq!(result.get_pixel(0, 0).0, [11, 0, 0]);
        assert_eq!(result.get_pixel(5, 5).0, [12, 1, 0]);
        assert_eq!(result.get_pixel(10 + 2, 2).0, [21, 0, 0]);
        assert_eq!(result.get_pixel(7, 3).0, [96, 96, 96]);
    }

    #[test]
    fn bad_crops_say_why() {
        for text in [
            "",
            "1,2,3,4",
            "1,2,3,4,x",
            "0,0,0,4,1",
            "0,0,1,1,0",
            "0,0,1,1,-1",
        ] {
            assert!(Crop::parse(text).is_err(), "{text}");
        }
        let panel = RgbImage::new(4, 4);
        let outside = Crop {
            origin_px: [2, 0],
            size_px: [3, 1],
            scale: 1,
        };
        assert!(
            render_crop(std::slice::from_ref(&panel), outside)
                .unwrap_err()
                .to_string()
                .contains("4x4")
        );
        let huge = Crop {
            origin_px: [0, 0],
            size_px: [4, 4],
            scale: 100_000,
        };
        assert!(render_crop(&[panel], huge).is_err());
    }
}
