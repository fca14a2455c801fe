//! Shaded points: the cache that keeps them, and what of them each pixel sees.

pub mod cache;
pub mod cull;
pub mod pixels;
pub mod project;
pub mod still;

pub use cache::PointCache;
pub use pixels::PixelSamples;
pub use still::Still;
