//! Reconstruction: colours for pixels from the samples that they can reach, in linear radiance.

pub mod antialias;
mod bare;
pub mod complex;
pub mod diffuse;
pub mod grow;
pub mod interpolate;
pub mod open;
pub mod settle;
pub mod spread;
pub mod taps;
