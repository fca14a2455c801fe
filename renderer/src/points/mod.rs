//! Shaded points: the cache that keeps them, and what of them each pixel sees.

pub mod around;
mod bands;
pub mod between;
pub mod cache;
pub mod cull;
pub mod due;
pub mod pixels;
pub mod project;
pub mod renew;
pub mod still;
mod sweep;
pub mod umbrella;

pub use cache::PointCache;
pub use due::Due;
pub use pixels::PixelSamples;
pub use still::Still;
