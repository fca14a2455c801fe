//! Half planes around a light: what a linear light sees in one of them depends on nothing outside it.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Vec2, Vec3};
use rays::Bounds;

use crate::light::Linear;

/// Coordinates about a linear light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    /// The middle of the light, world space.
    pub(crate) middle: Vec3,
    /// Unit, along the light.
    pub(crate) axis: Vec3,
    /// Unit, the half plane at angle 0.
    pub(crate) zero: Vec3,
    /// Unit, the half plane at a quarter turn.
    pub(crate) quarter: Vec3,
    /// Half the light's length, metres.
    pub(crate) half_length: f32,
}

/// A point about a light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// Angle of its half plane, radians in (−π, π].
    pub(crate) phi: f32,
    /// Where it is in its half plane: along the light from its middle, and away from the light's line; metres.
    pub(crate) flat: Vec2,
}

/// Angles of half planes, from `first` over `span` anticlockwise; radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Arc {
    pub(crate) first: f32,
    pub(crate) span: f32,
}

impl Arc {
    pub(crate) const FULL: Self = Self {
        first: -PI,
        span: TAU,
    };

    pub(crate) fn is_full(&self) -> bool {
        self.span >= TAU
    }

    /// What two arcs share, if together they are shorter than a turn; else the second.
    fn intersection(self, other: Self) -> Self {
        if self.span + other.span >= TAU {
            return other;
        }
        let middle = self.first + 0.5 * self.span;
        let shift = wrapped(other.first + 0.5 * other.span - middle);
        let start = (middle + shift - 0.5 * other.span).max(self.first);
        let end = (middle + shift + 0.5 * other.span).min(self.first + self.span);
        Self {
            first: start,
            span: (end - start).max(0.),
        }
    }

    /// The shortest arc with all of `arcs` in it; one without span if there are none.
    fn around(mut arcs: Vec<Self>) -> Self {
        for arc in &mut arcs {
            arc.first = wrapped(arc.first);
        }
        arcs.sort_unstable_by(|a, b| a.first.total_cmp(&b.first));
        // How far those that pass the end of the turn reach into the next.
        let ends = arcs.iter().map(|arc| arc.first + arc.span - TAU);
        let mut end = ends.fold(f32::NEG_INFINITY, f32::max);
        let (mut first, mut gap) = (0., f32::NEG_INFINITY);
        for arc in &arcs {
            if arc.first - end > gap {
                (first, gap) = (arc.first, arc.first - end);
            }
            end = end.max(arc.first + arc.span);
        }
        if arcs.is_empty() {
            return Self {
                first: 0.,
                span: 0.,
            };
        }
        if gap <= 0. {
            return Self::FULL;
        }
        Self {
            first,
            span: TAU - gap,
        }
    }

    /// Whether all of `other` is in this one.
    pub(crate) fn holds(self, other: Self) -> bool {
        let off = wrapped(other.first + 0.5 * other.span - self.first - 0.5 * self.span).abs();
        self.is_full() || off + 0.5 * other.span <= 0.5 * self.span
    }
}

/// An angle in [−π, π).
pub(crate) fn wrapped(angle: f32) -> f32 {
    angle - TAU * ((angle + PI) / TAU).floor()
}

impl Frame {
    pub(crate) fn new(light: &Linear) -> Self {
        let [from, to] = light.ends;
        // A light without length may be taken to run along any line.
        let axis = (to - from).try_normalize().unwrap_or(Vec3::X);
        let zero = light.facing.map_or_else(
            || axis.any_orthonormal_vector(),
            |n| n.reject_from_normalized(axis).normalize_or(Vec3::Y),
        );
        Self {
            middle: 0.5 * (from + to),
            axis,
            zero,
            quarter: axis.cross(zero),
            half_length: 0.5 * from.distance(to),
        }
    }

    /// The unit vector away from the light's line in the half plane at `phi`.
    pub(crate) fn radial(&self, phi: f32) -> Vec3 {
        let (sin, cos) = phi.sin_cos();
        self.zero * cos + self.quarter * sin
    }

    /// The point of the light's line at `x` from its middle.
    pub(crate) fn on_line(&self, x: f32) -> Vec3 {
        self.middle + self.axis * x
    }

    pub(crate) fn place(&self, point: Vec3) -> Place {
        let from_middle = point - self.middle;
        let (u, v) = (from_middle.dot(self.zero), from_middle.dot(self.quarter));
        Place {
            phi: v.atan2(u),
            flat: Vec2::new(from_middle.dot(self.axis), u.hypot(v)),
        }
    }

