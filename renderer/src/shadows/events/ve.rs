//! VE events: a vertex of the light and an edge of the blocker.

use glam::DVec3;

use super::pair::Pair;
use crate::shadows::wedge::{Event, EventKind, Wedge};

/// Appends the events of one edge of the blocker with all vertices of the light.
pub(super) fn find(pair: &Pair<'_>, edge: u32, out: &mut Vec<Event>) {
    let ends = pair.adjacency.edges[edge as usize];
    let Some(blocker) = in_front(pair, ends.map(|v| pair.at(v))) else {
        return;
    };
    for (k, vertex) in pair.light.vertices().iter().enumerate() {
        let Some(kind) = kind(pair, edge, k) else {
            continue;
        };
        if (blocker[0] - *vertex).cross(blocker[1] - *vertex) == DVec3::ZERO {
            continue;
        }
        out.push(Event {
            wedge: Wedge {
                light: [*vertex; 2],
                blocker,
            },
            kind,
            vertices: ends,
            corners: [pair.light.corner(k); 2],
        });
    }
}

/// What event, if any, a vertex of the light makes with an edge.
fn kind(pair: &Pair<'_>, edge: u32, vertex: usize) -> Option<EventKind> {
    let vertices = pair.light.vertices();
    let blocker = pair.outline(edge, vertices[vertex])?;
    if vertices.len() == 1 {
        return Some(EventKind::Hard);
    }
    let [a, b] = pair.adjacency.edges[edge as usize];
    let before = (vertex + vertices.len() - 1) % vertices.len();
    // The light's edge before this vertex ends here: seen from here, its other end is on the other side.
    let light = pair.passing(vertex, a, b);
    if light != pair.passing(before, a, b).other() {
        return None;
    }
    Some(if light == blocker {
        EventKind::Umbral
    } else {
        EventKind::Penumbral
    })
}

/// The part of a segment that the light's front faces.
fn in_front(pair: &Pair<'_>, ends: [DVec3; 2]) -> Option<[DVec3; 2]> {
    let [a, b] = ends.map(|p| pair.light.height(p));
    let cut = || ends[0].lerp(ends[1], a / (a - b));
    match (a > 0.0, b > 0.0) {
        (true, true) => Some(ends),
        (true, false) => Some([ends[0], cut()]),
        (false, true) => Some([cut(), ends[1]]),
        (false, false) => None,
    }
}
