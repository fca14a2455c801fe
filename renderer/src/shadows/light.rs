//! Lights as the polygons that shadow events start from (paper section 6.3).

use glam::{DAffine3, DVec3};
use protocol::scene::Light;

use crate::edges::adjacency::{Adjacency, EyeBox};

/// Polygons with less area than this, relative to the square of their extent, are segments.
const FLAT: f64 = 1e-12;

/// A light without its colour: one vertex (point), two (linear) or at least three (planar and convex, area).
///
/// The vertices of an area light run anticlockwise as seen from the side that it emits on, in every coordinate system that
/// the light is brought into. A light whose vertices all coincide is a point, one whose vertices lie on a line is linear:
/// such lights are lit on all sides, having no front.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShadowLight {
    vertices: Vec<DVec3>,
    /// Number of each vertex in the scene's light.
    corners: Vec<u32>,
    /// Unit normal on the side that emits; zero for point and linear lights.
    normal: DVec3,
}

impl ShadowLight {
    /// The light of a scene, world space, metres.
    pub fn new(light: &Light) -> Self {
        match light {
            Light::Point { position, .. } => Self::polygon(&[*position]),
            Light::Linear { from, to, .. } => Self::polygon(&[*from, *to]),
            Light::Area { vertices, .. } => Self::polygon(vertices),
        }
    }

    /// A light with these vertices, metres. A light with a coordinate that is not finite has no vertices, and casts no
    /// shadows.
    pub fn polygon(vertices: &[[f32; 3]]) -> Self {
        let vertices = vertices.iter().map(|v| DVec3::from(v.map(f64::from)));
        let mut light = Self::default();
        light.set(vertices, 0.., false);
        light
    }

    /// Becomes another light, brought into other coordinates. Allocates only if this light has never had as many
    /// vertices.
    pub fn set_transformed(&mut self, light: &Self, by: &DAffine3) {
        let mirrored = by.matrix3.determinant() < 0.0;
        let vertices = light.vertices.iter().map(|v| by.transform_point3(*v));
        self.set(vertices, light.corners.iter().copied(), mirrored);
    }

    /// The light in other coordinates.
    #[must_use]
    pub fn transformed(&self, by: &DAffine3) -> Self {
        let mut light = Self::default();
        light.set_transformed(self, by);
        light
    }

    /// The point light at the middle of its vertices.
    #[must_use]
    pub fn middle(&self) -> Self {
        let mut light = Self::default();
        if !self.vertices.is_empty() {
            let middle = self.vertices.iter().sum::<DVec3>() / self.vertices.len() as f64;
            light.set(std::iter::once(middle), [0], false);
        }
        light
    }

    /// Greatest distance between two vertices.
    pub fn extent(&self) -> f64 {
        let pairs = self.vertices.iter().enumerate();
        let distances =
            pairs.flat_map(|(i, a)| self.vertices[i + 1..].iter().map(|b| a.distance(*b)));
        distances.fold(0.0, f64::max)
    }

    fn set(
        &mut self,
        vertices: impl Iterator<Item = DVec3>,
        corners: impl IntoIterator<Item = u32>,
        mirrored: bool,
    ) {
        self.vertices.clear();
        self.corners.clear();
        self.normal = DVec3::ZERO;
        for (vertex, corner) in vertices.zip(corners) {
            if !vertex.is_finite() {
                self.vertices.clear();
                self.corners.clear();
                return;
            }
            if self.vertices.last() != Some(&vertex) {
                self.vertices.push(vertex);
                self.corners.push(corner);
            }
        }
        while self.vertices.len() > 1 && self.vertices.first() == self.vertices.last() {
            self.vertices.pop();
            self.corners.pop();
        }
        if mirrored {
            self.vertices.reverse();
            self.corners.reverse();
        }
        if self.vertices.len() > 2 {
            self.set_normal();
        }
    }

