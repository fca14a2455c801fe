//! Visibility channels: skins of one sample's depth discontinuities, drawn into the map of its neighbour.
//!
//! A skin joins the nearer and the farther surface of a discontinuity. From the neighbour it covers what its own sample does
//! not see: along it visibility goes from 0 at the nearer to 1 at the farther end (section 3.2). A channel keeps which skin
//! covers a texel, and the value is worked out where it is asked for, so that it has no steps of a texel's size.

use glam::Vec2;

use crate::{
    Transition,
    discontinuity::Edge,
    sample::{Row, Sample},
};

/// What a channel says of a texel.
pub(crate) type Mark = u16;

/// The whole of the light between the samples, as nothing says otherwise.
pub(crate) const LIT: Mark = u16::MAX;
/// The other sample is hidden, yet no skin says how much is seen.
pub(crate) const UNEXPLAINED: Mark = u16::MAX - 1;

/// The skin that covers a texel, as index of the neighbour's edges in the row.
pub(crate) fn skin(mark: Mark) -> Option<usize> {
    (mark < UNEXPLAINED).then_some(usize::from(mark))
}

/// Which of two neighbours on the light, in the order of its line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    First,
    Second,
}

impl Side {
    /// Whether a discontinuity of this sample turns its skin to the other one: the blocker must be beyond it.
    pub(crate) fn shows(self, edge: &Edge) -> bool {
        // Angles are 0 along the line, where the second sample is.
        edge.near_low == (self == Self::Second)
    }
}

/// Two neighbours on the light, one of which draws its skins into the other's channel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drawing<'a> {
    pub(crate) target: &'a Sample,
    pub(crate) source: &'a Sample,
    /// Which of the two the source is.
    pub(crate) source_side: Side,
    pub(crate) step: f32,
    pub(crate) bias: f32,
}

impl Drawing<'_> {
    /// The channel of a row of the target.
    pub(crate) fn row(&self, row: usize) -> Vec<Mark> {
        let target = &self.target.rows[row];
        let source = &self.source.rows[row];
        let mut marks = vec![LIT; target.inverse.len()];
        // Distances to the skins drawn so far.
        let mut nearest = vec![f32::INFINITY; marks.len()];
        let drawn = source.edges.iter().enumerate().take(UNEXPLAINED.into());
        for (index, edge) in drawn.filter(|(_, edge)| self.source_side.shows(edge)) {
            self.draw(edge, index as Mark, target, &mut marks, &mut nearest);
        }
        self.explain(row, &mut marks);
        marks
    }

    /// Marks texels whose surface is behind the skin, unless a nearer skin is drawn there.
    fn draw(&self, edge: &Edge, mark: Mark, target: &Row, marks: &mut [Mark], nearest: &mut [f32]) {
        let columns = &self.target.columns;
        let [near, far] = [edge.near, edge.far].map(|p| self.target.relative(p));
        let [a, b] = [near, far].map(|p| columns.at(p.y.atan2(p.x), self.step));
        let along = far - near;
        let first = a.min(b).ceil().max(0.) as usize;
        let end = (a.max(b).floor() + 1.).clamp(0., marks.len() as f32) as usize;
        for column in first..end {
            let (sin, cos) = columns.theta(column, self.step).sin_cos();
            let direction = Vec2::new(cos, sin);
            let across = direction.perp_dot(along);
            if across == 0. {
                continue;
            }
            let share = (-direction.perp_dot(near) / across).clamp(0., 1.);
            let distance = direction.dot(near + along * share);
            let behind = distance * target.inverse[column] <= 1.;
            if behind && distance > 0. && distance < nearest[column] {
                nearest[column] = distance;
                marks[column] = mark;
            }
        }
    }

    /// Finds texels that the source does not see although no skin covers them: those beside a skin get it too.
    fn explain(&self, row: usize, marks: &mut [Mark]) {
        for (column, mark) in marks.iter_mut().enumerate() {
            if *mark == LIT && self.hidden(row, column) {
                *mark = UNEXPLAINED;
            }
        }
        let found: Vec<Mark> = marks.to_vec();
        for (column, mark) in marks.iter_mut().enumerate() {
            if *mark == UNEXPLAINED {
                let before = column.checked_sub(1).and_then(|c| found.get(c));
                let mut beside = before.into_iter().chain(found.get(column + 1));
                *mark = *beside.find(|m| skin(**m).is_some()).unwrap_or(mark);
            }
        }
    }

    /// Whether the source does not see what is in a texel of the target.
    fn hidden(&self, row: usize, column: usize) -> bool {
        let p = self
            .source
            .relative(self.target.point(row, column, self.step));
        let sight = self
            .source
            .sight(row, p.y.atan2(p.x), 1. / p.length(), self.step, self.bias);
        !sight.seen
    }
}

impl Sample {
    /// The surface point in a texel, in its half plane.
    pub(crate) fn point(&self, row: usize, column: usize, step: f32) -> Vec2 {
        let (sin, cos) = self.columns.theta(column, step).sin_cos();
        Vec2::new(self.x, 0.) + Vec2::new(cos, sin) / self.rows[row].inverse[column]
    }
}

/// Where the light between samples at `from` and `to` comes out from behind a skin's blocker, as seen from `point`: how far
/// from `from` on the way to `to`, in [0, 1].
pub(crate) fn exit(edge: &Edge, point: Vec2, [from, to]: [f32; 2], transition: Transition) -> f32 {
    let share = match transition {
        Transition::Linear => {
            // Gouraud's interpolation in the image of the sample at `from`: along a line parallel to the light, even.
            let image = |p: Vec2| (p.x - from) / p.y;
            let (near, far) = (image(edge.near), image(edge.far));
            (image(point) - near) / (far - near)
        }
        Transition::Rational => (beyond(edge.near, point) - from) / (to - from),
    };
    if share.is_nan() {
        0.
    } else {
        share.clamp(0., 1.)
    }
}

/// Where the line from `point` past `near` meets the light's line; infinitely far if it does not come nearer.
pub(crate) fn beyond(near: Vec2, point: Vec2) -> f32 {
    let fall = point.y - near.y;
    if fall > 0. {
        point.x + (near.x - point.x) * (point.y / fall)
    } else {
        f32::INFINITY.copysign(near.x - point.x)
    }
}
