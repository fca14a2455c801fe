//! Textures: image files, and patterns made by arithmetic on integers so that every machine makes the same bytes.

use std::io::{BufRead, Cursor, Seek};
use std::path::Path;

use protocol::scene::Texture;
use serde::Deserialize;

use crate::error::{ErrorKind, SceneError};
use crate::loaders::Picture;

/// A pattern made on loading; colours are sRGB, 0 to 255, and every pattern repeats without a seam.
#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub(crate) enum TextureGenerator {
    /// `squares` by `squares` squares in turn of two colours.
    Checker {
        #[serde(default = "squares")]
        squares: u32,
        #[serde(default = "light")]
        light: [u8; 3],
        #[serde(default = "dark")]
        dark: [u8; 3],
    },
    /// Floor boards along u, each of its own shade, with grain and dark joints.
    Planks {
        #[serde(default = "boards")]
        boards: u32,
        #[serde(default = "wood")]
        color: [u8; 3],
    },
    /// Courses of bricks, each of its own shade, with mortar between.
    Bricks {
        #[serde(default = "courses")]
        courses: u32,
        #[serde(default = "brick")]
        color: [u8; 3],
        #[serde(default = "mortar")]
        mortar: [u8; 3],
    },
    /// A picture for a wall: hills under a sun.
    Landscape {},
}

const SIZE: u32 = 256;

/// Most texels in an image that is read.
const MAX_TEXELS: u64 = 1 << 26;

/// Reads a PNG or JPEG picture as 8-bit sRGB; transparency is left out.
pub(crate) fn open(picture: &Picture) -> Result<Texture, SceneError> {
    match picture {
        Picture::File(path) => {
            let reader = image::ImageReader::open(path)
                .map_err(|e| SceneError::new(path, ErrorKind::Unreadable(e.to_string())))?;
            decode(reader, path)
        }
        Picture::Held { name, bytes } => decode(image::ImageReader::new(Cursor::new(bytes)), name),
    }
}

fn decode<R: BufRead + Seek>(
    reader: image::ImageReader<R>,
    path: &Path,
) -> Result<Texture, SceneError> {
    let fail = |kind| SceneError::new(path, kind);
    let mut reader = reader
        .with_guessed_format()
        .map_err(|e| fail(ErrorKind::Unreadable(e.to_string())))?;
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(1 << 16);
    limits.max_image_height = Some(1 << 16);
    limits.max_alloc = Some(MAX_TEXELS * 4);
    reader.limits(limits);
    let picture = reader
        .decode()
        .map_err(|e| {
            fail(ErrorKind::Malformed(format!(
                "not a picture that can be read: {e}"
            )))
        })?
        .into_rgb8();
    let (width, height) = picture.dimensions();
    if width == 0 || height == 0 {
        return Err(fail(ErrorKind::Malformed(
            "the picture has no pixels".into(),
        )));
    }
    Ok(Texture {
        width,
        height,
        rgb: picture.pixels().map(|p| p.0).collect(),
    })
}

/// Mean of a picture that holds numbers rather than colours, 0 to 1 a channel.
pub(crate) fn mean(texture: &Texture) -> [f32; 3] {
    mean_of(texture, |byte| f64::from(byte) / 255.0)
}

/// Mean colour of a picture, linear.
pub(crate) fn mean_color(texture: &Texture) -> [f32; 3] {
    let linear: Vec<f64> = (0..=255)
        .map(|byte| {
            let s = f64::from(byte) / 255.0;
            // IEC 61966-2-1.
            if s <= 0.04045 {
                s / 12.92
            } else {
                ((s + 0.055) / 1.055).powf(2.4)
            }
        })
        .collect();
    mean_of(texture, |byte| linear[usize::from(byte)])
}

fn mean_of(texture: &Texture, value: impl Fn(u8) -> f64) -> [f32; 3] {
    let mut sum = [0.0; 3];
    for texel in &texture.rgb {
        for (sum, byte) in sum.iter_mut().zip(texel) {
            *sum += value(*byte);
        }
    }
    sum.map(|s| (s / texture.rgb.len().max(1) as f64) as f32)
}

/// Makes a pattern of 256 by 256 texels.
pub(crate) fn generate(kind: &TextureGenerator) -> Texture {
    let texel = |x: u32, y: u32| match *kind {
        TextureGenerator::Checker {
            squares,
            light,
            dark,
        } => checker(x, y, squares.clamp(1, SIZE), light, dark),
        TextureGenerator::Planks { boards, color } => {
            planks(x, y, boards.clamp(1, SIZE / 4), color)
        }
        TextureGenerator::Bricks {
            courses,
            color,
            mortar,
        } => bricks(x, y, courses.clamp(1, SIZE / 8), color, mortar),
        TextureGenerator::Landscape {} => landscape(x, y),
    };
    Texture {
        width: SIZE,
        height: SIZE,
        rgb: (0..SIZE * SIZE)
            .map(|i| texel(i % SIZE, i / SIZE))
            .collect(),
    }
}

