//! Shadow edges: where shadow events meet receivers (paper sections 6.4 and 6.5).
//!
//! An event's plane has two coordinates `(a, b)` in which its rays are the lines `b = s · a`: for a VE event, whose rays
//! spread from a vertex of the light, `a = t`; for an EV event, whose rays cross at a vertex of the blocker, `a = t - 1`.
//! Both are affine functions of position, so that a face is cut by interpolating them along two of its edges.

use glam::{DAffine3, DVec3};

use super::clip::{Envelope, Hit};
use super::faces::{FaceTree, HalfSpace, Region};
use super::wedge::{Event, EventKind, Wedge};

/// What a shadow event may fall on.
#[derive(Clone, Copy, Debug)]
pub struct Receiver<'a> {
    /// Its faces.
    pub tree: &'a FaceTree,
    /// World to object space.
    pub to_object: DAffine3,
    /// What the caller calls it.
    pub id: u32,
    /// It casts the event itself: the event's vertices are its own.
    pub is_blocker: bool,
    /// Its shadow edges are wanted. Otherwise it only hides what lies behind it.
    pub receives: bool,
}

/// Where a shadow event meets the first surface on its way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadowEdge {
    /// One end, world space, metres.
    pub from: DVec3,
    /// The other end, world space, metres.
    pub to: DVec3,
    /// Where along the event both ends lie; ascending.
    pub s: [f64; 2],
    /// Distance of both ends from the light over that of the blocker. The penumbra is about the light's size times
    /// `t - 1` wide. At least 1, but for [`CONTACT`].
    pub t: [f64; 2],
    /// Which receiver.
    pub receiver: u32,
    /// Which face of the receiver's mesh.
    pub face: u32,
    /// Which boundary it belongs to.
    pub kind: EventKind,
}

/// A surface of another object that an event meets before the blocker, but by no more than this share of the light's
/// distance, touches the blocker and keeps the event, so that what rests on a floor keeps its contact line.
pub const CONTACT: f64 = 1e-5;
/// Surfaces nearer to the light than this share of the blocker's distance hide nothing: a light may lie in a ceiling.
pub const AT_LIGHT: f64 = 1e-4;
/// Vertices nearer to the event's plane than this share of their distance lie on it.
const ON_PLANE: f64 = 1e-12;
/// Nearness of what hides an event that begins beyond it.
const BEFORE: f64 = 1e300;
/// `a` of the apex of an EV event, where `s` has no meaning.
const APEX: f64 = 1e-12;
/// What an event meets on less of its length than this lies along its rays, and is lit from its edge, if at all.
const ALONG_RAYS: f64 = 1e-11;

/// Memory that is kept from event to event.
#[derive(Clone, Debug, Default)]
pub struct CastScratch {
    stack: Vec<u32>,
    hits: Vec<Hit>,
    envelope: Envelope,
}

/// A wedge as a sector of its plane.
#[derive(Clone, Copy, Debug)]
struct Sector {
    apex: DVec3,
    /// What a unit of `a` and of `b` are in space.
    axes: [DVec3; 2],
    normal: DVec3,
    /// Gradients of `a` and `b`.
    gradients: [DVec3; 2],
    /// `t` at the apex.
    t_apex: f64,
}

/// A part of a sector in which `a` keeps its sign.
#[derive(Clone, Copy, Debug)]
struct Part {
    sign: f64,
    /// Least and greatest `sign · a`.
    range: [f64; 2],
    /// It lies before the blocker.
    before: bool,
}

impl Sector {
    /// Nothing for a wedge without area: one whose plane is not determined, or that is neither VE nor EV.
    fn new(wedge: &Wedge) -> Option<Self> {
        let [l0, l1] = wedge.light;
        let [b0, b1] = wedge.blocker;
        let (apex, t_apex, u, v) = if l0 == l1 {
            (l0, 0.0, b0 - l0, b1 - b0)
        } else if b0 == b1 {
            (b0, 1.0, b0 - l0, l0 - l1)
        } else {
            return None;
        };
        let n = u.cross(v);
        let (size, flat) = (n.length(), ON_PLANE * u.length() * v.length());
        // Not `size <= flat`: coordinates that are not finite must fail too.
        if !(size > flat && size.is_finite()) {
            return None;
        }
        let square = n.length_squared();
        Some(Self {
            apex,
            axes: [u, v],
            normal: n / size,
            gradients: [v.cross(n) / square, n.cross(u) / square],
            t_apex,
        })
    }

