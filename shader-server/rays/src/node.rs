//! Nodes of the eight-way trees, and the ray in the form that nodes and leaves want.

use glam::Vec3;

use crate::{Bounds, Ray};

/// Children a node, triangles a leaf.
pub(crate) const WIDTH: usize = 8;

/// Where a child is: an inner node, or a leaf (a block of triangles, or an instance).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Link(u32);

impl Link {
    /// A lane without a child; its bounds are empty, so it is never followed.
    pub(crate) const NONE: Self = Self(u32::MAX);
    const LEAF: u32 = 1 << 31;

    pub(crate) fn node(index: usize) -> Self {
        debug_assert!(index < Self::LEAF as usize);
        Self(index as u32)
    }

    pub(crate) fn leaf(index: usize) -> Self {
        debug_assert!(index < (Self::LEAF - 1) as usize);
        Self(index as u32 | Self::LEAF)
    }

    #[inline(always)]
    pub(crate) fn is_none(self) -> bool {
        self == Self::NONE
    }

    #[inline(always)]
    pub(crate) fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    #[inline(always)]
    pub(crate) fn index(self) -> usize {
        (self.0 & !Self::LEAF) as usize
    }
}

/// Eight children: bounds as structure of arrays, rows x, y, z of the minimum and then of the maximum.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Node {
    pub(crate) bounds: [[f32; WIDTH]; 6],
    pub(crate) children: [Link; WIDTH],
}

impl Node {
    pub(crate) fn empty() -> Self {
        let (low, high) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
        Self {
            bounds: [low, low, low, high, high, high],
            children: [Link::NONE; WIDTH],
        }
    }

    pub(crate) fn set_bounds(&mut self, lane: usize, bounds: &Bounds) {
        for axis in 0..3 {
            self.bounds[axis][lane] = bounds.min[axis];
            self.bounds[axis + 3][lane] = bounds.max[axis];
        }
    }

    /// Bounds of all children.
    pub(crate) fn total_bounds(&self) -> Bounds {
        let least = |row: usize| {
            self.bounds[row]
                .iter()
                .copied()
                .fold(f32::INFINITY, f32::min)
        };
        let most = |row: usize| {
            self.bounds[row]
                .iter()
                .copied()
                .fold(f32::NEG_INFINITY, f32::max)
        };
        Bounds {
            min: Vec3::new(least(0), least(1), least(2)),
            max: Vec3::new(most(3), most(4), most(5)),
        }
    }
}

/// A tree of eight-way nodes; node 0 is the root, parents come before their children.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tree {
    pub(crate) nodes: Vec<Node>,
}

/// A ray prepared for one tree.
///
/// Boxes are tested as if grown on every side by a pad that covers the rounding of both the slab test and the
/// triangle test: 8 ulp of the largest coordinate of tree and origin. The pad is put into the origin, once for the near
/// planes and once for the far ones, so that stored boxes stay tight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalRay {
    pub(crate) origin: [f32; 3],
    pub(crate) near_origin: [f32; 3],
    pub(crate) far_origin: [f32; 3],
    pub(crate) inverse: [f32; 3],
    /// Row of [`Node::bounds`] with the near plane, for each axis.
    pub(crate) near_row: [usize; 3],
    /// Row with the far plane.
    pub(crate) far_row: [usize; 3],
    /// Axes in the order x, y, z of the sheared space; z is the direction's largest component.
    pub(crate) axes: [usize; 3],
    /// Shear to that space (Woop, Benthin and Wald 2013, section 3).
    pub(crate) shear: [f32; 3],
}

impl LocalRay {
    /// Prepares `ray` for a tree whose coordinates are at most `extent` in size.
    #[inline(always)]
    pub(crate) fn new(ray: &Ray, extent: f32) -> Self {
        Self::with_slack(ray, extent, 1.)
    }

    /// The same with a pad `slack` times as large.
    #[inline(always)]
    pub(crate) fn with_slack(ray: &Ray, extent: f32, slack: f32) -> Self {
        let origin = ray.origin.to_array();
        let direction = ray.direction.to_array();
        let pad = slack * 8. * f32::EPSILON * extent.max(ray.origin.abs().max_element());

        let mut near_origin = origin;
        let mut far_origin = origin;
        let mut inverse = [0.; 3];
        let mut near_row = [0, 1, 2];
        let mut far_row = [3, 4, 5];
        for axis in 0..3 {
            // A zero gives an infinity of its sign; a plane at 0·∞ is NaN, which the slab test ignores.
            inverse[axis] = 1. / direction[axis];
            if direction[axis].is_sign_negative() {
                near_row[axis] = axis + 3;
                far_row[axis] = axis;
                near_origin[axis] -= pad;
                far_origin[axis] += pad;
            } else {
                near_origin[axis] += pad;
                far_origin[axis] -= pad;
            }
        }

        let size = [direction[0].abs(), direction[1].abs(), direction[2].abs()];
        let z = if size[0] > size[1] {
            if size[0] > size[2] { 0 } else { 2 }
        } else if size[1] > size[2] {
            1
        } else {
            2
        };
        let x = if z == 2 { 0 } else { z + 1 };
        let y = if x == 2 { 0 } else { x + 1 };
        let shear = [
            direction[x] / direction[z],
            direction[y] / direction[z],
            1. / direction[z],
        ];
        Self {
            origin,
            near_origin,
            far_origin,
            inverse,
            near_row,
            far_row,
            axes: [x, y, z],
            shear,
        }
    }
}
