//! Where two objects pass through one another: creases that are edges of neither mesh. The paper leaves them out.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;

use crate::shadows::faces::{FaceNode, FaceTree};

/// A segment in which a face of one object passes through a face of another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meet {
    /// One end, world space, metres.
    pub from: DVec3,
    /// The other end, world space, metres.
    pub to: DVec3,
    /// The objects; lesser first.
    pub objects: [u32; 2],
    /// Their faces.
    pub faces: [u32; 2],
}

/// Faces whose normals differ by less than this, radians, are taken for coplanar.
const COPLANAR: f64 = 1e-5;
/// Vertices nearer to a plane than this share of their coordinates lie on it.
const ON_PLANE: f64 = 1e-12;

/// Keeps the segments in which the objects of a scene pass through one another.
///
/// Surfaces that touch without passing through one another meet in nothing: what lies in the same plane or stands with
/// its edges on a face has edges of its own there.
#[derive(Clone, Debug)]
pub struct Meets {
    objects: Vec<Placed>,
    /// By pair of objects, lesser first; pairs that do not meet are left out.
    pairs: BTreeMap<[u32; 2], Vec<Meet>>,
}

#[derive(Clone, Debug)]
struct Placed {
    tree: Arc<FaceTree>,
    to_world: DAffine3,
    /// World box; empty if the object has no faces or no volume to be in.
    low: DVec3,
    high: DVec3,
}

impl Placed {
    fn new(tree: Arc<FaceTree>, to_world: DAffine3) -> Self {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let determinant = to_world.matrix3.determinant();
        let regular = determinant != 0.0 && determinant.is_finite();
        if regular && to_world.translation.is_finite() && !tree.is_empty() {
            let [a, b] = tree.bounds();
            let (centre, half) = moved_box(&to_world, (a + b) * 0.5, (b - a) * 0.5);
            (low, high) = (centre - half, centre + half);
        }
        Self {
            tree,
            to_world,
            low,
            high,
        }
    }

    fn overlaps(&self, other: &Self) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }
}

impl Meets {
    /// Finds all segments of objects, given by their faces and where they are (object to world space).
    pub fn new(objects: impl IntoIterator<Item = (Arc<FaceTree>, DAffine3)>) -> Self {
        let objects = objects.into_iter().map(|(tree, to)| Placed::new(tree, to));
        let mut meets = Self {
            objects: objects.collect(),
            pairs: BTreeMap::new(),
        };
        let n = meets.objects.len();
        meets.find((0..n).flat_map(|i| (i + 1..n).map(move |j| [i, j])));
        meets
    }

    /// Moves an object and finds its segments anew; those between others stay. An object that is not there is left
    /// alone.
    pub fn move_object(&mut self, object: usize, to_world: DAffine3) {
        let Some(placed) = self.objects.get_mut(object) else {
            return;
        };
        *placed = Placed::new(placed.tree.clone(), to_world);
        self.pairs
            .retain(|pair, _| !pair.contains(&(object as u32)));
        let others = (0..self.objects.len()).filter(|i| *i != object);
        self.find(others.map(|i| [i.min(object), i.max(object)]));
    }

    /// All segments, by pair of objects.
    pub fn iter(&self) -> impl Iterator<Item = &Meet> {
        self.pairs.values().flatten()
    }

    fn find(&mut self, pairs: impl Iterator<Item = [usize; 2]>) {
        let near: Vec<_> = pairs
            .filter(|[i, j]| self.objects[*i].overlaps(&self.objects[*j]))
            .collect();
        let objects = &self.objects;
        let found = near.par_iter().map(|&[i, j]| {
            let ids = [i as u32, j as u32];
            (ids, Pair::new(&objects[i], &objects[j], ids).find())
        });
        let found: Vec<_> = found.filter(|(_, meets)| !meets.is_empty()).collect();
        self.pairs.extend(found);
    }
}

/// The box around a moved box.
fn moved_box(by: &DAffine3, centre: DVec3, half: DVec3) -> (DVec3, DVec3) {
    let m = by.matrix3;
    let size = DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs());
    (by.transform_point3(centre), size * half)
}

/// Two objects whose boxes overlap.
struct Pair<'a> {
    first: &'a Placed,
    second: &'a Placed,
    ids: [u32; 2],
    /// From the second's object space to the first's.
    across: DAffine3,
}

impl<'a> Pair<'a> {
    fn new(first: &'a Placed, second: &'a Placed, ids: [u32; 2]) -> Self {
        Self {
            first,
            second,
            ids,
            across: first.to_world.inverse() * second.to_world,
        }
    }

