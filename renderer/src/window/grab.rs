//! Taking hold of an object or a light with the pointer, and putting it elsewhere. Knows nothing of windows.

use glam::Vec3;
use protocol::messages::{LightMove, ObjectMove};
use protocol::scene::{Affine, Light};

use crate::camera::View;
use crate::frame::{Edit, Placed, Thing};

/// How near the pointer must come to a light without area, pixels.
const NEAR_PX: f32 = 12.0;

/// Farthest that one drag takes a thing, as a multiple of its distance from the eye when it was grabbed.
const FARTHEST: f32 = 50.0;

/// In which plane through the point that was grabbed a thing moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Plane {
    /// Parallel to the screen.
    Screen,
    /// Level.
    Ground,
}

/// A thing as it was when it was grabbed.
#[derive(Clone, Debug)]
pub(super) struct Grab {
    thing: Thing,
    at: Vec3,
    reach: f32,
    before: Edit,
}

impl Grab {
    /// Takes hold of what was picked: at a world point.
    pub(super) fn new(placed: &Placed, thing: Thing, at: Vec3, eye: Vec3) -> Option<Self> {
        let mut before = Edit::default();
        match thing {
            Thing::Object(object) => {
                let transform = *placed.transform(object)?;
                before.objects.push(ObjectMove { object, transform });
            }
            Thing::Light(light) => {
                let value = placed.lights().get(light as usize)?.clone();
                before.lights.push(LightMove { light, value });
            }
        }
        Some(Self {
            thing,
            at,
            reach: (at - eye).length(),
            before,
        })
    }

    /// What is held.
    pub(super) fn thing(&self) -> Thing {
        self.thing
    }

    /// What puts it back.
    pub(super) fn before(&self) -> &Edit {
        &self.before
    }

    /// What puts it under image point (x, y) px of the view; nothing if no place in the plane is there.
    pub(super) fn to(
        &self,
        view: &View,
        (x, y): (f32, f32),
        plane: Plane,
        up: Vec3,
    ) -> Option<Edit> {
        let direction = view.direction(x, y);
        let normal = match plane {
            Plane::Screen => view.forward,
            Plane::Ground => up,
        };
        let along = (self.at - view.eye).dot(normal) / direction.dot(normal);
        let to = view.eye + direction * along;
        let by = to - self.at;
        let there = along > 0.0 && by.is_finite() && by.length() <= FARTHEST * self.reach;
        there.then(|| self.shifted(by))
    }

    fn shifted(&self, by: Vec3) -> Edit {
        let mut edit = self.before.clone();
        for moved in &mut edit.objects {
            shift(&mut moved.transform, by);
        }
        for moved in &mut edit.lights {
            let shift = |p: &mut [f32; 3]| *p = (Vec3::from(*p) + by).into();
            match &mut moved.value {
                Light::Point { position, .. } => shift(position),
                Light::Linear { from, to, .. } => [from, to].into_iter().for_each(shift),
                Light::Area { vertices, .. } => vertices.iter_mut().for_each(shift),
            }
        }
        edit
    }
}

fn shift(transform: &mut Affine, by: Vec3) {
    for (row, by) in transform.iter_mut().zip(by.to_array()) {
        row[3] += by;
    }
}

/// Where lights without area are in the image, px: their numbers and marked points.
pub(super) fn markers<'a>(
    lights: &'a [Light],
    view: &'a View,
) -> impl Iterator<Item = (u32, Vec3, [f32; 2])> + 'a {
    lights.iter().zip(0u32..).filter_map(|(light, index)| {
        let at = match light {
            Light::Point { position, .. } => Vec3::from(*position),
            Light::Linear { from, to, .. } => (Vec3::from(*from) + Vec3::from(*to)) * 0.5,
            Light::Area { .. } => return None,
        };
        let (x, y, _) = view.project(at)?;
        Some((index, at, [x, y]))
    })
}

