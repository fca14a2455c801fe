//! Neighbours in one plane become one convex polygon of at most four corners.
//!
//! Every polygon in a light's way costs the same, however small: a wall of a hundred cells is cast as one rectangle.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::{
    mesh::NONE,
    shells::{Joined, Side},
};

/// How far from a plane or a line a corner may be, in ulp of the largest coordinate: what rounding does to it.
const TOLERANCE_ULP: f64 = 4.;
/// Rounds of merging pairs at most; each may double a polygon.
const ROUNDS: usize = 48;

/// What merging gives.
pub(crate) struct Merged {
    /// Corners, and a triangle that is part of it.
    pub(crate) polygons: Vec<([u32; 4], u32)>,
    /// The polygon of each triangle.
    pub(crate) of_triangle: Vec<u32>,
}

/// A polygon in the making.
#[derive(Clone, Copy, Debug)]
struct Piece {
    corners: [u32; 4],
    alive: bool,
}

impl Piece {
    fn len(&self) -> usize {
        if self.corners[3] == NONE { 3 } else { 4 }
    }

    fn sides(self) -> impl Iterator<Item = (u32, u32)> {
        let n = self.len();
        (0..n).map(move |i| (self.corners[i], self.corners[(i + 1) % n]))
    }
}

struct Merging<'a> {
    positions: &'a [Vec3],
    pieces: Vec<Piece>,
    tolerance: f64,
}

/// Merges the faces `chosen` of `faces`, unless `merging` is off.
pub(crate) fn merge(
    positions: &[Vec3],
    chosen: &[u32],
    faces: &[[u32; 3]],
    merging: bool,
) -> Merged {
    let largest = positions
        .iter()
        .map(|p| p.abs().max_element())
        .fold(0., f32::max);
    let mut work = Merging {
        positions,
        pieces: chosen
            .iter()
            .map(|face| {
                let [a, b, c] = faces[*face as usize];
                Piece {
                    corners: [a, b, c, NONE],
                    alive: true,
                }
            })
            .collect(),
        tolerance: TOLERANCE_ULP * f64::from(f32::EPSILON) * f64::from(largest),
    };
    let mut joined = Joined::new(chosen.len());
    let mut active: Vec<u32> = (0..chosen.len() as u32).collect();
    for _ in 0..if merging { ROUNDS } else { 0 } {
        let pairs = work.pairs(&active);
        let mut merged = 0;
        let mut next = Vec::with_capacity(2 * pairs.len());
        let mut busy = vec![false; work.pieces.len()];
        for (a, b) in pairs {
            next.extend([a, b]);
            if busy[a as usize] || busy[b as usize] {
                continue;
            }
            if let Some(corners) = work.union(a, b) {
                busy[a as usize] = true;
                busy[b as usize] = true;
                work.pieces[a as usize].corners = corners;
                work.pieces[b as usize].alive = false;
                joined.join(a, b);
                merged += 1;
            }
        }
        if merged == 0 {
            break;
        }
        next.retain(|piece| work.pieces[*piece as usize].alive);
        next.sort_unstable();
        next.dedup();
        active = next;
    }
    let mut number = vec![NONE; chosen.len()];
    let mut polygons = Vec::new();
    for (i, piece) in work.pieces.iter().enumerate().filter(|(_, p)| p.alive) {
        number[i] = polygons.len() as u32;
        polygons.push((piece.corners, i as u32));
    }
    let of_triangle = (0..chosen.len() as u32)
        .map(|triangle| number[joined.root(triangle) as usize])
        .collect();
    Merged {
        polygons,
        of_triangle,
    }
}

