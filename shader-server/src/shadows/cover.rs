//! Visible share of a polygon behind few faces, without rays.
//!
//! Each face is drawn onto the light as the receiver sees it, on rows of samples that are as fine as the finest strata of
//! shadow rays: what those would find one by one, for the price of a few of them.

use glam::DVec3;

use super::{Shadows, area::FINEST, shadow_rays::STOP_SHORT};
use crate::{
    lights::{PolygonShape, Receiver},
    random::Stream,
    stage::Stage,
};

/// Samples a side and block: within a block all weigh the same.
const BLOCK: usize = 4;

/// Where a row's samples are, in the unit square.
#[derive(Clone, Copy, Default)]
struct Row {
    y: f64,
    /// Of the first sample; they are 1 / [`FINEST`] apart.
    x: f64,
}

impl Row {
    /// The samples from `low` to `high`, a bit each.
    fn between(&self, low: f64, high: f64) -> u32 {
        let n = FINEST as f64;
        let first = ((low - self.x) * n).ceil().max(0.);
        let last = ((high - self.x) * n).floor().min(n - 1.);
        if first > last {
            return 0;
        }
        let (first, last) = (first as u32, last as u32);
        (u32::MAX << first) & (u32::MAX >> (FINEST as u32 - 1 - last))
    }
}

/// Points `x` + `y` of the square on one side of a line: where `constant + x · along + y · across` is not negative.
#[derive(Clone, Copy)]
struct HalfPlane {
    constant: f64,
    along: f64,
    across: f64,
    /// -1 / along: times the value at the row's start, where the line crosses the row.
    crossing: f64,
}

impl HalfPlane {
    /// Whether no point of the square is inside.
    fn has_nothing(&self) -> bool {
        self.constant + self.along.max(0.) + self.across.max(0.) < 0.
    }

    /// Whether all of the square is inside.
    fn has_everything(&self) -> bool {
        self.constant + self.along.min(0.) + self.across.min(0.) >= 0.
    }
}

/// A light as a receiver sees it: the direction to (x, y) of the square is `corner + x · sides[0] + y · sides[1]`.
struct Seen {
    corner: DVec3,
    sides: [DVec3; 2],
    /// Crosswise to the first side and the light's normal, so that its product with the second is 1.
    upward: DVec3,
    normal: DVec3,
}

/// What a triangle covers of a light.
enum Shade {
    Nothing,
    Everything,
    /// What is inside all of these, in rows from one to another.
    Part([HalfPlane; 4], [usize; 2]),
}

impl Seen {
    fn new(shape: &PolygonShape, origin: DVec3) -> Self {
        let (corner, sides) = (shape.enclosing()[0] - origin, shape.sides());
        let across = shape.normal.cross(sides[0]);
        Self {
            corner,
            sides,
            upward: across / across.dot(sides[1]),
            normal: shape.normal,
        }
    }

    /// Where `normal` · direction ≥ `least`.
    fn half_plane(&self, normal: DVec3, least: f64) -> HalfPlane {
        let along = normal.dot(self.sides[0]);
        HalfPlane {
            constant: normal.dot(self.corner) - least,
            along,
            across: normal.dot(self.sides[1]),
            crossing: -along.recip(),
        }
    }

    /// Directions that meet a triangle, given from the receiver, before they come to the light.
    ///
    /// Neighbours share an edge's plane to the bit but for its sign, and what lies in it belongs to both: nothing is seen
    /// between them.
    fn triangle(&self, corners: [DVec3; 3]) -> Shade {
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a);
        let volume = normal.dot(a);
        // The receiver is in the triangle's plane.
        if volume == 0. || !volume.is_finite() {
            return Shade::Nothing;
        }
        let side = volume.signum();
        let edge = |p: DVec3, q: DVec3| self.half_plane(p.cross(q) * side, 0.);
        let reach = volume.abs() / (1. - f64::from(STOP_SHORT));
        let before_light = self.half_plane(normal * side, reach);
        let planes = [edge(a, b), edge(b, c), edge(c, a), before_light];
        if planes.iter().any(HalfPlane::has_nothing) {
            Shade::Nothing
        } else if planes.iter().all(HalfPlane::has_everything) {
            Shade::Everything
        } else {
            Shade::Part(planes, self.rows(corners))
        }
    }

    /// The first row that a triangle can reach into and the one after the last.
    fn rows(&self, corners: [DVec3; 3]) -> [usize; 2] {
        let to_plane = self.normal.dot(self.corner);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for corner in corners {
            let scale = to_plane / self.normal.dot(corner);
            if !(scale > 0. && scale.is_finite()) {
                // Not on the way to the light's plane: seen through the receiver it would be somewhere else.
                return [0, FINEST];
            }
            let y = (corner * scale - self.corner).dot(self.upward);
            (low, high) = (low.min(y), high.max(y));
        }
        let row = |y: f64| (y * FINEST as f64).clamp(0., FINEST as f64);
        [
            row(low - 1e-9).floor() as usize,
            row(high + 1e-9).ceil() as usize,
        ]
    }
}

