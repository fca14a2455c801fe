//! The hierarchy over receiver points (the paper's section 3.2): halves above a thousand points, then the least area.

use crate::{light::Box3, mesh::NONE, receivers::Point};

/// Points a leaf at most.
const LEAF: usize = 16;
/// Above so many points a node's box is cut in equal halves.
const HALVED: usize = 1024;

/// A node over points `first..first + count` of the order; a leaf has no children.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub(crate) bounds: Box3,
    pub(crate) first: u32,
    pub(crate) count: u32,
    /// Index of the first of two neighbouring nodes, or [`NONE`].
    pub(crate) children: u32,
    /// Groups that are dark for all points below.
    pub(crate) umbra: u32,
}

/// The root is node 0. Points are named by their number in a list.
#[derive(Clone, Debug, Default)]
pub(crate) struct Hierarchy {
    pub(crate) nodes: Vec<Node>,
    pub(crate) order: Vec<u32>,
}

impl Hierarchy {
    /// Over those of `points` that `order` names; `umbra` says which groups are dark for a point.
    pub(crate) fn build(points: &[Point], order: Vec<u32>, umbra: &[u32]) -> Self {
        let mut hierarchy = Self {
            nodes: Vec::with_capacity(order.len() / 4 + 1),
            order,
        };
        if hierarchy.order.is_empty() {
            return hierarchy;
        }
        let all = 0..hierarchy.order.len();
        let root = hierarchy.node(points, all);
        hierarchy.nodes.push(root);
        hierarchy.split(points, 0);
        for index in (0..hierarchy.nodes.len()).rev() {
            let node = &hierarchy.nodes[index];
            hierarchy.nodes[index].umbra = if node.children == NONE {
                hierarchy
                    .points(node)
                    .fold(u32::MAX, |all, p| all & umbra[p as usize])
            } else {
                let child = node.children as usize;
                hierarchy.nodes[child].umbra & hierarchy.nodes[child + 1].umbra
            };
        }
        hierarchy
    }

    /// The points below a node.
    pub(crate) fn points(&self, node: &Node) -> impl Iterator<Item = u32> + '_ {
        let first = node.first as usize;
        self.order[first..first + node.count as usize]
            .iter()
            .copied()
    }

    /// Size in memory, bytes.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.order[..])
    }

    fn node(&self, points: &[Point], range: std::ops::Range<usize>) -> Node {
        let mut bounds = Box3::EMPTY;
        for point in &self.order[range.clone()] {
            bounds.add(points[*point as usize].at);
        }
        Node {
            bounds,
            first: range.start as u32,
            count: range.len() as u32,
            children: NONE,
            umbra: 0,
        }
    }

    fn split(&mut self, points: &[Point], index: usize) {
        let Node {
            bounds,
            first,
            count,
            ..
        } = self.nodes[index].clone();
        let (first, count) = (first as usize, count as usize);
        if count <= LEAF {
            return;
        }
        let order = &mut self.order[first..first + count];
        let left = if count > HALVED {
            halves(points, order, &bounds)
        } else {
            least_area(points, order)
        };
        let children = self.nodes.len();
        self.nodes[index].children = children as u32;
        let middle = first + left;
        let pair = [first..middle, middle..first + count].map(|range| self.node(points, range));
        self.nodes.extend(pair);
        self.split(points, children);
        self.split(points, children + 1);
    }
}

/// Sorts by the halves of the longest side of the box; in equal numbers if one would be empty.
fn halves(points: &[Point], order: &mut [u32], bounds: &Box3) -> usize {
    let extent = |axis: usize| bounds.max[axis] - bounds.min[axis];
    let axis = (0..3)
        .max_by(|a, b| extent(*a).total_cmp(&extent(*b)))
        .unwrap_or(0);
    let middle = 0.5 * (bounds.min[axis] + bounds.max[axis]);
    let mut left = 0;
    for i in 0..order.len() {
        if points[order[i] as usize].at[axis] < middle {
            order.swap(i, left);
            left += 1;
        }
    }
    if left == 0 || left == order.len() {
        sort(points, order, axis);
        left = order.len() / 2;
    }
    left
}

/// Sorts by the axis and place at which both sides together have the least surface.
fn least_area(points: &[Point], order: &mut [u32]) -> usize {
    let mut best = (f32::INFINITY, 0, order.len() / 2);
    let mut right = vec![0f32; order.len()];
    for axis in 0..3 {
        sort(points, order, axis);
        let mut above = Box3::EMPTY;
        for (i, point) in order.iter().enumerate().rev() {
            above.add(points[*point as usize].at);
            right[i] = above.half_area();
        }
        let mut below = Box3::EMPTY;
        for i in 1..order.len() {
            below.add(points[order[i - 1] as usize].at);
            let area = below.half_area() + right[i];
            if area < best.0 {
                best = (area, axis, i);
            }
        }
    }
    sort(points, order, best.1);
    best.2
}

fn sort(points: &[Point], order: &mut [u32], axis: usize) {
    order.sort_unstable_by(|a, b| {
        let at = |i: u32| points[i as usize].at[axis];
        at(*a).total_cmp(&at(*b)).then(a.cmp(b))
    });
}
