//! Paths of objects and lights: keys that say how far each is from where the scene file puts it.

use glam::{DVec3, Vec3};
use protocol::messages::{LightMove, ObjectMove};
use protocol::scene::{Affine, Light, Scene};

use crate::path::{Timing, catmull_rom};
use crate::transform::affine;

/// How far an object or a light is from where the scene file puts it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionKey {
    /// Shift, world space, metres.
    pub translate: [f32; 3],
    /// Turn about x, then y, then z through the object's own place, degrees. Angles are interpolated as they are: from 0 to
    /// 360 is a whole turn. Lights do not turn.
    pub rotate: [f32; 3],
    /// Factor of its size about its own place, along the world's axes before the turn, positive. Lights keep their size.
    pub scale: [f32; 3],
    /// Factor of a light's intensity or radiance, not negative.
    pub power: f32,
}

impl MotionKey {
    /// Where the file puts it.
    pub const REST: Self = Self {
        translate: [0.0; 3],
        rotate: [0.0; 3],
        scale: [1.0; 3],
        power: 1.0,
    };

    fn values(&self) -> [f32; 10] {
        let ([a, b, c], [d, e, f], [g, h, i]) = (self.translate, self.rotate, self.scale);
        [a, b, c, d, e, f, g, h, i, self.power]
    }

    fn from_values([a, b, c, d, e, f, g, h, i, power]: [f32; 10]) -> Self {
        Self {
            translate: [a, b, c],
            rotate: [d, e, f],
            scale: [g, h, i],
            power,
        }
    }
}

/// What a [`Motion`] moves, by index in the scene's tables.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Moving {
    /// An object, or the parts of one, which keep their places to one another.
    Objects(Vec<u32>),
    /// A light.
    Light(u32),
}

/// A named path of an object or a light: a uniform Catmull-Rom spline through its keys like that of a
/// [`CameraPath`](crate::CameraPath). Paths that share a name play together.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// What `--path` calls it.
    pub name: String,
    /// What moves.
    pub moving: Moving,
    /// How its time runs.
    pub timing: Timing,
    /// At least two.
    pub keys: Vec<MotionKey>,
}

/// Scale and power stay between those of the keys: a spline that overshoots could turn an object inside out.
const BOUNDED: std::ops::Range<usize> = 6..10;

impl Motion {
    /// The place `seconds` after the start.
    pub fn at_seconds(&self, seconds: f32) -> MotionKey {
        let n = self.keys.len();
        let Some((near, u)) = self.timing.keys_near(n, seconds) else {
            return self.keys.first().copied().unwrap_or(MotionKey::REST);
        };
        let values = |i: usize| self.keys[i].values();
        let corners = near.map(|key| key.value(values));
        let mut out: [f32; 10] = std::array::from_fn(|k| catmull_rom(corners.map(|c| c[k]), u));
        for k in BOUNDED {
            let all = self.keys.iter().map(|key| key.values()[k]);
            let (low, high) = all.fold((f32::INFINITY, 0.0f32), |(l, h), v| (l.min(v), h.max(v)));
            out[k] = out[k].clamp(low, high);
        }
        MotionKey::from_values(out)
    }

    /// Adds what this path moves to these, as it is `seconds` after the start; `scene` is the scene as it was loaded.
    pub fn place(
        &self,
        scene: &Scene,
        seconds: f32,
        objects: &mut Vec<ObjectMove>,
        lights: &mut Vec<LightMove>,
    ) {
        let key = self.at_seconds(seconds);
        match &self.moving {
            Moving::Objects(parts) => {
                let pivot = pivot(scene, parts);
                for &object in parts {
                    if let Some(at_rest) = scene.objects.get(object as usize) {
                        let transform = moved(&key, pivot, &at_rest.transform);
                        objects.push(ObjectMove { object, transform });
                    }
                }
            }
            Moving::Light(light) => {
                if let Some(at_rest) = scene.lights.get(*light as usize) {
                    lights.push(LightMove {
                        light: *light,
                        value: moved_light(&key, at_rest),
                    });
                }
            }
        }
    }
}

/// The mean of the parts' origins, world space.
fn pivot(scene: &Scene, parts: &[u32]) -> DVec3 {
    let origins = parts.iter().filter_map(|&part| {
        let m = &scene.objects.get(part as usize)?.transform;
        Some(DVec3::from([m[0][3], m[1][3], m[2][3]].map(f64::from)))
    });
    origins.sum::<DVec3>() / parts.len().max(1) as f64
}

