//! Faces of a mesh in a hierarchy that a shadow event walks down (paper section 6.4, "Shadow edge computation").

use std::ops::Range;
use std::sync::Arc;

use fearless_simd::{Level, dispatch, f32x8, prelude::*};
use fearless_simd_macros::simd;
use glam::DVec3;
use protocol::scene::Mesh;

use super::faces_build;
use crate::edges::adjacency::Adjacency;

/// Nodes are tested in groups of this many.
pub(super) const LANES: usize = 8;
/// Count of a node that is not a leaf.
pub(super) const INNER: u32 = u32::MAX;
/// A vertex of no face.
pub(super) const NO_VERTEX: u32 = u32::MAX;
/// Bounds the relative rounding error of a test in `f32`.
const ROUNDING: f32 = 1.0 / (1 << 20) as f32;

/// Eight sibling nodes, by component; what is read first comes first.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct Group {
    pub(super) centre: [[f32; LANES]; 3],
    pub(super) half: [[f32; LANES]; 3],
    /// Leaf: its first face, in the tree's order. Otherwise the group of its children.
    pub(super) start: [u32; LANES],
    /// Faces of a leaf; [`INNER`]; 0 where there is no node.
    pub(super) count: [u32; LANES],
    pub(super) normal: [[f32; LANES]; 3],
    /// Half the extent of the interval vector of normals.
    pub(super) spread: [[f32; LANES]; 3],
    /// Least `N · (V - centre)` over the faces; minus infinity if one of them can be lit from both sides.
    pub(super) offset: [f32; LANES],
}

/// A bounding-volume hierarchy over the faces of a mesh, with an interval vector of normals at every node, in object space.
///
/// Faces that take no part in the [`Adjacency`] (without area, or repeats of others) are left out. Moving or scaling an
/// object changes nothing here.
#[derive(Clone, Debug)]
pub struct FaceTree {
    pub(super) adjacency: Arc<Adjacency>,
    pub(super) groups: Vec<Group>,
    /// Vertices of the faces in the tree's order.
    pub(super) corners: Vec<[u32; 3]>,
    /// Positions of those vertices, in the order in which the faces name them first, so that neighbours lie together.
    pub(super) positions: Vec<[f32; 3]>,
    /// The tree's number of each welded vertex of the adjacency; [`NO_VERTEX`] if no face has it.
    pub(super) vertices: Vec<u32>,
    /// Indices of those faces in the mesh.
    pub(super) faces: Vec<u32>,
    /// Greatest 1-norm of a corner.
    pub(super) reach: f32,
    pub(super) level: Level,
}

/// A node by itself, for walks down two trees at once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FaceNode {
    /// Middle of its box, object space.
    pub(crate) centre: DVec3,
    /// Half the size of its box.
    pub(crate) half: DVec3,
    start: u32,
    count: u32,
}

impl FaceNode {
    /// Whether it holds faces, not nodes.
    pub(crate) fn is_leaf(&self) -> bool {
        self.count != INNER
    }

    /// The faces of a leaf, by the tree's order.
    pub(crate) fn run(&self) -> Range<usize> {
        self.start as usize..(self.start + self.count) as usize
    }
}

/// The points with `normal · p >= offset`.
#[derive(Clone, Copy, Debug)]
pub(super) struct HalfSpace {
    pub(super) normal: DVec3,
    pub(super) offset: f64,
}

/// A convex part of a plane, in the form in which nodes are tested.
#[derive(Clone, Copy, Debug)]
pub(super) struct Region {
    /// Unit normal and offset of the plane, and then of the half-spaces.
    planes: [[f32; 4]; 4],
    /// Absolute normal, and what rounding may come to.
    reach: [[f32; 4]; 4],
}

/// Two ends of a light, in the form in which nodes are tested.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightEnds {
    ends: [[f32; 3]; 2],
    slack: f32,
}