/// Sets the bits of the samples that are inside all four half-planes. Says whether there were any.
fn draw(
    planes: &[HalfPlane; 4],
    [from, to]: [usize; 2],
    rows: &[Row; FINEST],
    covered: &mut [u32; FINEST],
) -> bool {
    let mut any = 0;
    for (row, bits) in rows[from..to].iter().zip(&mut covered[from..to]) {
        let (mut low, mut high) = (0f64, 1f64);
        for plane in planes {
            let start = plane.constant + row.y * plane.across;
            let crossing = start * plane.crossing;
            if plane.along > 0. {
                low = low.max(crossing);
            } else if plane.along < 0. {
                high = high.min(crossing);
            } else if start < 0. {
                high = -1.;
            }
        }
        let own = row.between(low, high);
        any |= own;
        *bits |= own;
    }
    any != 0
}

/// Share of the polygon's unoccluded irradiance that reaches `receiver` past the faces in `shadows.between`.
pub(super) fn fraction(
    stage: &Stage,
    receiver: &Receiver,
    shape: &PolygonShape,
    stream: &mut Stream,
    shadows: &mut Shadows,
) -> f32 {
    shadows.drawn += shadows.between.len() as u64;
    let [corner, ..] = shape.enclosing();
    let towards = (corner - receiver.position).dot(receiver.face_normal.as_dvec3());
    let lift = f64::from(receiver.clearance).copysign(towards);
    let origin = receiver.position + receiver.face_normal.as_dvec3() * lift;
    let seen = Seen::new(shape, origin);
    let rows: [Row; FINEST] = std::array::from_fn(|i| {
        let random = stream.square().as_dvec2();
        Row {
            y: (i as f64 + random.y) / FINEST as f64,
            x: random.x / FINEST as f64,
        }
    });
    let all: [u32; FINEST] = std::array::from_fn(|i| {
        let span = shape.across(rows[i].y);
        span.map_or(0, |[low, high]| rows[i].between(low, high))
    });
    let mut covered = [0; FINEST];
    let between = std::mem::take(&mut shadows.between);
    for &(instance, face) in &between {
        let Some(corners) = stage.triangle(instance, face) else {
            continue;
        };
        let covers = match seen.triangle(corners.map(|corner| corner - origin)) {
            Shade::Nothing => false,
            Shade::Everything => {
                covered = [u32::MAX; FINEST];
                true
            }
            Shade::Part(planes, span) => draw(&planes, span, &rows, &mut covered),
        };
        if covers {
            shadows.block(instance);
        }
    }
    shadows.between = between;
    share(receiver, shape, &all, &covered)
}