/// A transform after a key's scale and turn about a pivot, and its shift. A shift alone changes nothing else, to the bit.
fn moved(key: &MotionKey, pivot: DVec3, at_rest: &Affine) -> Affine {
    let shift = key.translate;
    if key.rotate == [0.0; 3] && key.scale == [1.0; 3] {
        let mut out = *at_rest;
        for (row, by) in out.iter_mut().zip(shift) {
            row[3] += by;
        }
        return out;
    }
    let turn = affine([0.0; 3], key.rotate, key.scale).map(|row| row.map(f64::from));
    let from = |k: usize| f64::from(at_rest[k][3]) - pivot[k];
    std::array::from_fn(|row| {
        std::array::from_fn(|column| {
            let part = |k: usize| match column {
                3 => from(k),
                _ => f64::from(at_rest[k][column]),
            };
            let sum: f64 = (0..3).map(|k| turn[row][k] * part(k)).sum();
            let offset = match column {
                3 => pivot[row] + f64::from(shift[row]),
                _ => 0.0,
            };
            (sum + offset) as f32
        })
    })
}

fn moved_light(key: &MotionKey, at_rest: &Light) -> Light {
    let shift = |p: &[f32; 3]| (Vec3::from(*p) + Vec3::from(key.translate)).to_array();
    let power = |c: &[f32; 3]| c.map(|c| c * key.power);
    match at_rest {
        Light::Point {
            position,
            intensity,
        } => Light::Point {
            position: shift(position),
            intensity: power(intensity),
        },
        Light::Linear {
            from,
            to,
            intensity,
        } => Light::Linear {
            from: shift(from),
            to: shift(to),
            intensity: power(intensity),
        },
        Light::Area { vertices, radiance } => Light::Area {
            vertices: vertices.iter().map(shift).collect(),
            radiance: power(radiance),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transform::apply;

    fn motion(keys: Vec<MotionKey>, open: bool, step: bool) -> Motion {
        let timing = Timing {
            seconds: 2.0,
            open,
            step,
        };
        Motion {
            name: "m".into(),
            moving: Moving::Light(0),
            timing,
            keys,
        }
    }

    #[test]
    fn keys_are_met_and_scale_and_power_never_leave_their_range() {
        let rest = MotionKey::REST;
        let far = MotionKey {
            translate: [1.0, 2.0, 3.0],
            rotate: [0.0, 90.0, 0.0],
            scale: [0.1; 3],
            power: 0.0,
        };
        let path = motion(vec![rest, far, far, rest], true, false);
        assert_eq!(path.at_seconds(0.0), rest);
        assert_eq!(path.at_seconds(9.0), rest);
        for i in 0..=100 {
            let key = path.at_seconds(i as f32 * 0.02);
            assert!((0.0..=1.0).contains(&key.power) && (0.1..=1.0).contains(&key.scale[0]));
        }
        let middle = path.at_seconds(2.0 / 3.0);
        assert!((middle.translate[1] - 2.0).abs() < 1e-5 && middle.power < 1e-5);
        let closed = motion(vec![rest, far], false, false);
        assert_eq!(closed.at_seconds(1.0), far);
        assert_eq!(closed.at_seconds(2.0), rest);
    }

    #[test]
    fn steps_hold_their_keys() {
        let off = MotionKey {
            power: 0.0,
            ..MotionKey::REST
        };
        let switch = motion(vec![MotionKey::REST, off], true, true);
        let power = |s: f32| switch.at_seconds(s).power;
        assert_eq!([0.0, 0.99, 1.0, 5.0].map(power), [1.0, 1.0, 0.0, 0.0]);
    }

    #[test]
    fn an_object_turns_about_its_own_place_and_a_shift_is_exact() {
        let at = affine([4.0, 1.0, 0.3], [10.0, 20.0, 30.0], [2.0; 3]);
        let pivot = DVec3::new(4.0, 1.0, f64::from(0.3f32));
        let mut key = MotionKey {
            translate: [0.5, 0.25, -1.0],
            ..MotionKey::REST
        };
        let shifted = moved(&key, pivot, &at);
        for (new, old) in shifted.iter().zip(&at) {
            assert_eq!(new[..3], old[..3]);
        }
        assert_eq!(shifted[0][3], 4.5);
        key.rotate = [0.0, 90.0, 0.0];
        let turned = moved(&key, pivot, &at);
        let (origin, arm) = (apply(&turned, [0.0; 3]), apply(&at, [1.0, 0.0, 0.0]));
        assert!((origin[0] - 4.5).abs() < 1e-6 && (origin[2] + 0.7).abs() < 1e-6);
        // About y by a quarter: what was along x is along -z.
        let to = apply(&turned, [1.0, 0.0, 0.0]);
        assert!((to[2] - origin[2] + (arm[0] - 4.0)).abs() < 1e-5);
    }
}
