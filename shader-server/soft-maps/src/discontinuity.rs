//! Depth discontinuities of a row, by a Laplacian of Gaussian of the reciprocal distance.
//!
//! The filter works on reciprocal distances, relative to the nearer one. Its second difference is that which is zero on
//! every plane (see [`crate::grid`]), so that neither a distant plane nor a steep one looks like a step; a step is then
//! required to leave the plane of the nearer texel, and the planes of its two sides not to meet between them.

use glam::Vec2;

/// Standard deviation of the Gaussian, columns: narrow enough that a thing of one column keeps two outlines.
const SIGMA: f32 = 0.5;

/// A jump from a nearer surface to a farther one between two columns.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Edge {
    /// Of the two columns the lower.
    pub(crate) column: u32,
    /// Whether the nearer surface is in the lower column.
    pub(crate) near_low: bool,
    /// Angle of the jump, radians.
    pub(crate) theta: f32,
    /// Where the nearer surface ends, in the row's half plane.
    pub(crate) near: Vec2,
    /// Where the farther surface is first seen behind it.
    pub(crate) far: Vec2,
    /// Where it is between its columns, 0 to 1.
    pub(crate) share: f32,
    /// Reciprocal distances just before it and just after it; until it is placed those of its columns.
    pub(crate) inverse: [f32; 2],
}

/// Finds the discontinuities of a row of reciprocal distances, `step` radians apart, in order of columns.
pub(crate) fn find(inverse: &[f32], step: f32, edges: &mut Vec<Edge>) {
    let count = inverse.len();
    if count < 2 {
        return;
    }
    let last = count as isize - 1;
    let at = |i: isize| inverse[i.clamp(0, last) as usize];
    let side = (-0.5 / (SIGMA * SIGMA)).exp();
    let (centre, side) = (1. / (1. + 2. * side), side / (1. + 2. * side));
    let turn = 2. * step.cos();
    let smooth = |i: isize| centre * at(i) + side * (at(i - 1) + at(i + 1));
    let curvature = |i: isize| smooth(i - 1) + smooth(i + 1) - turn * smooth(i);
    let mut here = curvature(0);
    for i in 0..last {
        let next = curvature(i + 1);
        let near_low = at(i) > at(i + 1);
        let (near, far) = if near_low { (here, next) } else { (next, here) };
        if near < 0. && far > 0. && is_step(&at, i, near_low, step) {
            edges.push(Edge {
                column: i as u32,
                near_low,
                theta: 0.,
                share: 0.5,
                near: Vec2::ZERO,
                far: Vec2::ZERO,
                inverse: [at(i), at(i + 1)],
            });
        }
        here = next;
    }
}

/// Whether the farther of columns `i` and `i + 1` is really farther than the nearer one's plane, by more than a column is
/// wide, and no crease joins the two.
pub(crate) fn is_step(at: &impl Fn(isize) -> f32, i: isize, near_low: bool, step: f32) -> bool {
    let turn = 2. * step.cos();
    let (near, far, away) = if near_low {
        (i, i + 1, 1)
    } else {
        (i + 1, i, -1)
    };
    let least = step * at(near);
    let near_plane = turn * at(near) - at(near - away);
    let far_plane = turn * at(far) - at(far + away);
    let jump = at(near) - at(far);
    // Two planes that meet between the columns cross there: the farther one's then rises past the nearer column.
    let meet = at(near) - far_plane < 0.25 * jump;
    jump > least && at(far) < near_plane - least && !meet
}

