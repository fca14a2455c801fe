//! Reprojection: every cached point to the pixel it falls in, the nearest one kept.

use fearless_simd::{Level, dispatch, prelude::*};
use fearless_simd_macros::simd;

use super::bands::Bands;
use super::{PixelSamples, PointCache, pixels::NO_POINT};
use crate::camera::View;

/// Depth given to points at infinity, metres: behind all else, still finite.
pub const FAR_DEPTH: f32 = 1e30;

/// Points projected together, so that what one pass leaves for the next stays in the nearest memory.
const BATCH: usize = 512;

/// Bits of a pixel to which a projected point's place is kept.
const PLACE_BITS: u32 = 8;

/// Marks in [`Projected`] a point that is not in the image.
const OUTSIDE: u32 = u32::MAX;

/// A batch of projected points.
#[derive(Clone, Debug)]
pub struct Projected {
    /// Image x, 1/256 pixel.
    x: [u32; BATCH],
    /// Image y, 1/256 pixel.
    y: [u32; BATCH],
    /// Bits of the depth along the line of sight, metres; positive floats order as their bits do.
    depth: [u32; BATCH],
    /// Which of them are in the image, in order.
    inside: [u16; BATCH],
}

impl Default for Projected {
    fn default() -> Self {
        Self {
            x: [0; BATCH],
            y: [0; BATCH],
            depth: [OUTSIDE; BATCH],
            inside: [0; BATCH],
        }
    }
}

/// What is left in each pixel, a band of rows at a time.
#[derive(Clone, Debug, Default)]
pub struct Nearest {
    /// Keys of depth, point and place of a band, by row without margin.
    keys: Vec<u64>,
    landed: Bands,
    batch: Projected,
    row: Row,
}

/// Points that the pixels of a row keep.
#[derive(Clone, Debug, Default)]
struct Row {
    /// Indices of elements of [`PixelSamples`].
    at: Vec<u32>,
    slots: Vec<u32>,
    rgb: Vec<[f32; 3]>,
}

/// How depth, point and place share 64 bits: the nearer key is the smaller one, of equally near ones that of the lower slot.
#[derive(Clone, Copy, Debug)]
struct KeyLayout {
    /// Bits of a slot's number.
    slot: u32,
}

impl KeyLayout {
    fn new(capacity: usize) -> Self {
        Self {
            slot: usize::BITS - capacity.leading_zeros(),
        }
    }

    /// Bits of the depth that are left out, where slots need the room.
    fn depth_cut(self) -> u32 {
        (2 * PLACE_BITS + self.slot).saturating_sub(32)
    }

    #[inline]
    fn pack(self, depth: u32, slot: usize, x: u32, y: u32) -> u64 {
        let place = (y & 0xff) << PLACE_BITS | x & 0xff;
        let depth = u64::from(depth >> self.depth_cut());
        (depth << self.slot | slot as u64) << (2 * PLACE_BITS) | u64::from(place)
    }

    /// Depth (m), slot and place (pixels, middle of its cell).
    #[inline]
    fn unpack(self, key: u64) -> (f32, usize, [f32; 2]) {
        let place = |shift: u32| ((key >> shift & 0xff) as f32 + 0.5) * (1.0 / 256.0);
        let rest = key >> (2 * PLACE_BITS);
        let slot = rest & ((1 << self.slot) - 1);
        let depth = f32::from_bits(((rest >> self.slot) as u32) << self.depth_cut());
        (depth, slot as usize, [place(0), place(PLACE_BITS)])
    }
}

