//! Predicates about a light and a blocker.

use glam::DVec3;

use super::rings::Rings;
use crate::edges::adjacency::{Adjacency, EyeBox, Facing};
use crate::shadows::light::ShadowLight;

/// Which events to leave out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EventOptions {
    /// The light sees closed surfaces from outside, so that light reaches none of their reflex edges: pass it if
    /// [`ShadowLight::is_outside`] says so.
    pub back_hidden: bool,
}

/// On which side of a directed line something passes, seen from the light vertex: positive orientation of (light vertex,
/// start, end, thing) is left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Left,
    Right,
}

impl Side {
    pub(super) fn other(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Right => Self::Left,
        }
    }
}

/// A light and a blocker in the blocker's coordinates.
pub(super) struct Pair<'a> {
    pub(super) adjacency: &'a Adjacency,
    pub(super) rings: &'a Rings,
    pub(super) light: &'a ShadowLight,
    options: EventOptions,
}

impl<'a> Pair<'a> {
    pub(super) fn new(
        adjacency: &'a Adjacency,
        rings: &'a Rings,
        light: &'a ShadowLight,
        options: EventOptions,
    ) -> Self {
        Self {
            adjacency,
            rings,
            light,
            options,
        }
    }

    /// Where a vertex of the blocker is.
    #[inline]
    pub(super) fn at(&self, vertex: u32) -> DVec3 {
        DVec3::from(self.adjacency.positions[vertex as usize].map(f64::from))
    }

    /// The end of an edge that is not the given one.
    #[inline]
    pub(super) fn other_end(&self, edge: u32, vertex: u32) -> u32 {
        let [a, b] = self.adjacency.edges[edge as usize];
        if a == vertex { b } else { a }
    }

    /// The side on which all faces at an edge are as seen from a point of the light, the edge running from its lesser to
    /// its greater vertex. Nothing if there are faces on both sides, or light cannot reach the edge.
    pub(super) fn outline(&self, edge: u32, from: DVec3) -> Option<Side> {
        let start = self.adjacency.edges[edge as usize][0];
        let end = self.adjacency.edges[edge as usize][1];
        let eye = EyeBox::point(from);
        let faces = self.adjacency.faces(edge as usize);
        let side = |face: u32| {
            let front = self.adjacency.facing(face, &eye) == Facing::Front;
            let ascending = self.rings.after(face, start) == end;
            if front == ascending {
                Side::Right
            } else {
                Side::Left
            }
        };
        let first = side(*faces.first()?);
        let one_sided = faces[1..].iter().all(|face| side(*face) == first);
        (one_sided && !self.is_hidden(edge, faces)).then_some(first)
    }

    /// Whether an edge is left out as reached only through the inside of a closed surface.
    fn is_hidden(&self, edge: u32, faces: &[u32]) -> bool {
        let &[first, second] = faces else {
            return false;
        };
        if !self.options.back_hidden || !self.adjacency.solid[first as usize] {
            return false;
        }
        let [a, b] = self.adjacency.edges[edge as usize];
        let apex = self.rings.corners(second).into_iter();
        apex.filter(|v| *v != a && *v != b).any(|v| {
            let n = self.adjacency.normals[first as usize];
            n.dot(self.at(v) - self.at(a)) > 0.0
        })
    }

    /// The side of the plane through light edge `edge` and blocker vertex `a` on which blocker vertex `b` is; as well the
    /// side of the plane through the light edge's start and `ab` on which its end is. Exactly opposite for `ba`.
    #[inline]
    pub(super) fn passing(&self, edge: usize, a: u32, b: u32) -> Side {
        let vertices = self.light.vertices();
        // The two directions of a linear light's edge are the same edge.
        let turned = (vertices.len() == 2 && edge == 1) != (a > b);
        let edge = if vertices.len() == 2 { 0 } else { edge };
        let [start, end] = self.light_edge(edge);
        let [p, q] = [a.min(b), a.max(b)].map(|v| self.at(v));
        let left = (end - start).cross(p - start).dot(q - p) >= 0.0;
        if left != turned {
            Side::Left
        } else {
            Side::Right
        }
    }

    /// Ends of the edge that starts at a vertex of the light.
    #[inline]
    pub(super) fn light_edge(&self, edge: usize) -> [DVec3; 2] {
        let vertices = self.light.vertices();
        [vertices[edge], vertices[(edge + 1) % vertices.len()]]
    }
}
