//! A decoded texture and its halved copies.

use std::sync::LazyLock;

use glam::{Vec2, Vec3, Vec3A};
use protocol::scene::Texture;

/// Most probes along the longer axis of a footprint; a longer one is read more coarsely than it is narrow.
const MOST_PROBES: f32 = 4.0;

/// Linear value of each sRGB code.
static DECODED: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|code| {
        let encoded = code as f64 / 255.;
        let linear = if encoded <= 0.040_45 {
            encoded / 12.92
        } else {
            ((encoded + 0.055) / 1.055).powf(2.4)
        };
        linear as f32
    })
});

/// A parallelogram in texture coordinates over which a map is averaged: its two sides.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Footprint {
    /// One side, texture coordinates.
    pub across: Vec2,
    /// The other.
    pub along: Vec2,
}

/// A texture in linear light, repeating, v up, with copies of half the size down to one texel.
#[derive(Clone, Debug)]
pub struct Map {
    levels: Vec<Level>,
    size: Vec2,
}

#[derive(Clone, Debug)]
struct Level {
    width: usize,
    height: usize,
    /// The same two.
    size: Vec2,
    texels: Vec<Vec3A>,
}

impl Map {
    /// Decodes a texture. One without texels, or with fewer than it says, becomes a black map.
    #[must_use]
    pub fn new(texture: &Texture) -> Self {
        let (width, height) = (texture.width as usize, texture.height as usize);
        let whole = width * height > 0 && texture.rgb.len() >= width * height;
        let first = if whole {
            let decode = |code: &[u8; 3]| Vec3A::from(code.map(|c| DECODED[usize::from(c)]));
            let texels = texture.rgb[..width * height].iter().map(decode).collect();
            Level::new(width, height, texels)
        } else {
            Level::new(1, 1, vec![Vec3A::ZERO])
        };
        let size = first.size;
        let mut levels = vec![first];
        while let Some(half) = levels.last().and_then(Level::halved) {
            levels.push(half);
        }
        Self { levels, size }
    }

    /// Mean linear colour of the whole map.
    #[must_use]
    pub fn mean(&self) -> Vec3 {
        self.levels
            .last()
            .map_or(Vec3::ZERO, |level| level.texels[0].into())
    }

    /// Linear colour at `uv`, bilinear between texel centres; black if `uv` is not finite.
    #[must_use]
    pub fn bilinear(&self, uv: Vec2) -> Vec3 {
        if uv.is_finite() {
            let level = &self.levels[0];
            level.sum(level.place(uv), Vec2::ZERO, 1).into()
        } else {
            Vec3::ZERO
        }
    }

    /// Mean linear colour over a footprint around `uv`; black if either is not finite.
    #[must_use]
    pub fn filtered(&self, uv: Vec2, footprint: &Footprint) -> Vec3 {
        let sides = [footprint.across * self.size, footprint.along * self.size];
        let squares = sides.map(Vec2::length_squared);
        let (longer, long, short) = if squares[0] > squares[1] {
            (footprint.across, squares[0].sqrt(), squares[1].sqrt())
        } else {
            (footprint.along, squares[1].sqrt(), squares[0].sqrt())
        };
        if !uv.is_finite() || !long.is_finite() {
            return Vec3::ZERO;
        }
        // Shorter than a texel a side changes nothing.
        let probes = (long / short.max(1.0)).min(MOST_PROBES);
        let probes = whole(probes) + 1;
        let width = short.max(long / probes as f32);
        let level = &self.levels[copy_of(width).min(self.levels.len() - 1)];
        let share = 1.0 / probes as f32;
        let step = longer * share * Vec2::new(level.size.x, -level.size.y);
        let first = level.place(uv) - step * (0.5 * (probes - 1) as f32);
        (level.sum(first, step, probes) * share).into()
    }
}