/// The light without area whose marker is nearest to an image point, if one is near.
pub(super) fn near_light(
    lights: &[Light],
    view: &View,
    (x, y): (f32, f32),
) -> Option<(Thing, Vec3)> {
    let away = |p: [f32; 2]| (p[0] - x).hypot(p[1] - y);
    let all = markers(lights, view).map(|(light, at, p)| (away(p), light, at));
    let nearest = all.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (nearest.0 <= NEAR_PX).then_some((Thing::Light(nearest.1), nearest.2))
}

#[cfg(test)]
mod tests {
    use protocol::messages::Camera;

    use super::*;
    use crate::config::Choices;
    use crate::frame::Display;

    fn view() -> View {
        let camera = scenes::builtin("chains").unwrap().camera;
        View::new(&Camera {
            eye: camera.eye,
            target: camera.target,
            up: camera.up,
            fov_y: camera.fov_y,
            width: 200,
            height: 160,
        })
    }

    #[test]
    fn what_is_picked_follows_the_pointer_and_goes_back() {
        let scene = scenes::builtin("chains").unwrap().scene;
        let mut display = Display::new(&scene, Choices::default(), 8, 8, 1);
        let view = view();
        let link = scene
            .objects
            .iter()
            .position(|o| o.name == "green/6")
            .unwrap() as u32;
        // The link's tube, half a metre from its middle along its own x axis.
        let [x, y, z] = scene.objects[link as usize].transform;
        let place = Vec3::from([x, y, z].map(|r| 0.55 * r[0] + r[3]));
        let (px, py, _) = view.project(place).unwrap();
        let (thing, at) = display.pick(&view, (px, py)).unwrap();
        assert_eq!(thing, Thing::Object(link));
        let grab = Grab::new(display.placed(), thing, at, view.eye).unwrap();
        assert_eq!(
            grab.to(&view, (px, py), Plane::Screen, Vec3::Y)
                .unwrap()
                .objects
                .len(),
            1
        );

        let to = (px - 30.0, py + 11.0);
        for plane in [Plane::Screen, Plane::Ground] {
            let edit = grab.to(&view, to, plane, Vec3::Y).unwrap();
            let new = edit.objects[0].transform;
            let by = Vec3::from(
                [0, 1, 2].map(|k: usize| new[k][3] - grab.before().objects[0].transform[k][3]),
            );
            let (x, y, depth) = view.project(at + by).unwrap();
            assert!(
                (x - to.0).abs() < 0.05 && (y - to.1).abs() < 0.05,
                "{x} {y}"
            );
            match plane {
                Plane::Screen => assert!((depth - view.project(at).unwrap().2).abs() < 1e-3),
                Plane::Ground => assert!(by.y.abs() < 1e-5 && by.length() > 0.1),
            }
            display.edit(1, &edit);
            let (again, _) = display.pick(&view, to).unwrap();
            assert_eq!(again, Thing::Object(link));
        }
        // Above the horizon no level place is under the pointer.
        let sky = View::new(&Camera {
            target: [0.0, 9.0, 0.0],
            ..view.camera()
        });
        assert!(
            grab.to(&sky, (100.0, 2.0), Plane::Ground, Vec3::Y)
                .is_none()
        );
        display.edit(2, grab.before());
        assert_eq!(
            display.placed().transform(link),
            Some(&scene.objects[link as usize].transform)
        );
    }

    #[test]
    fn lights_without_area_are_picked_by_their_markers() {
        let view = view();
        let at = Vec3::new(0.5, 1.0, 0.0);
        let lights = [Light::Point {
            position: at.into(),
            intensity: [1.0; 3],
        }];
        let (x, y, _) = view.project(at).unwrap();
        assert_eq!(
            near_light(&lights, &view, (x + 8.0, y + 8.0)),
            Some((Thing::Light(0), at))
        );
        assert_eq!(near_light(&lights, &view, (x + 9.0, y + 9.0)), None);
    }
}
