//! Pictures in linear RGB, read from EXR or PNG, and their display (sRGB) form.

use std::path::{Path, PathBuf};

use image::{ImageFormat, RgbImage};
use thiserror::Error;

/// What can go wrong with a picture file or a pair of pictures.
#[derive(Debug, Error)]
pub enum PictureError {
    /// The file cannot be read or decoded.
    #[error("cannot read the picture {path}: {source}; give an EXR or a PNG file")]
    Read {
        /// The file asked for.
        path: PathBuf,
        /// What the decoder said.
        source: image::ImageError,
    },
    /// The file cannot be written.
    #[error("cannot write the picture {path}: {source}; is its folder there and writable?")]
    Write {
        /// The file asked for.
        path: PathBuf,
        /// What the encoder said.
        source: image::ImageError,
    },
    /// Two pictures to be compared differ in size.
    #[error("the pictures differ in size: {a:?} and {b:?} pixels; render both at one --size")]
    SizeMismatch {
        /// Width and height of the first, pixels.
        a: [u32; 2],
        /// Width and height of the second, pixels.
        b: [u32; 2],
    },
    /// A picture has no pixels, or its buffer does not fit its size.
    #[error("a picture of {size:?} pixels cannot hold {len} values; the size is wrong")]
    BadSize {
        /// Width and height, pixels.
        size: [u32; 2],
        /// Number of pixels handed over.
        len: usize,
    },
}

/// A picture in linear RGB (the renderer's radiance, or decoded sRGB), row 0 on top.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    size_px: [u32; 2],
    rgb: Vec<[f32; 3]>,
}

impl Picture {
    /// A picture from `rgb`, linear, row-major from the top left.
    ///
    /// # Errors
    /// [`PictureError::BadSize`] when there is no pixel or the count does not fit the size.
    pub fn from_linear(size_px: [u32; 2], rgb: Vec<[f32; 3]>) -> Result<Self, PictureError> {
        let expected = size_px[0] as usize * size_px[1] as usize;
        if expected == 0 || expected != rgb.len() {
            return Err(PictureError::BadSize {
                size: size_px,
                len: rgb.len(),
            });
        }
        Ok(Self { size_px, rgb })
    }

    /// Reads an EXR (taken as linear) or any 8- or 16-bit image the `image` crate knows (taken as sRGB).
    ///
    /// # Errors
    /// [`PictureError::Read`] when the file is missing or cannot be decoded, [`PictureError::BadSize`]
    /// when it is empty.
    pub fn open(path: &Path) -> Result<Self, PictureError> {
        let read = |source| PictureError::Read {
            path: path.to_owned(),
            source,
        };
        let decoded = image::open(path).map_err(read)?;
        let linear = ImageFormat::from_path(path)
            .is_ok_and(|format| matches!(format, ImageFormat::OpenExr | ImageFormat::Hdr));
        let buffer = decoded.into_rgb32f();
        let size_px = [buffer.width(), buffer.height()];
        let to_linear = |v: f32| if linear { v } else { srgb_to_linear(v) };
        Self::from_linear(
            size_px,
            buffer.pixels().map(|p| p.0.map(to_linear)).collect(),
        )
    }

    /// Width and height in pixels of the picture in a file, by its head alone.
    ///
    /// # Errors
    /// [`PictureError::Read`] when the file is missing or is no picture.
    pub fn size_px_of(path: &Path) -> Result<[u32; 2], PictureError> {
        let (width, height) =
            image::image_dimensions(path).map_err(|source| PictureError::Read {
                path: path.to_owned(),
                source,
            })?;
        Ok([width, height])
    }

    /// Width and height in pixels.
    pub fn size_px(&self) -> [u32; 2] {
        self.size_px
    }

    /// Linear RGB values, row-major from the top left.
    pub fn rgb(&self) -> &[[f32; 3]] {
        &self.rgb
    }

    /// The same picture with every NaN or infinite value made 0, and the number of pixels that had one.
    pub fn without_non_finite(mut self) -> (Self, usize) {
        let mut bad_pixels = 0;
        for pixel in &mut self.rgb {
            if pixel.iter().any(|v| !v.is_finite()) {
                bad_pixels += 1;
                *pixel = pixel.map(|v| if v.is_finite() { v } else { 0.0 });
            }
        }
        (self, bad_pixels)
    }

