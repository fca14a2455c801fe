//! The generators by name, with their parameters and the limits of those.

use serde::Deserialize;

use super::Made;
use super::builder::Builder;
use super::chain::{self, ChainSpec};
use super::head::{self, HeadSpec};
use super::plants::{self, CrownSpec, PlantsSpec};
use super::tube::{self, TubeSpec};
use super::{furniture, round, solids};

/// A mesh to make. Lengths are in metres, y is up; centred on the origin unless said otherwise. All but `plane`, `plants`
/// and `crown` are closed and run anticlockwise seen from outside.
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
    /// An icosahedron whose faces are cut in four `steps` times and pushed out.
    Icosphere {
        radius: f32,
        #[serde(default = "steps")]
        steps: u32,
    },
    /// Along the y axis, flat ends.
    Cylinder {
        radius: f32,
        height: f32,
        #[serde(default = "around")]
        around: u32,
    },
    /// A cylinder along the y axis between two half spheres; `height` is without them.
    Capsule {
        radius: f32,
        height: f32,
        #[serde(default = "around")]
        around: u32,
        #[serde(default = "across")]
        across: u32,
    },
    /// A profile turned about the y axis: points of (radius, y) from the bottom up along the outside. Both ends on the
    /// axis, or joined to each other with `ring = true`.
    Lathe {
        profile: Vec<[f32; 2]>,
        #[serde(default)]
        ring: bool,
        #[serde(default = "around")]
        around: u32,
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
    /// A flat lattice in y = 0: `bars` bars along z and along x, `width` wide, `thickness` thick, in one closed piece; with
    /// `cells`, those along x lie on those along z, a hair apart, each a box of so many cells along its length.
    Bars {
        size: [f32; 2],
        bars: [u32; 2],
        width: f32,
        thickness: f32,
        #[serde(default)]
        cells: u32,
    },
    /// A slab from x = 0 to `size[0]`, y = 0 to `size[1]`, its middle in z = 0, with rectangular openings
    /// `[x from, y from, x to, y to]`.
    Wall {
        size: [f32; 3],
        #[serde(default)]
        openings: Vec<[f32; 4]>,
        /// Longest side of a cell on its faces.
        #[serde(default = "cell")]
        cell: f32,
    },
    /// Linked tori along a curve, each an object of its own.
    Chain(ChainSpec),
    /// A round body along a curve.
    Tube(TubeSpec),
    /// A head and its neck, its surface irregular as a scanner gives it; faces +z.
    Head(HeadSpec),
    /// Flowers or grass on y = 0, not closed.
    Plants(PlantsSpec),
    /// The leaves of a tree, not closed.
    Crown(CrownSpec),
    /// Stands on y = 0: a top and four legs.
    Table {
        size: [f32; 3],
        #[serde(default = "board")]
        thickness: f32,
        #[serde(default = "leg")]
        leg: f32,
    },
    /// Stands on y = 0, faces +z: seat, legs, back posts with slats.
    Chair {
        #[serde(default = "chair_size")]
        size: [f32; 3],
        #[serde(default = "seat")]
        seat: f32,
        #[serde(default = "slats")]
        slats: u32,
    },
    /// Stands on y = 0, open towards +z: sides, back and `boards` boards.
    Shelf {
        size: [f32; 3],
        boards: u32,
        #[serde(default = "board")]
        thickness: f32,
    },
    /// A row of books from x = 0 on y = 0, their backs in z = 0: those whose turn it is, `part` of `of`, so that
    /// several objects with the same seed make one row of several colours.
    Books {
        length: f32,
        height: f32,
        depth: f32,
        #[serde(default)]
        seed: u32,
        #[serde(default)]
        part: u32,
        #[serde(default = "one")]
        of: u32,
    },
}

impl Generator {
    /// Makes the mesh.
    ///
    /// # Errors
    /// What is wrong with which parameter.
    pub(crate) fn make(&self) -> Result<Made, String> {
        self.check()?;
        if let Self::Chain(spec) = self {
            return chain::chain(spec);
        }
        let grown = match self {
            Self::Plants(spec) => Some(plants::plants(spec)?),
            Self::Crown(spec) => Some(plants::crown(spec)?),
            _ => None,
        };
        if let Some(mesh) = grown {
            return Ok(mesh.into());
        }
        let mut b = Builder::default();
        match self {
            &Self::Torus {
                major,
                minor,
                around,
                across,
            } => round::torus(&mut b, major, minor, around, across),
            &Self::Sphere {
                radius,
                around,
                across,
            } => round::sphere(&mut b, radius, 0.0, around, across),
            &Self::Capsule {
                radius,
                height,
                around,
                across,
            } => round::sphere(&mut b, radius, height, around, across),
            &Self::Icosphere { radius, steps } => round::icosphere(&mut b, radius, steps),
            &Self::Cylinder {
                radius,
                height,
                around,
            } => {
                let h = height / 2.0;
                round::lathe(
                    &mut b,
                    &[[0.0, -h], [radius, -h], [radius, h], [0.0, h]],
                    false,
                    around,
                );
            }
            Self::Lathe {
                profile,
                ring,
                around,
            } => round::lathe(&mut b, profile, *ring, *around),
            &Self::Box { size } => {
                solids::cuboid(&mut b, size.map(|s| -s / 2.0), size.map(|s| s / 2.0));
            }
            &Self::Plane {
                size,
                cells,
                repeat,
            } => solids::plane(&mut b, size, cells, repeat),
            &Self::Bars {
                size,
                bars,
                width,
                thickness,
                cells: 0,
            } => solids::bars(&mut b, size, bars, width, thickness),
            &Self::Bars {
                size,
                bars,
                width,
                thickness,
                cells,
            } => solids::crossed_bars(&mut b, size, bars, [width, thickness], cells),
            Self::Wall {
                size,
                openings,
                cell,
            } => solids::wall(&mut b, *size, openings, *cell),
            Self::Tube(spec) => tube::tube(&mut b, spec)?,
            Self::Head(spec) => head::head(&mut b, spec)?,
            &Self::Table {
                size,
                thickness,
                leg,
            } => furniture::table(&mut b, size, thickness, leg),
            &Self::Chair { size, seat, slats } => furniture::chair(&mut b, size, seat, slats),
            &Self::Shelf {
                size,
                boards,
                thickness,
            } => furniture::shelf(&mut b, size, boards, thickness),
            &Self::Books {
                length,
                height,
                depth,
                seed,
                part,
                of,
            } => furniture::books(&mut b, [length, height, depth], seed, part, of),
            Self::Chain(_) | Self::Plants(_) | Self::Crown(_) => {}
        }
        let mesh = b.finish();
        if mesh.faces.is_empty() {
            return Err("these parameters leave no faces".into());
        }
        Ok(mesh.into())
    }
}

pub(super) fn around() -> u32 {
    48
}

pub(super) fn across() -> u32 {
    24
}

fn steps() -> u32 {
    3
}

fn one() -> u32 {
    1
}

fn one_cell() -> [u32; 2] {
    [1, 1]
}

fn one_repeat() -> [f32; 2] {
    [1.0, 1.0]
}

fn cell() -> f32 {
    1.0
}

fn board() -> f32 {
    0.03
}

fn leg() -> f32 {
    0.06
}

fn chair_size() -> [f32; 3] {
    [0.44, 0.92, 0.46]
}

fn seat() -> f32 {
    0.45
}

fn slats() -> u32 {
    4
}
