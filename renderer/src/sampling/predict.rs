//! Looking ahead: which parts of the next frame no cached point will cover (Render Cache 2002, "Prediction").

use fearless_simd::Level;

use crate::camera::View;
use crate::points::PointCache;
use crate::points::project::{Projected, for_each_in_image};

/// Side of a prediction cell, pixels.
pub const CELL_PX: usize = 4;

/// Occupancy of the predicted image, a cell of [`CELL_PX`] squared pixels each. No depth is kept.
#[derive(Clone, Debug, Default)]
pub struct Prediction {
    occupied: Vec<bool>,
    batch: Projected,
    columns: usize,
    rows: usize,
}

impl Prediction {
    /// Projects all points to the predicted view and gives `found` the middle pixel of every cell that stays empty, at most
    /// `limit` of them, spread over the image.
    pub fn find_empty(
        &mut self,
        level: Level,
        cache: &PointCache,
        view: &View,
        limit: usize,
        found: &mut Vec<(u16, u16)>,
    ) {
        found.clear();
        self.columns = (view.width as usize).div_ceil(CELL_PX);
        self.rows = (view.height as usize).div_ceil(CELL_PX);
        self.occupied.clear();
        self.occupied.resize(self.columns * self.rows, false);
        let Self {
            occupied,
            batch,
            columns,
            ..
        } = self;
        for_each_in_image(level, cache, view, batch, |_, [x, y], _| {
            occupied[(y >> 8) as usize / CELL_PX * *columns + (x >> 8) as usize / CELL_PX] = true;
        });
        let empty = self.occupied.iter().filter(|&&o| !o).count();
        let every = empty.div_ceil(limit.max(1)).max(1);
        if limit == 0 {
            return;
        }
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
