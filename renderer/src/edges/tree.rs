//! The interval edge tree (paper section 6.4): finds the silhouettes of a mesh without looking at every edge.
//!
//! A node holds an interval vector of face normals `N`, as the paper's does. Instead of an interval vector of positions
//! it holds a reference point `c` and the interval of `N · (V - c)` over its faces: Eq. 1 is then
//! `N · (E - c) - N · (V - c)`, and the interval of that is never wider than with an interval vector for `V` and much
//! narrower for nodes that are nearly flat. Nodes are tested in `f32` with a bound on every rounding error; an edge that
//! this cannot settle is decided by [`Adjacency::facing`], so that the answer is exactly that of brute force.

use super::adjacency::{Adjacency, EyeBox, Facing};
use super::tree_build;
use crate::shadows::wedge::EventKind;

/// Nodes are tested in groups of this many.
pub(super) const LANES: usize = 8;
/// Most edges in a leaf.
pub(super) const LEAF: usize = 32;
/// Bounds the relative rounding error of a test in `f32`; the sum of all of them is below 10 · 2⁻²⁴.
const ROUNDING: f32 = 1.0 / (1 << 20) as f32;

/// Intervals are at least this wide, so that no product is denormal, which would be slow.
pub(super) const TINY: f32 = 1e-30;

/// What an edge is to a viewer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum EdgeKind {
    /// Between a face that is seen from the front and one that is seen from behind (paper section 6.1).
    Silhouette,
    /// Sharper than the object's crease angle (paper section 6.2), or between faces of different materials.
    Crease,
    /// Has one face only.
    Border,
    /// Has three or more faces, which differ in facing or meet in a crease.
    NonManifold,
    /// Where two objects pass through one another: no edge of either.
    Meeting,
    /// Where a shadow begins or ends on a surface (paper section 6.3).
    Shadow(EventKind),
}

/// Eight sibling nodes, by component.
#[derive(Clone, Copy, Debug)]
pub(super) struct Group {
    pub(super) reference: [[f32; LANES]; 3],
    pub(super) normal: [[f32; LANES]; 3],
    /// Half the extent of the interval vector of normals.
    pub(super) spread: [[f32; LANES]; 3],
    pub(super) offset: [f32; LANES],
    /// Half the extent of the interval of `N · (V - c)`.
    pub(super) offset_spread: [f32; LANES],
    /// Greatest |V - c|, 1-norm.
    pub(super) radius: [f32; LANES],
    /// Leaf: its first edge. Otherwise the group of its children.
    pub(super) start: [u32; LANES],
    /// Edges of a leaf; [`INNER`]; 0 where there is no node.
    pub(super) count: [u32; LANES],
}

/// Count of a node that is not a leaf.
pub(super) const INNER: u32 = u32::MAX;

/// An edge that no pruning applies to: border, crease, non-manifold or twisted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Special {
    pub(super) edge: u32,
    pub(super) crease: bool,
    /// Both faces belong to a closed surface.
    pub(super) solid: bool,
}

/// All edges of a mesh, ready to be asked which of them matter to an eye or a light, in object space.
///
/// Moving or scaling an object changes nothing here: move the eye into object space instead. A reflection turns front
/// into back, which leaves silhouettes as they are; see [`EdgeTree::find`].
#[derive(Clone, Debug)]
pub struct EdgeTree {
    pub(super) groups: Vec<Group>,
    /// Normals and offsets of both faces of the edges: eight runs a leaf.
    pub(super) planes: Vec<f32>,
    /// Edge indices by leaf.
    pub(super) edges: Vec<u32>,
    pub(super) special: Vec<Special>,
}

/// Reused between queries.
#[derive(Clone, Debug, Default)]
pub struct TreeScratch {
    stack: Vec<u32>,
}

/// What a query did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct QueryCost {
    /// Nodes tested.
    pub nodes: usize,
    /// Edges tested.
    pub edges: usize,
    /// Edges that needed the exact predicate.
    pub exact: usize,
}

/// An eye in the form in which nodes are tested.
struct Eye32 {
    centre: [f32; 3],
    half: [f32; 3],
}

