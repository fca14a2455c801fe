//! Camera paths: closed or open Catmull-Rom splines through their keys.

use glam::Vec3;

/// Where the camera is and what it looks at, world space, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathKey {
    /// The camera's place.
    pub eye: [f32; 3],
    /// A point in the middle of the picture.
    pub target: [f32; 3],
}

/// A named way through the scene: a uniform Catmull-Rom spline, so it passes through every key, and each stretch between
/// two keys takes as long as any other.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraPath {
    /// What `--path` calls it.
    pub name: String,
    /// Time for the whole of it, seconds, positive.
    pub seconds: f32,
    /// If true it ends at the last key, else it returns to the first.
    pub open: bool,
    /// At least two if open, at least three if closed.
    pub keys: Vec<PathKey>,
}

impl CameraPath {
    /// The camera at `t`: 0 is the first key; 1 is the first key again, or the last if the path is open. A closed path
    /// repeats outside [0, 1), an open one stays at its ends.
    pub fn at(&self, t: f32) -> PathKey {
        let n = self.keys.len();
        if n < 2 {
            return self.keys.first().copied().unwrap_or(PathKey {
                eye: [0.0; 3],
                target: [0.0, 0.0, -1.0],
            });
        }
        let stretches = if self.open { n - 1 } else { n };
        let t = if !t.is_finite() {
            0.0
        } else if self.open {
            t.clamp(0.0, 1.0)
        } else {
            t.rem_euclid(1.0)
        };
        let along = t * stretches as f32;
        let index = (along as usize).min(stretches - 1);
        let u = along - index as f32;
        let near = [0, 1, 2, 3].map(|i| self.key_near(index, i));
        PathKey {
            eye: catmull_rom(near.map(|k| k.eye), u),
            target: catmull_rom(near.map(|k| k.target), u),
        }
    }

    /// The camera `seconds` after the start; a closed path repeats.
    pub fn at_seconds(&self, seconds: f32) -> PathKey {
        self.at(seconds / self.seconds)
    }

    /// Key `index + i - 1`, going round or mirrored beyond the ends.
    fn key_near(&self, index: usize, i: usize) -> PathKey {
        let n = self.keys.len();
        let mirrored = |end: usize, inner: usize| {
            let mix = |a: [f32; 3], b: [f32; 3]| std::array::from_fn(|k| 2.0 * a[k] - b[k]);
            PathKey {
                eye: mix(self.keys[end].eye, self.keys[inner].eye),
                target: mix(self.keys[end].target, self.keys[inner].target),
            }
        };
        match (self.open, index + i) {
            (true, 0) => mirrored(0, 1),
            (true, k) if k > n => mirrored(n - 1, n - 2),
            (true, k) => self.keys[k - 1],
            (false, k) => self.keys[(k + n - 1) % n],
        }
    }
}

fn catmull_rom(p: [[f32; 3]; 4], u: f32) -> [f32; 3] {
    let [a, b, c, d] = p.map(Vec3::from_array);
    let linear = (c - a) * 0.5;
    let square = a - b * 2.5 + c * 2.0 - d * 0.5;
    let cube = (d - a) * 0.5 + (b - c) * 1.5;
    (b + u * (linear + u * (square + u * cube))).to_array()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(open: bool) -> CameraPath {
        let key = |x: f32, z: f32| PathKey {
            eye: [x, 1.0, z],
            target: [z, 0.0, x],
        };
        CameraPath {
            name: "square".into(),
            seconds: 2.0,
            open,
            keys: vec![key(0.0, 0.0), key(1.0, 0.0), key(1.0, 1.0), key(0.0, 1.0)],
        }
    }

    #[test]
    fn passes_through_every_key() {
        let closed = square(false);
        let open = square(true);
        for (i, key) in closed.keys.iter().enumerate() {
            assert_eq!(closed.at(i as f32 / 4.0), *key);
            let at = open.at(i as f32 / 3.0);
            for k in 0..3 {
                assert!((at.eye[k] - key.eye[k]).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn a_closed_path_returns_and_repeats() {
        let path = square(false);
        assert_eq!(path.at(1.0), path.keys[0]);
        assert_eq!(path.at(-0.75), path.keys[1]);
        assert_eq!(path.at_seconds(2.5), path.keys[1]);
        let (before, after) = (path.at(0.999_99), path.at(0.000_01));
        for k in 0..3 {
            assert!(
                (before.eye[k] - after.eye[k]).abs() < 1e-3,
                "no jump at the seam"
            );
        }
    }

    #[test]
    fn an_open_path_stays_at_its_ends() {
        let path = square(true);
        assert_eq!(path.at(-3.0), path.keys[0]);
        assert_eq!(path.at(7.0), path.keys[3]);
        assert_eq!(path.at(f32::NAN), path.keys[0]);
    }

    #[test]
    fn a_straight_open_path_is_straight() {
        let key = |x: f32| PathKey {
            eye: [x, 0.0, 0.0],
            target: [x, 0.0, -1.0],
        };
        let path = CameraPath {
            name: "line".into(),
            seconds: 1.0,
            open: true,
            keys: vec![key(0.0), key(1.0), key(2.0)],
        };
        for i in 0..=10 {
            let t = i as f32 / 10.0;
            assert!((path.at(t).eye[0] - 2.0 * t).abs() < 1e-5);
        }
    }
}
