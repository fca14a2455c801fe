//! Shadow events as wedges (paper section 6.3).

use glam::{DAffine3, DVec3};

/// Which boundary of a shadow an event belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum EventKind {
    /// Of a point light: between light and no light.
    Hard,
    /// Between the whole light and a part of it.
    Penumbral,
    /// Between a part of the light and none of it.
    Umbral,
}

/// A shadow event: the points `light(s) + t · (blocker(s) − light(s))` for `s` in [0, 1] and `t` ≥ 1, where `light(s)`
/// and `blocker(s)` run along straight lines. They lie in one plane.
///
/// A VE event has one light vertex (`light[0] == light[1]`) and an edge of the blocker; an EV event has an edge of the
/// light and one vertex of the blocker (`blocker[0] == blocker[1]`). Affine maps keep `s` and `t`, so that a wedge may be
/// cut with a receiver in the receiver's own coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wedge {
    /// Where on the light the wedge's first and last rays start, metres.
    pub light: [DVec3; 2],
    /// Which points of the blocker they pass through.
    pub blocker: [DVec3; 2],
}

impl Wedge {
    /// The point at `s` along the event and `t` times as far from the light as the blocker.
    pub fn at(&self, s: f64, t: f64) -> DVec3 {
        let light = self.light[0].lerp(self.light[1], s);
        light + (self.blocker[0].lerp(self.blocker[1], s) - light) * t
    }

    /// The wedge in other coordinates.
    #[must_use]
    pub fn transformed(&self, by: &DAffine3) -> Self {
        Self {
            light: self.light.map(|p| by.transform_point3(p)),
            blocker: self.blocker.map(|p| by.transform_point3(p)),
        }
    }

    /// Whether a vertex of the light makes it with an edge of the blocker.
    pub fn is_vertex_edge(&self) -> bool {
        self.light[0] == self.light[1]
    }
}

/// A wedge and what it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// Where it lies.
    pub wedge: Wedge,
    /// Which boundary it belongs to.
    pub kind: EventKind,
    /// Welded vertices of the blocker that it passes through: an edge's two, or one twice.
    pub vertices: [u32; 2],
    /// Vertices of the light that it starts from: one twice, or an edge's two.
    pub corners: [u32; 2],
}
