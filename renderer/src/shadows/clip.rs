//! The first receiver keeps a shadow event (paper section 6.5, "Clipping").
//!
//! Where an event meets a face, the inverse of the distance along its rays is linear in the event's own parameter `s`. So
//! the faces that it meets are straight segments over `s`, and those that it meets first are their upper envelope.

/// Where an event meets a face: a straight segment over `s`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hit {
    /// From and to; ascending.
    pub(super) s: [f64; 2],
    /// Nearness at both ends: the inverse of a measure of distance that grows along each ray.
    pub(super) nearness: [f64; 2],
    /// Index in the mesh.
    pub(super) face: u32,
    /// Index among the receivers.
    pub(super) receiver: u32,
}

impl Hit {
    /// Nearness at `s`.
    pub(super) fn at(&self, s: f64) -> f64 {
        // To the bit, so that pieces on neighbouring faces meet.
        if s == self.s[1] {
            return self.nearness[1];
        }
        let share = (s - self.s[0]) / (self.s[1] - self.s[0]);
        self.nearness[0] + (self.nearness[1] - self.nearness[0]) * share
    }
}

/// A hit must be nearer by this share to be taken for nearer, so that surfaces in the same place do not alternate.
const TIE: f64 = 1e-12;

/// Finds the hits that nothing lies before. Keeps its memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Envelope {
    active: Vec<u32>,
}

/// The hit that is nearest just now, and where that began.
#[derive(Clone, Copy)]
struct Piece {
    hit: u32,
    from: f64,
}

impl Envelope {
    /// Calls `keep` with the parts of hits that are the nearest, by ascending `s`. Sorts the hits.
    pub(super) fn nearest(&mut self, hits: &mut [Hit], mut keep: impl FnMut(&Hit, [f64; 2])) {
        hits.sort_unstable_by(|a, b| a.s[0].total_cmp(&b.s[0]).then(a.face.cmp(&b.face)));
        let hits = &*hits;
        self.active.clear();
        let mut next = 0;
        let mut piece: Option<Piece> = None;
        let mut s = hits.first().map_or(0.0, |h| h.s[0]);
        loop {
            self.active.retain(|h| hits[*h as usize].s[1] > s);
            while next < hits.len() && hits[next].s[0] <= s {
                self.active.push(next as u32);
                next += 1;
            }
            let start = hits.get(next).map(|h| h.s[0]);
            if self.active.is_empty() {
                if let Some(p) = piece.take() {
                    keep(&hits[p.hit as usize], [p.from, s]);
                }
                match start {
                    Some(start) => s = start,
                    None => return,
                }
                continue;
            }
            let mut end = start.unwrap_or(f64::INFINITY);
            for h in &self.active {
                end = end.min(hits[*h as usize].s[1]);
            }
            piece = Some(self.stretch(hits, [s, end], piece, &mut keep));
            s = end;
        }
    }

    /// Goes along a stretch on which no hit begins or ends.
    fn stretch(
        &self,
        hits: &[Hit],
        [mut s, end]: [f64; 2],
        before: Option<Piece>,
        keep: &mut impl FnMut(&Hit, [f64; 2]),
    ) -> Piece {
        let nearness = |h: u32, s: f64| hits[h as usize].at(s);
        let first = self.active[0];
        let mut piece = before.filter(|p| self.active.contains(&p.hit));
        if let (Some(p), None) = (before, piece) {
            keep(&hits[p.hit as usize], [p.from, s]);
        }
        let mut best = piece.map_or(first, |p| p.hit);
        if self.active.len() > 1 {
            let mut most = [nearness(best, s), nearness(best, end)];
            for &h in &self.active {
                let here = [nearness(h, s), nearness(h, end)];
                let slack = TIE * most[0];
                let level = (here[0] - most[0]).abs() <= slack;
                if here[0] > most[0] + slack || (level && here[1] > most[1] + TIE * most[1]) {
                    (best, most) = (h, here);
                }
            }
        }
        // Of straight segments each is the nearest on one stretch at most.
        for _ in 0..self.active.len() {
            if let Some(p) = piece.filter(|p| p.hit != best) {
                keep(&hits[p.hit as usize], [p.from, s]);
                piece = None;
            }
            piece = piece.or(Some(Piece { hit: best, from: s }));
            if self.active.len() == 1 {
                break;
            }
            let Some((at, hit)) = self.overtaken(hits, best, [s, end]) else {
                break;
            };
            (s, best) = (at, hit);
        }
        piece.unwrap_or(Piece { hit: best, from: s })
    }

    /// Where and by which hit this one is first overtaken.
    fn overtaken(&self, hits: &[Hit], hit: u32, [s, end]: [f64; 2]) -> Option<(f64, u32)> {
        let own = [s, end].map(|x| hits[hit as usize].at(x));
        let mut first: Option<(f64, f64, u32)> = None;
        for &h in self.active.iter().filter(|h| **h != hit) {
            let lead = [s, end].map(|x| hits[h as usize].at(x));
            let (from, to) = (lead[0] - own[0], lead[1] - own[1]);
            if to <= TIE * own[1] {
                continue;
            }
            let share = if from >= 0.0 {
                0.0
            } else {
                -from / (to - from)
            };
            let slope = to - from;
            if first.is_none_or(|(least, steepest, _)| {
                share < least || (share == least && slope > steepest)
            }) {
                first = Some((share, slope, h));
            }
        }
        first.map(|(share, _, h)| (s + (end - s) * share, h))
    }
}
