//! What a point sees of the light between two neighbouring samples.

use glam::Vec2;
use rayon::prelude::*;

use crate::{
    Transition,
    discontinuity::Edge,
    sample::{NOTHING, Sample, Sight},
    skins::{Drawing, LIT, Mark, Side, UNEXPLAINED, beyond, exit, skin},
};

/// Two neighbours on the light, by index, and their channels by rows.
#[derive(Clone, Debug)]
pub(crate) struct Pair {
    pub(crate) samples: [usize; 2],
    /// Of the first sample's map, then of the second's.
    pub(crate) channels: Vec<[Vec<Mark>; 2]>,
    /// What was found when the channels were drawn, by rows.
    pub(crate) tallies: Vec<Tally>,
}

/// What a row of a pair came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Tally {
    /// Texels with a skin, and those that places tried in penumbrae stand for.
    pub(crate) penumbral: u32,
    /// Of those, where too few samples see what there is.
    pub(crate) undersampled: u32,
    /// Texels that the other sample does not see although no skin covers them.
    pub(crate) unexplained: u32,
}

/// What is seen of the light between two samples, as shares of its length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Parts {
    /// From the first sample on.
    pub(crate) first: f32,
    /// Up to the second sample.
    pub(crate) second: f32,
    /// Whether something between the samples may be missed.
    pub(crate) undersampled: bool,
}

impl Parts {
    pub(crate) const ALL: Self = Self {
        first: 1.,
        second: 0.,
        undersampled: false,
    };
    const NONE: Self = Self {
        first: 0.,
        second: 0.,
        undersampled: false,
    };
}

/// Parts of the light shorter than this, as share of what is between two samples, are not worth another sample.
const WORTH: f32 = 0.05;

/// Outlines looked at when a gap between blockers is sought.
const OUTLINES: usize = 8;

/// A pair at work: its samples, its channels in one row, and how transitions are made.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PairRow<'a> {
    pub(crate) samples: [&'a Sample; 2],
    pub(crate) channels: &'a [Vec<Mark>; 2],
    pub(crate) row: usize,
    pub(crate) step: f32,
    pub(crate) bias: f32,
    pub(crate) transition: Transition,
}