    fn parts(&self) -> &'static [Part] {
        const VERTEX_EDGE: [Part; 1] = [Part {
            sign: 1.0,
            range: [AT_LIGHT, f64::INFINITY],
            before: false,
        }];
        const EDGE_VERTEX: [Part; 2] = [
            Part {
                sign: 1.0,
                range: [APEX, f64::INFINITY],
                before: false,
            },
            Part {
                sign: -1.0,
                range: [APEX, 1.0 - AT_LIGHT],
                before: true,
            },
        ];
        if self.t_apex == 0.0 {
            &VERTEX_EDGE
        } else {
            &EDGE_VERTEX
        }
    }

    fn at(&self, s: f64, nearness: f64) -> (DVec3, f64) {
        let a = 1.0 / nearness;
        let point = self.apex + self.axes[0] * a + self.axes[1] * (s * a);
        (point, self.t_apex + a)
    }

    /// Greatest nearness of what keeps the event.
    fn limit(&self, receiver: &Receiver<'_>) -> f64 {
        match (self.t_apex == 0.0, receiver.is_blocker) {
            (true, true) => 1.0 + APEX,
            (true, false) => 1.0 / (1.0 - CONTACT),
            (false, _) => 2.0 / APEX,
        }
    }

    fn region(&self, part: &Part, tree: &FaceTree) -> Region {
        let through_apex = |normal: DVec3| HalfSpace {
            normal,
            offset: normal.dot(self.apex),
        };
        let [a, b] = self.gradients.map(|g| g * part.sign);
        let far = if part.range[1].is_finite() {
            HalfSpace {
                normal: -a,
                offset: -a.dot(self.apex) - part.range[1],
            }
        } else {
            through_apex(a)
        };
        tree.region(
            through_apex(self.normal),
            [through_apex(b), through_apex(a - b), far],
        )
    }
}

/// Cuts a shadow event with all that it may fall on, and appends what the first surfaces on its way keep, by ascending
/// `s`.
///
/// - What lies between light and blocker hides the event there: nothing keeps it.
/// - The blocker's own faces take part, if it is among the receivers, but for those that touch the event in the
///   blocker's edge (VE) or vertex (EV) only. A face that shares one vertex with a VE event's edge keeps the event from
///   that vertex on.
/// - Faces in the event's plane keep nothing, nor do wedges without area.
/// - Faces of closed surfaces that are turned away from the light may be left out, unless the light lies within the
///   surface's bounds: something else of that surface lies before them.
pub fn cast_event(
    event: &Event,
    receivers: &[Receiver<'_>],
    scratch: &mut CastScratch,
    out: &mut Vec<ShadowEdge>,
) {
    let Some(world) = Sector::new(&event.wedge) else {
        return;
    };
    scratch.hits.clear();
    for (index, receiver) in receivers.iter().enumerate() {
        let wedge = event.wedge.transformed(&receiver.to_object);
        if let Some(sector) = Sector::new(&wedge) {
            let cutter = Cutter {
                tree: receiver.tree,
                sector: &sector,
                receiver: index as u32,
                vertices: receiver
                    .is_blocker
                    .then(|| event.vertices.map(|v| receiver.tree.own_vertex(v))),
            };
            cutter.cut(&wedge, &mut scratch.stack, &mut scratch.hits);
        }
    }
    scratch.envelope.nearest(&mut scratch.hits, |hit, s| {
        let receiver = &receivers[hit.receiver as usize];
        if !receiver.receives {
            return;
        }
        let Some(s) = below(hit, s, world.limit(receiver)) else {
            return;
        };
        let [(from, t0), (to, t1)] = s.map(|s| world.at(s, hit.at(s)));
        if from != to {
            out.push(ShadowEdge {
                from,
                to,
                s,
                t: [t0, t1],
                receiver: receiver.id,
                face: hit.face,
                kind: event.kind,
            });
        }
    });
}

/// The part of a stretch of a hit on which it is no nearer than the limit.
fn below(hit: &Hit, [mut from, mut to]: [f64; 2], limit: f64) -> Option<[f64; 2]> {
    let [a, b] = [from, to].map(|s| hit.at(s));
    if a > limit && b > limit {
        return None;
    }
    let cross = from + (to - from) * ((limit - a) / (b - a));
    if a > limit {
        from = cross;
    } else if b > limit {
        to = cross;
    }
    (to - from > ALONG_RAYS).then_some([from, to])
}

/// Cuts one receiver with one event, in the receiver's coordinates.
struct Cutter<'a> {
    tree: &'a FaceTree,
    sector: &'a Sector,
    receiver: u32,
    /// Vertices of the event, as the tree numbers them, if they are the receiver's.
    vertices: Option<[u32; 2]>,
}

