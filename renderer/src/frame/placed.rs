//! Where everything of the scene is now, as far as the display must know it when something moves.

use glam::{DAffine3, DMat3, DVec3, Vec3};
use protocol::messages::{LightMove, ObjectMove};
use protocol::scene::{Affine, Light, Scene};

use crate::points::umbrella::Umbrella;

/// What moved and how, for servers and the display alike.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Edit {
    /// New places of objects.
    pub objects: Vec<ObjectMove>,
    /// Lights as they are from now on, of the same kind as before.
    pub lights: Vec<LightMove>,
}

impl Edit {
    /// Whether it moves nothing.
    pub fn is_empty(&self) -> bool {
        self.objects.is_empty() && self.lights.is_empty()
    }
}

/// Something that can be moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Thing {
    /// By its index in the scene.
    Object(u32),
    /// By its index in the scene.
    Light(u32),
}

/// The scene's objects and lights.
#[derive(Clone, Debug, Default)]
pub struct Placed {
    objects: Vec<Object>,
    lights: Vec<Light>,
}

#[derive(Clone, Debug)]
struct Object {
    /// Lowest and highest corner of its mesh, object space; lowest above highest if it has no face.
    bounds: [Vec3; 2],
    transform: Affine,
}

/// An object or a light's polygon that moved: a box, and the maps from its space to the world before and after.
#[derive(Clone, Debug)]
pub(super) struct Shift {
    pub(super) bounds: [Vec3; 2],
    pub(super) before: DAffine3,
    pub(super) after: DAffine3,
    /// The light that it is the polygon of.
    light: Option<u32>,
}

/// What an edit changed.
#[derive(Clone, Debug, Default)]
pub struct Changes {
    /// Objects whose transforms changed: index, before, after.
    pub objects: Vec<(u32, Affine, Affine)>,
    /// Lights that changed: index, before, after.
    pub lights: Vec<(u32, Light, Light)>,
}

impl Changes {
    /// Whether everything is as it was.
    pub fn is_empty(&self) -> bool {
        self.objects.is_empty() && self.lights.is_empty()
    }
}

impl Placed {
    pub(super) fn new(scene: &Scene) -> Self {
        let bounds: Vec<[Vec3; 2]> = scene.meshes.iter().map(mesh_bounds).collect();
        let objects = scene.objects.iter().map(|object| Object {
            bounds: bounds.get(object.mesh as usize).copied().unwrap_or(NOTHING),
            transform: object.transform,
        });
        Self {
            objects: objects.collect(),
            lights: scene.lights.clone(),
        }
    }

    /// An object's transform, if there is such an object.
    pub fn transform(&self, object: u32) -> Option<&Affine> {
        self.objects.get(object as usize).map(|o| &o.transform)
    }

    /// How many objects there are.
    pub(super) fn objects(&self) -> usize {
        self.objects.len()
    }

    /// The lights, in the scene's order.
    pub fn lights(&self) -> &[Light] {
        &self.lights
    }

    /// The part of an edit that is not so already.
    pub fn news(&self, edit: &Edit) -> Edit {
        let objects = edit.objects.iter();
        let lights = edit.lights.iter();
        let moves = |m: &&ObjectMove| self.transform(m.object) != Some(&m.transform);
        let changes = |m: &&LightMove| self.lights.get(m.light as usize) != Some(&m.value);
        Edit {
            objects: objects.filter(moves).copied().collect(),
            lights: lights.filter(changes).cloned().collect(),
        }
    }

    /// Takes an edit over; gives what is not as it was. What names no object, or no light of its kind, is left out.
    pub(super) fn apply(&mut self, edit: &Edit) -> Changes {
        let mut changes = Changes::default();
        for ObjectMove { object, transform } in &edit.objects {
            if let Some(here) = self.objects.get_mut(*object as usize)
                && here.transform != *transform
            {
                let before = std::mem::replace(&mut here.transform, *transform);
                changes.objects.push((*object, before, *transform));
            }
        }
        for LightMove { light, value } in &edit.lights {
            if let Some(here) = self.lights.get_mut(*light as usize)
                && std::mem::discriminant(here) == std::mem::discriminant(value)
                && here != value
            {
                let before = std::mem::replace(here, value.clone());
                changes.lights.push((*light, before, value.clone()));
            }
        }
        changes
    }

    /// The number of a light among the area lights.
    pub(super) fn area_light(&self, light: u32) -> Option<usize> {
        let is_area = |l: &&Light| matches!(l, Light::Area { .. });
        let here = self.lights.get(light as usize).filter(is_area);
        here.map(|_| self.lights[..light as usize].iter().filter(is_area).count())
    }

