//! Building the face hierarchy: binned splits by surface area, eight children a node.

use std::sync::Arc;

use fearless_simd::Level;
use glam::{DVec3, Vec3};
use protocol::scene::Mesh;

use super::faces::{FaceTree, Group, INNER, LANES, NO_VERTEX};
use crate::edges::adjacency::Adjacency;
use crate::edges::weld::weld;

/// Most faces in a leaf.
const LEAF: usize = 6;
/// Places where a set may be split.
const BINS: usize = 16;
/// Sets with more faces than this are split on all cores.
const PARALLEL: usize = 16_384;

#[derive(Clone, Copy)]
struct Item {
    low: Vec3,
    high: Vec3,
    face: u32,
}

#[derive(Clone, Copy)]
struct Bounds {
    low: Vec3,
    high: Vec3,
}

impl Bounds {
    const EMPTY: Self = Self {
        low: Vec3::INFINITY,
        high: Vec3::NEG_INFINITY,
    };

    fn add(&mut self, low: Vec3, high: Vec3) {
        self.low = self.low.min(low);
        self.high = self.high.max(high);
    }

    fn area(&self) -> f32 {
        let d = (self.high - self.low).max(Vec3::ZERO);
        d.x * d.y + d.y * d.z + d.z * d.x
    }
}

/// A run of items; without children it is a leaf.
struct Node {
    start: usize,
    count: usize,
    children: Vec<Node>,
}

pub(super) fn build(mesh: &Mesh, adjacency: Arc<Adjacency>) -> FaceTree {
    let (ids, _) = weld(&mesh.positions);
    let corners = |face: u32| mesh.faces[face as usize].map(|v| ids[v as usize]);
    let at = |v: u32| Vec3::from(adjacency.positions[v as usize]);
    let mut items: Vec<Item> = (0..mesh.faces.len() as u32)
        .filter(|f| adjacency.normals[*f as usize] != DVec3::ZERO)
        .map(|face| {
            let [a, b, c] = corners(face).map(at);
            Item {
                low: a.min(b).min(c),
                high: a.max(b).max(c),
                face,
            }
        })
        .collect();
    let mut groups = Vec::new();
    if !items.is_empty() {
        let root = subdivide(&mut items, 0);
        let top = if root.children.is_empty() {
            vec![root]
        } else {
            root.children
        };
        flatten(&mut groups, &adjacency, &items, &top);
    }
    let reach = items.iter().fold(0.0_f32, |most, i| {
        most.max(i.low.abs().max(i.high.abs()).element_sum())
    });
    let mut vertices = vec![NO_VERTEX; adjacency.positions.len()];
    let mut positions = Vec::with_capacity(adjacency.positions.len());
    let own = items.iter().map(|item| {
        corners(item.face).map(|v| {
            let own = &mut vertices[v as usize];
            if *own == NO_VERTEX {
                *own = positions.len() as u32;
                positions.push(adjacency.positions[v as usize]);
            }
            *own
        })
    });
    FaceTree {
        groups,
        corners: own.collect(),
        positions,
        vertices,
        faces: items.iter().map(|i| i.face).collect(),
        reach: reach.next_up(),
        level: Level::new(),
        adjacency,
    }
}

fn subdivide(items: &mut [Item], start: usize) -> Node {
    let count = items.len();
    let mut children = Vec::new();
    if count > LEAF {
        let mut pieces: Vec<(usize, &mut [Item])> = vec![(start, items)];
        while pieces.len() < LANES {
            let Some(largest) = (0..pieces.len()).max_by_key(|i| pieces[*i].1.len()) else {
                break;
            };
            if pieces[largest].1.len() <= LEAF {
                break;
            }
            let (first, piece) = pieces.swap_remove(largest);
            let cut = split(piece);
            let (left, right) = piece.split_at_mut(cut);
            pieces.push((first, left));
            pieces.push((first + cut, right));
        }
        children = subdivide_all(pieces, count);
    }
    Node {
        start,
        count,
        children,
    }
}

fn subdivide_all(mut pieces: Vec<(usize, &mut [Item])>, total: usize) -> Vec<Node> {
    if total < PARALLEL || pieces.len() < 2 {
        return pieces
            .into_iter()
            .map(|(start, items)| subdivide(items, start))
            .collect();
    }
    let rest = pieces.split_off(pieces.len() / 2);
    let (mut left, right) = rayon::join(
        || subdivide_all(pieces, total),
        || subdivide_all(rest, total),
    );
    left.extend(right);
    left
}

