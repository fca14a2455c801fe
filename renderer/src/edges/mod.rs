//! Finding edges and drawing them into the edge-and-point image.

pub mod crossings;