/// Projects all points of the cache and leaves in each pixel of `pixels` the nearest of those that fall in it; of equally
/// near ones the one in the lower slot. Places are kept to 1/256 pixel, depths to 2⁻¹⁶ of themselves or better. Points that
/// are kept are marked as [seen](PointCache::is_seen), and doubtful if it is time to ask again whether they can be.
/// Results do not depend on `level`.
pub fn project(
    level: Level,
    cache: &mut PointCache,
    view: &View,
    nearest: &mut Nearest,
    pixels: &mut PixelSamples,
) {
    let grid = pixels.grid;
    debug_assert!(grid.width == view.width as usize && grid.height == view.height as usize);
    let Nearest {
        keys,
        landed,
        batch,
        row,
    } = nearest;
    let layout = KeyLayout::new(cache.capacity());
    landed.start(grid, cache.reach());
    cache.start_frame();
    for_each_in_image(level, cache, view, batch, |slot, [x, y], depth| {
        let pixel = [x >> PLACE_BITS, y >> PLACE_BITS];
        landed.push(pixel, layout.pack(depth, slot, x, y));
    });
    for band in 0..landed.len() {
        let rows = landed.rows_of(band);
        keys.clear();
        keys.resize(rows.len() * grid.stride, u64::MAX);
        landed.for_each(band, |cell, key| {
            let cell = &mut keys[cell];
            *cell = key.min(*cell);
        });
        for (y, keys) in rows.zip(keys.chunks_exact(grid.stride)) {
            row.place(layout, keys, y, pixels);
            row.colour(cache, pixels);
        }
    }
}

impl Row {
    /// Puts the places of what is left in a row into its pixels.
    fn place(&mut self, layout: KeyLayout, keys: &[u64], y: usize, pixels: &mut PixelSamples) {
        let grid = pixels.grid;
        for list in [&mut self.at, &mut self.slots] {
            list.clear();
            list.reserve(grid.stride);
        }
        let all = grid.at(0, y)..grid.at(grid.stride, y);
        pixels.depth[all.clone()].fill(f32::INFINITY);
        pixels.point[all.clone()].fill(NO_POINT);
        pixels.count[all].fill(1.0);
        for (word, keys) in keys.chunks_exact(64).enumerate() {
            let held = |(k, &key): (usize, &u64)| u64::from(key != u64::MAX) << k;
            let bits = keys.iter().enumerate().map(held).fold(0, |a, b| a | b);
            pixels.has[y * grid.words + word] = bits;
            pixels.doubtful[y * grid.words + word] = 0;
            let mut left = bits;
            while left != 0 {
                let k = left.trailing_zeros() as usize;
                left &= left - 1;
                let at = grid.at(word * 64 + k, y);
                let (depth, slot, place) = layout.unpack(keys[k]);
                pixels.depth[at] = depth;
                pixels.point[at] = slot as u32;
                [pixels.x[at], pixels.y[at]] = place;
                self.at.push(at as u32);
                self.slots.push(slot as u32);
            }
        }
    }

    /// Gives the row's points their colours and marks them as seen. Slots lie anywhere in memory: short loops let the
    /// processor wait for many of them at once.
    fn colour(&mut self, cache: &mut PointCache, pixels: &mut PixelSamples) {
        let Self { at, slots, rgb } = self;
        rgb.clear();
        rgb.reserve(pixels.grid.stride);
        rgb.extend(slots.iter().map(|&slot| cache.rgb[slot as usize]));
        let origin = pixels.grid.origin;
        for (&at, &slot) in at.iter().zip(&*slots) {
            let pixel = at as usize - origin;
            pixels.doubtful[pixel / 64] |= u64::from(cache.keep(slot as usize)) << (pixel % 64);
        }
        for (plane, channel) in pixels.rgb.iter_mut().zip(0..) {
            for (&at, rgb) in at.iter().zip(&*rgb) {
                plane[at as usize] = rgb[channel];
            }
        }
    }
}

/// Calls `visit` for all points that are in the image, in the order of their slots: slot, place (1/256 pixel), bits of the
/// depth (m).
pub fn for_each_in_image(
    level: Level,
    cache: &PointCache,
    view: &View,
    batch: &mut Projected,
    mut visit: impl FnMut(usize, [u32; 2], u32),
) {
    for first in (0..cache.reach()).step_by(BATCH) {
        let last = (first + BATCH).min(cache.reach());
        dispatch!(level, simd => project_batch(simd, cache, view, first..last, batch));
        // Without a branch: whether a point is in the image is as good as random from slot to slot.
        let mut inside = 0;
        for k in 0..last - first {
            batch.inside[inside] = k as u16;
            inside += usize::from(batch.depth[k] != OUTSIDE);
        }
        for &k in &batch.inside[..inside] {
            let k = usize::from(k);
            visit(first + k, [batch.x[k], batch.y[k]], batch.depth[k]);
        }
    }
}

