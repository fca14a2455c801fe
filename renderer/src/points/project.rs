//! Reprojection: every cached point to the pixel it falls in, the nearest one kept.

use fearless_simd::{Level, dispatch, prelude::*};
use fearless_simd_macros::simd;

use super::{PixelSamples, PointCache, pixels::NO_POINT};
use crate::camera::View;

/// Depth given to points at infinity, metres: behind all else, still finite.
pub const FAR_DEPTH: f32 = 1e30;

/// A point that stays in sight is checked once in so many frames.
pub const TURNS: usize = 8;

/// Marks in [`project`]'s `seen` the points kept in this frame, until all are known.
const KEPT: u8 = 1;

/// Scratch of [`project`], a value a point.
#[derive(Clone, Debug, Default)]
pub struct Projected {
    /// Image x, pixels.
    pub x: Vec<f32>,
    /// Image y, pixels.
    pub y: Vec<f32>,
    /// Depth along the line of sight, metres; negative where the point is not in the image.
    pub depth: Vec<f32>,
    nearest: Vec<u64>,
}

impl Projected {
    /// Room for this many points.
    pub fn new(points: usize) -> Self {
        let plane = vec![0.0; points.next_multiple_of(16)];
        Self {
            x: plane.clone(),
            y: plane.clone(),
            depth: plane,
            nearest: Vec::new(),
        }
    }
}

/// Projects all points of the cache and leaves in each pixel of `pixels` the nearest of those that fall in it; of equally
/// near ones the one in the lower slot. `seen` says of each point whether a pixel kept it in the frame before (0 if not);
/// afterwards it says so of this one (255 or 0).
/// One in [`TURNS`] of the points that were seen is doubted anew, by `turn`. Results do not depend on `level`.
pub fn project(
    level: Level,
    cache: &PointCache,
    view: &View,
    projected: &mut Projected,
    pixels: &mut PixelSamples,
    (seen, turn): (&mut [u8], usize),
) {
    project_points(level, cache, view, projected);
    scatter(cache, view, projected, pixels, (seen, turn));
}

/// Projects all points of the cache, without asking which hides which.
pub fn project_points(level: Level, cache: &PointCache, view: &View, projected: &mut Projected) {
    dispatch!(level, simd => project_all(simd, cache, view, projected));
}

#[simd]
fn project_all<S: Simd>(simd: S, cache: &PointCache, view: &View, out: &mut Projected) {
    let lanes = S::f32s::LEN;
    let points = cache.capacity();
    let whole = points - points % lanes;
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
    for i in (0..whole).step_by(lanes) {
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
        x.store_slice(&mut out.x[i..i + lanes]);
        y.store_slice(&mut out.y[i..i + lanes]);
        inside
            .select(depth, splat(-1.0))
            .store_slice(&mut out.depth[i..i + lanes]);
    }
    for i in whole..points {
        project_one(cache, view, i, out);
    }
}

/// The plain path: one point, the same operations in the same order.
fn project_one(cache: &PointCache, view: &View, i: usize, out: &mut Projected) {
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
    out.x[i] = x;
    out.y[i] = y;
    out.depth[i] = if inside { depth } else { -1.0 };
}

/// The nearest point of every pixel, as keys that order by depth and then by slot.
fn scatter(
    cache: &PointCache,
    view: &View,
    projected: &mut Projected,
    pixels: &mut PixelSamples,
    (seen, turn): (&mut [u8], usize),
) {
    let grid = pixels.grid;
    debug_assert!(grid.width == view.width as usize && grid.height == view.height as usize);
    let Projected {
        x,
        y,
        depth,
        nearest,
    } = projected;
    nearest.clear();
    nearest.resize(grid.height * grid.stride, u64::MAX);
    let planes = x.iter().zip(y.iter()).zip(depth.iter());
    for (i, ((&x, &y), &depth)) in planes.take(cache.capacity()).enumerate() {
        if depth > 0.0 {
            // Positive floats order as their bits do.
            let key = u64::from(depth.to_bits()) << 32 | i as u64;
            let cell = &mut nearest[y as usize * grid.stride + x as usize];
            *cell = key.min(*cell);
        }
    }
    for row in 0..grid.height {
        for word in 0..grid.words {
            let (mut bits, mut doubtful) = (0u64, 0u64);
            let first = grid.at(word * 64, row);
            let keys = &nearest[row * grid.stride + word * 64..][..64];
            for (k, &key) in keys.iter().enumerate() {
                let at = first + k;
                if key == u64::MAX {
                    pixels.depth[at] = f32::INFINITY;
                    pixels.point[at] = NO_POINT;
                    continue;
                }
                let i = key as u32 as usize;
                bits |= 1 << k;
                let doubt = seen[i] == 0 || (i + turn).is_multiple_of(TURNS);
                doubtful |= u64::from(doubt) << k;
                seen[i] = KEPT;
                pixels.depth[at] = f32::from_bits((key >> 32) as u32);
                pixels.point[at] = i as u32;
                pixels.x[at] = x[i] - (word * 64 + k) as f32;
                pixels.y[at] = y[i] - row as f32;
                pixels.count[at] = 1.0;
                for (plane, value) in pixels.rgb.iter_mut().zip(cache.rgb[i]) {
                    plane[at] = value;
                }
            }
            pixels.has[row * grid.words + word] = bits;
            pixels.doubtful[row * grid.words + word] = doubtful;
        }
    }
    for state in seen {
        *state = if *state == KEPT { 255 } else { 0 };
    }
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
        let mut plain = Projected::new(cache.capacity());
        (0..cache.capacity()).for_each(|i| project_one(&cache, &view, i, &mut plain));
        let grid = Grid::new(70, 50);
        let (mut pixels, mut seen) = (PixelSamples::new(grid), vec![0; cache.capacity()]);
        for level in [Level::new(), Level::baseline()] {
            let mut fast = Projected::new(cache.capacity());
            project(level, &cache, &view, &mut fast, &mut pixels, (&mut seen, 0));
            for i in 0..cache.capacity() {
                assert_eq!(fast.depth[i], plain.depth[i], "{i}");
                let place = |p: &Projected| [p.x[i].to_bits(), p.y[i].to_bits()];
                assert!(fast.depth[i] < 0.0 || place(&fast) == place(&plain), "{i}");
            }
        }
        let mut kept = 0;
        for y in 0..50 {
            for x in 0..70 {
                let here = |i: &usize| {
                    plain.depth[*i] > 0.0 && (plain.x[*i] as usize, plain.y[*i] as usize) == (x, y)
                };
                let inside = (0..cache.capacity()).filter(here);
                let nearest = inside.min_by(|&a, &b| plain.depth[a].total_cmp(&plain.depth[b]));
                assert_eq!(pixels.has_sample(x, y), nearest.is_some());
                let point = nearest.map_or(NO_POINT, |i| i as u32);
                assert_eq!(pixels.point[grid.at(x, y)], point);
                kept += usize::from(nearest.is_some_and(|i| seen[i] == 255));
            }
        }
        assert_eq!(kept, seen.iter().filter(|&&s| s != 0).count());
        assert!(kept > 300);
    }
}
