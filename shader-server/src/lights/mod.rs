//! Lights, prepared for shading.

pub mod polygon;

pub use soft_maps::segment;

use glam::{DVec3, Vec2, Vec3};
use protocol::scene::Light;

use crate::random::Stream;

/// A point that light falls on.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// World space, metres.
    pub position: DVec3,
    /// Unit shading normal, on the viewer's side.
    pub normal: DVec3,
    /// Unit normal of the face itself, on either side.
    pub face_normal: Vec3,
    /// How far along the face normal a ray must start to be clear of the face, metres.
    pub clearance: f32,
    /// Instance that the point is on.
    pub instance: u32,
    /// Face of its mesh.
    pub face: u32,
}

/// A light with what shading needs of it.
#[derive(Clone, Debug)]
pub struct Emitter {
    /// Where it shines from.
    pub shape: Shape,
    /// Linear colour: W/sr, W/(m sr) or W/(m² sr), as the shape has it.
    pub strength: Vec3,
}

/// Where light comes from, world space, metres.
#[derive(Clone, Debug)]
pub enum Shape {
    /// A point.
    Point(DVec3),
    /// A segment's ends.
    Segment(DVec3, DVec3),
    /// A polygon.
    Polygon(PolygonShape),
}

/// A planar convex polygon and a parallelogram around it.
#[derive(Clone, Debug)]
pub struct PolygonShape {
    /// Anticlockwise as seen from the side that shines.
    pub vertices: Vec<DVec3>,
    /// Unit normal of that side; zero if the polygon has no area.
    pub normal: DVec3,
    area_m2: f64,
    corner: DVec3,
    sides: [DVec3; 2],
    fills: bool,
    /// Index of its instance among the world's.
    pub instance: u32,
}

impl Emitter {
    /// Prepares a light; `instance` is where its polygon, if it has one, stands in the world.
    #[must_use]
    pub fn new(light: &Light, instance: u32) -> Self {
        let point = |p: &[f32; 3]| Vec3::from(*p).as_dvec3();
        match light {
            Light::Point {
                position,
                intensity,
            } => Self {
                shape: Shape::Point(point(position)),
                strength: Vec3::from(*intensity),
            },
            Light::Linear {
                from,
                to,
                intensity,
            } => Self {
                shape: Shape::Segment(point(from), point(to)),
                strength: Vec3::from(*intensity),
            },
            Light::Area { vertices, radiance } => Self {
                shape: Shape::Polygon(PolygonShape::new(
                    vertices.iter().map(point).collect(),
                    instance,
                )),
                strength: Vec3::from(*radiance),
            },
        }
    }

    /// Irradiance at `receiver` from all of the light, as if nothing were in between, for strength 1.
    #[must_use]
    pub fn unoccluded(&self, receiver: &Receiver) -> f64 {
        let (p, n) = (receiver.position, receiver.normal);
        match &self.shape {
            Shape::Point(q) => {
                let to = *q - p;
                let squared = to.length_squared();
                if squared > 0. {
                    to.dot(n).max(0.) / (squared * squared.sqrt())
                } else {
                    0.
                }
            }
            Shape::Segment(from, to) => segment::irradiance(*from - p, *to - p, n),
            Shape::Polygon(shape) if shape.faces(p) => {
                polygon::irradiance(shape.vertices.iter().map(|v| *v - p), n)
            }
            Shape::Polygon(_) => 0.,
        }
    }
}

impl Shape {
    /// A random place of the light, each piece of it as likely as any other of its size.
    #[must_use]
    pub fn somewhere(&self, stream: &mut Stream) -> Option<DVec3> {
        match self {
            Self::Point(position) => Some(*position),
            Self::Segment(from, to) => Some(from.lerp(*to, f64::from(stream.unit()))),
            // A polygon fills at least half of the square that it is sampled on.
            Self::Polygon(shape) => (0..32).find_map(|_| shape.at(stream.square())),
        }
    }
}

impl PolygonShape {
    fn new(vertices: Vec<DVec3>, instance: u32) -> Self {
        let first = vertices.first().copied().unwrap_or_default();
        let area: DVec3 = vertices
            .windows(2)
            .map(|pair| (pair[0] - first).cross(pair[1] - first))
            .sum();
        let normal = area.normalize_or_zero();
        let mut shape = Self {
            vertices,
            normal,
            area_m2: 0.5 * area.length(),
            corner: first,
            sides: [DVec3::ZERO; 2],
            fills: false,
            instance,
        };
        shape.enclose();
        shape
    }

    /// Finds a parallelogram around the polygon: itself if it is one, else the smallest rectangle along one of its sides.
    fn enclose(&mut self) {
        let v = &self.vertices;
        if let [a, b, c, d] = v[..] {
            let size = (c - a).abs().max_element();
            if ((a + c) - (b + d)).abs().max_element() <= 1e-5 * size {
                self.sides = [b - a, d - a];
                self.fills = true;
                return;
            }
        }
        let mut smallest = f64::INFINITY;
        for (i, from) in v.iter().enumerate() {
            let along = (v[(i + 1) % v.len()] - *from).normalize_or_zero();
            let across = self.normal.cross(along);
            let extent = |axis: DVec3| {
                v.iter()
                    .map(|p| (*p - *from).dot(axis))
                    .fold((f64::MAX, f64::MIN), |(low, high), x| {
                        (low.min(x), high.max(x))
                    })
            };
            let ((x0, x1), (y0, y1)) = (extent(along), extent(across));
            let area = (x1 - x0) * (y1 - y0);
            if along != DVec3::ZERO && area < smallest {
                smallest = area;
                self.corner = *from + along * x0 + across * y0;
                self.sides = [along * (x1 - x0), across * (y1 - y0)];
            }
        }
    }

