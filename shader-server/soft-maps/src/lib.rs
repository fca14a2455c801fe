//! Soft shadow maps for linear lights, after Heidrich, Brabec and Seidel, "Soft Shadow Maps for Linear Lights" (2000).
//!
//! A few samples on the light get a depth map each. Where a depth map jumps from a near to a far surface a *skin* joins the
//! two; drawn into the map of the neighbouring sample it covers what only that neighbour sees, and visibility goes from 0 to 1
//! along it. A receiver then asks its two maps instead of tracing rays.
//!
//! Where the paper leaves room, or a better way is open:
//! - The paper takes one perspective map a sample. Here receivers are anywhere, so a map's rows are half planes around the
//!   light and its columns angles in them, over as much of the two as the scene's bounds fill. Both samples' maps have the
//!   same rows, a skin stays in its row, and each row is the two-dimensional scene of the paper's section 3.1. Such a map
//!   has a sixth fewer texels than a cube of the same finest resolution, and a moved object touches few of its rows.
//! - The Laplacian of Gaussian is that of the reciprocal distance along a row, with a second difference that is zero on
//!   planes. Discontinuities are then placed to a part of a texel by a few more rays ([`Options::refinements`]).
//! - [`Transition::Linear`] is the paper's Gouraud interpolation; [`Transition::Rational`] is the function that it
//!   approximates (Eq. 1), which costs the same once the skin's near end is known.
//! - Where both samples see a point and skins of both cover it, a blocker is between the samples: the channels then add
//!   up to less than 1, which the paper allows for without doing it.
//! - Undersampling is noticed and answered by samples in the middle (the paper's section 3.3 leaves their place open).
//! - The two terms of a pair are weighted by the irradiance of the very parts of the light that are seen, in closed form,
//!   in place of local illumination from the two samples.
//!
//! ```
//! use std::sync::Arc;
//! use glam::{Affine3A, Vec3, vec3};
//! use rays::{TriangleMesh, World};
//! use soft_maps::{Light, Options, Receiver, SoftMaps};
//!
//! let corners = |s: f32, y: f32| [vec3(-s, y, -s), vec3(s, y, -s), vec3(s, y, s), vec3(-s, y, s)];
//! let square = |s: f32, y: f32| {
//!     let mesh = TriangleMesh::build(&corners(s, y), &[[0, 1, 2], [0, 2, 3]]);
//!     (Arc::new(mesh), Affine3A::IDENTITY)
//! };
//! let world = World::new(vec![square(4., 0.), square(1., 1.)]);
//! let light = Light::Segment([vec3(-0.5, 3., 0.), vec3(0.5, 3., 0.)]);
//! let maps = SoftMaps::build(&world, &light, &Options::default())?;
//! let under = |x: f32| Receiver { position: vec3(x, 0., 0.), normal: Vec3::Y, face_normal: Vec3::Y };
//! assert_eq!(maps.fraction(&under(0.)).share, 0.);
//! assert_eq!(maps.fraction(&under(3.)).share, 1.);
//! assert!((maps.fraction(&under(1.5)).share - 0.5).abs() < 0.05);
//! # Ok::<(), soft_maps::BuildError>(())
//! ```

mod discontinuity;
mod frame;
mod grid;
mod irradiance;
mod light;
mod linear;
mod maps;
pub mod measure;
mod pair;
mod predict;
mod sample;
mod seam;
pub mod segment;
mod skins;

pub use self::{
    light::Light,
    maps::{Seen, SoftMaps, Stats},
    predict::{Predicted, predicted_error},
};

use glam::Vec3;
use rays::Bounds;

/// How visibility goes from 0 to 1 along a skin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Transition {
    /// Linearly in the neighbour's image, as the paper does: exact on receivers parallel to the light.
    Linear,
    /// By where the line past the blocker's outline meets the light: exact on all receivers.
    #[default]
    Rational,
}

/// How maps are made.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Samples on the light, or on each edge of a polygon, to begin with: 2 to 33.
    pub samples: u32,
    /// Samples that there may be after some are put where undersampling shows.
    pub max_samples: u32,
    /// Wanted angle between texels, radians. [`Options::with_texel`] finds it from a length.
    pub texel_angle: f32,
    /// Most texels a sample; maps that would need more are coarser.
    pub max_texels: u32,
    /// How much farther than the map's depth a receiver may be and count as seen, in widths of a texel there.
    pub bias: f32,
    /// Rays that place a discontinuity between two columns, each of which halves the uncertainty. 0 is the paper's.
    pub refinements: u32,
    /// How visibility goes from 0 to 1.
    pub transition: Transition,
    /// Where receivers are, world space; everywhere in the world if none.
    pub receivers: Option<Bounds>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            samples: 2,
            max_samples: 9,
            texel_angle: 0.006,
            max_texels: 1 << 20,
            bias: 1.,
            refinements: 5,
            transition: Transition::Rational,
            receivers: None,
        }
    }
}

impl Options {
    /// The same with texels of at most about `size` metres on whatever is in `bounds`, as seen from `light`.
    #[must_use]
    pub fn with_texel(mut self, light: &Light, bounds: &Bounds, size: f32) -> Self {
        let points: &[Vec3] = match light {
            Light::Segment(ends) => ends,
            Light::Polygon { vertices, .. } => vertices,
        };
        let reach = |point: &Vec3| {
            let farthest = (*point - bounds.min).abs().max((*point - bounds.max).abs());
            farthest.length()
        };
        let farthest = points.iter().map(reach).fold(0., f32::max);
        if farthest > 0. && size > 0. && !bounds.is_empty() {
            self.texel_angle = size / farthest;
        }
        self
    }
}

/// A point that light falls on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver {
    /// World space, metres.
    pub position: Vec3,
    /// Unit shading normal.
    pub normal: Vec3,
    /// Unit normal of the face itself, on either side.
    pub face_normal: Vec3,
}

/// Why there are no maps of a light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BuildError {
    /// A coordinate is not a finite number.
    #[error("the light has a coordinate that is not finite")]
    NotFinite,
    /// A polygon without area has no side that shines.
    #[error("the light is a polygon without area")]
    NoArea,
}
