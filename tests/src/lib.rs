//! Whole-system checks of the edge-and-point renderer: error metrics, picture comparison, the report.
//!
//! [`picture::Picture`] is a linear RGB image read from EXR or PNG; [`metrics`] compares two of them
//! or two sequences; [`compare`] is the command on top.

pub mod compare;
pub mod edge_accuracy;
pub mod metrics;
pub mod picture;
pub mod places;
pub mod ray_speed;
pub mod report;
pub mod scaling;
pub mod shadow_accuracy;
pub mod shadow_speed;
pub mod soak;