impl Eye32 {
    fn new(eye: &EyeBox) -> Self {
        let centre = ((eye.low + eye.high) * 0.5).to_array().map(|x| x as f32);
        let mut half = [0.0; 3];
        for k in 0..3 {
            let c = f64::from(centre[k]);
            half[k] = ((eye.high[k] - c).max(c - eye.low[k]) as f32)
                .next_up()
                .max(TINY);
        }
        Self { centre, half }
    }
}

impl EdgeTree {
    /// Sorts the edges of a mesh into a tree. Edges whose faces' normals differ by more than the crease angle (degrees)
    /// are creases.
    pub fn new(adjacency: &Adjacency, crease_angle: f32) -> Self {
        tree_build::build(adjacency, crease_angle)
    }

    /// Appends every edge that matters to the eye, with what it is, in an order that depends on the mesh alone.
    ///
    /// - silhouettes: two faces, of which one may be seen from the front and the other from behind;
    /// - creases, unless both faces are turned away on a closed surface (with `back_hidden`: pass it if the eye is
    ///   outside of the mesh's bounds);
    /// - borders, always; non-manifold edges with two faces that differ in facing, or with a crease.
    ///
    /// For an eye that is a box, an edge is found if the interval of Eq. 1 over the box does not rule it out.
    /// `mirrored` says that the object's transform is a reflection.
    pub fn find(
        &self,
        adjacency: &Adjacency,
        eye: &EyeBox,
        options: FindOptions,
        scratch: &mut TreeScratch,
        out: &mut Vec<(u32, EdgeKind)>,
    ) -> QueryCost {
        let mut cost = self.find_smooth(adjacency, eye, scratch, out);
        cost.edges += self.special.len();
        for special in &self.special {
            if let Some(kind) = classify(adjacency, special, eye, options) {
                out.push((special.edge, kind));
            }
        }
        cost
    }

    fn find_smooth(
        &self,
        adjacency: &Adjacency,
        eye: &EyeBox,
        scratch: &mut TreeScratch,
        out: &mut Vec<(u32, EdgeKind)>,
    ) -> QueryCost {
        let mut cost = QueryCost::default();
        let eye32 = Eye32::new(eye);
        scratch.stack.clear();
        if !self.groups.is_empty() {
            scratch.stack.push(0);
        }
        while let Some(index) = scratch.stack.pop() {
            let group = &self.groups[index as usize];
            let undecided = group.undecided(&eye32);
            cost.nodes += LANES;
            for (lane, undecided) in undecided.into_iter().enumerate() {
                if !undecided || group.count[lane] == 0 {
                    continue;
                }
                if group.count[lane] == INNER {
                    scratch.stack.push(group.start[lane]);
                } else {
                    cost.edges += group.count[lane] as usize;
                    cost.exact += self.test_leaf(adjacency, eye, &eye32, group, lane, out);
                }
            }
        }
        cost
    }

    /// Tests the edges of a leaf; returns how many needed the exact predicate.
    fn test_leaf(
        &self,
        adjacency: &Adjacency,
        eye: &EyeBox,
        eye32: &Eye32,
        group: &Group,
        lane: usize,
        out: &mut Vec<(u32, EdgeKind)>,
    ) -> usize {
        let (start, count) = (group.start[lane] as usize, group.count[lane] as usize);
        let w: [f32; 3] = std::array::from_fn(|k| eye32.centre[k] - group.reference[k][lane]);
        let size = w[0].abs() + w[1].abs() + w[2].abs() + group.radius[lane];
        // Normals are unit vectors: an error of the eye changes N·E by at most its 1-norm.
        let bound = (eye32.half[0] + eye32.half[1] + eye32.half[2]) * 1.000_001 + ROUNDING * size;
        let (first, second) = self.planes[8 * start..8 * (start + count)].split_at(4 * count);
        let (mut s0, mut s1) = ([0.0; LEAF], [0.0; LEAF]);
        signed_distances(first, w, &mut s0[..count]);
        signed_distances(second, w, &mut s1[..count]);
        let mut found = [0_u8; LEAF];
        let mut total = 0;
        for i in 0..count {
            found[total] = i as u8;
            // One product tells both that the signs agree and, with the bound on each, that they are certain.
            let settled =
                s0[i].abs() > bound && s1[i].abs() > bound && (s0[i] > 0.0) == (s1[i] > 0.0);
            total += usize::from(!settled);
        }
        let mut exact = 0;
        for &i in &found[..total] {
            let i = usize::from(i);
            let edge = self.edges[start + i];
            let certain = s0[i].abs() > bound && s1[i].abs() > bound;
            exact += usize::from(!certain);
            if certain || may_differ(adjacency, edge, eye) {
                out.push((edge, EdgeKind::Silhouette));
            }
        }
        exact
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.groups.len() * size_of::<Group>()
            + (self.planes.len() + self.edges.len()) * 4
            + self.special.len() * size_of::<Special>()
    }
}