#[simd]
fn project_batch<S: Simd>(
    simd: S,
    cache: &PointCache,
    view: &View,
    slots: std::ops::Range<usize>,
    out: &mut Projected,
) {
    let lanes = S::f32s::LEN;
    let whole = slots.end - slots.len() % lanes;
    let splat = |v: f32| S::f32s::splat(simd, v);
    let eye = view.eye.to_array().map(splat);
    let rows = [view.right, view.up, view.forward].map(|v| v.to_array().map(splat));
    let focal = splat(view.focal_px);
    let (cx, cy) = (
        splat(view.width as f32 * 0.5),
        splat(view.height as f32 * 0.5),
    );
    let (w_px, h_px) = (splat(view.width as f32), splat(view.height as f32));
    let zero = splat(0.0);
    for i in (slots.start..whole).step_by(lanes) {
        let load = |plane: &[f32]| S::f32s::from_slice(simd, &plane[i..i + lanes]);
        let w = load(&cache.w);
        let d: [S::f32s; 3] = std::array::from_fn(|a| load(&cache.position[a]) - w * eye[a]);
        let dot = |r: &[S::f32s; 3]| r[0] * d[0] + r[1] * d[1] + r[2] * d[2];
        let depth = dot(&rows[2]);
        let scale = focal / depth;
        let x = cx + dot(&rows[0]) * scale;
        let y = cy - dot(&rows[1]) * scale;
        let depth = w
            .simd_gt(zero)
            .select(depth, splat(FAR_DEPTH) * depth.min(splat(1.0)));
        let inside = depth.simd_gt(zero)
            & x.simd_ge(zero)
            & x.simd_lt(w_px)
            & y.simd_ge(zero)
            & y.simd_lt(h_px)
            & w.simd_ge(zero);
        let k = i - slots.start;
        let fixed = |v: S::f32s| S::u32s::truncate_from(inside.select(v * splat(256.0), zero));
        fixed(x).store_slice(&mut out.x[k..k + lanes]);
        fixed(y).store_slice(&mut out.y[k..k + lanes]);
        let outside = S::u32s::splat(simd, OUTSIDE);
        inside
            .select(depth.bitcast::<S::u32s>(), outside)
            .store_slice(&mut out.depth[k..k + lanes]);
    }
    for i in whole..slots.end {
        project_one(cache, view, i, i - slots.start, out);
    }
}

/// The plain path: one point, the same operations in the same order.
fn project_one(cache: &PointCache, view: &View, i: usize, k: usize, out: &mut Projected) {
    let w = cache.w[i];
    let eye = view.eye.to_array();
    let d: [f32; 3] = std::array::from_fn(|a| cache.position[a][i] - w * eye[a]);
    let dot = |r: glam::Vec3| r.x * d[0] + r.y * d[1] + r.z * d[2];
    let depth = dot(view.forward);
    let scale = view.focal_px / depth;
    let x = view.width as f32 * 0.5 + dot(view.right) * scale;
    let y = view.height as f32 * 0.5 - dot(view.up) * scale;
    let depth = if w > 0.0 {
        depth
    } else {
        FAR_DEPTH * depth.min(1.0)
    };
    let inside = depth > 0.0
        && x >= 0.0
        && x < view.width as f32
        && y >= 0.0
        && y < view.height as f32
        && w >= 0.0;
    let fixed = |v: f32| if inside { (v * 256.0) as u32 } else { 0 };
    (out.x[k], out.y[k]) = (fixed(x), fixed(y));
    out.depth[k] = if inside { depth.to_bits() } else { OUTSIDE };
}

#[cfg(test)]
mod tests {
    use protocol::messages::{Camera, Sample, flags};

    use super::*;
    use crate::epi::grid::Grid;
    use crate::sampling::place::hash_unit;