impl PairRow<'_> {
    /// What `point` sees, which the two samples see as `sights`.
    pub(crate) fn parts(&self, point: Vec2, sights: [&Sight; 2]) -> Parts {
        match [sights[0].seen, sights[1].seen] {
            [true, true] => self.both(point, sights),
            [true, false] => self.one(Side::First, point, sights),
            [false, true] => self.one(Side::Second, point, sights),
            [false, false] => Parts {
                undersampled: self.gap(point, sights),
                ..Parts::NONE
            },
        }
    }

    /// Both ends are seen: all is, but for what a blocker between the ends covers, whose outlines both channels then have.
    fn both(&self, point: Vec2, sights: [&Sight; 2]) -> Parts {
        let nearest = |side: usize| skin(self.channels[side][sights[side].columns[0]]);
        let (Some(first), Some(second)) = (nearest(0), nearest(1)) else {
            return Parts::ALL;
        };
        let from_first = self.exit(Side::First, first, point);
        let from_second = self.exit(Side::Second, second, point);
        if from_first + from_second >= 1. {
            return Parts::ALL;
        }
        // One blocker ends where the other outline is; if it ends sooner, there may be light between two.
        let end = self.blocker_end(Side::First, first, point);
        Parts {
            first: from_first,
            second: from_second,
            undersampled: end < 1. - from_second - WORTH,
        }
    }

    /// The sample on `side` is seen, the other one is hidden.
    fn one(&self, side: Side, point: Vec2, sights: [&Sight; 2]) -> Parts {
        let columns = sights[side as usize].columns;
        let marks = columns.map(|c| self.channels[side as usize].get(c).copied().unwrap_or(LIT));
        let (seen, undersampled) = match marks.into_iter().find_map(skin) {
            // What hides the other sample is the receiver's own surface, which hides nothing of the light above it.
            _ if !sights[1 - side as usize].faces => (self.exit_own(side, point, 1.), false),
            Some(index) => (
                self.exit(side, index, point),
                self.blocker_end(side, index, point) < 1. - WORTH,
            ),
            // At the outer border of a penumbra the texel still sees all.
            None if marks[0] == LIT => (1., false),
            None => (0.5, true),
        };
        match side {
            Side::First => Parts {
                first: seen,
                second: 0.,
                undersampled,
            },
            Side::Second => Parts {
                first: 0.,
                second: seen,
                undersampled,
            },
        }
    }

    /// How much of the light, from the sample on `side` on, `point` sees before what hides the other sample from it, of
    /// which edge `index` of that one is the outline.
    fn exit(&self, side: Side, index: usize, point: Vec2) -> f32 {
        let (own, other) = self.own_and_other(side);
        let edge = &other.rows[self.row].edges[index];
        let skin = exit(edge, point, [own.x, other.x], self.transition);
        self.exit_own(side, point, skin)
    }

    /// The least of `exit` and where the sample's own outlines end what is seen.
    ///
    /// A thick blocker has another outline as seen from the point than from the other sample. It is one that the sample on
    /// `side` sees, since nothing is between that sample and the point. The paper's linear transition leaves it out.
    fn exit_own(&self, side: Side, point: Vec2, exit: f32) -> f32 {
        if self.transition == Transition::Linear {
            return exit;
        }
        let (own, other) = self.own_and_other(side);
        let edges = &own.rows[self.row].edges;
        let from_own = own.relative(point);
        let theta = from_own.y.atan2(from_own.x);
        let passed = edges.partition_point(|edge| edge.theta < theta);
        let (low, high) = edges.split_at(passed);
        let least = |edges: &mut dyn Iterator<Item = &Edge>| {
            let nearer = edges.filter(|e| !side.shows(e) && e.near.y < point.y);
            nearer.take(OUTLINES).fold(exit, |least, edge| {
                let share = (beyond(edge.near, point) - own.x) / (other.x - own.x);
                if share < least { share.max(0.) } else { least }
            })
        };
        match side {
            Side::First => least(&mut low.iter().rev()),
            Side::Second => least(&mut high.iter()),
        }
    }

    /// Where the blocker with edge `index` of the other sample ends on its far side, as seen from `point`: how far from
    /// the sample on `side` on the way to the other, at least 0; infinite if it does not end.
    fn blocker_end(&self, side: Side, index: usize, point: Vec2) -> f32 {
        let (own, other) = self.own_and_other(side);
        let edges = &other.rows[self.row].edges;
        let ends = |i: &usize| edges[*i].near_low != edges[index].near_low;
        let end = match side {
            Side::First => (0..index).rev().find(ends),
            Side::Second => (index + 1..edges.len()).find(ends),
        };
        let Some(end) = end else {
            return f32::INFINITY;
        };
        let share = (beyond(edges[end].near, point) - own.x) / (other.x - own.x);
        if edges[end].near.y >= point.y || share.is_nan() {
            f32::INFINITY
        } else {
            share.max(0.)
        }
    }

    fn own_and_other(&self, side: Side) -> (&Sample, &Sample) {
        let [first, second] = self.samples;
        match side {
            Side::First => (first, second),
            Side::Second => (second, first),
        }
    }

    /// Both ends are hidden: whether what hides the first ends, as seen from `point`, before what hides the second begins.
    fn gap(&self, point: Vec2, sights: [&Sight; 2]) -> bool {
        let first = self.hidden_from(Side::First, point, sights[0]);
        let second = self.hidden_from(Side::Second, point, sights[1]);
        first + second < 1. - WORTH
    }

    /// How much of the light, from the sample on `side` on, is hidden by what hides that sample from `point`.
    fn hidden_from(&self, side: Side, point: Vec2, sight: &Sight) -> f32 {
        let (own, other) = self.own_and_other(side);
        let edges = &own.rows[self.row].edges;
        let share = |p: Vec2| (beyond(p, point) - own.x) / (other.x - own.x);
        let passed = edges.partition_point(|edge| edge.theta < sight.theta);
        let mut hidden = 1.;
        for step in 0..OUTLINES {
            let index = match side {
                Side::First => passed.checked_sub(step + 1),
                Side::Second => Some(passed + step),
            };
            let Some(edge) = index.and_then(|i| edges.get(i)) else {
                break;
            };
            if !side.shows(edge) {
                continue;
            }
            hidden = share(edge.near);
            // What is behind the outline may be in front of the point, and go on hiding.
            let goes_on = edge.far.y < point.y && share(edge.far) <= hidden + WORTH;
            if !goes_on {
                break;
            }
            hidden = 1.;
        }
        if hidden.is_nan() {
            1.
        } else {
            hidden.clamp(0., 1.)
        }
    }

    /// How a sample sees a point of this row.
    fn sight(&self, side: usize, point: Vec2) -> Sight {
        let p = self.samples[side].relative(point);
        let theta = p.y.atan2(p.x);
        self.samples[side].sight(self.row, theta, 1. / p.length(), self.step, self.bias)
    }

    fn undersampled(&self, point: Vec2) -> bool {
        let sights = [self.sight(0, point), self.sight(1, point)];
        self.parts(point, [&sights[0], &sights[1]]).undersampled
    }

    /// The channels as the paper has them: how much of the light between the samples a texel's surface sees, 0.5 where both
    /// channels are to add up to all of it.
    pub(crate) fn values(&self) -> [Vec<f32>; 2] {
        let of = |side: Side| {
            let (own, _) = self.own_and_other(side);
            let marks = self.channels[side as usize].iter().enumerate();
            let value = |(column, mark): (usize, &Mark)| match skin(*mark) {
                Some(index) => self.exit(side, index, own.point(self.row, column, self.step)),
                None => 0.5,
            };
            marks.map(value).collect()
        };
        [of(Side::First), of(Side::Second)]
    }

    /// Counts what the row's channels hold, and where they fail.
    fn tally(&self) -> Tally {
        let mut tally = Tally::default();
        for (side, channel) in self.channels.iter().enumerate() {
            let sample = self.samples[side];
            for (column, &mark) in channel.iter().enumerate() {
                let nothing = sample.rows[self.row].instance[column] == NOTHING;
                if mark == LIT || nothing {
                    continue;
                }
                tally.unexplained += u32::from(mark == UNEXPLAINED);
                self.count(sample.point(self.row, column, self.step), 1, &mut tally);
            }
        }
        for side in [Side::First, Side::Second] {
            self.tally_hidden(side, &mut tally);
        }
        tally
    }

    /// Counts a place that stands for `texels` texels.
    fn count(&self, point: Vec2, texels: u32, tally: &mut Tally) {
        tally.penumbral += texels;
        if self.undersampled(point) {
            tally.undersampled += texels;
        }
    }

    /// Tries places that neither sample may see: where the penumbra behind an outline of the sample on `side` would be on
    /// the surface that is first seen past it.
    fn tally_hidden(&self, side: Side, tally: &mut Tally) {
        let (own, other) = self.own_and_other(side);
        let row = &own.rows[self.row];
        for edge in row.edges.iter().filter(|edge| side.shows(edge)) {
            // The first two texels past the outline give the surface's plane.
            let low = edge.column as usize;
            let (first, second) = if edge.near_low {
                (low + 1, low + 2)
            } else {
                (low, low.wrapping_sub(1))
            };
            if second >= row.inverse.len() || row.instance[first] == NOTHING {
                continue;
            }
            let here = own.point(self.row, first, self.step);
            let along = here - own.point(self.row, second, self.step);
            let seen_at = |p: Vec2| {
                let p = other.relative(p);
                p.y.atan2(p.x)
            };
            let width = (seen_at(edge.near) - seen_at(edge.far)).abs() / self.step;
            let texels = (width / 3.).max(1.) as u32;
            for share in [0.25, 0.5, 0.75] {
                let from = Vec2::new(own.x + (other.x - own.x) * share, 0.);
                let ray = edge.near - from;
                let across = ray.perp_dot(along);
                let reach = (here - from).perp_dot(along) / across;
                let point = from + ray * reach;
                if reach > 1. && reach < 100. && point.is_finite() {
                    self.count(point, texels, tally);
                }
            }
        }
    }
}

