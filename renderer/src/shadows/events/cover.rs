//! What the faces at a vertex cover, seen along lines that sweep from one point of a light's edge to another.
//!
//! Seen along a line through the vertex, the plane through the light's edge is a line, with the light on one half of the picture. A
//! neighbour of the vertex is a spoke from the centre. Its height over the plane stays the same during the sweep and
//! its place across changes linearly, since the ray turns within the plane.

use super::pair::Pair;

/// Up to this many spokes, every order of theirs is told apart.
const EXACT: usize = 48;
/// Extra cuts for larger fans.
const STEPS: u32 = 16;

/// A half of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Half {
    /// The half with the light.
    Light,
    /// The other one.
    Far,
}

/// A neighbour of the vertex, up to a positive factor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spoke {
    pub(super) half: Half,
    /// Distance from the plane, more than zero.
    pub(super) height: f64,
    /// Place across at the start of the sweep.
    pub(super) across: f64,
    /// How much that changes during the sweep.
    pub(super) shift: f64,
}

impl Spoke {
    fn across(&self, s: f64) -> f64 {
        self.across + self.shift * s
    }

    /// Direction in its half of the picture, as the cotangent of its angle.
    fn direction(&self, s: f64) -> f64 {
        self.across(s) / self.height
    }
}

/// The faces at a vertex.
#[derive(Clone, Debug, Default)]
pub(super) struct Fan {
    /// Vertex at the end of each spoke.
    neighbours: Vec<u32>,
    /// Each face as its two spokes.
    faces: Vec<[u32; 2]>,
    spokes: Vec<Spoke>,
    cuts: Vec<f64>,
    intervals: Vec<[f64; 2]>,
    closed: bool,
}

impl Fan {
    /// Forgets the vertex.
    pub(super) fn clear(&mut self) {
        self.neighbours.clear();
        self.faces.clear();
    }

    /// Gathers the faces at a vertex, unless that has been done.
    pub(super) fn collect(&mut self, pair: &Pair<'_>, vertex: u32) {
        if !self.neighbours.is_empty() {
            return;
        }
        let edges = pair.rings.edges_at(vertex);
        self.neighbours
            .extend(edges.iter().map(|e| pair.other_end(*e, vertex)));
        self.closed = true;
        for (i, edge) in edges.iter().enumerate() {
            let faces = pair.adjacency.faces(*edge as usize);
            self.closed &= faces.len() == 2;
            for face in faces {
                // Each face is met at two edges and taken at one.
                let first = self.neighbours[i];
                if pair.rings.after(*face, vertex) != first {
                    continue;
                }
                let last = pair.rings.after(*face, first);
                if let Some(j) = self.neighbours.iter().position(|v| *v == last) {
                    self.faces.push([i as u32, j as u32]);
                }
            }
        }
    }

    /// Places the spokes.
    pub(super) fn project(&mut self, spoke: impl Fn(u32) -> Spoke) {
        self.spokes.clear();
        self.spokes
            .extend(self.neighbours.iter().map(|v| spoke(*v)));
    }

    fn ends(&self, face: [u32; 2]) -> [Spoke; 2] {
        face.map(|k| self.spokes[k as usize])
    }

    /// Whether the light's half could be covered and the other one not, judged by how many faces cross the plane.
    ///
    /// To cover a half, a face must cross at either end of it. Where every edge has two faces, two crossing faces bound
    /// one run of spokes in either half: both halves are covered if they cross at different ends, and none otherwise.
    pub(super) fn may_cover(&self) -> bool {
        let crossing = self.faces.iter().filter(|f| {
            let [a, b] = self.ends(**f);
            a.half != b.half
        });
        crossing.count() >= if self.closed { 4 } else { 2 }
    }

    /// Cuts the sweep where coverage may change: where a face is seen edge-on, and where two spokes on the same half have
    /// the same direction. In between, the order of everything that coverage depends on stays the same.
    pub(super) fn cut(&mut self) {
        let Self {
            spokes,
            faces,
            cuts,
            ..
        } = self;
        cuts.clear();
        cuts.extend([0.0, 1.0]);
        let mut cut = |at_start: f64, shift: f64| {
            let s = -at_start / shift;
            if s > 0.0 && s < 1.0 {
                cuts.push(s);
            }
        };
        for face in faces {
            let [a, b] = face.map(|k| &spokes[k as usize]);
            if a.half != b.half {
                cut(
                    a.across * b.height + b.across * a.height,
                    a.shift * b.height + b.shift * a.height,
                );
            }
        }
        if spokes.len() <= EXACT {
            for (i, a) in spokes.iter().enumerate() {
                for b in spokes[i + 1..].iter().filter(|b| b.half == a.half) {
                    cut(
                        a.across * b.height - b.across * a.height,
                        a.shift * b.height - b.shift * a.height,
                    );
                }
            }
        } else {
            for k in 1..STEPS {
                cut(-f64::from(k), f64::from(STEPS));
            }
        }
        cuts.sort_unstable_by(f64::total_cmp);
    }

    /// Where the sweep is cut, in order, from 0 to 1.
    pub(super) fn cuts(&self) -> &[f64] {
        &self.cuts
    }

    /// Whether the faces leave no gap in a half of the picture.
    pub(super) fn covers(&mut self, half: Half, s: f64) -> bool {
        self.intervals.clear();
        for k in 0..self.faces.len() {
            let [a, b] = self.ends(self.faces[k]);
            let interval = match (a.half == half, b.half == half) {
                (true, true) => {
                    let [c, d] = [a.direction(s), b.direction(s)];
                    [c.min(d), c.max(d)]
                }
                (true, false) => crossing(&a, &b, s),
                (false, true) => crossing(&b, &a, s),
                (false, false) => continue,
            };
            self.intervals.push(interval);
        }
        self.intervals
            .sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
        let mut reach = f64::NEG_INFINITY;
        for [from, to] in &self.intervals {
            if *from > reach {
                return false;
            }
            reach = reach.max(*to);
        }
        reach == f64::INFINITY
    }
}

/// What a face covers of the half that its first spoke is in, if its second one is in the other.
fn crossing(inside: &Spoke, outside: &Spoke, s: f64) -> [f64; 2] {
    let at = inside.across(s) * outside.height + outside.across(s) * inside.height;
    let direction = inside.direction(s);
    if at > 0.0 {
        [direction, f64::INFINITY]
    } else if at < 0.0 {
        [f64::NEG_INFINITY, direction]
    } else {
        [direction; 2]
    }
}
