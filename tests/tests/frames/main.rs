//! Whole frames of small scenes whose right colours are known exactly, the shader in the same process.

mod coincident;
mod drive;
mod two_colours;
