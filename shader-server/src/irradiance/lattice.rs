//! Where records lie: points of the surfaces that depend on the scene alone, never on who asked first.
//!
//! Space is divided into cubes, at each level half as large as at the one before. In each cube the surfaces that face about
//! the same way have one site: the point of theirs that is nearest to their common centroid.

use glam::{DVec3, IVec3, Vec3};
use rays::{Hit, Region};

use crate::{lights::Receiver, stage::Stage};

/// A cube of the lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Cell {
    /// Each level halves the spacing.
    pub(crate) level: u8,
    /// Multiples of the level's spacing, of the lowest corner.
    pub(crate) at: IVec3,
}

/// The surfaces of a cell that face about the same way: the largest axis of the normal on the side seen, its sign, and
/// whether that side is the one from which the face's vertices run anticlockwise.
pub(crate) type Orientation = u8;

/// A site: its cell and which way its surface faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Place {
    pub(crate) cell: Cell,
    pub(crate) orientation: Orientation,
}

/// Deepest level.
pub(crate) const DEEPEST: u8 = 16;

/// Surfaces that fill less of a cell, as a share of the square of its side, have no site there: those nearby serve.
const LEAST_AREA: f64 = 0.02;

/// Corners that a triangle can have once six planes have cut it.
const CORNERS: usize = 9;

/// Where cells begin, as a share of the coarsest spacing: a third is a third or two thirds at every level, so that surfaces at
/// round coordinates are on no border, to have sites on both sides of it.
const ORIGIN: f64 = 1. / 3.;

/// The spacing of the lattice.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lattice {
    coarsest_m: f64,
}

impl Lattice {
    /// Of which the coarsest cells are a 16th to a 32nd of `diagonal_m`.
    pub(crate) fn new(diagonal_m: f64) -> Self {
        let size = if diagonal_m.is_finite() && diagonal_m > 0. {
            diagonal_m / 16.
        } else {
            1.
        };
        Self {
            coarsest_m: size.clamp(1e-6, 1e9).log2().floor().exp2(),
        }
    }

    /// Side of a level's cells, metres.
    pub(crate) fn spacing_m(&self, level: u8) -> f64 {
        self.coarsest_m * (-f64::from(level)).exp2()
    }

    /// The cell around a point.
    pub(crate) fn cell(&self, level: u8, point: DVec3) -> Cell {
        let from = point - ORIGIN * self.coarsest_m;
        let at = (from / self.spacing_m(level)).floor().as_ivec3();
        Cell { level, at }
    }

    /// The lowest and the highest corner of a cell.
    pub(crate) fn corners(&self, cell: Cell) -> [DVec3; 2] {
        let low = cell.at.as_dvec3() * self.spacing_m(cell.level) + ORIGIN * self.coarsest_m;
        [low, low + self.spacing_m(cell.level)]
    }

    /// Whether a cell reaches into a box.
    pub(crate) fn meets(&self, cell: Cell, bounds: &rays::Bounds) -> bool {
        let [low, high] = self.corners(cell);
        low.cmple(bounds.max.as_dvec3()).all() && high.cmpge(bounds.min.as_dvec3()).all()
    }

    /// The sites of a cell, in the order of their orientations.
    pub(crate) fn sites(&self, stage: &Stage, cell: Cell) -> Vec<(Orientation, Receiver)> {
        let [low, high] = self.corners(cell);
        let pieces = pieces(stage, low, high);
        let least = LEAST_AREA * (high.x - low.x).powi(2);
        (0..12)
            .filter_map(|orientation| {
                let own = |p: &&Piece| p.orientations.contains(&orientation);
                let area: f64 = pieces.iter().filter(own).map(|p| p.area).sum();
                if area < least {
                    return None;
                }
                let sum: DVec3 = pieces.iter().filter(own).map(|p| p.centroid * p.area).sum();
                let centroid = sum / area;
                let distance = |p: &Piece| (p.nearest(centroid) - centroid).length_squared();
                let best = pieces
                    .iter()
                    .filter(own)
                    .min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
                let site = best.site(stage, centroid, orientation)?;
                Some((orientation, site))
            })
            .collect()
    }
}

/// The part of a face that is inside a cell.
struct Piece {
    instance: u32,
    face: u32,
    triangle: [DVec3; 3],
    corners: Polygon,
    normal: DVec3,
    centroid: DVec3,
    area: f64,
    orientations: [Orientation; 2],
}

/// Which way a surface faces that is seen from the side of `normal`.
pub(crate) fn orientation(normal: DVec3, is_front: bool) -> Orientation {
    let size = normal.abs();
    let axis = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    axis * 4 + u8::from(normal[axis as usize] < 0.) * 2 + u8::from(is_front)
}

/// Whether an orientation is that of surfaces seen from their front.
pub(crate) fn is_front(orientation: Orientation) -> bool {
    orientation & 1 == 1
}

fn pieces(stage: &Stage, low: DVec3, high: DVec3) -> Vec<Piece> {
    let centre = (low + high) * 0.5;
    let half = (high.x - low.x) as f32 * 0.5;
    let mut planes = [(Vec3::ZERO, 0.); 6];
    for (i, plane) in planes.iter_mut().enumerate() {
        let sign = if i < 3 { 1. } else { -1. };
        *plane = (Vec3::AXES[i % 3] * sign, -half);
    }
    let mut faces = Vec::new();
    stage
        .world()
        .may_touch(&Region::new(centre.as_vec3(), planes), |instance, face| {
            faces.push((instance, face));
            false
        });
    // The tree's order depends on how it came to be.
    faces.sort_unstable();
    faces
        .into_iter()
        .filter_map(|(instance, face)| Piece::new(stage, instance, face, low, high))
        .collect()
}

