//! Finding the shadow events of a light and a blocker (paper sections 6.3, 6.4 and Appendix A).
//!
//! # What an event is
//! A line from a point of the light through a point of the blocker bounds a shadow if, seen along the line, light and blocker
//! touch there without overlapping (penumbra: beside it the whole light is seen), or if the opening beside the blocker touches
//! the light without overlapping it (umbra: beside it none is). Only what lies next to the two points is looked at;
//! whatever else the line hits is left to the clipping of shadow edges.
//!
//! - **VE**: light vertex `v`, blocker edge `e`. All faces at `e` are on one side of the plane (Eq. 1, by the predicate
//!   that a face shares with its other edges), and both neighbours of `v` on the light are on one side. Opposite sides
//!   are penumbral, the same side is umbral.
//! - **EV**: light edge, blocker vertex `w`. Penumbral if all edges at `w` are on the side of the plane where the light is
//!   not. Umbral if the faces at `w`, as seen along the line, leave no gap on the light's side, and one on the other. A gap on the
//!   light's side opens and closes while the line sweeps along the light's edge, so that an umbral EV event may take a
//!   part of it only.
//!
//! # Why there is no walk
//! Appendix A reaches the EV events by walking from a VE event to its neighbours, comparing angles. Here each vertex at
//! an edge that the tree returns is tried with each edge of the light. None is missed: at an EV event neither the faces
//! nor the gaps at `w` take up all directions round the line, so that an edge at `w` has all of its faces on one side as
//! seen from that point of the light, and the tree returns it for the box of the light. In exact arithmetic that is a consequence; in
//! floating point it is demanded of every EV event, so that the tree finds exactly what trying all vertices would.
//!
//! The side on which blocker edge `ab` passes light edge `vv'` is one determinant, computed in one order whoever asks, and zero counts as
//! positive. VE events ask it about light vertices, EV events about blocker vertices: both get the same answer, so that a
//! VE event and the EV event next to it share a ray also where rounding decides.
//!
//! # Cases that the paper leaves open
//! - A light edge and a blocker edge in one plane (parallel, or meeting when extended): the determinant is zero and
//!   counts as positive. The strip between two parallel edges is then one VE and one EV event, which do not overlap.
//! - Equal angles do not arise, since none are compared.
//! - A light vertex on the plane of a face is behind the face. A face whose plane cuts the light is in front of some
//!   vertices of the light and behind others; each is asked by itself.
//! - An area light lights only what is in front of it: blocker edges are cut at its plane, vertices on or behind it have no
//!   EV events, and neither has an edge that lies in the plane.
//! - A blocker vertex on the line through a light edge, or a blocker edge on a line through a light vertex (a light
//!   vertex on the edge itself, for one) makes no event: there is no plane.
//! - A light inside a closed blocker: what blocks is the surface, not the volume. Events are those of the surface seen from inside.
//! - Reflex edges of closed blockers are reached only through the inside. They are left out on request
//!   ([`EventOptions`]), as creases are in [`FindOptions`].
//! - A linear light has one edge and no inside: its EV events may have the blocker on either side.
//!
//! - A vertex with more than 48 edges has its umbral EV events tried at finitely many places of the light's edge, not at every
//!   place where they can begin or end.
//!
//! EEE events, for which lines touch three edges, are left out, as in the paper.

mod cover;
mod ev;
mod pair;
mod rings;
mod ve;

#[cfg(test)]
mod tests;

pub use pair::EventOptions;
pub use rings::Rings;

use crate::edges::adjacency::Adjacency;
use crate::edges::tree::{EdgeKind, EdgeTree, FindOptions, QueryCost, TreeScratch};

use super::light::ShadowLight;
use super::wedge::Event;
use cover::Fan;
use pair::Pair;

/// A mesh as something that casts shadows. All three are of the same mesh and stay as they are when it moves.
#[derive(Clone, Copy, Debug)]
pub struct Blocker<'a> {
    /// Edges and face planes.
    pub adjacency: &'a Adjacency,
    /// To find edges by; its crease angle does not matter.
    pub tree: &'a EdgeTree,
    /// What lies around vertices.
    pub rings: &'a Rings,
}

/// Reused between queries, also of different meshes.
#[derive(Clone, Debug, Default)]
pub struct EventScratch {
    tree: TreeScratch,
    candidates: Vec<(u32, EdgeKind)>,
    /// For each vertex the last query that met it.
    met: Vec<u32>,
    query: u32,
    fan: Fan,
}

impl EventScratch {
    /// Starts a query: no vertex has been met.
    fn begin(&mut self, vertices: usize) {
        self.candidates.clear();
        if self.met.len() < vertices {
            self.met.resize(vertices, self.query);
        }
        if self.query == u32::MAX {
            self.met.fill(0);
            self.query = 0;
        }
        self.query += 1;
    }
}

/// Appends all shadow events of a light and a blocker, in the blocker's coordinates, in an order that depends on mesh and
/// light alone: VE events before EV events. The light is in the blocker's coordinates too
/// ([`ShadowLight::set_transformed`]); a reflection needs no more than that.
///
/// Each event is found once. Nothing is allocated once the scratch has seen as large a query, but for what `out` needs.
pub fn find_events(
    blocker: Blocker<'_>,
    light: &ShadowLight,
    options: EventOptions,
    scratch: &mut EventScratch,
    out: &mut Vec<Event>,
) -> QueryCost {
    let Blocker {
        adjacency,
        tree,
        rings,
    } = blocker;
    scratch.begin(adjacency.positions.len());
    if light.vertices().is_empty() {
        return QueryCost::default();
    }
    let pair = Pair::new(adjacency, rings, light, options);
    // Not told to drop hidden creases: that rule is about what an eye sees.
    let cost = tree.find(
        adjacency,
        &light.bounds(),
        FindOptions::default(),
        &mut scratch.tree,
        &mut scratch.candidates,
    );
    scratch
        .candidates
        .retain(|(_, kind)| matches!(kind, EdgeKind::Silhouette | EdgeKind::Border));
    let branching = rings.branching.iter();
    scratch
        .candidates
        .extend(branching.map(|e| (*e, EdgeKind::NonManifold)));
    for (edge, _) in &scratch.candidates {
        ve::find(&pair, *edge, out);
    }
    if light.vertices().len() > 1 {
        for (edge, _) in &scratch.candidates {
            for vertex in adjacency.edges[*edge as usize] {
                let met = &mut scratch.met[vertex as usize];
                if *met != scratch.query {
                    *met = scratch.query;
                    ev::find(&pair, vertex, &mut scratch.fan, out);
                }
            }
        }
    }
    cost
}
