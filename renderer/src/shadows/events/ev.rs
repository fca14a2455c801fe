//! EV events: an edge of the light and a vertex of the blocker.

use glam::DVec3;

use super::cover::{Fan, Half, Spoke};
use super::pair::{Pair, Side};
use crate::shadows::wedge::{Event, EventKind, Wedge};

/// Events narrower than this part of the light's edge are left out.
const NARROW: f64 = 1e-9;

/// Appends the events of one vertex of the blocker with all edges of the light.
pub(super) fn find(pair: &Pair<'_>, vertex: u32, fan: &mut Fan, out: &mut Vec<Event>) {
    let at = pair.at(vertex);
    if pair.light.height(at) <= 0.0 {
        return;
    }
    fan.clear();
    for edge in 0..pair.light.vertices().len() {
        let passing = |e: &u32| pair.passing(edge, vertex, pair.other_end(*e, vertex));
        let edges = pair.rings.edges_at(vertex);
        let left = edges.iter().filter(|e| passing(e) == Side::Left).count();
        // The light is on the right.
        if left == edges.len() {
            penumbral(pair, vertex, edge, out);
        } else if left > 0
            || edges
                .iter()
                .any(|e| pair.adjacency.faces(*e as usize).len() != 2)
        {
            umbral(pair, vertex, edge, fan, out);
        }
    }
}

fn penumbral(pair: &Pair<'_>, vertex: u32, edge: usize, out: &mut Vec<Event>) {
    let ends = pair.light_edge(edge);
    if plane(pair, vertex, edge).is_some() && ends.iter().all(|p| has_outline(pair, vertex, *p)) {
        out.push(event(pair, vertex, edge, ends, EventKind::Penumbral));
    }
}

fn umbral(pair: &Pair<'_>, vertex: u32, edge: usize, fan: &mut Fan, out: &mut Vec<Event>) {
    let Some(normal) = plane(pair, vertex, edge) else {
        return;
    };
    fan.collect(pair, vertex);
    let [start, end] = pair.light_edge(edge);
    let (along, ray) = (end - start, pair.at(vertex) - start);
    fan.project(|neighbour| {
        let to = pair.at(neighbour) - pair.at(vertex);
        Spoke {
            half: match pair.passing(edge, vertex, neighbour) {
                Side::Right => Half::Light,
                Side::Left => Half::Far,
            },
            height: normal.dot(to).abs().max(f64::MIN_POSITIVE),
            // The part of `to` in the plane is a sum of the ray and the light's edge.
            across: to.cross(ray).dot(normal),
            shift: -to.cross(along).dot(normal),
        }
    });
    if !fan.may_cover() {
        return;
    }
    let mut open: Option<[f64; 2]> = None;
    let mut emit = |[from, to]: [f64; 2]| {
        if to - from > NARROW {
            let at = |s: f64| if s < 1.0 { start.lerp(end, s) } else { end };
            let ends = [at(from), at(to)];
            out.push(event(pair, vertex, edge, ends, EventKind::Umbral));
        }
    };
    fan.cut();
    for k in 1..fan.cuts().len() {
        let [from, to] = [fan.cuts()[k - 1], fan.cuts()[k]];
        let middle = 0.5 * (from + to);
        let holds =
            to > from && fan.covers(Half::Light, middle) && !fan.covers(Half::Far, middle) && {
                let eye = start.lerp(end, middle);
                has_outline(pair, vertex, eye.clamp(start.min(end), start.max(end)))
            };
        match &mut open {
            Some(run) if holds => run[1] = to,
            None if holds => open = Some([from, to]),
            // An interval of no width says nothing.
            Some(run) if to > from => {
                emit(*run);
                open = None;
            }
            _ => {}
        }
    }
    if let Some(run) = open {
        emit(run);
    }
}

fn event(pair: &Pair<'_>, vertex: u32, edge: usize, light: [DVec3; 2], kind: EventKind) -> Event {
    let next = (edge + 1) % pair.light.vertices().len();
    Event {
        wedge: Wedge {
            light,
            blocker: [pair.at(vertex); 2],
        },
        kind,
        vertices: [vertex; 2],
        corners: [edge, next].map(|k| pair.light.corner(k)),
    }
}

/// Normal of the plane through an edge of the light and a vertex, away from an area light that faces the vertex. Nothing
/// if they are on a line.
fn plane(pair: &Pair<'_>, vertex: u32, edge: usize) -> Option<DVec3> {
    let [start, end] = pair.light_edge(edge);
    let normal = (end - start).cross(pair.at(vertex) - start);
    (normal != DVec3::ZERO && normal.is_finite()).then_some(normal)
}

/// Whether some edge at a vertex bounds the blocker as seen from a point of the light.
fn has_outline(pair: &Pair<'_>, vertex: u32, from: DVec3) -> bool {
    let mut edges = pair.rings.edges_at(vertex).iter();
    edges.any(|e| pair.outline(*e, from).is_some())
}
