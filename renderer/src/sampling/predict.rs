//! Looking ahead: which parts of the next frame no cached point will cover (Render Cache 2002, "Prediction").

use std::ops::Range;

use fearless_simd::{Level, dispatch, prelude::*};
use fearless_simd_macros::simd;

use crate::camera::View;
use crate::points::PointCache;

/// Side of a prediction cell, pixels.
pub const CELL_PX: usize = 4;

/// Points projected together, so that what one pass leaves for the next stays in the nearest memory.
const BATCH: usize = 512;

/// Most points in a vector.
const MOST_LANES: usize = 64;

/// Occupancy of the predicted image, a cell of [`CELL_PX`] squared pixels each. No depth is kept.
#[derive(Clone, Debug, Default)]
pub struct Prediction {
    /// One cell more than there are, for points outside the image.
    occupied: Vec<bool>,
    columns: usize,
    rows: usize,
}

impl Prediction {
    /// Projects all points to the predicted view and gives `found` the middle pixel of every cell that stays empty, at most
    /// `limit` of them, spread over the image. Results do not depend on `level`.
    pub fn find_empty(
        &mut self,
        level: Level,
        cache: &PointCache,
        view: &View,
        limit: usize,
        found: &mut Vec<(u16, u16)>,
    ) {
        found.clear();
        if limit == 0 {
            return;
        }
        self.columns = (view.width as usize).div_ceil(CELL_PX);
        self.rows = (view.height as usize).div_ceil(CELL_PX);
        let outside = self.columns * self.rows;
        self.occupied.clear();
        self.occupied.resize(outside + 1, false);
        let cells = Cells {
            view,
            columns: self.columns as u32,
            outside: outside as u32,
        };
        let mut batch = [0; BATCH];
        for first in (0..cache.reach()).step_by(BATCH) {
            let slots = first..(first + BATCH).min(cache.reach());
            let batch = &mut batch[..slots.len()];
            dispatch!(level, simd => cells_of(simd, cache, slots, &cells, batch));
            for &cell in &*batch {
                self.occupied[cell as usize] = true;
            }
        }
        self.occupied.truncate(outside);
        let empty = self.occupied.iter().filter(|&&o| !o).count();
        let every = empty.div_ceil(limit).max(1);
        for (k, (cell, _)) in self
            .occupied
            .iter()
            .enumerate()
            .filter(|(_, o)| !**o)
            .enumerate()
        {
            if k % every == 0 {
                let middle = |cell: usize, size: u32| {
                    (cell * CELL_PX + CELL_PX / 2).min(size as usize - 1) as u16
                };
                found.push((
                    middle(cell % self.columns, view.width),
                    middle(cell / self.columns, view.height),
                ));
            }
        }
    }
}

/// How the cells of a view are numbered.
struct Cells<'a> {
    view: &'a View,
    columns: u32,
    /// Stands for all that lies outside of the image.
    outside: u32,
}

/// The cells that the points in some slots fall in.
#[simd]
fn cells_of<S: Simd>(
    simd: S,
    cache: &PointCache,
    slots: Range<usize>,
    cells: &Cells<'_>,
    out: &mut [u32],
) {
    let lanes = S::f32s::LEN;
    let whole = slots.len() - slots.len() % lanes;
    for k in (0..whole).step_by(lanes) {
        let slots = slots.start + k..slots.start + k + lanes;
        let x = S::f32s::from_slice(simd, &cache.position[0][slots.clone()]);
        let y = S::f32s::from_slice(simd, &cache.position[1][slots.clone()]);
        let z = S::f32s::from_slice(simd, &cache.position[2][slots.clone()]);
        let w = S::f32s::from_slice(simd, &cache.w[slots]);
        let numbers = cells.of(simd, [x, y, z, w]);
        numbers.store_slice(&mut out[k..k + lanes]);
    }
    if whole < slots.len() {
        // Filled up with slots that hold no point.
        let mut last = [[-1.0; MOST_LANES]; 4];
        let left = slots.start + whole..slots.end;
        for (last, plane) in last.iter_mut().zip(cache.position.iter().chain([&cache.w])) {
            last[..left.len()].copy_from_slice(&plane[left.clone()]);
        }
        let x = S::f32s::from_slice(simd, &last[0][..lanes]);
        let y = S::f32s::from_slice(simd, &last[1][..lanes]);
        let z = S::f32s::from_slice(simd, &last[2][..lanes]);
        let w = S::f32s::from_slice(simd, &last[3][..lanes]);
        let mut numbers = [0; MOST_LANES];
        cells
            .of(simd, [x, y, z, w])
            .store_slice(&mut numbers[..lanes]);
        out[whole..].copy_from_slice(&numbers[..left.len()]);
    }
}

