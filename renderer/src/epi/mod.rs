//! The edge-and-point image (paper section 4) and what can be reached in it (section 5.2).
//!
//! [`classify`](classify::classify) turns boundary crossings into an [`Epi`]: an edge code a pixel and bit planes.
//! [`Epi::set_primary`] adds the samples' places, which settles each pixel's primary region.
//! [`ReachMap::compute`](reach::ReachMap::compute) then finds, for every pixel, which of its 5x5 neighbours hold a
//! primary region that no edge separates from its own.
//!
//! Per-pixel data is laid out by [`grid::Grid`]: a *bit plane* has one bit a pixel in 64-bit words, an *element array*
//! one element a pixel with a margin. Image space has its origin at the top left, x right, y down, one unit a pixel.

pub mod bends;
pub mod classify;
pub mod code;
pub(crate) mod geometry;
pub mod grid;
mod image;
pub mod reach;
pub mod reach_tables;

#[cfg(test)]
pub(crate) mod testing;

pub use image::{Counts, Epi, SamplePlaces};
