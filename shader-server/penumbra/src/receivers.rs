//! Points that want to know what they see of a light.

use glam::Vec3;

use crate::{
    lanes::{LANES, LEAST},
    light::{Box3, Light},
    mesh::NONE,
    predicate,
};

/// A batch of receivers as structure of arrays, all of the same length.
#[derive(Clone, Debug, Default)]
pub struct Receivers {
    /// Where shadow rays would start: world space, metres, lifted off the receiver's surface by what rounding needs.
    pub origins: Vec<Vec3>,
    /// Unit shading normals, world space: samples below the horizon count as blocked, the others weigh by the cosine. Zero for
    /// a receiver without a horizon.
    pub normals: Vec<Vec3>,
    /// Instance and face that each is on, which do not block it; past the end for none.
    pub own: Vec<(u32, u32)>,
    /// Which set of samples each uses, modulo the light's number of sets.
    pub sets: Vec<u8>,
}

impl Receivers {
    /// Adds one.
    pub fn push(&mut self, origin: Vec3, normal: Vec3, own: (u32, u32), set: u8) {
        self.origins.push(origin);
        self.normals.push(normal);
        self.own.push(own);
        self.sets.push(set);
    }

    /// Empties the list and keeps its memory.
    pub fn clear(&mut self) {
        self.origins.clear();
        self.normals.clear();
        self.own.clear();
        self.sets.clear();
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.origins.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.origins.is_empty()
    }
}

/// A receiver in light space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Point {
    pub(crate) at: [f32; 3],
    pub(crate) normal: [f32; 3],
    /// Key of its own polygon, or [`NONE`].
    pub(crate) own: u32,
    pub(crate) set: u32,
    /// Its number in the batch.
    pub(crate) index: u32,
}

impl Point {
    pub(crate) fn new(
        light: &Light,
        receivers: &Receivers,
        index: usize,
        key: impl Fn((u32, u32)) -> u32,
    ) -> Self {
        Self {
            at: light.to_light(receivers.origins[index].as_dvec3()),
            normal: light.rotate(receivers.normals[index]),
            own: key(receivers.own[index]),
            set: u32::from(receivers.sets[index]) % light.sampling().sets,
            index: index as u32,
        }
    }

    /// Whether any of the light can reach it: it is finite, the light shines its way, and its horizon does not hide all.
    pub(crate) fn may_see(&self, light: &Light) -> bool {
        let finite = self.at.iter().chain(&self.normal).all(|x| x.is_finite());
        finite
            && (!light.is_planar() || self.at[2] > 0.)
            && (self.normal == [0.; 3] || {
                let horizon = predicate::horizon(self.at, self.normal);
                highest(&horizon, &light.bounds) >= LEAST
            })
    }
}

/// Highest value of a condition in a box.
fn highest(condition: &predicate::Condition, bounds: &Box3) -> f32 {
    let term = |n: f32, axis: usize| (n * bounds.min[axis]).max(n * bounds.max[axis]);
    ((term(condition.x, 0) + term(condition.y, 1)) + term(condition.z, 2)) + condition.constant
}

/// Up to sixteen receivers that are near each other, all of which may see something of the light.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Leaf {
    pub(crate) at: [[f32; LANES]; 3],
    pub(crate) normal: [[f32; LANES]; 3],
    pub(crate) own: [u32; LANES],
    pub(crate) set: [u32; LANES],
    pub(crate) index: [u32; LANES],
    pub(crate) len: usize,
    pub(crate) bounds: Box3,
}

impl Leaf {
    pub(crate) fn new(points: &[Point]) -> Self {
        let mut leaf = Self {
            at: [[0.; LANES]; 3],
            normal: [[0.; LANES]; 3],
            own: [NONE; LANES],
            set: [0; LANES],
            index: [NONE; LANES],
            len: points.len().min(LANES),
            bounds: Box3::EMPTY,
        };
        for lane in 0..LANES {
            // Lanes past the end repeat the last receiver: no numbers out of the ordinary.
            let Some(point) = points.get(lane).or(points.last()) else {
                break;
            };
            for axis in 0..3 {
                leaf.at[axis][lane] = point.at[axis];
                leaf.normal[axis][lane] = point.normal[axis];
            }
            leaf.own[lane] = point.own;
            leaf.set[lane] = point.set;
            if lane < leaf.len {
                leaf.index[lane] = point.index;
                leaf.bounds.add(point.at);
            }
        }
        leaf
    }

    pub(crate) fn point(&self, lane: usize) -> [f32; 3] {
        self.at.map(|row| row[lane])
    }

    pub(crate) fn normal(&self, lane: usize) -> [f32; 3] {
        self.normal.map(|row| row[lane])
    }
}

/// Sorts points so that each sixteen are near each other, in any number of threads the same.
pub(crate) fn sort_into_leaves(points: &mut [Point]) {
    if points.len() <= LANES {
        return;
    }
    let mut span = Box3::EMPTY;
    points.iter().for_each(|point| span.add(point.at));
    let extent = |axis: usize| span.max[axis] - span.min[axis];
    let axis = (0..3)
        .max_by(|a, b| extent(*a).total_cmp(&extent(*b)))
        .unwrap_or(0);
    let leaves = points.len().div_ceil(LANES);
    let middle = leaves / 2 * LANES;
    points.select_nth_unstable_by(middle, |a, b| {
        a.at[axis]
            .total_cmp(&b.at[axis])
            .then(a.index.cmp(&b.index))
    });
    let (left, right) = points.split_at_mut(middle);
    if left.len() > 4096 {
        rayon::join(|| sort_into_leaves(left), || sort_into_leaves(right));
    } else {
        sort_into_leaves(left);
        sort_into_leaves(right);
    }
}