    /// Display values: clamped to [0, 1], sRGB-encoded, not quantised.
    pub fn to_srgb(&self) -> Vec<[f32; 3]> {
        self.rgb
            .iter()
            .map(|p| p.map(|v| linear_to_srgb(v.clamp(0.0, 1.0))))
            .collect()
    }

    /// Display values in 8 bits: clamped to [0, 1], sRGB-encoded, rounded to nearest.
    pub fn to_srgb8(&self) -> RgbImage {
        let bytes = self.to_srgb().into_iter().flatten().map(quantise).collect();
        RgbImage::from_raw(self.size_px[0], self.size_px[1], bytes)
            .expect("the buffer has exactly width * height * 3 values by construction")
    }

    /// Errors unless `other` has the same size.
    ///
    /// # Errors
    /// [`PictureError::SizeMismatch`] naming both sizes.
    pub fn check_same_size(&self, other: &Self) -> Result<(), PictureError> {
        if self.size_px == other.size_px {
            return Ok(());
        }
        Err(PictureError::SizeMismatch {
            a: self.size_px,
            b: other.size_px,
        })
    }
}

/// Writes an 8-bit picture; the format follows the extension.
///
/// # Errors
/// [`PictureError::Write`] with the path and the encoder's words.
pub fn save_srgb8(picture: &RgbImage, path: &Path) -> Result<(), PictureError> {
    picture.save(path).map_err(|source| PictureError::Write {
        path: path.to_owned(),
        source,
    })
}

/// IEC 61966-2-1 decoding of one value in [0, 1] to linear light.
pub fn srgb_to_linear(encoded: f32) -> f32 {
    if encoded <= 0.04045 {
        encoded / 12.92
    } else {
        ((encoded + 0.055) / 1.055).powf(2.4)
    }
}

/// IEC 61966-2-1 encoding of one linear value in [0, 1].
pub fn linear_to_srgb(linear: f32) -> f32 {
    if linear <= 0.003_130_8 {
        linear * 12.92
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    }
}

fn quantise(value: f32) -> u8 {
    (value * 255.0).round().clamp(0.0, 255.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_8_bit_value_survives_decoding_and_encoding() {
        for byte in 0..=255_u8 {
            let linear = srgb_to_linear(f32::from(byte) / 255.0);
            assert_eq!(quantise(linear_to_srgb(linear)), byte);
        }
    }

    #[test]
    fn known_values_of_the_transfer_curve() {
        assert!((srgb_to_linear(0.5) - 0.214_041_14).abs() < 1e-6);
        assert!((linear_to_srgb(0.18) - 0.461_356_13).abs() < 1e-6);
    }

    #[test]
    fn an_exr_keeps_its_values_and_a_png_its_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let values = [[0.0, 0.25, 7.5], [1e-6, 300.0, -0.5]];
        let exr = folder.path().join("a.exr");
        let flat = values.iter().flatten().copied().collect();
        image::Rgb32FImage::from_raw(2, 1, flat)
            .unwrap()
            .save(&exr)
            .unwrap();
        assert_eq!(Picture::open(&exr).unwrap().rgb(), values);

        let png = folder.path().join("a.png");
        let bytes: RgbImage =
            image::ImageBuffer::from_raw(1, 2, vec![0, 1, 2, 128, 254, 255]).unwrap();
        save_srgb8(&bytes, &png).unwrap();
        assert_eq!(Picture::open(&png).unwrap().to_srgb8(), bytes);
    }

    #[test]
    fn a_missing_file_is_named() {
        let message = Picture::open(Path::new("nowhere.exr"))
            .unwrap_err()
            .to_string();
        assert!(message.contains("nowhere.exr"), "{message}");
    }

    #[test]
    fn non_finite_pixels_are_counted_and_blackened() {
        let rgb = vec![
            [f32::NAN, 1.0, 2.0],
            [1.0; 3],
            [f32::INFINITY, 0.0, f32::NAN],
        ];
        let (clean, bad) = Picture::from_linear([3, 1], rgb)
            .unwrap()
            .without_non_finite();
        assert_eq!(bad, 2);
        assert_eq!(clean.rgb(), [[0.0, 1.0, 2.0], [1.0; 3], [0.0; 3]]);
    }
}
