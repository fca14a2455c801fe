//! What maps multiply pixels by, once it is known which map each pixel wears: rows of pixels, which threads share.

use ::textures::Map;
use glam::{DVec3, Vec3};
use rayon::ThreadPool;
use rayon::prelude::*;

use super::paint::Inputs;
use super::projected::Projected;
use super::{Maps, PointTexel};
use crate::epi::grid::Grid;
use crate::frame::wide;
use crate::points::pixels::NO_POINT;

/// Rows that a thread takes at once: a part of a face's projection is all that it does twice.
const ROWS: usize = 32;

/// What pixels wear.
#[derive(Clone, Copy)]
pub(super) struct Worn<'a> {
    pub(super) grid: Grid,
    /// Slot of the point whose map a pixel wears, by [`Grid`].
    pub(super) source: &'a [u32],
    /// Plane: the pixel wears a map.
    pub(super) worn: &'a [u64],
}

/// Fills the planes at every pixel that wears a map; the same for any number of threads.
pub(super) fn fill(
    pool: Option<&ThreadPool>,
    maps: &Maps,
    inputs: &Inputs<'_>,
    worn: Worn<'_>,
    planes: &mut [Vec<f32>; 3],
) {
    let grid = worn.grid;
    let pixels = grid.origin..grid.origin + grid.height * grid.stride;
    let [red, green, blue] = planes.each_mut().map(|plane| &mut plane[pixels.clone()]);
    match pool {
        None => rows(maps, inputs, worn, 0, [red, green, blue]),
        Some(pool) => pool.install(|| {
            let n = ROWS * grid.stride;
            let parts = red
                .par_chunks_mut(n)
                .zip(green.par_chunks_mut(n))
                .zip(blue.par_chunks_mut(n));
            parts.enumerate().for_each(|(part, ((red, green), blue))| {
                rows(maps, inputs, worn, part * ROWS, [red, green, blue]);
            });
        }),
    }
}

/// The rows from `top` on that the planes hold.
fn rows(maps: &Maps, inputs: &Inputs<'_>, worn: Worn<'_>, top: usize, planes: [&mut [f32]; 3]) {
    let grid = worn.grid;
    let [red, green, blue] = planes;
    let count = red.len() / grid.stride;
    let mut seen: Option<Seen<'_>> = None;
    // Neighbours mostly wear the same point's map, or at least that of the same face.
    let mut last = NO_POINT;
    let mut texel = &PointTexel::NONE;
    for row in 0..count {
        let y = top + row;
        for word in 0..grid.words {
            let mut left = worn.worn[y * grid.words + word];
            while left != 0 {
                let x = word * 64 + left.trailing_zeros() as usize;
                left &= left - 1;
                let slot = worn.source[grid.at(x, y)];
                if slot != last {
                    last = slot;
                    texel = inputs.cache.texel(slot);
                    let key = (inputs.cache.info[slot as usize].object, texel.face);
                    if seen.as_ref().is_none_or(|s| s.key != key) {
                        seen = Seen::new(maps, inputs, slot, key);
                    }
                }
                let [r, g, b] = seen.as_ref().map_or([1.0; 3], |seen| {
                    seen.factor(texel, [x as f32 + 0.5, y as f32 + 0.5])
                });
                let at = row * grid.stride + x;
                (red[at], green[at], blue[at]) = (r, g, b);
            }
        }
    }
}

/// The last face looked at.
struct Seen<'a> {
    /// Object and face.
    key: (u32, u32),
    projected: Projected,
    map: &'a Map,
    /// One over the map's mean.
    per_mean: Vec3,
    side: bool,
}

impl<'a> Seen<'a> {
    /// Projects the face of a point.
    fn new(maps: &'a Maps, inputs: &Inputs<'_>, slot: u32, key: (u32, u32)) -> Option<Self> {
        let face = maps.face(key.0, key.1)?;
        let map = face.map? as usize;
        let to_world = wide(inputs.placed.transform(key.0)?);
        let corners: [DVec3; 3] = face
            .corners
            .map(|p| to_world.transform_point3(p.as_dvec3()));
        let projected = Projected::new(inputs.view, corners, &face.uvs);
        let (x, y, _) = inputs.view.project(inputs.cache.point(slot))?;
        Some(Self {
            key,
            projected,
            map: &maps.maps[map],
            per_mean: maps.means[map].recip(),
            side: projected.side(x, y),
        })
    }

    /// What the map is to its mean at an image point, as far as the point's colour is the map's.
    #[inline]
    fn factor(&self, texel: &PointTexel, [x, y]: [f32; 2]) -> [f32; 3] {
        // Beyond the horizon of the face's plane there is nothing of the map.
        if self.projected.side(x, y) != self.side {
            return [1.0; 3];
        }
        let Some((uv, footprint)) = self.projected.at(x, y) else {
            return [1.0; 3];
        };
        let to_mean = self.map.filtered(uv, &footprint) * self.per_mean;
        (Vec3::ONE + Vec3::from(texel.share) * (to_mean - 1.0)).to_array()
    }
}
