//! The depth map of one sample on the light.

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use rays::{Hit, Ray, World};

use crate::{
    discontinuity::{self, Edge},
    frame::Frame,
    grid::{Columns, Grid},
    seam::{self, Seam},
};

/// The instance of texels that see nothing.
pub(crate) const NOTHING: u32 = u32::MAX;

/// What one sample sees.
#[derive(Clone, Debug)]
pub(crate) struct Sample {
    /// Metres along the light from its middle.
    pub(crate) x: f32,
    pub(crate) columns: Columns,
    pub(crate) rows: Vec<Row>,
    /// Between each row and the next, where depth jumps along the light.
    pub(crate) seams: Vec<Vec<Seam>>,
}

/// What one sample sees in one half plane, by columns.
#[derive(Clone, Debug, Default)]
pub(crate) struct Row {
    /// Reciprocal distances from the sample, 1/metres; of the far depth where there is nothing.
    pub(crate) inverse: Vec<f32>,
    /// Instances seen, or [`NOTHING`].
    pub(crate) instance: Vec<u32>,
    /// Depth discontinuities from column to column.
    pub(crate) edges: Vec<Edge>,
}

/// What tracing needs to know besides the sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tracer<'a> {
    pub(crate) world: &'a World,
    pub(crate) frame: &'a Frame,
    pub(crate) grid: &'a Grid,
    /// Instance that rays pass through.
    pub(crate) ignored: Option<u32>,
    /// Where background is, metres from any sample.
    pub(crate) far: f32,
    /// Rays to place a discontinuity between two columns.
    pub(crate) refinements: u32,
}

impl Tracer<'_> {
    /// A sample at `x` with all its rows traced.
    pub(crate) fn sample(&self, x: f32, columns: Columns) -> Sample {
        let mut sample = Sample {
            x,
            columns,
            rows: vec![Row::default(); self.grid.rows],
            seams: vec![Vec::new(); self.grid.rows],
        };
        self.trace(&mut sample, &vec![true; self.grid.rows]);
        sample
    }

    /// Traces the rows for which `due` is set afresh.
    pub(crate) fn trace(&self, sample: &mut Sample, due: &[bool]) {
        let (x, columns) = (sample.x, sample.columns);
        let rows = sample.rows.par_iter_mut().enumerate();
        rows.filter(|(row, _)| due[*row]).for_each_init(
            Default::default,
            |(rays, hits), (row, slot)| {
                self.trace_row(x, &columns, row, slot, rays, hits);
            },
        );
        let rows = &sample.rows;
        let seams = sample.seams.par_iter_mut().enumerate();
        seams.for_each(|(row, seams)| {
            let around = self.grid.four_around(row);
            if self.refinements > 0 && around.iter().any(|r| due[*r]) {
                let four = around.map(|r| &rows[r].inverse[..]);
                seams.clear();
                seam::find(four, self.grid.row_step, seams);
                for seam in seams {
                    seam.place(
                        self.grid.phi(row),
                        self.grid.row_step,
                        self.refinements,
                        |column, phi| {
                            let (sin, cos) = columns.theta(column, self.grid.column_step).sin_cos();
                            self.ask(x, self.frame.axis * cos + self.frame.radial(phi) * sin)
                        },
                    );
                }
            }
        });
    }

    /// Reciprocal distance in a direction from the sample at `x`.
    fn ask(&self, x: f32, direction: Vec3) -> f32 {
        let ray = Ray {
            origin: self.frame.on_line(x),
            direction,
        };
        self.seen(&ray, self.world.closest(&ray, self.far)).0
    }

    fn trace_row(
        &self,
        x: f32,
        columns: &Columns,
        row: usize,
        slot: &mut Row,
        rays: &mut Vec<Ray>,
        hits: &mut Vec<Option<Hit>>,
    ) {
        let step = self.grid.column_step;
        let origin = self.frame.on_line(x);
        let radial = self.frame.radial(self.grid.phi(row));
        let ray = |theta: f32| {
            let (sin, cos) = theta.sin_cos();
            Ray {
                origin,
                direction: self.frame.axis * cos + radial * sin,
            }
        };
        rays.clear();
        rays.extend((0..columns.count).map(|c| ray(columns.theta(c, step))));
        self.world.closest_each(rays, self.far, hits);
        slot.inverse.clear();
        slot.instance.clear();
        for (ray, hit) in rays.iter().zip(hits.iter()) {
            let (inverse, instance) = self.seen(ray, *hit);
            slot.inverse.push(inverse);
            slot.instance.push(instance);
        }
        let ask = |theta: f32| self.ask(x, ray(theta).direction);
        slot.edges.clear();
        discontinuity::find(&slot.inverse, step, &mut slot.edges);
        for edge in &mut slot.edges {
            let between = columns.theta(edge.column as usize, step);
            edge.place(between, step, x, self.refinements, ask);
        }
    }

    /// Reciprocal distance and instance of what a ray sees, past the light's own polygon.
    fn seen(&self, ray: &Ray, mut hit: Option<Hit>) -> (f32, u32) {
        let mut passed = 0.;
        // A ray along the polygon may graze it more than once.
        for _ in 0..4 {
            match hit {
                Some(h) if Some(h.instance) == self.ignored => {
                    passed += h.t + 1e-5 * self.far;
                    let onward = Ray {
                        origin: ray.at(passed),
                        direction: ray.direction,
                    };
                    hit = self.world.closest(&onward, self.far - passed);
                }
                Some(h) => return (1. / (passed + h.t), h.instance),
                None => break,
            }
        }
        (1. / self.far, NOTHING)
    }
}