    /// Walks down both trees at once.
    fn find(&self) -> Vec<Meet> {
        let mut out = Vec::new();
        let (a, b) = (&*self.first.tree, &*self.second.tree);
        let mut stack = vec![(a.root(), b.root())];
        while let Some((x, y)) = stack.pop() {
            let (centre, half) = moved_box(&self.across, y.centre, y.half);
            let slack = 1e-9 * (centre.abs() + half + x.centre.abs());
            let apart = (centre - x.centre).abs().cmpgt(half + x.half + slack);
            if apart.any() {
                continue;
            }
            match (x.is_leaf(), y.is_leaf()) {
                (true, true) => self.faces(&x, &y, &mut out),
                (false, leaf) if leaf || x.half.element_sum() > half.element_sum() => {
                    stack.extend(a.children(&x).map(|x| (x, y)));
                }
                _ => stack.extend(b.children(&y).map(|y| (x, y))),
            }
        }
        out
    }

    fn faces(&self, x: &FaceNode, y: &FaceNode, out: &mut Vec<Meet>) {
        for j in y.run() {
            let b = Face::new(self.second, j);
            for i in x.run() {
                let a = Face::new(self.first, i);
                if let Some([from, to]) = a.meet(&b) {
                    out.push(Meet {
                        from,
                        to,
                        objects: self.ids,
                        faces: [self.first.tree.face(i), self.second.tree.face(j)],
                    });
                }
            }
        }
    }
}

/// A triangle in world space.
struct Face {
    ids: [u32; 3],
    at: [DVec3; 3],
    normal: DVec3,
}

/// Where a triangle's sides pass through a plane.
struct Cut {
    ends: [DVec3; 2],
    /// Both ends are vertices: a side lies in the plane.
    side: bool,
}

impl Face {
    fn new(of: &Placed, face: usize) -> Self {
        let ids = of.tree.corners(face);
        let at = ids.map(|v| of.to_world.transform_point3(of.tree.position(v)));
        let normal = (at[1] - at[0]).cross(at[2] - at[0]).normalize_or_zero();
        Self { ids, at, normal }
    }

    /// The segment that two triangles have in common, if they pass through one another.
    fn meet(&self, other: &Self) -> Option<[DVec3; 2]> {
        let mine = self.cut(other)?;
        let line = self.normal.cross(other.normal);
        // What is not a number is not across either.
        let across = line.length() > COPLANAR;
        if !across {
            return None;
        }
        let theirs = other.cut(self)?;
        if mine.side && theirs.side {
            return None;
        }
        let along = |cut: Cut| {
            let [a, b] = cut.ends.map(|p| (line.dot(p), p));
            if a.0 <= b.0 { [a, b] } else { [b, a] }
        };
        let [a, b] = [along(mine), along(theirs)];
        let from = if a[0].0 >= b[0].0 { a[0] } else { b[0] };
        let to = if a[1].0 <= b[1].0 { a[1] } else { b[1] };
        (from.0 < to.0).then_some([from.1, to.1])
    }

    /// Where this triangle passes through the plane of another one. What lies on the plane counts as in front, so that
    /// neighbours agree.
    fn cut(&self, plane: &Self) -> Option<Cut> {
        let origin = plane.at[0];
        let heights = self.at.map(|p| {
            let height = plane.normal.dot(p - origin);
            let rounding = ON_PLANE * (p.abs() + origin.abs()).element_sum();
            if height.abs() <= rounding {
                0.0
            } else {
                height
            }
        });
        let lone = match heights.map(|h| h < 0.0) {
            [a, b, c] if a == b && b == c => return None,
            [a, b, _] if a == b => 2,
            [a, _, c] if a == c => 1,
            _ => 0,
        };
        let others = [(lone + 1) % 3, (lone + 2) % 3];
        let ends = others.map(|other| {
            // In the same order for both faces of a side.
            let (i, j) = if self.ids[lone] < self.ids[other] {
                (lone, other)
            } else {
                (other, lone)
            };
            match (heights[i], heights[j]) {
                (0.0, _) => self.at[i],
                (_, 0.0) => self.at[j],
                (h, k) => self.at[i].lerp(self.at[j], h / (h - k)),
            }
        });
        Some(Cut {
            ends,
            side: others.iter().all(|k| heights[*k] == 0.0),
        })
    }
}

#[cfg(test)]
#[path = "meets_tests.rs"]
mod tests;