impl FaceTree {
    /// Sorts the faces of a mesh into a tree. The adjacency must be the mesh's own.
    pub fn new(mesh: &Mesh, adjacency: Arc<Adjacency>) -> Self {
        faces_build::build(mesh, adjacency)
    }

    /// Faces that take part.
    pub fn len(&self) -> usize {
        self.faces.len()
    }

    /// Whether no face takes part.
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    /// Corners of the box around the faces.
    pub fn bounds(&self) -> [DVec3; 2] {
        self.adjacency.bounds.map(|p| DVec3::from(p.map(f64::from)))
    }

    /// The welded mesh that this is a tree of.
    pub fn adjacency(&self) -> &Arc<Adjacency> {
        &self.adjacency
    }

    /// Bytes held, the adjacency not counted.
    pub fn bytes(&self) -> usize {
        let nodes = self.groups.len() * size_of::<Group>();
        nodes + self.faces.len() * 16 + self.positions.len() * 12 + self.vertices.len() * 4
    }

    /// The tree's number of a welded vertex; [`NO_VERTEX`] if it is not there.
    pub(super) fn own_vertex(&self, welded: u32) -> u32 {
        let own = self.vertices.get(welded as usize);
        own.copied().unwrap_or(NO_VERTEX)
    }

    /// Position of a vertex by the tree's number.
    #[inline]
    pub(crate) fn position(&self, vertex: u32) -> DVec3 {
        DVec3::from(self.positions[vertex as usize].map(f64::from))
    }

    /// Vertices of a face, both by the tree's order.
    pub(crate) fn corners(&self, face: usize) -> [u32; 3] {
        self.corners[face]
    }

    /// Index in the mesh of a face by the tree's order.
    pub(crate) fn face(&self, face: usize) -> u32 {
        self.faces[face]
    }

    /// The node that holds all.
    pub(crate) fn root(&self) -> FaceNode {
        let [low, high] = self.bounds();
        FaceNode {
            centre: (low + high) * 0.5,
            half: (high - low) * 0.5,
            start: 0,
            count: if self.groups.is_empty() { 0 } else { INNER },
        }
    }

    /// The nodes below a node that is no leaf.
    pub(crate) fn children(&self, node: &FaceNode) -> impl Iterator<Item = FaceNode> {
        let group = &self.groups[node.start as usize];
        let lanes = (0..LANES).filter(|i| group.count[*i] != 0);
        lanes.map(|i| {
            let at = |x: &[[f32; LANES]; 3]| DVec3::from([0, 1, 2].map(|k| f64::from(x[k][i])));
            FaceNode {
                centre: at(&group.centre),
                half: at(&group.half),
                start: group.start[i],
                count: group.count[i],
            }
        })
    }

    /// A plane and half-spaces as nodes are tested with.
    pub(super) fn region(&self, plane: HalfSpace, sides: [HalfSpace; 3]) -> Region {
        let all = [plane, sides[0], sides[1], sides[2]].map(|h| {
            let length = h.normal.length();
            let scale = if length > 0.0 { 1.0 / length } else { 0.0 };
            (h.normal * scale, h.offset * scale)
        });
        let planes = all.map(|(n, d)| [n.x as f32, n.y as f32, n.z as f32, d as f32]);
        Region {
            planes,
            reach: planes.map(|p| {
                let slack = ROUNDING * (self.reach + p[3].abs());
                [p[0].abs(), p[1].abs(), p[2].abs(), slack]
            }),
        }
    }

    /// Both ends of a light, if what is turned away from it is never lit: unless it lies within the bounds, and may be
    /// inside a closed surface.
    pub(super) fn light_outside(&self, ends: [DVec3; 2]) -> Option<LightEnds> {
        let [low, high] = self.bounds();
        let (least, most) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        let outside = most.cmplt(low).any() || least.cmpgt(high).any();
        let size = ends.map(|e| e.abs().element_sum() as f32);
        outside.then(|| LightEnds {
            ends: ends.map(|e| e.as_vec3().to_array()),
            slack: ROUNDING * (size[0].max(size[1]) + self.reach),
        })
    }

