//! The edge stages of a frame: found, hidden ones left out, drawn into crossings.

use fearless_simd::Level;
use protocol::scene::Scene;

use crate::camera::View;
use crate::config::Choices;
use crate::edges::crossings::Crossings;
use crate::epi::Epi;
use crate::epi::classify::classify;
use crate::epi::grid::Grid;
use crate::points::{PixelSamples, PointCache};
use crate::stats::StageMs;

/// Everything about edges that lasts from frame to frame.
pub struct EdgeStage {
    crossings: Crossings,
    changed: bool,
}

impl EdgeStage {
    /// Ready to find the edges of this scene.
    pub fn new(_scene: &Scene, _choices: Choices, grid: Grid) -> Self {
        Self {
            crossings: Crossings::new(grid.width, grid.height),
            changed: true,
        }
    }

    /// Finds and draws.
    pub fn find(&mut self, _view: &View, moved: bool, _pixels: &PixelSamples, _ms: &mut StageMs) {
        self.changed |= moved;
    }

    /// Classifies.
    pub fn classify(&mut self, level: Level, epi: &mut Epi) {
        if std::mem::take(&mut self.changed) {
            classify(level, &self.crossings, epi);
        }
    }

    /// Edges found.
    pub fn found(&self) -> usize {
        0
    }

    /// The scene for rays, where the choices need it.
    pub fn world(&self) -> Option<&rays::World> {
        None
    }
}

/// Whether a point is seen from the eye.
pub fn sees(_world: &rays::World, _view: &View, _cache: &PointCache, _point: u32) -> bool {
    true
}