impl Cutter<'_> {
    fn cut(&self, wedge: &Wedge, stack: &mut Vec<u32>, hits: &mut Vec<Hit>) {
        let light = self.tree.light_outside(wedge.light);
        for part in self.sector.parts() {
            let region = self.sector.region(part, self.tree);
            self.tree.visit(&region, light.as_ref(), stack, |run| {
                for face in run {
                    if let Some(hit) = self.face(face, part) {
                        hits.push(hit);
                    }
                }
            });
        }
    }

    /// Height over the event's plane. The same for every face at a vertex; nought on the plane.
    #[inline]
    fn height(&self, vertex: u32) -> f64 {
        let p = self.tree.position(vertex) - self.sector.apex;
        let height = p.dot(self.sector.normal);
        if height.abs() <= ON_PLANE * (p.abs().element_sum() + f64::from(self.tree.reach)) {
            0.0
        } else {
            height
        }
    }

    /// What a part of the event and a face (by the tree's order) have in common.
    #[inline]
    fn face(&self, face: usize, part: &Part) -> Option<Hit> {
        let corners = self.tree.corners[face];
        let mut heights = corners.map(|v| self.height(v));
        if let Some(own) = self.vertices {
            let mut shared = 0;
            for (corner, height) in corners.iter().zip(&mut heights) {
                if own.contains(corner) {
                    shared += 1;
                    *height = 0.0;
                }
            }
            if shared == 2 || (shared == 1 && own[0] == own[1]) {
                return None;
            }
        }
        // On the plane counts as above it, so that neighbours agree and a face in the plane is not cut.
        let below = heights.map(|h| h < 0.0);
        let lone = match below {
            [a, b, c] if a == b && b == c => return None,
            [a, b, _] if a == b => 2,
            [a, _, c] if a == c => 1,
            _ => 0,
        };
        let end = |other: usize| {
            let (i, j) = if corners[lone] < corners[other] {
                (lone, other)
            } else {
                (other, lone)
            };
            self.crossing([corners[i], corners[j]], [heights[i], heights[j]])
        };
        let [p, q] = [end((lone + 1) % 3), end((lone + 2) % 3)];
        let (s, nearness) = clip_to_part(p, q, part)?;
        Some(Hit {
            s,
            nearness,
            face: self.tree.faces[face],
            receiver: self.receiver,
        })
    }

    /// Where a face's edge passes through the plane. Takes the vertices in the same order for both of its faces.
    #[inline]
    fn crossing(&self, vertices: [u32; 2], heights: [f64; 2]) -> [f64; 2] {
        if heights[0] == 0.0 {
            return self.coordinates(vertices[0]);
        }
        let last = self.coordinates(vertices[1]);
        if heights[1] == 0.0 {
            return last;
        }
        let first = self.coordinates(vertices[0]);
        let share = heights[0] / (heights[0] - heights[1]);
        [0, 1].map(|k| first[k] + (last[k] - first[k]) * share)
    }

    #[inline]
    fn coordinates(&self, vertex: u32) -> [f64; 2] {
        let p = self.tree.position(vertex) - self.sector.apex;
        let [a, b] = self.sector.gradients.map(|g| g.dot(p));
        match self.vertices {
            // A VE event's own vertices: rounding must not move them off its first and last ray.
            Some(own) if own.contains(&vertex) => [1.0, b.round()],
            _ => [a, b],
        }
    }
}

/// The part of a segment of the plane that lies in a part of the sector, as `s` and nearness at both ends.
#[inline]
fn clip_to_part(p: [f64; 2], q: [f64; 2], part: &Part) -> Option<([f64; 2], [f64; 2])> {
    let [p, q] = [p, q].map(|c| c.map(|x| x * part.sign));
    let mut range = [0.0_f64, 1.0];
    let sides = |c: [f64; 2]| {
        [
            c[1],
            c[0] - c[1],
            c[0] - part.range[0],
            part.range[1] - c[0],
        ]
    };
    for (f, g) in sides(p).into_iter().zip(sides(q)) {
        if f < 0.0 && g < 0.0 {
            return None;
        }
        if f < 0.0 {
            range[0] = range[0].max(f / (f - g));
        } else if g < 0.0 {
            range[1] = range[1].min(f / (f - g));
        }
    }
    // What is not a number is nothing either.
    let some = range[0] < range[1];
    if !some {
        return None;
    }
    let at = |share: f64| {
        let c = match share {
            0.0 => p,
            1.0 => q,
            _ => [0, 1].map(|k| p[k] + (q[k] - p[k]) * share),
        };
        let nearness = if part.before { BEFORE } else { 1.0 / c[0] };
        ((c[1] / c[0]).clamp(0.0, 1.0), nearness)
    };
    let [(s0, n0), (s1, n1)] = range.map(at);
    if s1 - s0 > ALONG_RAYS {
        Some(([s0, s1], [n0, n1]))
    } else if s0 - s1 > ALONG_RAYS {
        Some(([s1, s0], [n1, n0]))
    } else {
        None
    }
}

#[cfg(test)]
#[path = "cast_tests.rs"]
mod tests;

#[cfg(test)]
#[path = "contact_tests.rs"]
mod contact_tests;
