//! The edge-and-point image.

pub mod grid;