    /// Area, square metres.
    #[must_use]
    pub fn area_m2(&self) -> f64 {
        self.area_m2
    }

    /// Whether `point` is on the side that shines.
    #[must_use]
    pub fn faces(&self, point: DVec3) -> bool {
        (point - self.corner).dot(self.normal) > 0.
    }

    /// Corners of the parallelogram that the unit square maps onto, in order around it; the polygon is inside.
    #[must_use]
    pub fn enclosing(&self) -> [DVec3; 4] {
        let [u, v] = self.sides;
        [
            self.corner,
            self.corner + u,
            self.corner + u + v,
            self.corner + v,
        ]
    }

    /// Whether the unit square maps onto the polygon and nothing else.
    #[must_use]
    pub fn fills_square(&self) -> bool {
        self.fills
    }

    /// The point at `place` in the unit square, if it is on the polygon. The map keeps areas in proportion.
    #[must_use]
    pub fn at(&self, place: Vec2) -> Option<DVec3> {
        let point = self.on_plane(place.as_dvec2().to_array());
        (self.fills || self.contains(point)).then_some(point)
    }

    /// The point of the light's plane at `place` of the unit square, on the polygon or not.
    #[must_use]
    pub fn on_plane(&self, [x, y]: [f64; 2]) -> DVec3 {
        self.corner + self.sides[0] * x + self.sides[1] * y
    }

    /// The two sides of the parallelogram that the unit square maps onto, from its first corner.
    #[must_use]
    pub fn sides(&self) -> [DVec3; 2] {
        self.sides
    }

    /// From where to where in the unit square the polygon reaches in the row at `y`.
    #[must_use]
    pub fn across(&self, y: f64) -> Option<[f64; 2]> {
        if self.fills {
            return Some([0., 1.]);
        }
        // The sides of the rectangle around a polygon that does not fill it are at right angles.
        let place = |p: &DVec3| {
            self.sides
                .map(|side| (*p - self.corner).dot(side) / side.length_squared())
        };
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for (i, from) in self.vertices.iter().enumerate() {
            let [[x0, y0], [x1, y1]] =
                [from, &self.vertices[(i + 1) % self.vertices.len()]].map(place);
            if (y0 <= y) != (y1 <= y) {
                let x = x0 + (x1 - x0) * (y - y0) / (y1 - y0);
                (low, high) = (low.min(x), high.max(x));
            }
        }
        (low <= high).then_some([low, high])
    }

    fn contains(&self, point: DVec3) -> bool {
        let v = &self.vertices;
        (0..v.len()).all(|i| {
            let (a, b) = (v[i], v[(i + 1) % v.len()]);
            (b - a).cross(point - a).dot(self.normal) >= 0.
        })
    }

    /// Irradiance at `receiver` from a unit of area around `point` of the polygon, for radiance 1.
    #[must_use]
    pub fn weight(&self, receiver: &Receiver, point: DVec3) -> f64 {
        let to = point - receiver.position;
        let squared = to.length_squared();
        let cosines = to.dot(receiver.normal).max(0.) * (-to.dot(self.normal)).max(0.);
        if squared > 0. {
            cosines / (squared * squared)
        } else {
            0.
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;

    fn receiver() -> Receiver {
        Receiver {
            position: dvec3(0.1, 0.2, -1.),
            normal: dvec3(0.1, 0.4, 1.).normalize(),
            face_normal: Vec3::Z,
            clearance: 0.,
            instance: 0,
            face: 0,
        }
    }

    /// The closed form against a fine sum over the square that polygons are sampled on.
    fn assert_integrates(vertices: &[DVec3]) {
        let shape = PolygonShape::new(vertices.to_vec(), 0);
        let receiver = receiver();
        let n = 700;
        let cell = shape.sides[0].cross(shape.sides[1]).length() / f64::from(n * n);
        let mut sum = 0.;
        for i in 0..n {
            for j in 0..n {
                let place = Vec2::new(i as f32 + 0.5, j as f32 + 0.5) / n as f32;
                sum += shape.at(place).map_or(0., |q| shape.weight(&receiver, q)) * cell;
            }
        }
        let emitter = Emitter {
            shape: Shape::Polygon(shape),
            strength: Vec3::ONE,
        };
        let exact = emitter.unoccluded(&receiver);
        assert!(
            (sum / exact - 1.).abs() < 2e-3,
            "{vertices:?}: {sum} {exact}"
        );
    }

    #[test]
    fn weights_integrate_to_the_closed_form() {
        let down = |x: f64, y: f64| dvec3(y, x, 0.5 + 0.1 * x);
        assert_integrates(&[down(0., 0.), down(2., 0.), down(2., 1.), down(0., 1.)]);
        assert_integrates(&[down(0., 0.), down(2., 0.), down(1., 1.5)]);
        assert_integrates(&[
            down(0., 0.),
            down(2., 0.),
            down(2.5, 1.),
            down(1., 2.),
            down(-1., 1.),
        ]);
    }

    #[test]
    fn area_lights_are_dark_behind() {
        let light = Light::Area {
            vertices: vec![[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]],
            radiance: [1.; 3],
        };
        let Emitter {
            shape: Shape::Polygon(shape),
            ..
        } = Emitter::new(&light, 0)
        else {
            panic!("an area light is a polygon");
        };
        assert!(shape.faces(dvec3(0.5, 0.5, 1.)) && shape.fills_square());
        assert!(!shape.faces(dvec3(0.5, 0.5, -1.)) && !shape.faces(dvec3(5., 5., 0.)));
        assert_eq!(Emitter::new(&light, 0).unoccluded(&receiver()), 0.);
    }
}