impl Piece {
    fn new(stage: &Stage, instance: u32, face: u32, low: DVec3, high: DVec3) -> Option<Self> {
        let triangle = stage.triangle(instance, face)?;
        let [a, b, c] = triangle;
        let normal = (b - a).cross(c - a).try_normalize()?;
        let mut corners = Polygon::new(&triangle);
        for axis in 0..3 {
            corners = corners.above(|p| p[axis] - low[axis]);
            corners = corners.above(|p| high[axis] - p[axis]);
        }
        let (centroid, area) = corners.centroid()?;
        Some(Self {
            instance,
            face,
            triangle,
            corners,
            normal,
            centroid,
            area,
            orientations: [orientation(normal, true), orientation(-normal, false)],
        })
    }

    /// The point of the piece next to `point`.
    fn nearest(&self, point: DVec3) -> DVec3 {
        let foot = point - self.normal * (point - self.centroid).dot(self.normal);
        let corners = self.corners.points();
        let next = |i: usize| corners[(i + 1) % corners.len()];
        let inside = (0..corners.len()).all(|i| {
            (next(i) - corners[i])
                .cross(foot - corners[i])
                .dot(self.normal)
                >= 0.
        });
        if inside {
            return foot;
        }
        let on_side = |i: usize| {
            let (from, along) = (corners[i], next(i) - corners[i]);
            let t = (foot - from).dot(along) / along.length_squared().max(f64::MIN_POSITIVE);
            from + along * t.clamp(0., 1.)
        };
        let nearer = |a: &DVec3, b: &DVec3| {
            let of = |p: &DVec3| (*p - foot).length_squared();
            of(a).total_cmp(&of(b))
        };
        (0..corners.len())
            .map(on_side)
            .min_by(nearer)
            .unwrap_or(self.centroid)
    }

    /// The site nearest to `wanted`, a little inside the piece: on its border other surfaces may begin.
    fn site(&self, stage: &Stage, wanted: DVec3, orientation: Orientation) -> Option<Receiver> {
        let position = self.nearest(wanted).lerp(self.centroid, 0.05);
        let [a, b, c] = self.triangle;
        let (u, v, p) = (b - a, c - a, position - a);
        let (uu, uv, vv) = (u.dot(u), u.dot(v), v.dot(v));
        let (pu, pv) = (p.dot(u), p.dot(v));
        let det = uu * vv - uv * uv;
        if det <= 0. {
            return None;
        }
        let weights = [(vv * pu - uv * pv) / det, (uu * pv - uv * pu) / det];
        let hit = Hit {
            t: 0.,
            instance: self.instance,
            face: self.face,
            barycentric: weights.map(|w| w.clamp(0., 1.) as f32),
        };
        let surface = stage.surface(&hit)?;
        let side = if is_front(orientation) {
            surface.face_normal
        } else {
            -surface.face_normal
        };
        let normal = if surface.normal.dot(side.as_dvec3()) < 0. {
            -surface.normal
        } else {
            surface.normal
        };
        Some(Receiver {
            position: surface.position,
            normal,
            face_normal: surface.face_normal,
            clearance: surface.clearance,
            instance: self.instance,
            face: self.face,
        })
    }
}

/// A convex polygon of few corners.
#[derive(Clone, Copy)]
struct Polygon {
    corners: [DVec3; CORNERS],
    count: usize,
}

impl Polygon {
    fn new(points: &[DVec3]) -> Self {
        let mut polygon = Self {
            corners: [DVec3::ZERO; CORNERS],
            count: 0,
        };
        points.iter().for_each(|p| polygon.push(*p));
        polygon
    }

    fn push(&mut self, point: DVec3) {
        // Rounding can cut a polygon into more corners than there are planes; those are next to others.
        if self.count < CORNERS {
            self.corners[self.count] = point;
            self.count += 1;
        }
    }

    fn points(&self) -> &[DVec3] {
        &self.corners[..self.count]
    }

    /// The part where `height` is not negative (Sutherland and Hodgman 1974).
    fn above(&self, height: impl Fn(DVec3) -> f64) -> Self {
        let mut kept = Self::new(&[]);
        let points = self.points();
        for (i, &from) in points.iter().enumerate() {
            let to = points[(i + 1) % points.len()];
            let (a, b) = (height(from), height(to));
            if a >= 0. {
                kept.push(from);
            }
            if (a >= 0.) != (b >= 0.) {
                kept.push(from.lerp(to, a / (a - b)));
            }
        }
        kept
    }

    fn centroid(&self) -> Option<(DVec3, f64)> {
        let points = self.points();
        let first = *points.first()?;
        let (mut sum, mut area) = (DVec3::ZERO, 0.);
        for pair in points.windows(2).skip(1) {
            let part = (pair[0] - first).cross(pair[1] - first).length() * 0.5;
            sum += (first + pair[0] + pair[1]) * (part / 3.);
            area += part;
        }
        (area > 0.).then(|| (sum / area, area))
    }
}