impl Edge {
    /// Finds where between its columns the edge is, the lower of which is at `theta` as seen from a sample at `x`, with
    /// `halvings` more distances from `ask`.
    pub(crate) fn place(
        &mut self,
        theta: f32,
        step: f32,
        x: f32,
        halvings: u32,
        ask: impl Fn(f32) -> f32,
    ) {
        let (mut low, mut high) = (theta, theta + step);
        let [mut below, mut above] = self.inverse;
        for _ in 0..halvings {
            let middle = 0.5 * (low + high);
            let inverse = ask(middle);
            if (inverse - below).abs() < (inverse - above).abs() {
                (low, below) = (middle, inverse);
            } else {
                (high, above) = (middle, inverse);
            }
        }
        self.inverse = [below, above];
        self.theta = 0.5 * (low + high);
        self.share = (self.theta - theta) / step;
        let (sin, cos) = self.theta.sin_cos();
        let point = |inverse: f32| Vec2::new(x + cos / inverse, sin / inverse);
        self.near = point(below.max(above));
        self.far = point(below.min(above));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reciprocal distances along a row of what `distance` says about an angle.
    fn row(count: usize, first: f32, step: f32, distance: impl Fn(f32) -> f32) -> Vec<f32> {
        (0..count)
            .map(|i| 1. / distance(first + i as f32 * step))
            .collect()
    }

    fn steps(inverse: &[f32], step: f32) -> Vec<(u32, bool)> {
        let mut edges = Vec::new();
        find(inverse, step, &mut edges);
        edges.iter().map(|e| (e.column, e.near_low)).collect()
    }

    const STEP: f32 = 0.01;

    #[test]
    fn planes_however_steep_have_none() {
        // Distance of the line at distance 1 whose normal is at angle `turn`.
        for tilt in [0., 0.5, 1., 1.3, 1.5, 1.55] {
            let turn = 1.5 - tilt;
            let plane = row(300, 0.05, STEP, |t| {
                let c = (t - turn).cos();
                if c > 1e-3 { 1. / c } else { 1e3 }
            });
            assert_eq!(steps(&plane, STEP), [], "tilted by {tilt}");
        }
    }

    #[test]
    fn steep_continuous_slopes_have_none() {
        // Two planes that meet, the second ever nearer to the rays' own direction.
        let bend = 1.9f32;
        let x0 = bend.cos() / bend.sin();
        for (slope, end) in [(0.5, 2.4), (1., 2.2), (2., 2.), (2.5, 1.945)] {
            for shift in 0..10 {
                let first = 1.4 + 0.1 * STEP * shift as f32;
                let inverse = row(((end - first) / STEP) as usize, first, STEP, |t| {
                    let (sin, cos) = t.sin_cos();
                    if t < bend {
                        1. / sin
                    } else {
                        (1. + slope * x0) / (sin + slope * cos)
                    }
                });
                let steepest = inverse.windows(2).map(|w| w[0] / w[1]).fold(1., f32::max);
                assert!(slope < 2.5 || steepest > 1.3, "{steepest}");
                assert!(steps(&inverse, STEP).is_empty(), "slope {slope}");
            }
        }
    }

    #[test]
    fn a_wire_of_one_column_has_two_and_a_gap_too() {
        let mut inverse = vec![0.1; 40];
        inverse[20] = 0.5;
        assert_eq!(steps(&inverse, STEP), [(19, false), (20, true)]);
        let mut inverse = vec![0.5; 40];
        inverse[20] = 0.1;
        assert_eq!(steps(&inverse, STEP), [(19, true), (20, false)]);
    }

    #[test]
    fn an_edge_is_placed_between_its_columns() {
        let jump = 1.2345;
        let distance = |t: f32| if t < jump { 1. } else { 5. };
        let inverse = row(100, 1., STEP, distance);
        let mut edges = Vec::new();
        find(&inverse, STEP, &mut edges);
        assert_eq!(edges.len(), 1);
        let low = 1. + edges[0].column as f32 * STEP;
        edges[0].place(low, STEP, 0., 5, |t| 1. / distance(t));
        assert!((edges[0].theta - jump).abs() < STEP / 60.);
        assert!((edges[0].near.length() - 1.).abs() < 1e-5);
        assert!((edges[0].far.length() - 5.).abs() < 1e-4);
    }
}