impl Cells<'_> {
    /// Of points given by position and [`PointCache::w`].
    #[inline(always)]
    fn of<S: Simd>(&self, simd: S, [x, y, z, w]: [S::f32s; 4]) -> S::u32s {
        let view = self.view;
        let away = [
            x - w * S::f32s::splat(simd, view.eye.x),
            y - w * S::f32s::splat(simd, view.eye.y),
            z - w * S::f32s::splat(simd, view.eye.z),
        ];
        let zero = S::f32s::splat(simd, 0.0);
        let depth = dot(simd, view.forward, away);
        let scale = S::f32s::splat(simd, view.focal_px) / depth;
        let (width, height) = (
            S::f32s::splat(simd, view.width as f32),
            S::f32s::splat(simd, view.height as f32),
        );
        let half = S::f32s::splat(simd, 0.5);
        let px = width * half + dot(simd, view.right, away) * scale;
        let py = height * half - dot(simd, view.up, away) * scale;
        let inside = depth.simd_gt(zero)
            & px.simd_ge(zero)
            & px.simd_lt(width)
            & py.simd_ge(zero)
            & py.simd_lt(height)
            & w.simd_ge(zero);
        let cells = S::f32s::splat(simd, 1.0 / CELL_PX as f32);
        let column = S::u32s::truncate_from(inside.select(px * cells, zero));
        let row = S::u32s::truncate_from(inside.select(py * cells, zero));
        let numbered = row * S::u32s::splat(simd, self.columns) + column;
        inside.select(numbered, S::u32s::splat(simd, self.outside))
    }
}

#[inline(always)]
fn dot<S: Simd>(simd: S, v: glam::Vec3, [x, y, z]: [S::f32s; 3]) -> S::f32s {
    S::f32s::splat(simd, v.x) * x + S::f32s::splat(simd, v.y) * y + S::f32s::splat(simd, v.z) * z
}

#[cfg(test)]
mod tests {
    use protocol::messages::{Camera, Sample, flags};

    use super::*;
    use crate::sampling::place::hash_unit;

    #[test]
    fn cells_without_points_are_found_at_every_level() {
        let view = View::new(&Camera {
            eye: [0.0, 1.0, 4.0],
            target: [0.0, 0.5, 0.0],
            up: [0.0, 1.0, 0.0],
            fov_y: 50.0,
            width: 70,
            height: 50,
        });
        let mut cache = PointCache::new(1203);
        let mut occupied = vec![false; 18 * 13];
        for id in 0..1100 {
            let random = |axis: u64| 8.0 * hash_unit(axis, id) - 4.0;
            let miss = id % 9 == 0;
            let p = glam::Vec3::new(random(1), random(2), random(3));
            let position = if miss { p.normalize() } else { p };
            let sample = Sample {
                id,
                position: position.into(),
                object: 0,
                radiance: [0.5; 3],
                flags: if miss { flags::MISS } else { 0 },
            };
            cache.insert(&sample, None);
            let away = if miss { position } else { position - view.eye };
            let [right, up, depth] = [view.right, view.up, view.forward].map(|v| v.dot(away));
            let (x, y) = (
                35.0 + view.focal_px * right / depth,
                25.0 - view.focal_px * up / depth,
            );
            if depth > 0.0 && (0.0..70.0).contains(&x) && (0.0..50.0).contains(&y) {
                occupied[y as usize / CELL_PX * 18 + x as usize / CELL_PX] = true;
            }
        }
        let wanted: Vec<(u16, u16)> = (0..18 * 13)
            .filter(|c| !occupied[*c])
            .map(|c| {
                (
                    (c % 18 * 4 + 2).min(69) as u16,
                    (c / 18 * 4 + 2).min(49) as u16,
                )
            })
            .collect();
        assert!((20..200).contains(&wanted.len()), "{}", wanted.len());
        let (mut prediction, mut found) = (Prediction::default(), Vec::new());
        for level in [Level::new(), Level::baseline()] {
            prediction.find_empty(level, &cache, &view, 1000, &mut found);
            assert_eq!(found, wanted);
            prediction.find_empty(level, &cache, &view, 7, &mut found);
            assert!((4..=7).contains(&found.len()) && found.iter().all(|p| wanted.contains(p)));
            prediction.find_empty(level, &cache, &view, 0, &mut found);
            assert!(found.is_empty());
        }
    }
}
