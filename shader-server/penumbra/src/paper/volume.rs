//! Penumbra volumes: planes between a polygon and the light's bounds that have one on each side (the paper's section 3.2).

use glam::{DVec3, Vec3};

use crate::{blocker::Blocker, light::Box3};

/// Most planes a volume: every edge of both, and the cap.
const MOST: usize = 24;
/// What counts as rounding when sides are told apart in double precision, relative to the scene's size.
const TINY: f64 = 1e-11;
/// By how much planes are moved outwards, relative to the scene's size: more than the blocking rule's rounding.
const MARGIN: f64 = 2e-5;
/// By how much bounds of samples are widened, relative to the scene's size.
const WIDEN: f64 = 2e-6;

/// A convex region: where all planes are not negative. Light space.
#[derive(Clone, Debug)]
pub(crate) struct Volume {
    /// Normal and constant.
    planes: [[f32; 4]; MOST],
    count: usize,
}

impl Default for Volume {
    fn default() -> Self {
        Self {
            planes: [[0.; 4]; MOST],
            count: 0,
        }
    }
}

/// What samples are bounded by: corners and the sides between them.
struct Hull {
    corners: Vec<DVec3>,
    sides: Vec<[usize; 2]>,
}

impl Hull {
    /// The rectangle around samples of a planar light, the box around others.
    fn new(bounds: &Box3, planar: bool, size: f64) -> Self {
        let mut wide = *bounds;
        for axis in 0..if planar { 2 } else { 3 } {
            wide.min[axis] -= (WIDEN * size) as f32;
            wide.max[axis] += (WIDEN * size) as f32;
        }
        let count = if planar { 4 } else { 8 };
        let corners = wide.corners()[..count]
            .iter()
            .map(|corner| Vec3::from(*corner).as_dvec3())
            .collect();
        let sides = (0..count)
            .flat_map(|from| {
                (0..3)
                    .map(move |axis| [from, from | 1 << axis])
                    .filter(move |[from, to]| from != to && *to < count)
            })
            .collect();
        Self { corners, sides }
    }
}

impl Volume {
    /// All places that `blocker` may hide from samples in `bounds`; `size` is the largest coordinate of the scene.
    pub(crate) fn new(blocker: &Blocker, bounds: &Box3, planar: bool, size: f32) -> Self {
        let size = f64::from(size);
        let hull = Hull::new(bounds, planar, size);
        let n = blocker.edges();
        let corners = blocker.corners.map(|corner| Vec3::from(corner).as_dvec3());
        let corners = &corners[..n];
        let mut volume = Self::default();
        let [lowest, highest] = blocker.heights(bounds);
        let normal = Vec3::from(blocker.normal).as_dvec3();
        let margin = (MARGIN * size) as f32;
        if lowest > margin {
            volume.add(-normal, f64::from(blocker.offset) + MARGIN * size);
        } else if highest < -margin {
            volume.add(normal, -f64::from(blocker.offset) + MARGIN * size);
        }
        for i in 0..n {
            let edge = [corners[i], corners[(i + 1) % n]];
            for corner in &hull.corners {
                volume.separate(edge, *corner, corners, &hull.corners, size);
            }
        }
        for side in &hull.sides {
            let side = side.map(|i| hull.corners[i]);
            for corner in corners {
                volume.separate(side, *corner, corners, &hull.corners, size);
            }
        }
        volume
    }

    /// Adds the plane through `line` and `point` if it has the polygon on one side and the light on the other.
    fn separate(
        &mut self,
        line: [DVec3; 2],
        point: DVec3,
        polygon: &[DVec3],
        light: &[DVec3],
        size: f64,
    ) {
        let along = line[1] - line[0];
        let normal = along.cross(point - line[0]);
        // Relative to the line's length, as the blocking rule's rounding is.
        let Some(normal) = (normal / along.length()).try_normalize() else {
            return;
        };
        let tiny = TINY * size;
        let sides = |points: &[DVec3]| {
            points
                .iter()
                .map(|p| normal.dot(*p - line[0]))
                .fold((0f64, 0f64), |(low, high), d| (low.min(d), high.max(d)))
        };
        let ((polygon_low, polygon_high), (light_low, light_high)) = (sides(polygon), sides(light));
        let turn = if polygon_low >= -tiny && light_high <= tiny {
            1.
        } else if polygon_high <= tiny && light_low >= -tiny {
            -1.
        } else {
            return;
        };
        // Where both are in the plane it tells nothing apart.
        if polygon_high - polygon_low <= tiny && light_high - light_low <= tiny {
            return;
        }
        self.add(normal * turn, -turn * normal.dot(line[0]) + MARGIN * size);
    }

    fn add(&mut self, normal: DVec3, constant: f64) {
        let plane = [normal.x, normal.y, normal.z, constant].map(|x| x as f32);
        let near = |other: &[f32; 4]| (0..4).all(|i| (plane[i] - other[i]).abs() < 1e-6);
        if self.count < MOST && !self.planes[..self.count].iter().any(near) {
            self.planes[self.count] = plane;
            self.count += 1;
        }
    }

    /// All its planes, a bit each.
    pub(crate) fn all(&self) -> u32 {
        (1 << self.count) - 1
    }

    /// Of the planes `active`, those that cut the box; none if it is outside of one.
    pub(crate) fn cut(&self, bounds: &Box3, active: u32) -> Option<u32> {
        let mut left = active;
        for i in crate::lanes::bits(active) {
            let [a, b, c, d] = self.planes[i];
            let (mut near, mut far) = (d, d);
            for (axis, n) in [a, b, c].into_iter().enumerate() {
                let (low, high) = (n * bounds.min[axis], n * bounds.max[axis]);
                near += low.min(high);
                far += low.max(high);
            }
            if far < 0. {
                return None;
            }
            if near >= 0. {
                left &= !(1 << i);
            }
        }
        Some(left)
    }

    /// Whether a point is on the inner side of all planes `active`.
    pub(crate) fn contains(&self, [x, y, z]: [f32; 3], active: u32) -> bool {
        crate::lanes::bits(active).all(|i| {
            let [a, b, c, d] = self.planes[i];
            a * x + b * y + c * z + d >= 0.
        })
    }
}