/// How to treat an object's edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FindOptions {
    /// The object's transform is a reflection.
    pub mirrored: bool,
    /// The eye sees closed surfaces from outside, so that what is turned away cannot be seen.
    pub back_hidden: bool,
}

impl Group {
    /// For each node: its faces are not known to be all on one side.
    #[inline]
    fn undecided(&self, eye: &Eye32) -> [bool; LANES] {
        let mut result = [false; LANES];
        for (i, undecided) in result.iter_mut().enumerate() {
            let mut s = -self.offset[i];
            let mut bound = self.offset_spread[i] + ROUNDING * self.radius[i];
            for k in 0..3 {
                let w = eye.centre[k] - self.reference[k][i];
                let (n, spread) = (self.normal[k][i], self.spread[k][i]);
                s += n * w;
                bound += (spread + ROUNDING) * w.abs() + (n.abs() + spread) * eye.half[k];
            }
            // 1.00001 covers the rounding of the bound itself; a NaN decides nothing.
            let decided = s.abs() > bound * 1.000_01;
            *undecided = !decided;
        }
        result
    }
}

#[inline]
fn signed_distances(planes: &[f32], w: [f32; 3], out: &mut [f32]) {
    let n = out.len();
    let (x, rest) = planes.split_at(n);
    let (y, rest) = rest.split_at(n);
    let (z, d) = rest.split_at(n);
    for i in 0..n {
        out[i] = x[i] * w[0] + y[i] * w[1] + z[i] * w[2] - d[i];
    }
}

/// Eq. 1 for an edge with two faces.
pub(super) fn may_differ(adjacency: &Adjacency, edge: u32, eye: &EyeBox) -> bool {
    let faces = adjacency.faces(edge as usize);
    let (a, b) = (
        adjacency.facing(faces[0], eye),
        adjacency.facing(faces[1], eye),
    );
    a != b || a == Facing::Mixed
}

/// What an edge is to the eye that is not a plain one inside a smooth surface.
pub(super) fn classify(
    adjacency: &Adjacency,
    special: &Special,
    eye: &EyeBox,
    options: FindOptions,
) -> Option<EdgeKind> {
    let faces = adjacency.faces(special.edge as usize);
    if faces.len() == 1 {
        return Some(EdgeKind::Border);
    }
    let (mut front, mut back) = (0, 0);
    for &face in faces {
        let facing = adjacency.facing(face, eye);
        front += usize::from(facing != Facing::Back);
        back += usize::from(facing != Facing::Front);
    }
    if faces.len() > 2 {
        return (special.crease || (front > 0 && back > 0)).then_some(EdgeKind::NonManifold);
    }
    let differs = if adjacency.twisted[special.edge as usize] {
        front == 2 || back == 2
    } else {
        front > 0 && back > 0
    };
    if differs {
        return Some(EdgeKind::Silhouette);
    }
    let turned_away = if options.mirrored {
        back == 0
    } else {
        front == 0
    };
    let hidden = turned_away && special.solid && options.back_hidden;
    (special.crease && !hidden).then_some(EdgeKind::Crease)
}
