//! Nodes of the eight-way trees, and the ray in the form that nodes and leaves want.

use glam::{Vec3, Vec3A, Vec3Swizzles};

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
    pub(crate) fn bits(self) -> u32 {
        self.0
    }

    /// What [`bits`](Self::bits) came from.
    #[inline(always)]
    pub(crate) fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    #[inline(always)]
    pub(crate) fn index(self) -> usize {
        (self.0 & !Self::LEAF) as usize
    }
}

/// Rows of [`Node::bounds`]. An enumeration, so that indexing by it needs no check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Row {
    MinX,
    MinY,
    MinZ,
    MaxX,
    MaxY,
    MaxZ,
}

/// Axes, for indexing without a check too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Axis {
    X,
    Y,
    Z,
}

/// Eight children: bounds as structure of arrays, rows x, y, z of the minimum and then of the maximum.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Node {
    pub(crate) bounds: [[f32; WIDTH]; 6],
    pub(crate) children: [Link; WIDTH],
    /// Bits of the lanes with leaves.
    pub(crate) leaves: u32,
}

impl Node {
    pub(crate) fn empty() -> Self {
        let (low, high) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
        Self {
            bounds: [low, low, low, high, high, high],
            children: [Link::NONE; WIDTH],
            leaves: 0,
        }
    }

    pub(crate) fn set_child(&mut self, lane: usize, link: Link, bounds: &Bounds) {
        self.children[lane] = link;
        self.leaves |= u32::from(link.is_leaf()) << lane;
        self.set_bounds(lane, bounds);
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
    /// Nodes on the longest way down.
    pub(crate) depth: usize,
}

impl Tree {
    /// Room that a traversal needs for nodes still to be visited.
    pub(crate) fn stack_size(&self) -> usize {
        WIDTH * (self.depth + 1)
    }
}

/// One side of the slab test: which planes, and what takes them to distances along a ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Planes {
    pub(crate) rows: [Row; 3],
    pub(crate) origin: [f32; 3],
    pub(crate) inverse: [f32; 3],
}

/// A ray prepared for one tree.
///
/// Boxes are tested as if grown on every side by a pad that covers the rounding of both the slab test and the
/// triangle test: 8 ulp of the largest coordinate of tree and origin. The pad is put into the origin, once for the near
/// planes and once for the far ones, so that stored boxes stay tight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalRay {
    pub(crate) near: Planes,
    pub(crate) far: Planes,
    /// Axes in the order x, y, z of the sheared space; z is the direction's largest component.
    pub(crate) axes: [Axis; 3],
    /// In that order.
    pub(crate) origin: [f32; 3],
    /// Shear to that space (Woop, Benthin and Wald 2013, section 3).
    pub(crate) shear: [f32; 3],
}

/// Largest inverse of a direction: finite, so that a plane through the origin is at distance 0 and no number is NaN.
const MAX_INVERSE: f32 = 1e37;

impl LocalRay {
    /// Prepares `ray` for a tree whose coordinates are at most `extent` in size.
    #[inline(always)]
    pub(crate) fn new(ray: &Ray, extent: f32) -> Self {
        Self::with_slack(ray, extent, 1.)
    }

    /// The same with a pad `slack` times as large.
    #[inline(always)]
    pub(crate) fn with_slack(ray: &Ray, extent: f32, slack: f32) -> Self {
        let (origin, direction) = (Vec3A::from(ray.origin), Vec3A::from(ray.direction));
        let size = direction.abs();
        let pad = slack * 8. * f32::EPSILON * extent.max(origin.abs().max_element());
        let pad = Vec3A::splat(pad).copysign(direction);
        let inverse = direction.recip();
        let limit = Vec3A::splat(MAX_INVERSE);
        let clamped = inverse.clamp(-limit, limit).to_array();
        let [x_back, y_back, z_back] = direction.to_array().map(f32::is_sign_negative);
        let row = |back: bool, min: Row, max: Row| if back { max } else { min };
        let near_rows = [
            row(x_back, Row::MinX, Row::MaxX),
            row(y_back, Row::MinY, Row::MaxY),
            row(z_back, Row::MinZ, Row::MaxZ),
        ];
        let far_rows = [
            row(x_back, Row::MaxX, Row::MinX),
            row(y_back, Row::MaxY, Row::MinY),
            row(z_back, Row::MaxZ, Row::MinZ),
        ];

        // Swizzles rather than indices: they stay in registers.
        let (axes, sheared_origin, direction, inverse) = if size.x > size.y && size.x > size.z {
            let axes = [Axis::Y, Axis::Z, Axis::X];
            (axes, origin.yzx(), direction.yzx(), inverse.yzx())
        } else if size.x <= size.y && size.y > size.z {
            let axes = [Axis::Z, Axis::X, Axis::Y];
            (axes, origin.zxy(), direction.zxy(), inverse.zxy())
        } else {
            ([Axis::X, Axis::Y, Axis::Z], origin, direction, inverse)
        };
        let shear = (direction * inverse.z).with_z(inverse.z);
        Self {
            near: Planes {
                rows: near_rows,
                origin: (origin + pad).to_array(),
                inverse: clamped,
            },
            far: Planes {
                rows: far_rows,
                origin: (origin - pad).to_array(),
                inverse: clamped,
            },
            axes,
            origin: sheared_origin.to_array(),
            shear: shear.to_array(),
        }
    }
}
