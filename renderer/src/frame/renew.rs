//! Asking again for what was provisional or looks different from here.

use super::Display;
use crate::points::pixels::NO_POINT;

impl Display {
    /// Marks points in sight as due that want another sample. Scenes whose samples ask for none pay nothing.
    pub(super) fn mark_renewals(&mut self) {
        let Some(view) = self.view.filter(|_| self.renewal.is_needed()) else {
            return;
        };
        self.renewal.next_frame();
        let grid = self.grid;
        for y in 0..grid.height {
            for x in 0..grid.width {
                let slot = self.pixels.point[grid.at(x, y)];
                if slot == NO_POINT || self.cache.w[slot as usize] != 1.0 {
                    continue;
                }
                let (info, position) = (self.cache.info[slot as usize], self.cache.point(slot));
                if self.renewal.is_wanted(slot, info, position, view.eye) && !self.due.is_due(slot)
                {
                    self.due.set(slot);
                }
            }
        }
    }
}