/// A point of a row as a sample sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sight {
    pub(crate) theta: f32,
    /// Reciprocal distance, 1/metres.
    pub(crate) inverse: f32,
    /// Whether nothing is nearer in this direction.
    pub(crate) seen: bool,
    /// The two columns around it: first that with its surface, or the nearest if both have it.
    pub(crate) columns: [usize; 2],
    /// Whether the sample is in front of the surface tested.
    pub(crate) faces: bool,
}

impl Row {
    /// Reciprocal distance `share` of the way between two columns: on one surface that
    /// between theirs, at a step that of the side on which it is.
    #[inline]
    fn depth(&self, [lower, upper]: [usize; 2], share: f32) -> f32 {
        let (low, high) = (self.inverse[lower], self.inverse[upper]);
        if (high - low).abs() < 0.02 * low.max(high) {
            return low + (high - low) * share;
        }
        let Ok(edge) = self
            .edges
            .binary_search_by_key(&(lower as u32), |e| e.column)
        else {
            return low + (high - low) * share;
        };
        // The surfaces of both sides are known at the step as well as at the columns.
        let edge = &self.edges[edge];
        let [before, after] = edge.inverse;
        if share < edge.share {
            low + (before - low) * (share / edge.share)
        } else {
            let along = (share - edge.share) / (1. - edge.share).max(f32::MIN_POSITIVE);
            after + (high - after) * along
        }
    }
}

impl Sample {
    /// A point relative to the sample, in its half plane.
    pub(crate) fn relative(&self, flat: Vec2) -> Vec2 {
        flat - Vec2::new(self.x, 0.)
    }

    /// The direction of a point of a half plane from the sample, as angle to the light's line.
    pub(crate) fn theta(&self, flat: Vec2) -> f32 {
        let p = self.relative(flat);
        p.y.atan2(p.x)
    }

    /// Tests a surface in the direction `theta` against the depths of `row`; of it the reciprocal distance is `inverse`.
    /// It counts as seen if it is not farther than the depth there by more than the share `bias`.
    #[inline]
    pub(crate) fn sight(
        &self,
        row: usize,
        theta: f32,
        inverse: f32,
        step: f32,
        bias: f32,
    ) -> Sight {
        let at = self.columns.at(theta, step);
        let last = self.columns.count as f32 - 1.;
        let inside = (-1. ..=last + 1.).contains(&at);
        let at = at.clamp(0., last.max(0.));
        let lower = at as usize;
        let upper = (lower + 1).min(self.columns.count.saturating_sub(1));
        let share = at - lower as f32;
        let off = |column: usize| (self.rows[row].inverse[column] - inverse).abs();
        // Beside a step one of the two is on another surface.
        let lower_first = match off(lower).total_cmp(&off(upper)) {
            _ if (off(lower) - off(upper)).abs() < 0.02 * inverse => share < 0.5,
            order => order.is_lt(),
        };
        let columns = if lower_first {
            [lower, upper]
        } else {
            [upper, lower]
        };
        let seen = !inside || {
            let there = self.rows[row].depth([lower, upper], share);
            inverse >= there * (1. - bias)
        };
        Sight {
            theta,
            inverse,
            seen,
            columns,
            faces: true,
        }
    }

    /// What hides a point that [`sight`](Self::sight) found hidden.
    pub(crate) fn blocker(&self, row: usize, sight: &Sight) -> Option<u32> {
        let row = &self.rows[row];
        let nearest = sight
            .columns
            .into_iter()
            .find(|&c| row.inverse[c] > sight.inverse);
        let instance = row.instance[nearest?];
        (instance != NOTHING).then_some(instance)
    }

    pub(crate) fn bytes(&self) -> usize {
        let row = |r: &Row| {
            size_of::<Row>()
                + size_of_val(&r.inverse[..])
                + size_of_val(&r.instance[..])
                + size_of_val(&r.edges[..])
        };
        let seams = |s: &Vec<Seam>| size_of_val(s) + size_of_val(&s[..]);
        self.rows.iter().map(row).sum::<usize>() + self.seams.iter().map(seams).sum::<usize>()
    }
}