/// What pairs share.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drawer {
    pub(crate) step: f32,
    pub(crate) bias: f32,
    pub(crate) transition: Transition,
}

impl Drawer {
    /// Draws the channels of a pair in the rows for which `due` is set.
    pub(crate) fn draw(&self, pair: &mut Pair, samples: &[Sample], due: &[bool]) {
        let Self { step, bias, .. } = *self;
        let [first, second] = pair.samples.map(|i| &samples[i]);
        let drawing = |target, source, source_side| Drawing {
            target,
            source,
            source_side,
            step,
            bias,
        };
        let into_first = drawing(first, second, Side::Second);
        let into_second = drawing(second, first, Side::First);
        let rows = pair.channels.par_iter_mut().zip(&mut pair.tallies);
        rows.enumerate()
            .filter(|(row, _)| due[*row])
            .for_each(|(row, (channels, tally))| {
                *channels = [into_first.row(row), into_second.row(row)];
                *tally = self.at([first, second], channels, row).tally();
            });
    }

    /// A pair in one of its rows.
    pub(crate) fn at<'a>(
        &self,
        samples: [&'a Sample; 2],
        channels: &'a [Vec<Mark>; 2],
        row: usize,
    ) -> PairRow<'a> {
        PairRow {
            samples,
            channels,
            row,
            step: self.step,
            bias: self.bias,
            transition: self.transition,
        }
    }
}

impl Pair {
    /// A pair with nothing drawn yet.
    pub(crate) fn new(samples: [usize; 2], rows: usize) -> Self {
        Self {
            samples,
            channels: vec![[Vec::new(), Vec::new()]; rows],
            tallies: vec![Tally::default(); rows],
        }
    }

    pub(crate) fn total(&self) -> Tally {
        self.tallies
            .iter()
            .fold(Tally::default(), |all, row| Tally {
                penumbral: all.penumbral + row.penumbral,
                undersampled: all.undersampled + row.undersampled,
                unexplained: all.unexplained + row.unexplained,
            })
    }

    pub(crate) fn bytes(&self) -> usize {
        let row = |c: &[Vec<Mark>; 2]| size_of_val(&c[0][..]) + size_of_val(&c[1][..]);
        self.channels.iter().map(row).sum::<usize>()
            + size_of_val(&self.channels[..])
            + size_of_val(&self.tallies[..])
    }
}