/// The copy whose texels are nearest to `width` texels of the first, by ratio.
#[inline]
fn copy_of(width: f32) -> usize {
    // The exponent of a float is its logarithm, rounded down.
    let ratio = (width * std::f32::consts::SQRT_2).max(1.0);
    (ratio.to_bits() >> 23) as usize - 127
}

/// The whole number below; a call to the library costs as much as the rest of a look-up.
#[inline]
fn whole(v: f32) -> i32 {
    let towards_zero = v as i32;
    towards_zero.wrapping_sub(i32::from(towards_zero as f32 > v))
}

impl Level {
    fn new(width: usize, height: usize, texels: Vec<Vec3A>) -> Self {
        Self {
            width,
            height,
            size: Vec2::new(width as f32, height as f32),
            texels,
        }
    }

    /// Every other texel's box: two by two, or three where a side is odd, so that no texel is lost and the mean stays.
    fn halved(&self) -> Option<Self> {
        if self.width == 1 && self.height == 1 {
            return None;
        }
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let mut texels = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let mut sum = Vec3A::ZERO;
                for (row, down) in shares(y, height, self.height) {
                    for (column, across) in shares(x, width, self.width) {
                        sum += self.texels[row * self.width + column] * (down * across);
                    }
                }
                texels.push(sum);
            }
        }
        Some(Self::new(width, height, texels))
    }

    /// Texture coordinates in texels, from the centre of the first, down.
    #[inline]
    fn place(&self, uv: Vec2) -> Vec2 {
        Vec2::new(uv.x, 1.0 - uv.y) * self.size - 0.5
    }

    /// Sum of `count` bilinear look-ups in a row, places in texels.
    #[inline]
    fn sum(&self, first: Vec2, step: Vec2, count: i32) -> Vec3A {
        // A division for each look-up costs more than the rest of it.
        if self.width.is_power_of_two() && self.height.is_power_of_two() {
            let wrap = |at: i32, size: usize| at as usize & (size - 1);
            self.sum_with(first, step, count, wrap)
        } else {
            let wrap = |at: i32, size: usize| at.rem_euclid(size as i32) as usize;
            self.sum_with(first, step, count, wrap)
        }
    }

    #[inline(always)]
    fn sum_with(
        &self,
        first: Vec2,
        step: Vec2,
        count: i32,
        wrap: impl Fn(i32, usize) -> usize,
    ) -> Vec3A {
        let mut sum = Vec3A::ZERO;
        for k in 0..count {
            let place = first + step * k as f32;
            let (x, y) = (whole(place.x), whole(place.y));
            // Coordinates too large for a whole number have no fraction either.
            let right = (place.x - x as f32).clamp(0.0, 1.0);
            let down = (place.y - y as f32).clamp(0.0, 1.0);
            let (x0, x1) = (wrap(x, self.width), wrap(x.wrapping_add(1), self.width));
            let (y0, y1) = (wrap(y, self.height), wrap(y.wrapping_add(1), self.height));
            let texel = |x: usize, y: usize| self.texels[y * self.width + x];
            let upper = texel(x0, y0) + (texel(x1, y0) - texel(x0, y0)) * right;
            let lower = texel(x0, y1) + (texel(x1, y1) - texel(x0, y1)) * right;
            sum += upper + (lower - upper) * down;
        }
        sum
    }
}

/// Texels that the `index`th of `count` equal parts of `size` texels covers, and each one's share of the part.
fn shares(index: usize, count: usize, size: usize) -> impl Iterator<Item = (usize, f32)> {
    let part = size as f32 / count as f32;
    let (low, high) = (index as f32 * part, (index + 1) as f32 * part);
    let first = low as usize;
    let last = (high.ceil() as usize).min(size);
    (first..last).map(move |texel| {
        let covered = high.min((texel + 1) as f32) - low.max(texel as f32);
        (texel, covered / part)
    })
}

#[cfg(test)]
#[path = "map_tests.rs"]
mod tests;
