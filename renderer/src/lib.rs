//! The display: draws sharp pictures from sparsely shaded points and analytically found edges.
//!
//! A frame runs one way: samples are drained into [`points`], projected, [`edges`] are found and rasterised, [`epi`]
//! classifies pixels and finds what is reachable, [`filters`] reconstruct colours, [`sampling`] says what to ask for
//! next; [`shadows`] finds where shadows begin and end. None of these stages knows of sockets: [`link`] does.

pub mod camera;
pub mod cli;
pub mod config;
pub mod edges;
pub mod epi;
pub mod explain;
pub mod filters;
pub mod frame;
pub mod headless;
pub mod link;
pub mod maps;
pub mod points;
pub mod sampling;
pub mod servers;
pub mod shadows;
pub mod show;
pub mod stats;
pub mod tone;
pub mod traces;
pub mod window;
