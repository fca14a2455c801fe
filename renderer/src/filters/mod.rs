//! Reconstruction: colours for pixels from the samples that they can reach, in linear radiance.

pub mod antialias;
mod bare;
mod blocks;
pub mod complex;
mod fit;
mod grow;
pub mod interpolate;
mod lattice;
mod moments;
mod records;
pub mod settle;
pub mod taps;
mod window;
