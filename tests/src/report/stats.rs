//! The renderer's `--stats` file: JSON lines, one object a frame (DESIGN section 7).

use std::collections::BTreeMap;

use serde::Deserialize;
use thiserror::Error;

/// The frame's stages in the order in which they run.
pub const STAGES: [&str; 12] = [
    "drain",
    "reproject",
    "depth",
    "find_edges",
    "rasterize",
    "classify",
    "reach",
    "interpolate",
    "complex",
    "antialias",
    "present",
    "prioritize",
];

/// What one frame took and met.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct FrameStats {
    /// Frame number from 0.
    pub frame: u64,
    /// Time of all stages, milliseconds, without waiting for samples.
    pub total_ms: f64,
    /// Time of each stage, milliseconds, by its name in [`STAGES`].
    #[serde(default)]
    pub stage_ms: BTreeMap<String, f64>,
    /// Silhouettes, creases and borders found.
    #[serde(default)]
    pub silhouette_edges: u64,
    /// Shadow edges found.
    #[serde(default)]
    pub shadow_edges: u64,
    /// Pixels by class.
    #[serde(default)]
    pub pixels: PixelClasses,
    /// Samples that arrived for this frame.
    #[serde(default)]
    pub samples_new: u64,
    /// Samples of the cache that are seen in this frame.
    #[serde(default)]
    pub samples_visible: u64,
    /// Points in the cache.
    #[serde(default)]
    pub points: u64,
    /// Light-blocker-receiver triples known.
    #[serde(default)]
    pub triples: u64,
    /// Shader servers connected.
    #[serde(default)]
    pub servers: u64,
    /// Lockstep's waiting for samples, milliseconds.
    #[serde(default)]
    pub wait_ms: f64,
}

/// Number of pixels of each class.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
pub struct PixelClasses {
    /// Without an edge.
    #[serde(default)]
    pub empty: u64,
    /// With one edge, from side to side.
    #[serde(default)]
    pub simple: u64,
    /// Everything else.
    #[serde(default)]
    pub complex: u64,
}

/// A line that is no frame.
#[derive(Debug, Error)]
#[error("line {line} of the statistics is no frame: {source}")]
pub struct StatsError {
    /// Line number from 1.
    pub line: usize,
    /// What the parser said.
    pub source: serde_json::Error,
}

/// Reads every line; empty lines and unknown keys are passed over.
///
/// # Errors
/// [`StatsError`] names the first line that lacks `frame` or `total_ms` or is no JSON object.
pub fn parse(text: &str) -> Result<Vec<FrameStats>, StatsError> {
    let lines = text
        .lines()
        .enumerate()
        .filter(|(_, line)| !line.trim().is_empty());
    let frame = |(i, line)| {
        serde_json::from_str(line).map_err(|source| StatsError {
            line: i + 1,
            source,
        })
    };
    lines.map(frame).collect()
}

/// The value below which `share` (0 to 1) of `values` lie, by linear interpolation between the nearest two; 0 for none.
pub fn percentile(values: impl IntoIterator<Item = f64>, share: f64) -> f64 {
    let mut sorted: Vec<f64> = values.into_iter().collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else {
        return 0.0;
    };
    let place = last as f64 * share.clamp(0.0, 1.0);
    let (below, above) = (
        sorted[place as usize],
        sorted[(place as usize + 1).min(last)],
    );
    below + (above - below) * place.fract()
}

/// The middle value; 0 for none.
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    percentile(values, 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIXTURE: &str = r#"
{"frame":0,"total_ms":5.5,"stage_ms":{"drain":0.1,"reproject":1.5},"silhouette_edges":900,"shadow_edges":3,"pixels":{"empty":1000,"simple":20,"complex":4},"samples_new":50,"samples_visible":40,"points":50,"triples":2,"servers":1,"wait_ms":12.5,"unknown":[1]}

{"frame":1,"total_ms":4}
"#;

    #[test]
    fn frames_are_read_and_unknown_keys_passed_over() {
        let frames = parse(FIXTURE).unwrap();
        assert_eq!(frames.len(), 2);
        assert_eq!(frames[0].stage_ms["reproject"], 1.5);
        assert_eq!(
            frames[0].pixels,
            PixelClasses {
                empty: 1000,
                simple: 20,
                complex: 4
            }
        );
        assert_eq!(frames[0].wait_ms, 12.5);
        assert_eq!(
            (frames[1].frame, frames[1].total_ms, frames[1].points),
            (1, 4.0, 0)
        );
    }

    #[test]
    fn a_bad_line_is_named() {
        let error = parse("{\"frame\":0,\"total_ms\":1}\n{\"frame\":1}").unwrap_err();
        assert_eq!(error.line, 2);
    }

    #[test]
    fn percentiles_interpolate() {
        let values = [4.0, 1.0, 3.0, 2.0];
        assert_eq!(median(values), 2.5);
        assert_eq!(percentile(values, 0.0), 1.0);
        assert_eq!(percentile(values, 1.0), 4.0);
        assert!((percentile(values, 0.95) - 3.85).abs() < 1e-12);
        assert_eq!(median([]), 0.0);
    }
}
