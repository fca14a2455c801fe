//! Faces that are transparent in places.

use glam::{Vec2, vec2};

use crate::mesh::NONE;

/// A bit a texel: whether it blocks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AlphaMap {
    width: u32,
    height: u32,
    bits: Vec<u64>,
}

impl AlphaMap {
    /// A map of `width` by `height` texels, rows from v = 0 up; `blocks(x, y)` says which are opaque. None if it has no texel.
    #[must_use]
    pub fn new(width: u32, height: u32, blocks: impl Fn(u32, u32) -> bool) -> Option<Self> {
        let texels = u64::from(width) * u64::from(height);
        if texels == 0 {
            return None;
        }
        let mut bits = vec![0; texels.div_ceil(64) as usize];
        for y in 0..height {
            for x in 0..width {
                let texel = u64::from(y) * u64::from(width) + u64::from(x);
                bits[(texel / 64) as usize] |= u64::from(blocks(x, y)) << (texel % 64);
            }
        }
        Some(Self {
            width,
            height,
            bits,
        })
    }

    /// Whether the texel at `uv` blocks; the map repeats.
    #[must_use]
    pub fn blocks(&self, uv: Vec2) -> bool {
        let texel = |t: f32, size: u32| {
            let within = t - t.floor();
            ((within * size as f32) as u32).min(size - 1)
        };
        let (x, y) = (texel(uv.x, self.width), texel(uv.y, self.height));
        let texel = y as usize * self.width as usize + x as usize;
        self.bits[texel / 64] >> (texel % 64) & 1 == 1
    }
}

/// Which faces of a mesh have which map, and where on it they are.
#[derive(Clone, Debug, Default)]
pub struct Alpha {
    /// The maps.
    pub maps: Vec<AlphaMap>,
    /// Of each face the index of its map; one past the maps if it is opaque.
    pub map_of_face: Vec<u32>,
    /// Of each face the texture coordinates of its corners.
    pub uvs: Vec<[[f32; 2]; 3]>,
}

impl Alpha {
    /// Whether a face has a map.
    pub(crate) fn has(&self, face: usize) -> bool {
        self.map(face).is_some() && face < self.uvs.len() && face != NONE as usize
    }

    fn map(&self, face: usize) -> Option<&AlphaMap> {
        self.maps.get(*self.map_of_face.get(face)? as usize)
    }

    /// Whether a face blocks where its corners weigh `weights`, which need not add up to one.
    pub(crate) fn blocks(&self, face: usize, weights: [f32; 3]) -> bool {
        let (Some(map), Some(uvs)) = (self.map(face), self.uvs.get(face)) else {
            return true;
        };
        let sum = weights[0] + weights[1] + weights[2];
        let [a, b, c] = uvs.map(|[u, v]| vec2(u, v));
        let uv = (a * weights[0] + b * weights[1] + c * weights[2]) / sum;
        // Nothing tells where a sliver is met.
        !uv.is_finite() || map.blocks(uv)
    }
}
