//! Every choice of the display, each a switch of `render`.

use clap::{Args, ValueEnum};
use serde::{Deserialize, Serialize};

/// How the colours of pixels come about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Sparse samples, edges, the complex filter: everything.
    #[default]
    EdgeAndPoint,
    /// The same without the complex filter.
    NoComplex,
    /// The same samples without edges: the Render Cache.
    PointsOnly,
    /// Every pixel shaded once by the servers in every frame, no reconstruction.
    Full,
    /// Many jittered samples a pixel, box-filtered.
    Reference,
}

/// How the primary region's colour is interpolated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Interpolation {
    /// The paper's fixed weights a pixel offset.
    Paper,
    /// Weighted plane through the samples' true places.
    #[default]
    Linear,
}

/// What priorities are made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Priority {
    /// The paper's: missing interpolation weight.
    Paper,
    /// Local contrast between pixels that no edge separates, over that weight.
    #[default]
    Contrast,
}

/// How hidden edges are told from visible ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Culling {
    /// Not at all.
    None,
    /// The paper's: by the filtered depth of reprojected points.
    Points,
    /// By rays from the eye to points on the edge.
    #[default]
    Rays,
}

/// Which shadow edges keep samples apart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum ShadowEdges {
    /// None.
    Off,
    /// Every umbral and penumbral edge: the paper's.
    All,
    /// One line along each hard or narrow shadow, where its light can be seen to matter.
    #[default]
    Chosen,
}

/// How points seen through a nearer surface are told from visible ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum PointCulling {
    /// Not at all.
    None,
    /// The Render Cache's: well behind their neighbours' mean depth.
    Depth,
    /// A ray decides about those.
    #[default]
    Rays,
}

/// Bits that a sample's place in its pixel is known to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
pub enum PlaceBits {
    /// 4x4 cells, the paper's.
    #[value(name = "4")]
    #[serde(rename = "4")]
    Four,
    /// 8x8 cells.
    #[value(name = "6")]
    #[serde(rename = "6")]
    Six,
    /// 16x16 cells.
    #[default]
    #[value(name = "8")]
    #[serde(rename = "8")]
    Eight,
}

/// A switch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Switch {
    /// As it is meant to be used.
    #[default]
    On,
    /// Left out, to see what it does.
    Off,
}

impl Switch {
    /// Whether it is on.
    pub fn is_on(self) -> bool {
        self == Self::On
    }
}

/// Default of [`Choices::shadow_width`].
const NARROW: f32 = 0.5;

/// Default of [`Choices::shadow_steps`].
const STEPS: f32 = 1.0;

/// The choices.
#[derive(Args, Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Choices {
    /// How the colours of pixels come about
    #[arg(long, value_enum, default_value_t)]
    pub method: Method,
    /// How the primary region of a pixel gets its colour
    #[arg(long, value_enum, default_value_t)]
    pub interpolation: Interpolation,
    /// What is asked for first
    #[arg(long, value_enum, default_value_t)]
    pub priority: Priority,
    /// How hidden edges are told from visible ones
    #[arg(long, value_enum, default_value_t)]
    pub culling: Culling,
    /// Which edges of shadows keep samples apart
    #[arg(long, value_enum, default_value_t)]
    pub shadow_edges: ShadowEdges,
    /// Greatest width of a penumbra on screen whose edge is chosen, mean distances between samples
    #[arg(long, default_value_t = NARROW, value_name = "RATIO")]
    pub shadow_width: f32,
    /// Least change of the picture that a shadow edge is chosen for, steps of 255; 0 for every one that is narrow
    #[arg(long, default_value_t = STEPS, value_name = "STEPS")]
    pub shadow_steps: f32,
    /// How points seen through a nearer surface are told from visible ones
    #[arg(long, value_enum, default_value_t)]
    pub point_culling: PointCulling,
    /// Bits that a sample's place in its pixel is known to
    #[arg(long, value_enum, default_value_t)]
    pub place_bits: PlaceBits,
    /// Blend both sides of the edge in simple pixels
    #[arg(long, value_enum, default_value_t)]
    pub antialias: Switch,
    /// Ask for what the next camera will uncover
    #[arg(long, value_enum, default_value_t)]
    pub prediction: Switch,
    /// Average raw samples while nothing moves
    #[arg(long, value_enum, default_value_t)]
    pub settle: Switch,
    /// Renew what an edit may have made wrong before everything else
    #[arg(long, value_enum, default_value_t)]
    pub due_first: Switch,
    /// Size of the point cache, points a pixel
    #[arg(long, default_value_t = 1.5, value_name = "RATIO")]
    pub cache: f32,
}

impl Default for Choices {
    fn default() -> Self {
        Self {
            method: Method::default(),
            interpolation: Interpolation::default(),
            priority: Priority::default(),
            culling: Culling::default(),
            shadow_edges: ShadowEdges::default(),
            shadow_width: NARROW,
            shadow_steps: STEPS,
            point_culling: PointCulling::default(),
            place_bits: PlaceBits::default(),
            antialias: Switch::default(),
            prediction: Switch::default(),
            settle: Switch::default(),
            due_first: Switch::default(),
            cache: 1.5,
        }
    }
}

impl Choices {
    /// Whether edges are found at all.
    pub fn edges(&self) -> bool {
        matches!(self.method, Method::EdgeAndPoint | Method::NoComplex)
    }
}
