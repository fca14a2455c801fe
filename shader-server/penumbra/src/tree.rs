//! Trees of sixteen children a node over boxes.

use std::ops::Range;

use crate::{lanes::LANES, light::Box3};

/// A child that is no node but a box of the list.
pub(crate) const LEAF: u32 = 1 << 31;
const BINS: usize = 16;

/// Children as structure of arrays; a lane without one holds NaN, which meets nothing.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// Lowest x, y, z, then highest.
    pub(crate) bounds: [[f32; LANES]; 6],
    pub(crate) children: [u32; LANES],
}

impl Node {
    fn empty() -> Self {
        Self {
            bounds: [[f32::NAN; LANES]; 6],
            children: [LEAF; LANES],
        }
    }

    fn set(&mut self, lane: usize, child: u32, bounds: &Box3) {
        self.children[lane] = child;
        for axis in 0..3 {
            self.bounds[axis][lane] = bounds.min[axis];
            self.bounds[axis + 3][lane] = bounds.max[axis];
        }
    }
}

/// The root is node 0.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tree {
    pub(crate) nodes: Vec<Node>,
}

impl Tree {
    /// The tree over `boxes`, and the order in which its leaves name them: leaf `i` is box `order[i]`.
    pub(crate) fn build(boxes: &[Box3]) -> (Self, Vec<u32>) {
        let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
        let mut tree = Self::default();
        if !boxes.is_empty() {
            let middle = |axis: usize, i: u32| {
                let b = &boxes[i as usize];
                b.min[axis] + b.max[axis]
            };
            let mut building = Building {
                boxes,
                middles: (0..boxes.len() as u32)
                    .map(|i| [0, 1, 2].map(|axis| middle(axis, i)))
                    .collect(),
                nodes: Vec::with_capacity(boxes.len() / LANES * 2 + 1),
            };
            building.node(&mut order, 0);
            tree.nodes = building.nodes;
        }
        (tree, order)
    }
}

struct Building<'a> {
    boxes: &'a [Box3],
    /// Twice the boxes' middles.
    middles: Vec<[f32; 3]>,
    nodes: Vec<Node>,
}

impl Building<'_> {
    /// Makes a node over `order`, which starts at leaf `first`, and says where it is and what it bounds.
    fn node(&mut self, order: &mut [u32], first: usize) -> (u32, Box3) {
        let index = self.nodes.len();
        self.nodes.push(Node::empty());
        let mut all = Box3::EMPTY;
        if order.len() <= LANES {
            // Large ones first: they are the most likely to darken all.
            order.sort_by(|a, b| {
                let area = |i: u32| self.boxes[i as usize].half_area();
                area(*b).total_cmp(&area(*a)).then(a.cmp(b))
            });
            for (lane, i) in order.iter().enumerate() {
                let bounds = self.boxes[*i as usize];
                all = all.union(&bounds);
                self.nodes[index].set(lane, LEAF | (first + lane) as u32, &bounds);
            }
            return (index as u32, all);
        }
        let mut pieces = Vec::with_capacity(LANES);
        pieces.push(0..order.len());
        while pieces.len() < LANES {
            let largest = (0..pieces.len()).max_by_key(|i| (pieces[*i].len(), usize::MAX - i));
            let Some(i) = largest.filter(|i| pieces[*i].len() > LANES) else {
                break;
            };
            let Range { start, end } = pieces[i].clone();
            let middle = start + self.split(&mut order[start..end]);
            pieces[i] = start..middle;
            pieces.push(middle..end);
        }
        pieces.sort_by_key(|piece| piece.start);
        for (lane, piece) in pieces.into_iter().enumerate() {
            let start = piece.start;
            let (child, bounds) = self.node(&mut order[piece], first + start);
            all = all.union(&bounds);
            self.nodes[index].set(lane, child, &bounds);
        }
        (index as u32, all)
    }

    /// Sorts so that the first few, a multiple of sixteen, and the others are far apart, by surface area; says how many.
    fn split(&self, order: &mut [u32]) -> usize {
        let mut span = Box3::EMPTY;
        order
            .iter()
            .for_each(|i| span.add(self.middles[*i as usize]));
        let extent = |axis: usize| span.max[axis] - span.min[axis];
        let axis = (0..3)
            .max_by(|a, b| extent(*a).total_cmp(&extent(*b)))
            .unwrap_or(0);
        let (low, width) = (span.min[axis], extent(axis).max(f32::MIN_POSITIVE));
        let mut bins = [(0usize, Box3::EMPTY); BINS];
        for i in order.iter() {
            let place = (self.middles[*i as usize][axis] - low) / width * BINS as f32;
            let bin = &mut bins[(place as usize).min(BINS - 1)];
            bin.0 += 1;
            bin.1 = bin.1.union(&self.boxes[*i as usize]);
        }
        let mut right = [0f32; BINS];
        let mut above = (0, Box3::EMPTY);
        for bin in (1..BINS).rev() {
            above = (above.0 + bins[bin].0, above.1.union(&bins[bin].1));
            right[bin] = above.1.half_area() * above.0 as f32;
        }
        let mut below = (0, Box3::EMPTY);
        let mut best = (f32::INFINITY, order.len() / 2);
        for bin in 0..BINS - 1 {
            below = (below.0 + bins[bin].0, below.1.union(&bins[bin].1));
            let cost = below.1.half_area() * below.0 as f32 + right[bin + 1];
            if below.0 > 0 && below.0 < order.len() && cost < best.0 {
                best = (cost, below.0);
            }
        }
        let most = (order.len() - 1) / LANES * LANES;
        let count = ((best.1 + LANES / 2) / LANES * LANES).clamp(LANES, most);
        order.select_nth_unstable_by(count, |a, b| {
            let at = |i: u32| self.middles[i as usize][axis];
            at(*a).total_cmp(&at(*b)).then(a.cmp(b))
        });
        count
    }
}
