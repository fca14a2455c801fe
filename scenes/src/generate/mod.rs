//! Meshes made by formula.

mod builder;
mod round;
mod solids;

use protocol::scene::Mesh;
use serde::Deserialize;

use builder::Builder;

/// A mesh to make; lengths in metres, y up, centred on the origin unless said otherwise. All but `plane` are closed.
#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub(crate) enum Generator {
    /// A ring about the y axis.
    Torus {
        major: f32,
        minor: f32,
        #[serde(default = "around")]
        around: u32,
        #[serde(default = "across")]
        across: u32,
    },
    /// Circles of latitude about the y axis.
    Sphere {
        radius: f32,
        #[serde(default = "around")]
        around: u32,
        #[serde(default = "across")]
        across: u32,
    },
    /// An axis-parallel box.
    Box { size: [f32; 3] },
    /// A rectangle in y = 0, seen from above, cut into `cells`.
    Plane {
        size: [f32; 2],
        #[serde(default = "one_cell")]
        cells: [u32; 2],
        /// How often a texture repeats across it.
        #[serde(default = "one_repeat")]
        repeat: [f32; 2],
    },
}

/// Most triangles in one made mesh.
const MAX_TRIANGLES: u64 = 1 << 24;

impl Generator {
    /// Makes the mesh.
    ///
    /// # Errors
    /// What is wrong with which parameter.
    pub(crate) fn make(&self) -> Result<Mesh, String> {
        let mut b = Builder::default();
        match *self {
            Self::Torus {
                major,
                minor,
                around,
                across,
            } => {
                positive("minor", minor)?;
                if !(major > minor && major.is_finite()) {
                    return Err(format!(
                        "major = {major} must be greater than minor = {minor}"
                    ));
                }
                counts(&[("around", around, 3), ("across", across, 3)])?;
                round::torus(&mut b, major, minor, around, across);
            }
            Self::Sphere {
                radius,
                around,
                across,
            } => {
                positive("radius", radius)?;
                counts(&[("around", around, 3), ("across", across, 2)])?;
                round::sphere(&mut b, radius, around, across);
            }
            Self::Box { size } => {
                for s in size {
                    positive("size", s)?;
                }
                solids::cuboid(&mut b, size.map(|s| -s / 2.0), size.map(|s| s / 2.0));
            }
            Self::Plane {
                size,
                cells,
                repeat,
            } => {
                for s in size {
                    positive("size", s)?;
                }
                if !repeat.iter().all(|r| r.is_finite()) {
                    return Err("repeat must be finite".into());
                }
                counts(&[("cells", cells[0], 1), ("cells", cells[1], 1)])?;
                solids::plane(&mut b, size, cells, repeat);
            }
        }
        Ok(b.finish())
    }
}

fn positive(name: &str, value: f32) -> Result<(), String> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(format!("{name} = {value} must be greater than 0"))
    }
}

/// Each count must reach its least, and their product must stay within [`MAX_TRIANGLES`].
fn counts(given: &[(&str, u32, u32)]) -> Result<(), String> {
    let mut product = 2_u64;
    for &(name, value, least) in given {
        if value < least {
            return Err(format!("{name} = {value} must be at least {least}"));
        }
        product = product.saturating_mul(value.into());
    }
    if product > MAX_TRIANGLES {
        return Err(format!(
            "{product} triangles are more than the {MAX_TRIANGLES} allowed"
        ));
    }
    Ok(())
}

fn around() -> u32 {
    48
}

fn across() -> u32 {
    24
}

fn one_cell() -> [u32; 2] {
    [1, 1]
}

fn one_repeat() -> [f32; 2] {
    [1.0, 1.0]
}
