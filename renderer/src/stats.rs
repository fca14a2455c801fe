//! What a frame cost and what it was made of: the lines of `--stats`.

use std::time::Instant;

use serde::Serialize;

/// Stages of a frame, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Taking samples from the servers into the cache.
    Drain,
    /// Projecting the points.
    Reproject,
    /// Depth culling of points and the depth for culling edges.
    Depth,
    /// Silhouettes, creases, borders.
    FindEdges,
    /// Visibility and crossings.
    Rasterize,
    /// Codes and primary regions.
    Classify,
    /// Reachability.
    Reach,
    /// Primary colours.
    Interpolate,
    /// Complex pixels.
    Complex,
    /// Simple pixels.
    Antialias,
    /// Tone-mapping and showing.
    Present,
    /// Priorities and the choice of requests.
    Prioritize,
}

/// Milliseconds a stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[expect(missing_docs, reason = "named as in Stage")]
pub struct StageMs {
    pub drain: f64,
    pub reproject: f64,
    pub depth: f64,
    pub find_edges: f64,
    pub rasterize: f64,
    pub classify: f64,
    pub reach: f64,
    pub interpolate: f64,
    pub complex: f64,
    pub antialias: f64,
    pub present: f64,
    pub prioritize: f64,
}

impl StageMs {
    /// The stage's field.
    pub fn of(&mut self, stage: Stage) -> &mut f64 {
        match stage {
            Stage::Drain => &mut self.drain,
            Stage::Reproject => &mut self.reproject,
            Stage::Depth => &mut self.depth,
            Stage::FindEdges => &mut self.find_edges,
            Stage::Rasterize => &mut self.rasterize,
            Stage::Classify => &mut self.classify,
            Stage::Reach => &mut self.reach,
            Stage::Interpolate => &mut self.interpolate,
            Stage::Complex => &mut self.complex,
            Stage::Antialias => &mut self.antialias,
            Stage::Present => &mut self.present,
            Stage::Prioritize => &mut self.prioritize,
        }
    }

    /// All stages together.
    pub fn total(&self) -> f64 {
        self.drain
            + self.reproject
            + self.depth
            + self.find_edges
            + self.rasterize
            + self.classify
            + self.reach
            + self.interpolate
            + self.complex
            + self.antialias
            + self.present
            + self.prioritize
    }

    /// Runs a stage and adds its time.
    pub fn time<T>(&mut self, stage: Stage, run: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = run();
        *self.of(stage) += start.elapsed().as_secs_f64() * 1e3;
        result
    }
}

/// Pixels of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct PixelKinds {
    /// No edge.
    pub empty: usize,
    /// One edge.
    pub simple: usize,
    /// The others.
    pub complex: usize,
}

/// One line of `--stats`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct FrameStats {
    /// Frame number, from 0.
    pub frame: usize,
    /// All stages, ms.
    pub total_ms: f64,
    /// Each stage, ms.
    pub stage_ms: StageMs,
    /// Silhouettes, creases and borders found, before culling.
    pub silhouette_edges: usize,
    /// Shadow edges rasterised.
    pub shadow_edges: usize,
    /// Pixels of each kind.
    pub pixels: PixelKinds,
    /// Samples that came in since the frame before.
    pub samples_new: usize,
    /// Pixels with a sample.
    pub samples_visible: usize,
    /// Points in the cache.
    pub points: usize,
    /// Light-blocker-receiver triples known.
    pub triples: usize,
    /// Servers connected.
    pub servers: usize,
    /// Lockstep's waiting for samples, ms; in no stage and not in the total.
    pub wait_ms: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_the_contract_s_keys() {
        let line = serde_json::to_value(FrameStats::default()).unwrap();
        let keys = |v: &serde_json::Value| {
            v.as_object()
                .unwrap()
                .keys()
                .cloned()
                .collect::<Vec<_>>()
                .join(" ")
        };
        assert_eq!(
            keys(&line),
            "frame pixels points samples_new samples_visible servers shadow_edges silhouette_edges stage_ms total_ms triples wait_ms"
        );
        assert_eq!(
            keys(&line["stage_ms"]),
            "antialias classify complex depth drain find_edges interpolate present prioritize rasterize reach reproject"
        );
        assert_eq!(keys(&line["pixels"]), "complex empty simple");
    }
}