/// Share of `all` samples that are not covered, by what they would give.
fn share(
    receiver: &Receiver,
    shape: &PolygonShape,
    all: &[u32; FINEST],
    covered: &[u32; FINEST],
) -> f32 {
    let lit: [u32; FINEST] = std::array::from_fn(|i| all[i] & !covered[i]);
    if lit == *all {
        return 1.;
    }
    if lit.iter().all(|row| *row == 0) {
        return 0.;
    }
    let (mut sum, mut whole) = (0., 0.);
    for y in (0..FINEST).step_by(BLOCK) {
        for x in (0..FINEST).step_by(BLOCK) {
            let block = ((1 << BLOCK) - 1) << x;
            let count = |bits: &[u32; FINEST]| -> u32 {
                let rows = &bits[y..y + BLOCK];
                rows.iter().map(|row| (row & block).count_ones()).sum()
            };
            let of_all = count(all);
            if of_all > 0 {
                let half = 0.5 * BLOCK as f64;
                let centre = shape.on_plane([x, y].map(|c| (c as f64 + half) / FINEST as f64));
                let weight = shape.weight(receiver, centre);
                sum += weight * f64::from(count(&lit));
                whole += weight * f64::from(of_all);
            }
        }
    }
    if whole > 0. {
        (sum / whole) as f32
    } else {
        // So near the horizon that no block's middle gives light: every sample counts the same.
        let count =
            |bits: &[u32; FINEST]| bits.iter().map(|row| row.count_ones()).sum::<u32>() as f32;
        count(&lit) / count(all)
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, dvec3};

    use super::*;
    use crate::lights::{Emitter, Shape};

    fn shape(vertices: &[DVec3]) -> PolygonShape {
        let light = protocol::scene::Light::Area {
            vertices: vertices.iter().map(|v| v.as_vec3().to_array()).collect(),
            radiance: [1.; 3],
        };
        match Emitter::new(&light, 0).shape {
            Shape::Polygon(shape) => shape,
            Shape::Point(_) | Shape::Segment(..) => panic!("an area light is a polygon"),
        }
    }

    fn rows(stream: &mut Stream) -> [Row; FINEST] {
        std::array::from_fn(|i| {
            let random = stream.square().as_dvec2() / FINEST as f64;
            Row {
                y: i as f64 / FINEST as f64 + random.y,
                x: random.x,
            }
        })
    }

    fn drawn(seen: &Seen, rows: &[Row; FINEST], triangle: [DVec3; 3]) -> [u32; FINEST] {
        let mut covered = [0; FINEST];
        match seen.triangle(triangle) {
            Shade::Nothing => {}
            Shade::Everything => covered = [u32::MAX; FINEST],
            Shade::Part(planes, span) => {
                draw(&planes, span, rows, &mut covered);
            }
        }
        covered
    }

    /// Every sample against the solution of "direction · t = corners · weights": in front of, behind, beside and across the light.
    #[test]
    fn faces_cover_what_rays_would_meet() {
        let square = [(0., 0.), (0., 1.), (1., 1.), (1., 0.)];
        let shape = shape(&square.map(|(x, y)| dvec3(x - 0.3, y - 0.4, 2. + 0.3 * x)));
        let seen = Seen::new(&shape, DVec3::ZERO);
        let mut stream = Stream::new(1, 2);
        let (mut covered, mut free) = (0, 0);
        for i in 0..600 {
            let mut corner = || {
                let at = stream.square().as_dvec2() * 3. - 1.5;
                dvec3(at.x, at.y, f64::from(stream.unit()) * 3.2 - 0.5)
            };
            let mut triangle = [corner(), corner(), corner()];
            if i % 3 == 0 {
                // Small and in the way.
                let middle = dvec3(0.2, 0.1, 1.);
                triangle = triangle.map(|p| middle + p * 0.2);
            }
            if i % 50 == 1 {
                triangle[2] = triangle[1];
            }
            let rows = rows(&mut stream);
            let bits = drawn(&seen, &rows, triangle);
            for (row, bits) in rows.iter().zip(bits) {
                for column in 0..FINEST {
                    let x = row.x + column as f64 / FINEST as f64;
                    let direction = seen.corner + seen.sides[0] * x + seen.sides[1] * row.y;
                    let matrix = DMat3::from_cols_array_2d(&triangle.map(|p| p.to_array()));
                    let weights = matrix.inverse() * direction;
                    let sum: f64 = weights.to_array().iter().sum();
                    let least = weights
                        .min_element()
                        .min(sum - 1. / (1. - f64::from(STOP_SHORT)));
                    let is_covered = bits >> column & 1 == 1;
                    (covered, free) = (
                        covered + u32::from(is_covered),
                        free + u32::from(!is_covered),
                    );
                    if matrix.determinant().abs() < 1e-9 {
                        assert!(
                            !is_covered || i % 50 != 1,
                            "a face without area covers nothing"
                        );
                    } else if least.abs() > 1e-9 * weights.abs().max_element() {
                        assert_eq!(is_covered, least > 0., "{i}: {triangle:?} at {x} {}", row.y);
                    }
                }
            }
        }
        assert!(covered > 20_000 && free > 20_000, "{covered} {free}");
    }

    /// Faces that share an edge leave nothing between them, even where samples lie on it.
    #[test]
    fn nothing_is_seen_between_neighbours() {
        let square = [(0., 0.), (0., 1.), (1., 1.), (1., 0.)];
        let shape = shape(&square.map(|(x, y)| dvec3(x, y, 2.)));
        let seen = Seen::new(&shape, dvec3(0.5, 0.5, 0.));
        let mut stream = Stream::new(3, 4);
        let even = std::array::from_fn(|i| Row {
            y: i as f64 / FINEST as f64,
            x: 0.,
        });
        for i in 0..200 {
            let rows = if i == 0 { even } else { rows(&mut stream) };
            let hub = if i == 0 {
                [0.5; 2]
            } else {
                stream.square().as_dvec2().to_array()
            };
            let corner = |x: f64, y: f64| dvec3(x - 0.5, y - 0.5, 1.);
            let around = [
                corner(-0.2, -0.2),
                corner(1.2, -0.2),
                corner(1.2, 1.2),
                corner(-0.2, 1.2),
            ];
            let hub = corner(hub[0], hub[1]);
            let mut covered = [0; FINEST];
            for side in 0..4 {
                let bits = drawn(&seen, &rows, [around[side], around[(side + 1) % 4], hub]);
                (0..FINEST).for_each(|row| covered[row] |= bits[row]);
            }
            assert_eq!(covered, [u32::MAX; FINEST], "{i}");
        }
    }

    /// A light that is no parallelogram has its samples where it is.
    #[test]
    fn rows_of_a_polygon_end_at_its_border() {
        let pentagon = [(0., 0.), (2., 0.), (2.5, 1.), (1., 2.), (-1., 1.)];
        let shape = shape(&pentagon.map(|(x, y)| dvec3(y, x, 0.5 + 0.1 * x)));
        for i in 1..100 {
            let y = f64::from(i) / 100.;
            let span = shape.across(y);
            for j in 0..100 {
                let x = f64::from(j) / 100. + 0.005;
                let inside = span.is_some_and(|[low, high]| low <= x && x <= high);
                let place = glam::dvec2(x, y).as_vec2();
                assert_eq!(inside, shape.at(place).is_some(), "{x} {y}");
            }
        }
    }
}