    /// What an instance of the display's own scene for rays is: objects come first, then area lights.
    pub(super) fn thing(&self, instance: u32) -> Option<Thing> {
        let Some(k) = (instance as usize).checked_sub(self.objects.len()) else {
            return Some(Thing::Object(instance));
        };
        let lights = self.lights.iter().zip(0u32..);
        let mut areas = lights.filter(|(l, _)| matches!(l, Light::Area { .. }));
        areas.nth(k).map(|(_, i)| Thing::Light(i))
    }

    /// What moved and can stand before something.
    pub(super) fn shifts(&self, changes: &Changes) -> Vec<Shift> {
        let objects = changes
            .objects
            .iter()
            .filter_map(|(object, before, after)| {
                Some(Shift {
                    bounds: self.objects.get(*object as usize)?.bounds,
                    before: wide(before),
                    after: wide(after),
                    light: None,
                })
            });
        let lights = changes.lights.iter().filter_map(|(light, before, after)| {
            let (Light::Area { vertices: old, .. }, Light::Area { vertices: new, .. }) =
                (before, after)
            else {
                return None;
            };
            // Each box in a space of its own: that of the world, shifted to the box's lowest corner.
            let ([a, b], [c, d]) = (bounds_of(old), bounds_of(new));
            (old != new).then(|| Shift {
                bounds: [Vec3::ZERO, (b - a).max(d - c)],
                before: DAffine3::from_translation(a.as_dvec3()),
                after: DAffine3::from_translation(c.as_dvec3()),
                light: Some(*light),
            })
        });
        objects.chain(lights).collect()
    }

    /// The old and the new shadow volumes of what moved, for every light but those that changed, which need no shadow to
    /// change what they light.
    pub(super) fn shadows(&self, changes: &Changes, shifts: &[Shift]) -> Vec<Umbrella> {
        let changed = |light: u32| changes.lights.iter().any(|(l, ..)| *l == light);
        let mut all = Vec::new();
        for (light, index) in self.lights.iter().zip(0u32..) {
            if changed(index) {
                continue;
            }
            let ends = ends(light);
            for shift in shifts.iter().filter(|s| s.light != Some(index)) {
                let volume = |at| Umbrella::new(shift.bounds, at, &ends);
                all.extend([&shift.before, &shift.after].into_iter().filter_map(volume));
            }
        }
        all
    }
}

impl Shift {
    /// Where the box stood, and stands, before the eye.
    pub(super) fn before_the_eye(&self, eye: Vec3) -> [Option<Umbrella>; 2] {
        [&self.before, &self.after].map(|at| Umbrella::new(self.bounds, at, &[eye]))
    }
}

/// Whether a light shines on a point at all, wherever the point's surface faces.
pub(super) fn shines_on(light: &Light, p: Vec3) -> bool {
    let Light::Area { vertices, radiance } = light else {
        return true;
    };
    let normal = normal(vertices);
    let corner = vertices.first().map_or(Vec3::ZERO, |v| Vec3::from(*v));
    // Half a thousandth of the distance for rounding.
    let ahead = (p - corner).dot(normal);
    *radiance != [0.0; 3] && ahead >= -5e-4 * (p - corner).length()
}

/// Points that all of a light is between.
fn ends(light: &Light) -> Vec<Vec3> {
    match light {
        Light::Point { position, .. } => vec![Vec3::from(*position)],
        Light::Linear { from, to, .. } => vec![Vec3::from(*from), Vec3::from(*to)],
        Light::Area { vertices, .. } => vertices.iter().map(|v| Vec3::from(*v)).collect(),
    }
}

fn normal(vertices: &[[f32; 3]]) -> Vec3 {
    let p = |i: usize| Vec3::from(vertices[i]);
    let fan = (2..vertices.len()).map(|i| (p(i - 1) - p(0)).cross(p(i) - p(0)));
    fan.sum::<Vec3>().normalize_or_zero()
}

const NOTHING: [Vec3; 2] = [Vec3::INFINITY, Vec3::NEG_INFINITY];

fn bounds_of(points: &[[f32; 3]]) -> [Vec3; 2] {
    points.iter().fold(NOTHING, |[low, high], p| {
        let p = Vec3::from(*p);
        [low.min(p), high.max(p)]
    })
}

fn mesh_bounds(mesh: &protocol::scene::Mesh) -> [Vec3; 2] {
    let used = mesh.faces.iter().flatten();
    used.fold(NOTHING, |[low, high], &v| {
        match mesh.positions.get(v as usize) {
            Some(p) => [low.min(Vec3::from(*p)), high.max(Vec3::from(*p))],
            None => [low, high],
        }
    })
}

/// Rows of a transform as a map in double precision.
pub(crate) fn wide(rows: &Affine) -> DAffine3 {
    let column = |k: usize| DVec3::from([rows[0][k], rows[1][k], rows[2][k]].map(f64::from));
    DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(1), column(2)), column(3))
}