    /// Half planes that meet a box.
    pub(crate) fn arc_of(&self, bounds: &Bounds) -> Arc {
        let toward =
            (0.5 * (bounds.min + bounds.max) - self.middle).reject_from_normalized(self.axis);
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        let centre = toward.dot(self.quarter).atan2(toward.dot(self.zero));
        for corner in corners(bounds) {
            let off = wrapped(self.place(corner).phi - centre);
            (low, high) = (low.min(off), high.max(off));
        }
        // All corners in one half of the plane across the light: the line passes the box by.
        if toward != Vec3::ZERO && high - low < PI {
            Arc {
                first: centre + low,
                span: high - low,
            }
        } else {
            Arc::FULL
        }
    }

    /// Half planes in which `light` shines on something in one of `boxes`.
    pub(crate) fn lit_arc(&self, light: &Linear, boxes: &[Bounds]) -> Arc {
        let arc = Arc::around(boxes.iter().map(|b| self.arc_of(b)).collect());
        if light.facing.is_none() {
            return arc;
        }
        arc.intersection(Arc {
            first: -FRAC_PI_2,
            span: PI,
        })
    }

    /// Angles from the light's line, as seen from `x` on it, between which all of `boxes` lie; radians in [0, π].
    pub(crate) fn angles_of(&self, boxes: &[Bounds], x: f32) -> [f32; 2] {
        let angles = boxes.iter().map(|b| self.angles_of_box(b, x));
        angles
            .reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
            .unwrap_or_default()
    }

    fn angles_of_box(&self, bounds: &Bounds, x: f32) -> [f32; 2] {
        let toward = (0.5 * (bounds.min + bounds.max) - self.middle)
            .reject_from_normalized(self.axis)
            .normalize_or_zero();
        let (mut near, mut far) = (f32::INFINITY, 0f32);
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        for corner in corners(bounds) {
            let flat = self.place(corner).flat;
            near = near.min((corner - self.middle).dot(toward));
            far = far.max(flat.y);
            (low, high) = (low.min(flat.x - x), high.max(flat.x - x));
        }
        let near = near.max(0.);
        let least = if high > 0. { near } else { far };
        let most = if low < 0. { near } else { far };
        [least.atan2(high), most.atan2(low)]
    }
}

/// The corners of a box.
pub(crate) fn corners(bounds: &Bounds) -> [Vec3; 8] {
    std::array::from_fn(|i| {
        let pick = |axis: usize| {
            if i >> axis & 1 == 0 {
                bounds.min[axis]
            } else {
                bounds.max[axis]
            }
        };
        Vec3::new(pick(0), pick(1), pick(2))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn box_at(min: [f32; 3], max: [f32; 3]) -> Bounds {
        Bounds {
            min: min.into(),
            max: max.into(),
        }
    }

    #[test]
    fn arcs_hold_every_point_of_a_box() {
        let light = Linear {
            ends: [Vec3::new(-1., 3., 0.2), Vec3::new(1., 3.5, 0.)],
            facing: None,
            ignored: None,
        };
        let frame = Frame::new(&light);
        for bounds in [
            box_at([-4., 0., -4.], [4., 0., 4.]),
            box_at([1., 2., 1.], [2., 5., 3.]),
            box_at([-1., 2., -1.], [1., 4., 1.]),
        ] {
            let arc = frame.arc_of(&bounds);
            let [low, high] = frame.angles_of(&[bounds], 0.5);
            for i in 0..11 * 11 * 11 {
                let t = Vec3::new((i % 11) as f32, (i / 11 % 11) as f32, (i / 121) as f32) / 10.;
                let p = frame.place(bounds.min + t * (bounds.max - bounds.min));
                let off = wrapped(p.phi - arc.first - 0.5 * arc.span).abs();
                assert!(arc.is_full() || off <= 0.5 * arc.span + 1e-4);
                let theta = p.flat.y.atan2(p.flat.x - 0.5);
                assert!((low - 1e-4..=high + 1e-4).contains(&theta));
            }
        }
        let passed = frame.arc_of(&box_at([-1., 2., -1.], [1., 4., 1.]));
        assert!(passed.is_full());
    }

    #[test]
    fn the_shortest_arc_around_arcs_has_them_all() {
        let arc = |first: f32, span: f32| Arc { first, span };
        let close = |a: Arc, first: f32, span: f32| {
            wrapped(a.first - first).abs() < 1e-5 && (a.span - span).abs() < 1e-5
        };
        assert!(close(Arc::around(vec![arc(1., 0.5)]), 1., 0.5));
        assert!(close(
            Arc::around(vec![arc(1., 0.5), arc(1.2, 0.1), arc(2., 0.5)]),
            1.,
            1.5
        ));
        assert!(close(
            Arc::around(vec![arc(3., 0.5), arc(-2.5, 0.5)]),
            3.,
            TAU - 5.
        ));
        assert!(Arc::around(vec![arc(-3., 3.), arc(-0.5, 3.), arc(2., 2.)]).is_full());
        assert!(Arc::around(vec![arc(0., 1.), Arc::FULL]).is_full());
        assert!(arc(3., 1.).holds(arc(-3., 0.5)) && !arc(3., 1.).holds(arc(-3., 1.5)));
    }
}