impl Merging<'_> {
    fn at(&self, corner: u32) -> DVec3 {
        self.positions[corner as usize].as_dvec3()
    }

    fn normal(&self, piece: Piece) -> DVec3 {
        let [a, b, c] = [0, 1, 2].map(|i| self.at(piece.corners[i]));
        let normal = (b - a).cross(c - a);
        if piece.len() == 3 {
            return normal;
        }
        normal + (c - a).cross(self.at(piece.corners[3]) - a)
    }

    /// Neighbours in one plane, those across the longest sides first: triangles that were a rectangle become one again.
    fn pairs(&self, active: &[u32]) -> Vec<(u32, u32)> {
        let mut sides: Vec<Side> = active
            .par_iter()
            .flat_map_iter(|i| {
                let sides = self.pieces[*i as usize].sides();
                sides.map(|(from, to)| Side::new(from, to, *i))
            })
            .collect();
        sides.par_sort_unstable();
        let mut pairs: Vec<(f64, u32, u32)> = sides
            .chunk_by(|a, b| a.ends == b.ends)
            .filter(|run| run.len() == 2 && run[0].forward != run[1].forward)
            .filter(|run| self.share_a_plane(run[0].face, run[1].face))
            .map(|run| {
                let length = self.at(run[0].ends.0).distance(self.at(run[0].ends.1));
                (length, run[0].face, run[1].face)
            })
            .collect();
        pairs.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        pairs.into_iter().map(|(_, a, b)| (a, b)).collect()
    }

    fn share_a_plane(&self, a: u32, b: u32) -> bool {
        let [a, b] = [a, b].map(|i| self.pieces[i as usize]);
        let [na, nb] = [a, b].map(|piece| self.normal(piece).normalize_or_zero());
        let near = |normal: DVec3, from: Piece, piece: Piece| {
            piece.corners[..piece.len()].iter().all(|corner| {
                normal
                    .dot(self.at(*corner) - self.at(from.corners[0]))
                    .abs()
                    <= self.tolerance
            })
        };
        na.dot(nb) > 0.99 && near(na, a, b) && near(nb, b, a)
    }

    /// The corners of both together, if that is a convex polygon of at most four.
    fn union(&self, a: u32, b: u32) -> Option<[u32; 4]> {
        let [a, b] = [a, b].map(|i| self.pieces[i as usize]);
        let (from, to) = a
            .sides()
            .find(|(from, to)| b.sides().any(|side| side == (*to, *from)))?;
        let ring = |piece: Piece, first: u32| {
            let n = piece.len();
            let start = piece.corners[..n].iter().position(|c| *c == first);
            (0..n).map(move |i| piece.corners[(start.unwrap_or(0) + i) % n])
        };
        // Around `a` from the shared side's end to its start, then around `b` without the two.
        let mut corners: Vec<u32> = ring(a, to).collect();
        corners.extend(ring(b, from).skip(1).take(b.len() - 2));
        for shared in [from, to] {
            let i = corners.iter().position(|c| *c == shared)?;
            let n = corners.len();
            if self.is_straight(corners[(i + n - 1) % n], shared, corners[(i + 1) % n]) {
                corners.remove(i);
            }
        }
        let n = corners.len();
        let distinct = (0..n).all(|i| !corners[..i].contains(&corners[i]));
        if !(3..=4).contains(&n) || !distinct {
            return None;
        }
        let normal = self.normal(a).normalize_or_zero();
        let convex = (0..n).all(|i| {
            let [p, q, r] = [0, 1, 2].map(|k| self.at(corners[(i + k) % n]));
            let (along, next) = (q - p, r - q);
            let turn = along.cross(next).dot(normal);
            turn > self.tolerance * (along.length() + next.length())
        });
        let mut all = [NONE; 4];
        all[..n].copy_from_slice(&corners);
        convex.then_some(all)
    }

    fn is_straight(&self, before: u32, corner: u32, after: u32) -> bool {
        let [p, q, r] = [before, corner, after].map(|i| self.at(i));
        let line = r - p;
        let length = line.length();
        (q - p).cross(line).length() <= self.tolerance * length
            && (q - p).dot(line) > 0.
            && (r - q).dot(line) > 0.
    }
}
