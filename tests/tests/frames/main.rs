//! Whole frames of small scenes whose right colours are known exactly, the shader in the same process.

mod coincident;
mod drive;
mod jump;
mod shadow_edges;
mod shadows;
mod switch;
mod two_colours;