fn checker(x: u32, y: u32, squares: u32, light: [u8; 3], dark: [u8; 3]) -> [u8; 3] {
    let cell = x * squares / SIZE + y * squares / SIZE;
    if cell.is_multiple_of(2) { light } else { dark }
}

fn planks(x: u32, y: u32, boards: u32, color: [u8; 3]) -> [u8; 3] {
    let board = y * boards / SIZE;
    let top = (board * SIZE).div_ceil(boards);
    let joint = hash(board, 7) % SIZE;
    let along = (x + SIZE - joint) % SIZE;
    if y == top || along < 2 {
        return shade(color, 110);
    }
    let grain = noise(x, y, 64, 2, 11) / 2 + noise(x, y, 16, 1, 12) / 4;
    shade(color, 205 + hash(board, 3) % 40 + grain / 5)
}

fn bricks(x: u32, y: u32, courses: u32, color: [u8; 3], mortar: [u8; 3]) -> [u8; 3] {
    let course = y * courses / SIZE;
    let in_course = y - (course * SIZE).div_ceil(courses);
    let across = (courses / 2).max(1);
    let shift = if course.is_multiple_of(2) {
        0
    } else {
        SIZE / across / 2
    };
    let u = (x + shift) % SIZE;
    let brick = u * across / SIZE;
    let in_brick = u - (brick * SIZE).div_ceil(across);
    let joint = (SIZE / courses / 8).max(1);
    let rough = noise(x, y, 4, 4, 5) / 8;
    if in_course < joint || in_brick < joint {
        return shade(mortar, 224 + rough);
    }
    shade(color, 190 + hash(brick, course + 31) % 56 + rough)
}

fn landscape(x: u32, y: u32) -> [u8; 3] {
    let ridge = |base: u32, step: u32, seed: u32| base + noise(x, 0, step, 1, seed) / 5;
    let (dx, dy) = (x.abs_diff(182), y.abs_diff(62));
    if y > ridge(176, 64, 1) {
        return shade([70, 110, 52], 200 + noise(x, y, 8, 4, 9) / 4);
    }
    if y > ridge(120, 32, 2) {
        return [92, 128, 120];
    }
    if dx * dx + dy * dy < 24 * 24 {
        return [250, 226, 150];
    }
    let down = y.min(150);
    let mix = |top: u32, low: u32| ((top * (150 - down) + low * down) / 150) as u8;
    [mix(96, 236), mix(142, 206), mix(196, 170)]
}

/// A colour times `amount` / 256.
fn shade(color: [u8; 3], amount: u32) -> [u8; 3] {
    color.map(|c| (u32::from(c) * amount / 256).min(255) as u8)
}

/// Smooth noise in 0 to 255 with a period of [`SIZE`]: lattice values every `step_x` by `step_y` texels, blended.
fn noise(x: u32, y: u32, step_x: u32, step_y: u32, seed: u32) -> u32 {
    let (cell_x, cell_y) = (x / step_x, y / step_y);
    let (u, v) = (x % step_x, y % step_y);
    let at = |dx: u32, dy: u32| {
        let (i, j) = (
            (cell_x + dx) % (SIZE / step_x),
            (cell_y + dy) % (SIZE / step_y),
        );
        hash(i * 4096 + j, seed) % 256
    };
    let low = at(0, 0) * (step_x - u) + at(1, 0) * u;
    let high = at(0, 1) * (step_x - u) + at(1, 1) * u;
    (low * (step_y - v) + high * v) / (step_x * step_y)
}

fn hash(value: u32, seed: u32) -> u32 {
    let mut h = value.wrapping_mul(0x9e37_79b1) ^ seed.wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
    h = (h ^ (h >> 12)).wrapping_mul(0x297a_2d39);
    h ^ (h >> 15)
}

fn squares() -> u32 {
    8
}

fn light() -> [u8; 3] {
    [225, 220, 208]
}

fn dark() -> [u8; 3] {
    [86, 84, 92]
}

fn boards() -> u32 {
    8
}

fn wood() -> [u8; 3] {
    [176, 122, 72]
}

fn courses() -> u32 {
    16
}

fn brick() -> [u8; 3] {
    [178, 84, 62]
}

fn mortar() -> [u8; 3] {
    [200, 192, 180]
}
