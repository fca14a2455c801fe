//! Checks of every value that comes from a peer.
//!
//! Decoding makes sure of types and lengths; these functions make sure of what the numbers mean. They know no history:
//! whether an id is outstanding or a view was sent is [`crate::session`]'s to say.

mod geometry;
mod message;
mod scene;

pub use message::{validate_camera, validate_samples, validate_to_display, validate_to_server};
pub use scene::{validate_light, validate_scene, validate_transform};

use crate::messages::FaultCode;

/// A value that is not allowed, and where it stands.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{place}: {problem}")]
pub struct ValueError {
    /// Path of the value from its message or scene, such as `meshes[3].faces[17]`.
    pub place: String,
    /// What is wrong with it.
    pub problem: Problem,
}

/// What is wrong with a value.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Problem {
    /// NaN or infinite.
    #[error("{0} is not a finite number")]
    NotFinite(f32),
    /// Outside of what is allowed.
    #[error("{value} is outside {min} to {max}")]
    Range {
        /// The value.
        value: f64,
        /// Least allowed.
        min: f64,
        /// Most allowed.
        max: f64,
    },
    /// Too few or too many elements.
    #[error("has {count} elements, {min} to {max} are allowed")]
    Count {
        /// How many there are.
        count: usize,
        /// Least allowed.
        min: usize,
        /// Most allowed.
        max: usize,
    },
    /// Past the end of its table.
    #[error("index {index} is past its table, which has {len} elements")]
    Index {
        /// The index.
        index: u32,
        /// Length of the table.
        len: usize,
    },
    /// Should be a unit vector.
    #[error("is {length} long, should be a unit vector")]
    NotUnit {
        /// Its length.
        length: f32,
    },
    /// Anything else.
    #[error("{0}")]
    Other(&'static str),
}

impl ValueError {
    /// The kind of fault to report to who sent it.
    pub fn fault(&self) -> FaultCode {
        match self.problem {
            Problem::Count { .. } => FaultCode::Limit,
            _ => FaultCode::Value,
        }
    }

    /// The same error with its place seen from further up.
    #[must_use]
    pub fn inside(mut self, outer: &str) -> Self {
        self.place = format!("{outer}.{}", self.place);
        self
    }
}

type Checked = Result<(), ValueError>;

/// Names the place of a problem; the name is only made when there is one.
trait At {
    fn at(self, place: impl FnOnce() -> String) -> Checked;
}

impl At for Result<(), Problem> {
    fn at(self, place: impl FnOnce() -> String) -> Checked {
        self.map_err(|problem| ValueError {
            place: place(),
            problem,
        })
    }
}

/// NaN is in no range.
fn range(value: f32, min: f32, max: f32) -> Result<(), Problem> {
    if !value.is_finite() {
        Err(Problem::NotFinite(value))
    } else if value < min || value > max {
        Err(Problem::Range {
            value: value.into(),
            min: min.into(),
            max: max.into(),
        })
    } else {
        Ok(())
    }
}

fn ranges(values: &[f32], min: f32, max: f32) -> Result<(), Problem> {
    values.iter().try_for_each(|&value| range(value, min, max))
}

fn whole(value: u32, min: u32, max: u32) -> Result<(), Problem> {
    if value < min || value > max {
        Err(Problem::Range {
            value: value.into(),
            min: min.into(),
            max: max.into(),
        })
    } else {
        Ok(())
    }
}

fn count(count: usize, min: usize, max: usize) -> Result<(), Problem> {
    if count < min || count > max {
        Err(Problem::Count { count, min, max })
    } else {
        Ok(())
    }
}

fn index(index: u32, len: usize) -> Result<(), Problem> {
    if index as usize >= len {
        Err(Problem::Index { index, len })
    } else {
        Ok(())
    }
}

fn unit(vector: [f32; 3]) -> Result<(), Problem> {
    ranges(&vector, -2.0, 2.0)?;
    let length = vector.iter().map(|c| c * c).sum::<f32>().sqrt();
    if (length - 1.0).abs() > crate::limits::UNIT_TOLERANCE {
        Err(Problem::NotUnit { length })
    } else {
        Ok(())
    }
}

fn position(point: [f32; 3]) -> Result<(), Problem> {
    let max = crate::limits::MAX_COORDINATE;
    ranges(&point, -max, max)
}
