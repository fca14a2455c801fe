//! What a shadow edge is judged by that does not depend on where it is seen from: how wide its penumbra is on the receiver,
//! and how much light it can take away there.

use glam::{DVec3, Vec3};

use super::cast::ShadowEdge;
use super::geometry::ShadowObject;
use super::light::ShadowLight;

/// Penumbrae that do not end, since a part of the light lies below the receiver's horizon, are taken to be this wide, metres.
const ENDLESS: f64 = 1e9;

/// Of the shadow edge of a light's middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grade {
    /// Unit vector across the edge in the plane of the face that it lies on, world space.
    pub across: Vec3,
    /// How far the shadow edges of the light's vertices are apart in that direction, at both ends, metres. What touches the
    /// receiver has a penumbra without width there.
    pub width: [f32; 2],
    /// No light whose intensity from its middle is 1 gives any place on the edge more irradiance than this, 1/m². The cosine
    /// is that of shading normals: where a round surface turns away from the light there is little left to take away,
    /// however sharply its facets do it.
    pub form: f32,
}

/// Grades the edges that the middle of one light makes.
pub struct Grader<'a> {
    light: &'a ShadowLight,
    middle: DVec3,
    extent: f64,
}

impl<'a> Grader<'a> {
    /// For the edges of a light, world space. Nothing for a light that casts no shadows.
    pub fn new(light: &'a ShadowLight) -> Option<Self> {
        let middle = light.middle().vertices().first().copied()?;
        Some(Self {
            light,
            middle,
            extent: light.extent(),
        })
    }

    /// Grades an edge on a receiver.
    pub fn grade(&self, edge: &ShadowEdge, receiver: &ShadowObject) -> Grade {
        let [a, b, c] = receiver.corners(edge.face);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let plane = Plane::new(normal, self.middle, edge);
        let ends = [(edge.from, edge.t[0]), (edge.to, edge.t[1])];
        Grade {
            across: plane.across.as_vec3(),
            width: ends.map(|(end, t)| plane.width(self.light, end, t) as f32),
            form: self.form(edge, plane.normal, receiver) as f32,
        }
    }

    /// See [`Grade::form`].
    fn form(&self, edge: &ShadowEdge, normal: DVec3, receiver: &ShadowObject) -> f64 {
        let nearest = nearest_point(self.middle, edge.from, edge.to);
        let distance = nearest.distance(self.middle) - 0.5 * self.extent;
        if distance <= 0.0 {
            return f64::INFINITY;
        }
        let [mut arriving, mut leaving] = [0.0_f64; 2];
        for place in [edge.from, nearest, edge.to] {
            let shading = receiver.shading_normal(edge.face, place).unwrap_or(normal);
            let side = if shading.dot(normal) < 0.0 { -1.0 } else { 1.0 };
            for from in self.light.vertices().iter().chain([&self.middle]) {
                let to_light = (*from - place).normalize_or_zero();
                arriving = arriving.max(side * shading.dot(to_light));
                leaving = leaving.max(match self.light.normal() {
                    DVec3::ZERO => 1.0,
                    front => -front.dot(to_light),
                });
            }
        }
        arriving * leaving / (distance * distance)
    }
}

/// The plane of a face.
struct Plane {
    /// On the light's side.
    normal: DVec3,
    across: DVec3,
    /// Of the light.
    middle: DVec3,
}

impl Plane {
    fn new(normal: DVec3, middle: DVec3, edge: &ShadowEdge) -> Self {
        let turned = normal.dot(middle - edge.from) < 0.0;
        let normal = if turned { -normal } else { normal };
        Self {
            normal,
            across: normal.cross(edge.to - edge.from).normalize_or_zero(),
            middle,
        }
    }

    /// Width of the penumbra where the ray from the light's middle that `t` belongs to meets the plane.
    fn width(&self, light: &ShadowLight, end: DVec3, t: f64) -> f64 {
        if t <= 1.0 {
            return 0.0;
        }
        let blocker = self.middle + (end - self.middle) / t;
        let height = |p: DVec3| self.normal.dot(p - end);
        let over = height(blocker);
        let mut range = [0.0_f64; 2];
        for vertex in light.vertices() {
            let above = height(*vertex) - over;
            // Its rays do not come down to the plane, or so far away that it makes no difference.
            if above <= 0.0 && over > 0.0 {
                return ENDLESS;
            }
            let falls = blocker + (blocker - *vertex) * (over / above).max(0.0);
            let off = self.across.dot(falls - end);
            range = [range[0].min(off), range[1].max(off)];
        }
        let width = range[1] - range[0];
        if width < ENDLESS { width } else { ENDLESS }
    }
}

/// The point of a segment that is nearest to another.
fn nearest_point(point: DVec3, from: DVec3, to: DVec3) -> DVec3 {
    let along = to - from;
    let share = (point - from).dot(along) / along.length_squared();
    if share.is_finite() {
        from + along * share.clamp(0.0, 1.0)
    } else {
        from
    }
}

#[cfg(test)]
#[path = "grade_tests.rs"]
mod tests;
