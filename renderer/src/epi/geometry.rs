//! Exact geometry of coded edges in one pixel (or sub-pixel), in integer units.
//!
//! A square of side `2 · segments · scale` units is used, so that segment ends, segment mid-points and the corners of
//! sub-pixel cells all have integer coordinates and every test is exact.

/// A place in the pixel, integer units, x right, y down.
pub(crate) type Place = (i32, i32);

/// A square whose boundary is cut into `segments` pieces a side, numbered clockwise from the top-left corner.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Boundary {
    /// Pieces a side.
    segments: i32,
    /// Units that half a segment is long.
    half: i32,
}

impl Boundary {
    /// A boundary of `segments` pieces a side, half a piece being `half` units long.
    pub(crate) const fn new(segments: i32, half: i32) -> Self {
        Self { segments, half }
    }

    /// Side of the square, units.
    pub(crate) const fn side(self) -> i32 {
        2 * self.half * self.segments
    }

    /// The place that is `along` half segments clockwise from the top-left corner.
    pub(crate) fn at(self, along: i32) -> Place {
        let side = self.side();
        let (quarter, rest) = (along / (2 * self.segments) % 4, along % (2 * self.segments));
        let d = rest * self.half;
        match quarter {
            0 => (d, 0),
            1 => (side, d),
            2 => (side - d, side),
            _ => (0, side - d),
        }
    }

    /// The middle of a segment.
    pub(crate) fn middle(self, segment: i32) -> Place {
        self.at(2 * segment + 1)
    }

    /// Polygon of the region that lies clockwise between the mid-points of segments `a < b`.
    pub(crate) fn inner_polygon(self, a: i32, b: i32) -> Vec<Place> {
        let mut polygon = vec![self.middle(a)];
        let corners = (1..4).filter(|k| a < k * self.segments && k * self.segments <= b);
        polygon.extend(corners.map(|k| self.at(2 * k * self.segments)));
        polygon.push(self.middle(b));
        polygon
    }

    /// Area of the region inside the arc, as a share of the square.
    pub(crate) fn inner_area(self, a: i32, b: i32) -> f64 {
        let side = f64::from(self.side());
        twice_area(&self.inner_polygon(a, b)) / (2.0 * side * side)
    }

    /// Centroids of the outer and the inner region, in units of the square's side.
    pub(crate) fn centroids(self, a: i32, b: i32) -> [[f64; 2]; 2] {
        let side = f64::from(self.side());
        let polygon = self.inner_polygon(a, b);
        let area = twice_area(&polygon) / (2.0 * side * side);
        let inner = centroid(&polygon).map(|c| c / side);
        // Both regions together balance in the middle of the square.
        let outer = inner.map(|c| (0.5 - area * c) / (1.0 - area));
        [outer, inner]
    }

    /// Length of the part of side `k` (0 top, then clockwise) that bounds the inner region, units.
    pub(crate) fn inner_length(self, a: i32, b: i32, k: i32) -> i32 {
        let (from, to) = (2 * k * self.segments, 2 * (k + 1) * self.segments);
        ((2 * b + 1).min(to) - (2 * a + 1).max(from)).max(0) * self.half
    }

    /// Is this place inside the arc, seen from the line between the mid-points of `a` and `b`?
    pub(crate) fn is_inner(self, a: i32, b: i32, place: Place) -> bool {
        // The inner region lies to the right of the way from b to a, y pointing down.
        cross(self.middle(a), self.middle(b), place) < 0
    }

    /// Does an edge from anywhere in segment `a` to anywhere in segment `b` cut the open cell?
    ///
    /// All those edges together are the convex hull of the two segments, so that this is an overlap test of two convex
    /// polygons: they are apart if a side of one of them separates them.
    pub(crate) fn cuts_cell(self, a: i32, b: i32, min: Place, max: Place) -> bool {
        // Clockwise order of the four ends makes a convex polygon whatever the two segments are.
        let hull = [
            self.at(2 * a),
            self.at(2 * a + 2),
            self.at(2 * b),
            self.at(2 * b + 2),
        ];
        let cell = [min, (max.0, min.1), max, (min.0, max.1)];
        !separated_by_side(&hull, &cell) && !separated_by_side(&cell, &hull)
    }
}

/// Does a side of clockwise polygon `of` have all of `other` on its outer side (touching counts as apart)?
fn separated_by_side(of: &[Place; 4], other: &[Place; 4]) -> bool {
    (0..4).any(|i| {
        let (from, to) = (of[i], of[(i + 1) % 4]);
        from != to && other.iter().all(|&p| cross(from, to, p) <= 0)
    })
}

/// Cross product of `to - from` and `p - from`: positive if p lies clockwise of the way, y pointing down.
fn cross(from: Place, to: Place, p: Place) -> i32 {
    (to.0 - from.0) * (p.1 - from.1) - (to.1 - from.1) * (p.0 - from.0)
}

fn sides(polygon: &[Place]) -> impl Iterator<Item = ([f64; 2], [f64; 2])> + '_ {
    let float = |p: Place| [f64::from(p.0), f64::from(p.1)];
    (0..polygon.len()).map(move |i| (float(polygon[i]), float(polygon[(i + 1) % polygon.len()])))
}

fn twice_area(polygon: &[Place]) -> f64 {
    sides(polygon).map(|(p, q)| p[0] * q[1] - p[1] * q[0]).sum()
}

fn centroid(polygon: &[Place]) -> [f64; 2] {
    let mut sum = [0.0; 2];
    for (p, q) in sides(polygon) {
        let weight = p[0] * q[1] - p[1] * q[0];
        sum[0] += (p[0] + q[0]) * weight;
        sum[1] += (p[1] + q[1]) * weight;
    }
    sum.map(|s| s / (3.0 * twice_area(polygon)))
}