    /// Calls `leaf` with runs of faces (in the tree's order) that together hold all that meet the region, but for some
    /// that are turned away from the light if that is given.
    pub(super) fn visit(
        &self,
        region: &Region,
        light: Option<&LightEnds>,
        stack: &mut Vec<u32>,
        mut leaf: impl FnMut(Range<usize>),
    ) {
        stack.clear();
        if !self.groups.is_empty() {
            stack.push(0);
        }
        dispatch!(self.level, simd => self.walk(simd, region, light, stack, &mut leaf));
    }

    #[simd]
    fn walk<S: Simd>(
        &self,
        simd: S,
        region: &Region,
        light: Option<&LightEnds>,
        stack: &mut Vec<u32>,
        leaf: &mut impl FnMut(Range<usize>),
    ) {
        while let Some(index) = stack.pop() {
            let group = &self.groups[index as usize];
            let mut meets = group.meets(simd, region);
            if meets == 0 {
                continue;
            }
            if let Some(light) = light {
                meets &= group.lit(simd, light);
            }
            while meets != 0 {
                let lane = meets.trailing_zeros() as usize;
                meets &= meets - 1;
                let (start, count) = (group.start[lane], group.count[lane]);
                if count == INNER {
                    stack.push(start);
                } else {
                    leaf(start as usize..(start + count) as usize);
                }
            }
        }
    }
}

impl Group {
    pub(super) const EMPTY: Self = Self {
        centre: [[0.0; LANES]; 3],
        half: [[0.0; LANES]; 3],
        normal: [[0.0; LANES]; 3],
        spread: [[0.0; LANES]; 3],
        offset: [f32::NEG_INFINITY; LANES],
        start: [0; LANES],
        count: [0; LANES],
    };

    /// A bit for each node whose box may meet the region.
    #[inline(always)]
    fn meets<S: Simd>(&self, simd: S, region: &Region) -> u32 {
        let splat = |v: f32| f32x8::splat(simd, v);
        let load = |lanes: &[f32; LANES]| f32x8::from_slice(simd, lanes);
        let (centre, half) = (
            self.centre.each_ref().map(load),
            self.half.each_ref().map(load),
        );
        let mut margin = splat(f32::INFINITY);
        for k in 0..4 {
            let [x, y, z, d] = region.planes[k].map(splat);
            let [rx, ry, rz, slack] = region.reach[k].map(splat);
            let side = x * centre[0] + y * centre[1] + z * centre[2] - d;
            let reach = rx * half[0] + ry * half[1] + rz * half[2] + slack;
            let inside = if k == 0 {
                reach - side.abs()
            } else {
                reach + side
            };
            // A NaN must not rule a node out.
            margin = inside.simd_lt(margin).select(inside, margin);
        }
        let there = self.count.iter().enumerate();
        let there = there.fold(0, |mask, (i, count)| mask | u32::from(*count != 0) << i);
        margin.simd_ge(splat(0.0)).to_bitmask() as u32 & there
    }

    /// A bit for each node of which some face may be turned to the light.
    #[inline(always)]
    fn lit<S: Simd>(&self, simd: S, light: &LightEnds) -> u32 {
        let splat = |v: f32| f32x8::splat(simd, v);
        let load = |lanes: &[f32; LANES]| f32x8::from_slice(simd, lanes);
        let behind = splat(light.slack) - load(&self.offset);
        let mut most = splat(f32::NEG_INFINITY);
        for end in &light.ends {
            let mut front = behind;
            for (k, at) in end.iter().enumerate() {
                let w = splat(*at) - load(&self.centre[k]);
                let spread = load(&self.spread[k]) + splat(ROUNDING);
                front += load(&self.normal[k]) * w + spread * w.abs();
            }
            most = front.simd_le(most).select(most, front);
        }
        // What is not a number is not turned away.
        !(most.simd_lt(splat(0.0)).to_bitmask() as u32) & ((1 << LANES) - 1)
    }
}
