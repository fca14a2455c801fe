//! Where shadows begin and end: events between lights and blockers, and the edges they draw on receivers
//! (paper sections 6.3 to 6.5 and Appendix A).

mod answers;
pub mod cast;
mod clip;
pub mod events;
pub mod faces;
mod faces_build;
pub mod geometry;
pub mod grade;
pub mod light;
pub mod list;
mod order;
pub mod store;
pub mod truth;
pub mod wedge;
pub mod worker;
pub mod worth;
