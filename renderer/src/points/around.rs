//! What is certain of a point by the depth of what is known around it.

/// A point further behind than this, as a share of one over its depth, is hidden. Not nearer to 1: a surface may fall away
/// steeply, as the ground does near the horizon.
pub(super) const HIDDEN: f32 = 0.6;

/// How far behind the nearest of its neighbours a point on their surface may lie, widths of a pixel there: a slope of two
/// over two pixels.
pub(super) const AGREES_PX: f32 = 4.0;

/// How far before the nearest of its neighbours: what hides it would have to be nearer still, and no edge lies between.
pub(super) const BEFORE_PX: f32 = 16.0;

/// How far apart the neighbours may lie that a point on their surface lies between: a slope of eight over four pixels. Where
/// they lie farther apart they are of two surfaces.
pub(super) const WITHIN_PX: f32 = 32.0;

/// How far behind all its neighbours, beyond what they differ by themselves, a point must lie to be hidden, widths of a pixel
/// there.
pub(super) const BEHIND_PX: f32 = 8.0;

/// The same where one neighbour alone is known: the slope of the surface is not.
pub(super) const BEHIND_ONE_PX: f32 = 40.0;

/// What is known about the depth around a point, one over metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Around {
    /// Of the nearest surface point; 0 where nothing is known.
    pub(super) most: f32,
    /// Of the farthest.
    pub(super) least: f32,
}

/// What neighbours say of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It lies among them.
    Visible,
    /// It lies behind them.
    Hidden,
    /// Neither is certain.
    Unknown,
}

impl Around {
    pub(super) const NOTHING: Self = Self {
        most: 0.0,
        least: f32::INFINITY,
    };

    /// Says what is certain of an unsure point by one over its depth; `px` is one over the focal length, pixels.
    pub(super) fn judge(self, inverse: f32, px: f32) -> Verdict {
        let Self { most, least } = self;
        if most == 0.0 {
            return Verdict::Unknown;
        }
        let spread = most - least;
        let room = if spread > 0.0 {
            BEHIND_PX
        } else {
            BEHIND_ONE_PX
        } * px;
        let near =
            inverse >= (1.0 - AGREES_PX * px) * most && inverse <= (1.0 + BEFORE_PX * px) * most;
        let within = inverse >= least && inverse <= most && spread <= WITHIN_PX * px * most;
        if inverse < HIDDEN * most || inverse < least - spread - room * least {
            Verdict::Hidden
        } else if near || within {
            Verdict::Visible
        } else {
            Verdict::Unknown
        }
    }
}
