//! Rows and columns of maps: half planes around the light, and angles in them.
//!
//! A row is a half plane that ends on the light's line, the same for all samples of a light, so that a depth
//! discontinuity of one sample is warped along a row of the other and each row is a two-dimensional scene (section 3.1 of
//! the paper). Columns are equal angles about the sample. In such a row the reciprocal distance of any plane is a sinusoid,
//! a·cos θ + b·sin θ, so that a second difference with 2·cos δ in place of 2 is zero on it, exactly.

use std::f32::consts::{PI, TAU};

use rays::Bounds;

use crate::{
    Options,
    frame::{Arc, Frame, wrapped},
    light::Linear,
};

/// Rows, shared by the samples of a linear light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    /// Radians between neighbouring columns.
    pub(crate) column_step: f32,
    /// Radians between neighbouring rows.
    pub(crate) row_step: f32,
    pub(crate) rows: usize,
    first_phi: f32,
    /// Whether the last row is a neighbour of the first.
    wraps: bool,
}

/// Columns of one sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Columns {
    pub(crate) first_theta: f32,
    pub(crate) count: usize,
}

/// Two rows around a point, and how much the second weighs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Between {
    pub(crate) rows: [usize; 2],
    pub(crate) second: f32,
}

impl Grid {
    /// Rows and columns that see all of `boxes`; coarser than asked for if a sample would have more texels than allowed.
    pub(crate) fn new(frame: &Frame, light: &Linear, boxes: &[Bounds], options: &Options) -> Self {
        let arc = frame.lit_arc(light, boxes);
        let [low, high] = widest(frame, boxes);
        let wanted = options.texel_angle.clamp(1e-4, 0.5);
        let texels = arc.span / wanted * ((high - low) / wanted);
        let step = wanted * (texels / options.max_texels.max(16) as f32).max(1.).sqrt();
        let mut grid = Self {
            column_step: step,
            row_step: step,
            rows: (arc.span / step).ceil() as usize,
            first_phi: arc.first,
            wraps: arc.is_full(),
        };
        if grid.wraps {
            grid.row_step = TAU / grid.rows as f32;
        } else if grid.rows > 0 {
            grid.row_step = arc.span / grid.rows as f32;
        }
        grid
    }

    /// Columns for the sample at `x`, with room around `boxes` so that their outline has both sides in the map.
    pub(crate) fn columns(&self, frame: &Frame, boxes: &[Bounds], x: f32) -> Columns {
        if boxes.is_empty() {
            return Columns {
                first_theta: 0.,
                count: 0,
            };
        }
        let [low, high] = frame.angles_of(boxes, x);
        let low = (low - 2. * self.column_step).max(0.);
        let high = (high + 2. * self.column_step).min(PI);
        Columns {
            first_theta: low,
            count: ((high - low) / self.column_step).ceil().max(1.) as usize,
        }
    }

    /// Whether half planes of `arc` are all among the rows, or are dark.
    pub(crate) fn reaches(&self, arc: Arc) -> bool {
        let own = Arc {
            first: self.first_phi,
            span: self.rows as f32 * self.row_step,
        };
        self.wraps || own.holds(arc)
    }

    /// Angle of a row's middle.
    pub(crate) fn phi(&self, row: usize) -> f32 {
        self.first_phi + (row as f32 + 0.5) * self.row_step
    }

    /// The rows around the half plane at `phi`, if any is near.
    pub(crate) fn around(&self, phi: f32) -> Option<Between> {
        if self.rows == 0 {
            return None;
        }
        let middle = 0.5 * self.rows as f32;
        let off = wrapped(phi - self.first_phi - middle * self.row_step) / self.row_step;
        let at = off + middle - 0.5;
        let lower = at.floor();
        if self.wraps {
            let row = |r: f32| (r as i64).rem_euclid(self.rows as i64) as usize;
            return Some(Between {
                rows: [row(lower), row(lower + 1.)],
                second: at - lower,
            });
        }
        // A row beyond the ends is the shadow's that is all there is.
        let last = self.rows as f32 - 1.;
        (-1.5..=last + 1.5).contains(&at).then(|| Between {
            rows: [lower, lower + 1.].map(|r| r.clamp(0., last) as usize),
            second: at - lower,
        })
    }

    /// A row, the one before and the next two; at the ends of the map the last that there is.
    pub(crate) fn four_around(&self, row: usize) -> [usize; 4] {
        [-1, 0, 1, 2].map(|off| {
            let row = row as i64 + off;
            if self.wraps {
                row.rem_euclid(self.rows as i64) as usize
            } else {
                row.clamp(0, self.rows as i64 - 1) as usize
            }
        })
    }

    /// Which rows meet `arc`.
    pub(crate) fn rows_of(&self, arc: Arc) -> Vec<bool> {
        let reach = 0.5 * arc.span + 1.5 * self.row_step;
        let middle = arc.first + 0.5 * arc.span;
        (0..self.rows)
            .map(|row| arc.is_full() || wrapped(self.phi(row) - middle).abs() <= reach)
            .collect()
    }
}

impl Columns {
    /// Whether the angles from `low` to `high` are all among the columns.
    pub(crate) fn reach(&self, [low, high]: [f32; 2], step: f32) -> bool {
        low >= self.first_theta && high <= self.first_theta + self.count as f32 * step
    }

    /// Where `theta` is, in columns: a column's middle is a whole number.
    #[inline]
    pub(crate) fn at(&self, theta: f32, step: f32) -> f32 {
        (theta - self.first_theta) / step - 0.5
    }

    pub(crate) fn theta(&self, column: usize, step: f32) -> f32 {
        self.first_theta + (column as f32 + 0.5) * step
    }
}

/// Angles that any sample of the light may need.
fn widest(frame: &Frame, boxes: &[Bounds]) -> [f32; 2] {
    let from = frame.angles_of(boxes, -frame.half_length);
    let to = frame.angles_of(boxes, frame.half_length);
    [from[0].min(to[0]), from[1].max(to[1])]
}
