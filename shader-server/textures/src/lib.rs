//! Filtered look-up of diffuse maps. The shader server and the display read a map in the same way, so that what a sample was
//! shaded with can be taken off it and put back elsewhere.
//!
//! A [`Map`] is a texture decoded to linear light with its halved copies. [`Map::filtered`] averages it over a [`Footprint`]:
//! a parallelogram in texture space, covered by a few probes along its longer axis, each bilinear in the copy whose texels are
//! about as wide as its shorter one (the usual anisotropic filter, without blending copies: probes cost more than that shows).

mod map;

pub use map::{Footprint, Map};