    #[test]
    fn every_level_projects_as_the_plain_path_and_the_nearest_point_wins() {
        let view = View::new(&Camera {
            eye: [0.0, 1.0, 4.0],
            target: [0.0, 0.5, 0.0],
            up: [0.0, 1.0, 0.0],
            fov_y: 50.0,
            width: 70,
            height: 50,
        });
        let mut cache = PointCache::new(4001);
        for id in 0..3500 {
            let random = |axis: u64| 10.0 * hash_unit(axis, id) - 5.0;
            let miss = id % 9 == 0;
            let p = glam::Vec3::new(random(1), random(2), random(3));
            let position = if miss { p.normalize() } else { p }.into();
            let flags = if miss { flags::MISS } else { 0 };
            cache.insert(
                &Sample {
                    id,
                    position,
                    object: 0,
                    radiance: [0.5; 3],
                    flags,
                },
                None,
            );
        }
        (0..50).for_each(|slot| cache.remove(slot * 7));
        let capacity = cache.capacity();
        let mut plain = [Vec::new(), Vec::new(), Vec::new()];
        for i in 0..capacity {
            let mut one = Projected::default();
            project_one(&cache, &view, i, 0, &mut one);
            let values = [one.x[0], one.y[0], one.depth[0]];
            plain.iter_mut().zip(values).for_each(|(p, v)| p.push(v));
        }
        for level in [Level::new(), Level::baseline()] {
            let mut visited = Vec::new();
            let mut batch = Projected::default();
            for_each_in_image(level, &cache, &view, &mut batch, |i, [x, y], depth| {
                assert_eq!(
                    [x, y, depth],
                    [plain[0][i], plain[1][i], plain[2][i]],
                    "{i}"
                );
                visited.push(i);
            });
            let inside = (0..capacity).filter(|&i| plain[2][i] != OUTSIDE);
            assert!(visited.into_iter().eq(inside));
        }
        let grid = Grid::new(70, 50);
        let (mut pixels, mut nearest) = (PixelSamples::new(grid), Nearest::default());
        project(Level::new(), &mut cache, &view, &mut nearest, &mut pixels);
        let mut kept = 0;
        for y in 0..50 {
            for x in 0..70 {
                let here = |i: &usize| {
                    plain[2][*i] != OUTSIDE
                        && (plain[0][*i] as usize / 256, plain[1][*i] as usize / 256) == (x, y)
                };
                let inside = (0..capacity).filter(here);
                let nearest = inside.min_by_key(|&i| plain[2][i]);
                assert_eq!(pixels.has_sample(x, y), nearest.is_some());
                let at = grid.at(x, y);
                assert_eq!(pixels.point[at], nearest.map_or(NO_POINT, |i| i as u32));
                if let Some(i) = nearest {
                    let depth = f32::from_bits(plain[2][i]);
                    assert!((pixels.depth[at] / depth - 1.0).abs() < 1e-6);
                    let place = |axis: usize| (plain[axis][i] % 256) as f32 / 256.0;
                    assert!((pixels.x[at] - place(0)).abs() < 0.004);
                    assert!((pixels.y[at] - place(1)).abs() < 0.004);
                    assert!(cache.is_seen(i as u32));
                    kept += 1;
                }
            }
        }
        let seen = (0..capacity as u32).filter(|&i| cache.is_seen(i)).count();
        assert_eq!(kept, seen);
        assert!(kept > 300);
    }

    #[test]
    fn keys_order_by_depth_then_slot_and_come_back() {
        for capacity in [1, 4000, 400_000, 20_000_000] {
            let layout = KeyLayout::new(capacity);
            let mut last = 0;
            for depth in [1e-3f32, 0.5, 0.5001, 7.0, FAR_DEPTH] {
                for slot in [0, capacity / 2, capacity - 1] {
                    let key = layout.pack(depth.to_bits(), slot, 5 * 256 + 200, 77);
                    assert!(key >= last && key < u64::MAX, "{depth} {slot}");
                    last = key;
                    let (d, s, place) = layout.unpack(key);
                    assert!((d / depth - 1.0).abs() < 2e-5 && s == slot);
                    assert_eq!(place, [200.5 / 256.0, 77.5 / 256.0]);
                }
            }
        }
    }
}