    /// Finds the side that emits, or makes the light a segment if it has no area.
    fn set_normal(&mut self) {
        let origin = self.vertices[0];
        let mut normal = DVec3::ZERO;
        for pair in self.vertices.windows(2) {
            normal += (pair[0] - origin).cross(pair[1] - origin);
        }
        let EyeBox { low, high } = self.bounds();
        if normal.length() > FLAT * (high - low).length_squared() {
            self.normal = normal.normalize();
            return;
        }
        let distance = |from: DVec3| move |v: &DVec3| (*v - from).length_squared();
        let (first, _) = farthest(&self.vertices, distance(origin));
        let (second, _) = farthest(&self.vertices, distance(self.vertices[first]));
        let ends = [first.min(second), first.max(second)];
        self.vertices = ends.map(|k| self.vertices[k]).to_vec();
        self.corners = ends.map(|k| self.corners[k]).to_vec();
    }

    /// The vertices; see the type.
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// The number that a vertex has in the scene's light.
    pub fn corner(&self, vertex: usize) -> u32 {
        self.corners[vertex]
    }

    /// Unit normal of the side that emits; zero for point and linear lights.
    pub fn normal(&self) -> DVec3 {
        self.normal
    }

    /// How far a point lies in front of an area light's plane, in the light's units; 1 for other lights, which are in front
    /// of everything.
    pub fn height(&self, point: DVec3) -> f64 {
        match self.vertices.first() {
            Some(origin) if self.normal != DVec3::ZERO => self.normal.dot(point - *origin),
            _ => 1.0,
        }
    }

    /// The box of all positions on the light; a box of nothing for a light without vertices.
    pub fn bounds(&self) -> EyeBox {
        let mut bounds = EyeBox {
            low: DVec3::INFINITY,
            high: DVec3::NEG_INFINITY,
        };
        for v in &self.vertices {
            bounds.low = bounds.low.min(*v);
            bounds.high = bounds.high.max(*v);
        }
        bounds
    }

    /// Whether the light lies outside of a mesh's bounds, so that it sees closed surfaces from outside only. The light is in
    /// the mesh's coordinates.
    pub fn is_outside(&self, adjacency: &Adjacency) -> bool {
        let EyeBox { low, high } = self.bounds();
        let [b_low, b_high] = adjacency.bounds.map(|p| DVec3::from(p.map(f64::from)));
        high.cmplt(b_low).any() || low.cmpgt(b_high).any()
    }
}

/// Index and measure of the vertex with the greatest measure.
fn farthest(vertices: &[DVec3], measure: impl Fn(&DVec3) -> f64) -> (usize, f64) {
    let measured = vertices.iter().map(measure).enumerate();
    measured.fold((0, f64::NEG_INFINITY), |best, next| {
        if next.1 > best.1 { next } else { best }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: [[f32; 3]; 4] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
    ];

    #[test]
    fn a_light_keeps_its_front_when_mirrored() {
        let light = ShadowLight::polygon(&SQUARE);
        assert_eq!(light.normal(), DVec3::Z);
        let mirror = DAffine3::from_scale(DVec3::new(-2.0, 1.0, 1.0));
        let mirrored = light.transformed(&mirror);
        assert_eq!(mirrored.normal(), DVec3::Z);
        let turned = light.transformed(&DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0)));
        assert_eq!(turned.normal(), DVec3::NEG_Z);
        for (k, v) in mirrored.vertices().iter().enumerate() {
            let original = SQUARE[mirrored.corner(k) as usize].map(f64::from);
            assert_eq!(*v, mirror.transform_point3(original.into()));
        }
        assert_eq!(light.height(DVec3::new(5.0, 5.0, 3.0)), 3.0);
        assert_eq!(mirrored.transformed(&mirror.inverse()), light);
    }

    #[test]
    fn lights_without_area_are_segments_and_without_length_points() {
        let point = ShadowLight::polygon(&[[1.0, 2.0, 3.0]]);
        assert_eq!(ShadowLight::polygon(&[[1.0, 2.0, 3.0]; 4]), point);
        let line = ShadowLight::polygon(&[[0.0; 3], [2.0; 3], [3.0; 3], [1.0; 3]]);
        assert_eq!(line.vertices(), [DVec3::ZERO, DVec3::splat(3.0)]);
        assert_eq!(line.corner(1), 2);
        assert_eq!(line.height(DVec3::splat(-9.0)), 1.0);
        let broken = ShadowLight::polygon(&[[0.0; 3], [f32::NAN; 3], [3.0; 3]]);
        assert!(broken.vertices().is_empty());
    }
}
