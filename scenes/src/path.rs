//! Paths: closed or open Catmull-Rom splines through their keys, or steps from key to key; and those of the camera.

/// Where the camera is and what it looks at, world space, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathKey {
    /// The camera's place.
    pub eye: [f32; 3],
    /// A point in the middle of the picture.
    pub target: [f32; 3],
}

/// How a path's time runs from key to key.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timing {
    /// Time for the whole of it, seconds, positive.
    pub seconds: f32,
    /// If true it ends at the last key, else it returns to the first.
    pub open: bool,
    /// If true each key is held for an equal time, and the next one follows at once.
    pub step: bool,
}

/// One of the four keys that a piece of a spline is made from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Near {
    Key(usize),
    /// Beyond an open path's end: the key at the end, and its neighbour to be mirrored in it.
    Mirrored {
        end: usize,
        inner: usize,
    },
}

impl Near {
    pub(crate) fn value<const N: usize>(self, key: impl Fn(usize) -> [f32; N]) -> [f32; N] {
        match self {
            Self::Key(i) => key(i),
            Self::Mirrored { end, inner } => {
                let (a, b) = (key(end), key(inner));
                std::array::from_fn(|k| 2.0 * a[k] - b[k])
            }
        }
    }
}

impl Timing {
    /// The keys about a moment and how far it is between the middle two, 0 to 1; nothing if there are fewer than two keys.
    pub(crate) fn keys_near(&self, n: usize, seconds: f32) -> Option<([Near; 4], f32)> {
        if n < 2 {
            return None;
        }
        let t = seconds / self.seconds;
        let t = if !t.is_finite() {
            0.0
        } else if self.open {
            t.clamp(0.0, 1.0)
        } else {
            t.rem_euclid(1.0)
        };
        if self.step {
            let index = ((t * n as f32) as usize).min(n - 1);
            return Some(([Near::Key(index); 4], 0.0));
        }
        let stretches = if self.open { n - 1 } else { n };
        let along = t * stretches as f32;
        let index = (along as usize).min(stretches - 1);
        let near = [0, 1, 2, 3].map(|i| self.key_near(n, index + i));
        Some((near, along - index as f32))
    }

    /// Key `after` less one, going round or mirrored beyond the ends.
    fn key_near(&self, n: usize, after: usize) -> Near {
        match (self.open, after) {
            (true, 0) => Near::Mirrored { end: 0, inner: 1 },
            (true, k) if k > n => Near::Mirrored {
                end: n - 1,
                inner: n - 2,
            },
            (true, k) => Near::Key(k - 1),
            (false, k) => Near::Key((k + n - 1) % n),
        }
    }
}

/// A named way of the camera through the scene: a uniform Catmull-Rom spline, so it passes through every key, and each
/// stretch between two keys takes as long as any other.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraPath {
    /// What `--path` calls it.
    pub name: String,
    /// Time for the whole of it, seconds, positive.
    pub seconds: f32,
    /// If true it ends at the last key, else it returns to the first.
    pub open: bool,
    /// If true each key is held for an equal time: the camera jumps.
    pub step: bool,
    /// At least two if open, at least three if closed.
    pub keys: Vec<PathKey>,
}

impl CameraPath {
    /// The camera at `t`: 0 is the first key; 1 is the first key again, or the last if the path is open. A closed path
    /// repeats outside [0, 1), an open one stays at its ends.
    pub fn at(&self, t: f32) -> PathKey {
        let timing = Timing {
            seconds: 1.0,
            open: self.open,
            step: self.step,
        };
        let Some((near, u)) = timing.keys_near(self.keys.len(), t) else {
            return self.keys.first().copied().unwrap_or(PathKey {
                eye: [0.0; 3],
                target: [0.0, 0.0, -1.0],
            });
        };
        let corners = near.map(|key| {
            key.value(|i| {
                let ([a, b, c], [d, e, f]) = (self.keys[i].eye, self.keys[i].target);
                [a, b, c, d, e, f]
            })
        });
        let [a, b, c, d, e, f] =
            std::array::from_fn(|k| catmull_rom(corners.map(|values| values[k]), u));
        PathKey {
            eye: [a, b, c],
            target: [d, e, f],
        }
    }

    /// The camera `seconds` after the start; a closed path repeats.
    pub fn at_seconds(&self, seconds: f32) -> PathKey {
        self.at(seconds / self.seconds)
    }
}

/// Between the second and the third value, at `u` from 0 to 1.
pub(crate) fn catmull_rom([a, b, c, d]: [f32; 4], u: f32) -> f32 {
    let linear = (c - a) * 0.5;
    let square = a - b * 2.5 + c * 2.0 - d * 0.5;
    let cube = (d - a) * 0.5 + (b - c) * 1.5;
    b + u * (linear + u * (square + u * cube))
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
            step: false,
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
            step: false,
            keys: vec![key(0.0), key(1.0), key(2.0)],
        };
        for i in 0..=10 {
            let t = i as f32 / 10.0;
            assert!((path.at(t).eye[0] - 2.0 * t).abs() < 1e-5);
        }
    }
}
