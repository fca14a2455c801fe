//! What to ask the shader servers for next.

pub mod blue_noise;
pub mod choose;
pub mod place;
pub mod predict;
pub mod priority;
