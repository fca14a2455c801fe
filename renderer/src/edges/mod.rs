//! Finding edges and drawing them into the edge-and-point image.
//!
//! [`EdgeFinder`](finder::EdgeFinder) is built from a scene and fills an [`EdgeList`](list::EdgeList) for a view;
//! [`raster`] draws the list into [`Crossings`](crossings::Crossings).

pub mod adjacency;
pub mod by_rays;
mod chain;
pub mod clip;
pub mod crossings;
pub mod depth;
pub mod finder;
mod layer;
pub mod list;
pub mod meets;
mod orient;
pub mod raster;
pub mod tree;
mod tree_build;
pub mod truth;
pub mod visibility;
pub mod visible;
pub mod weld;
pub mod world;

#[cfg(test)]
mod finder_tests;
#[cfg(test)]
mod raster_tests;
#[cfg(test)]
pub(crate) mod test_meshes;
#[cfg(test)]
mod tests;
