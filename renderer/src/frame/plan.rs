//! Saying what is wanted next.

use protocol::messages::SampleRequest;

use super::Display;
use crate::camera::View;
use crate::sampling::place::{PixelState, hash_unit, place};
use crate::stats::Stage;

/// Largest share of the budget that goes to what the next camera will uncover (Render Cache 2002: one half).
const AHEAD_SHARE: usize = 2;

/// What a frame asks for, most wanted first.
#[derive(Clone, Debug, Default)]
pub struct Wanted {
    /// In the view of the frame.
    pub here: Vec<SampleRequest>,
    /// In the view that comes next.
    pub ahead: Vec<SampleRequest>,
}

impl Wanted {
    /// Requests in all.
    pub fn len(&self) -> usize {
        self.here.len() + self.ahead.len()
    }

    /// Whether nothing is wanted.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl Display {
    /// Chooses at most `budget` samples to ask for: where the frame just drawn is lacking, and, if the camera is going to
    /// be at `next`, where that view will have no points at all.
    pub fn plan(&mut self, budget: usize, next: Option<&View>, wanted: &mut Wanted) {
        let mut ms = std::mem::take(&mut self.stage_ms);
        ms.time(Stage::Prioritize, || self.choose(budget, next, wanted));
        self.stage_ms = ms;
    }

    /// What to ask for before there is any frame: pixels spread over the whole image of this view.
    pub fn plan_first(&mut self, budget: usize, wanted: &mut Wanted) {
        wanted.here.clear();
        wanted.ahead.clear();
        self.priorities.priority.fill(1.0);
        self.request_chosen(budget, wanted);
    }

    fn choose(&mut self, budget: usize, next: Option<&View>, wanted: &mut Wanted) {
        self.relocate();
        wanted.here.clear();
        wanted.ahead.clear();
        self.uncovered.clear();
        let moving = next.filter(|n| self.view.as_ref() != Some(*n));
        if let Some(view) = moving.filter(|_| self.choices.prediction.is_on()) {
            let limit = budget / AHEAD_SHARE;
            let (level, cache) = (self.level, &self.cache);
            let found = &mut self.uncovered;
            self.prediction.find_empty(level, cache, view, limit, found);
        }
        self.prioritize();
        self.drop_settled();
        self.request_chosen(budget - self.uncovered.len(), wanted);
        for &(x, y) in &self.uncovered {
            self.last_id += 1;
            let offset = [5, 6].map(|salt| hash_unit(self.seed ^ salt, self.last_id));
            wanted.ahead.push(SampleRequest {
                id: self.last_id,
                x,
                y,
                offset,
            });
        }
    }

    /// Takes the priority of pixels that more samples would not change visibly: a still camera stops asking when none is
    /// left.
    fn drop_settled(&mut self) {
        for &pixel in self.still.touched() {
            let (x, y) = (
                pixel as usize % self.grid.width,
                pixel as usize / self.grid.width,
            );
            if self.still.whole(x, y).is_settled() {
                self.priorities.priority[self.grid.at(x, y)] = 0.0;
            }
        }
    }

    fn request_chosen(&mut self, budget: usize, wanted: &mut Wanted) {
        self.plans += 1;
        let image = (self.grid, &self.priorities.priority[..]);
        let key = self.seed ^ self.plans;
        self.chooser
            .choose(self.level, image, budget, key, &mut self.chosen);
        for &(x, y) in &self.chosen {
            self.last_id += 1;
            let offset = self.place_of(usize::from(x), usize::from(y));
            wanted.here.push(SampleRequest {
                id: self.last_id,
                x,
                y,
                offset,
            });
        }
    }

    fn place_of(&self, x: usize, y: usize) -> [f32; 2] {
        let code = self.epi.code_at(x, y);
        // While the camera moves there is nothing to look up for thousands of pixels all over the image.
        let still = Some(&self.still).filter(|still| !still.touched().is_empty());
        let count = still.map_or(0, |still| still.whole(x, y).count as u32);
        let region_centre = code.is_simple().then(|| {
            let tables = self.epi.tables();
            let counts = still
                .and_then(|still| still.split(x, y, code.0))
                .map_or([0.0; 2], |s| s.regions.map(|r| r.count));
            let area = tables.inner_area(code);
            // The region with fewer samples for its area.
            let inner = counts[1] * (1.0 - area) < counts[0] * area
                || (counts == [0.0; 2] && tables.inner_larger(code));
            tables.centroid_px(code, inner)
        });
        let moving = if count == 0 { self.plans } else { 0 };
        place(
            self.seed ^ moving << 20,
            PixelState {
                x,
                y,
                count,
                region_centre,
            },
        )
    }
}