/// Sorts the items into two sets, neither of them empty; returns how many the first has.
fn split(items: &mut [Item]) -> usize {
    let mut middles = Bounds::EMPTY;
    for item in items.iter() {
        let middle = item.low + item.high;
        middles.add(middle, middle);
    }
    let extent = middles.high - middles.low;
    let axis = extent.max_position();
    let scale = BINS as f32 / extent[axis];
    let bin = |i: &Item| {
        let at = (i.low[axis] + i.high[axis] - middles.low[axis]) * scale;
        (at as usize).min(BINS - 1)
    };
    let mut cut = 0;
    if scale.is_finite() {
        let mut bins = [(Bounds::EMPTY, 0_usize); BINS];
        for item in items.iter() {
            let b = &mut bins[bin(item)];
            b.0.add(item.low, item.high);
            b.1 += 1;
        }
        let last = cheapest(&bins);
        cut = partition(items, |i| bin(i) <= last);
    }
    if cut == 0 || cut == items.len() {
        items.len() / 2
    } else {
        cut
    }
}

/// The last bin of the first set where splitting costs least.
fn cheapest(bins: &[(Bounds, usize); BINS]) -> usize {
    let mut after = [0.0_f32; BINS];
    let (mut bounds, mut count) = (Bounds::EMPTY, 0);
    for b in (1..BINS).rev() {
        bounds.add(bins[b].0.low, bins[b].0.high);
        count += bins[b].1;
        after[b - 1] = bounds.area() * count as f32;
    }
    let (mut bounds, mut count) = (Bounds::EMPTY, 0);
    let (mut best, mut least) = (BINS / 2, f32::INFINITY);
    for b in 0..BINS - 1 {
        bounds.add(bins[b].0.low, bins[b].0.high);
        count += bins[b].1;
        let cost = bounds.area() * count as f32 + after[b];
        if cost < least {
            (best, least) = (b, cost);
        }
    }
    best
}

/// Moves the items that satisfy the predicate to the front; returns how many.
fn partition(items: &mut [Item], first: impl Fn(&Item) -> bool) -> usize {
    let mut count = 0;
    for i in 0..items.len() {
        if first(&items[i]) {
            items.swap(i, count);
            count += 1;
        }
    }
    count
}

/// Appends the group of some siblings and everything below it; returns its index.
fn flatten(groups: &mut Vec<Group>, adjacency: &Adjacency, items: &[Item], nodes: &[Node]) -> u32 {
    let index = groups.len();
    groups.push(Group::EMPTY);
    for (lane, node) in nodes.iter().enumerate() {
        let (start, count) = if node.children.is_empty() {
            (node.start as u32, node.count as u32)
        } else {
            (flatten(groups, adjacency, items, &node.children), INNER)
        };
        let group = &mut groups[index];
        bound(
            group,
            lane,
            adjacency,
            &items[node.start..node.start + node.count],
        );
        group.start[lane] = start;
        group.count[lane] = count;
    }
    index as u32
}

/// Sets the intervals of a node that holds these faces, rounded outwards.
fn bound(group: &mut Group, lane: usize, adjacency: &Adjacency, items: &[Item]) {
    let mut all = Bounds::EMPTY;
    let (mut n_low, mut n_high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let mut solid = true;
    for item in items {
        all.add(item.low, item.high);
        let n = adjacency.normals[item.face as usize];
        n_low = n_low.min(n);
        n_high = n_high.max(n);
        solid &= adjacency.solid[item.face as usize];
    }
    let centre = all.low * 0.5 + all.high * 0.5;
    let half = (all.high - centre).max(centre - all.low);
    for k in 0..3 {
        group.centre[k][lane] = centre[k];
        group.half[k][lane] = half[k].next_up();
        let middle = ((n_low[k] + n_high[k]) * 0.5) as f32;
        let spread = (n_high[k] - f64::from(middle)).max(f64::from(middle) - n_low[k]);
        group.normal[k][lane] = middle;
        group.spread[k][lane] = (spread as f32).next_up();
    }
    group.offset[lane] = f32::NEG_INFINITY;
    if solid {
        let centre = centre.as_dvec3();
        let least = items.iter().fold(f64::INFINITY, |least, item| {
            let anchor = DVec3::from(adjacency.anchors[item.face as usize].map(f64::from));
            least.min(adjacency.normals[item.face as usize].dot(anchor - centre))
        });
        group.offset[lane] = (least as f32).next_down();
    }
}
