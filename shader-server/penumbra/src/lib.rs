//! Hierarchical penumbra casting (Laine and Aila 2005): which samples of an area light each of many receivers sees.
//!
//! Rays ask for every receiver and sample what blocks it; casting asks for every polygon what it blocks. A [`Light`] has
//! samples in groups; a [`Caster`] holds the polygons of [`BlockerMesh`]es between it and the [`Receivers`] of a batch, and
//! finds for each of those a bit a sample and the share of the light's irradiance that arrives.
//!
//! ```
//! use std::sync::Arc;
//! use glam::{Affine3A, Vec3, dvec3, vec3};
//! use penumbra::{BlockerMesh, Caster, Instance, Light, Receivers, Route, Sampling, Seen, Shape, Wanted};
//!
//! // A light of a square metre, two metres up, shines down on a small triangle above the receiver.
//! let corners = vec![dvec3(-0.5, 2., -0.5), dvec3(0.5, 2., -0.5), dvec3(0.5, 2., 0.5), dvec3(-0.5, 2., 0.5)];
//! let light = Light::new(Shape::Polygon(corners), Sampling::default()).expect("a square and 256 samples");
//! let triangle = [vec3(-0.2, 1., -0.2), vec3(0.2, 1., -0.2), vec3(0., 1., 0.2)];
//! let mesh = Arc::new(BlockerMesh::new(&triangle, &[[0, 1, 2]]));
//! let caster = Caster::new(vec![Instance { mesh, to_world: Affine3A::IDENTITY }], light, None);
//! let mut receivers = Receivers::default();
//! receivers.push(Vec3::ZERO, Vec3::Y, (u32::MAX, 0), 0);
//! let mut seen = Seen::default();
//! caster.cast(&receivers, Route::Cast, Wanted::default(), &mut seen);
//! assert!(seen.shares[0] > 0.5 && seen.shares[0] < 0.9);
//! ```

mod alpha;
mod antialias;
mod batch;
mod blocker;
pub mod brute;
mod cast;
mod caster;
mod costs;
mod kernel;
mod lanes;
mod light;
mod merge;
mod mesh;
mod paper;
pub(crate) mod predicate;
mod receivers;
mod shadow_rays;
mod shells;
mod strata;
mod tree;
mod weigh;

pub use alpha::{Alpha, AlphaMap};
pub use antialias::{FirstPass, SubReceiver, places};
pub use batch::{Route, Seen, Wanted};
pub use cast::Counts;
pub use caster::{Caster, Instance};
pub use costs::Costs;
pub use light::{Light, LightError, MAX_SAMPLES, MAX_SETS, Sampling, Shape};
pub use mesh::BlockerMesh;
pub use paper::{PaperOrder, PaperSeen};
pub use receivers::Receivers;
pub use weigh::{share_of_irradiance, share_of_samples};
