//! Building the interval edge tree.
//!
//! The paper splits on one of the three axes of the normal, whichever leaves the smallest children. A mesh that holds
//! several parts, or one that is seen from nearby, gains as much from narrow positions, so these are axes too, weighted
//! by the size of the mesh.

use glam::{DVec3, Vec3};

use super::adjacency::Adjacency;
use super::tree::{EdgeTree, Group, INNER, LANES, LEAF, Special, TINY};

/// What a unit of relative position extent counts against one of normal extent.
const POSITION_WEIGHT: f32 = 1.0;
/// Sets with more edges than this are split on all cores.
const PARALLEL: usize = 16_384;

/// An edge while the tree is built: intervals of its faces' normals and of its position relative to the mesh's size.
#[derive(Clone, Copy)]
struct Item {
    edge: u32,
    low: [Vec3; 2],
    high: [Vec3; 2],
}

/// An interval vector of normals and one of positions.
#[derive(Clone, Copy)]
struct Extent {
    low: [Vec3; 2],
    high: [Vec3; 2],
}

impl Extent {
    const EMPTY: Self = Self {
        low: [Vec3::INFINITY; 2],
        high: [Vec3::NEG_INFINITY; 2],
    };

    fn add(&mut self, low: [Vec3; 2], high: [Vec3; 2]) {
        for k in 0..2 {
            self.low[k] = self.low[k].min(low[k]);
            self.high[k] = self.high[k].max(high[k]);
        }
    }

    fn of(items: &[Item]) -> Self {
        let mut all = Self::EMPTY;
        for item in items {
            all.add(item.low, item.high);
        }
        all
    }

    /// What the chance that a node cannot be pruned grows with.
    fn size(&self) -> f32 {
        if self.low[0].x > self.high[0].x {
            return 0.0;
        }
        let [n, p] = [0, 1].map(|k| (self.high[k] - self.low[k]).element_sum());
        n + POSITION_WEIGHT * p
    }
}

/// A set of edges that is to become a node.
struct Piece<'a> {
    items: &'a mut [Item],
    /// Its edges are too sharp to be told apart by normals: it is a node's own, and only halved.
    sharp: bool,
}

enum Node {
    Leaf(Vec<u32>),
    Inner(Vec<Node>),
}

/// Builds a tree of all edges of a mesh; crease angle in degrees.
pub(super) fn build(adjacency: &Adjacency, crease_angle: f32) -> EdgeTree {
    let cosine = f64::from(crease_angle).to_radians().cos();
    let scale = match adjacency.diagonal() {
        d if d > 0.0 => (1.0 / d) as f32,
        _ => 1.0,
    };
    let mut special = Vec::new();
    let mut items = Vec::with_capacity(adjacency.edges.len());
    for edge in 0..adjacency.edges.len() {
        let faces = adjacency.faces(edge);
        let crease = is_crease(adjacency, faces, cosine) || adjacency.changes_material(faces);
        if faces.len() != 2 || crease || adjacency.twisted[edge] {
            let solid = faces.iter().all(|f| adjacency.solid[*f as usize]);
            special.push(Special {
                edge: edge as u32,
                crease,
                solid,
            });
        } else {
            items.push(item(adjacency, edge as u32, faces, scale));
        }
    }
    let mut tree = EdgeTree {
        groups: Vec::new(),
        planes: Vec::new(),
        edges: Vec::new(),
        special,
    };
    if !items.is_empty() {
        let root = match subdivide(Piece {
            items: &mut items,
            sharp: false,
        }) {
            leaf @ Node::Leaf(_) => vec![leaf],
            Node::Inner(children) => children,
        };
        tree.planes.reserve(items.len() * 8);
        tree.edges.reserve(items.len());
        flatten(&mut tree, adjacency, &root);
    }
    tree
}

fn is_crease(adjacency: &Adjacency, faces: &[u32], cosine: f64) -> bool {
    faces.iter().enumerate().any(|(i, a)| {
        let n = adjacency.normals[*a as usize];
        faces[i + 1..]
            .iter()
            .any(|b| n.dot(adjacency.normals[*b as usize]) < cosine)
    })
}

fn item(adjacency: &Adjacency, edge: u32, faces: &[u32], scale: f32) -> Item {
    let [a, b] = [0, 1].map(|k| adjacency.normals[faces[k] as usize].as_vec3());
    let [u, v] =
        adjacency.edges[edge as usize].map(|v| Vec3::from(adjacency.positions[v as usize]) * scale);
    Item {
        edge,
        low: [a.min(b), u.min(v)],
        high: [a.max(b), u.max(v)],
    }
}

fn subdivide(piece: Piece<'_>) -> Node {
    if piece.items.len() <= LEAF {
        return Node::Leaf(piece.items.iter().map(|i| i.edge).collect());
    }
    let total = piece.items.len();
    let mut pieces = vec![piece];
    while pieces.len() + 2 <= LANES {
        let Some(largest) = (0..pieces.len()).max_by_key(|i| pieces[*i].items.len()) else {
            break;
        };
        if pieces[largest].items.len() <= LEAF {
            break;
        }
        let piece = pieces.swap_remove(largest);
        pieces.extend(split(piece));
    }
    Node::Inner(subdivide_all(pieces, total))
}

fn subdivide_all(mut pieces: Vec<Piece<'_>>, total: usize) -> Vec<Node> {
    if total < PARALLEL || pieces.len() < 2 {
        return pieces.into_iter().map(subdivide).collect();
    }
    let rest = pieces.split_off(pieces.len() / 2);
    let (mut left, right) = rayon::join(
        || subdivide_all(pieces, total),
        || subdivide_all(rest, total),
    );
    left.extend(right);
    left
}

/// Splits a set into two, and a third of edges that stay at the node.
fn split(piece: Piece<'_>) -> Vec<Piece<'_>> {
    let Piece { items, mut sharp } = piece;
    let mut all = Extent::of(items);
    let mut result = Vec::with_capacity(3);
    let mut rest = items;
    if !sharp {
        // "An edge is stored at a node if its normals span more than half of the node's entire range of normals."
        let half = (all.high[0] - all.low[0]).element_sum() * 0.5;
        let stay = partition(rest, |i| (i.high[0] - i.low[0]).element_sum() > half);
        if stay == rest.len() {
            sharp = true;
        } else if stay > 0 {
            let (own, others) = rest.split_at_mut(stay);
            result.push(Piece {
                items: own,
                sharp: true,
            });
            rest = others;
            all = Extent::of(rest);
            if rest.len() <= LEAF {
                result.push(Piece { items: rest, sharp });
                return result;
            }
        }
    }
    let (axis, at) = best_axis(rest, &all);
    let mut cut = partition(rest, |i| along(i, axis) < at);
    if cut == 0 || cut == rest.len() {
        cut = rest.len() / 2;
    }
    let (left, right) = rest.split_at_mut(cut);
    result.push(Piece { items: left, sharp });
    result.push(Piece {
        items: right,
        sharp,
    });
    result
}

/// Twice the middle of an edge's interval on one of the six axes.
fn along(item: &Item, axis: usize) -> f32 {
    item.low[axis / 3][axis % 3] + item.high[axis / 3][axis % 3]
}

/// The axis on which halving the interval leaves the smallest children, and where to cut (see [`along`]).
fn best_axis(items: &[Item], all: &Extent) -> (usize, f32) {
    let middle: [f32; 6] = std::array::from_fn(|a| all.low[a / 3][a % 3] + all.high[a / 3][a % 3]);
    let mut halves = [[(Extent::EMPTY, 0_usize); 2]; 6];
    // A sample is enough to choose an axis.
    let step = (items.len() / 4096).max(1);
    for item in items.iter().step_by(step) {
        for (axis, halves) in halves.iter_mut().enumerate() {
            let half = &mut halves[usize::from(along(item, axis) >= middle[axis])];
            half.0.add(item.low, item.high);
            half.1 += 1;
        }
    }
    let cost = |a: usize| -> f32 { halves[a].iter().map(|(e, n)| e.size() * *n as f32).sum() };
    let axis = (0..6)
        .min_by(|a, b| cost(*a).total_cmp(&cost(*b)))
        .unwrap_or(0);
    (axis, middle[axis])
}

/// Moves the items that satisfy the predicate to the front; returns how many.
fn partition(items: &mut [Item], mut first: impl FnMut(&Item) -> bool) -> usize {
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
fn flatten(tree: &mut EdgeTree, adjacency: &Adjacency, nodes: &[Node]) -> u32 {
    let index = tree.groups.len();
    tree.groups.push(Group {
        reference: [[0.0; LANES]; 3],
        normal: [[0.0; LANES]; 3],
        spread: [[0.0; LANES]; 3],
        offset: [0.0; LANES],
        offset_spread: [-1.0; LANES],
        radius: [0.0; LANES],
        start: [0; LANES],
        count: [0; LANES],
    });
    for (lane, node) in nodes.iter().enumerate() {
        let first = tree.edges.len();
        let (start, count) = match node {
            Node::Leaf(edges) => {
                tree.edges.extend(edges);
                (first as u32, edges.len() as u32)
            }
            Node::Inner(children) => (flatten(tree, adjacency, children), INNER),
        };
        let edges = &tree.edges[first..];
        let reference = bound(&mut tree.groups[index], lane, adjacency, edges);
        tree.groups[index].start[lane] = start;
        tree.groups[index].count[lane] = count;
        if count != INNER {
            push_planes(&mut tree.planes, adjacency, edges, reference);
        }
    }
    index as u32
}

/// Sets the intervals of a node that holds these edges, rounded outwards; returns the reference point.
fn bound(group: &mut Group, lane: usize, adjacency: &Adjacency, edges: &[u32]) -> DVec3 {
    let faces = || {
        edges
            .iter()
            .flat_map(|e| adjacency.faces(*e as usize))
            .map(|f| *f as usize)
    };
    let anchor = |f: usize| DVec3::from(adjacency.anchors[f].map(f64::from));
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (mut n_low, mut n_high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for f in faces() {
        low = low.min(anchor(f));
        high = high.max(anchor(f));
        n_low = n_low.min(adjacency.normals[f]);
        n_high = n_high.max(adjacency.normals[f]);
    }
    // Rounded to f32 once; everything else is relative to the rounded point.
    let reference = ((low + high) * 0.5).as_vec3().as_dvec3();
    let (mut d_low, mut d_high, mut radius) = (f64::INFINITY, f64::NEG_INFINITY, 0.0_f64);
    for f in faces() {
        let v = anchor(f) - reference;
        let d = adjacency.normals[f].dot(v);
        d_low = d_low.min(d);
        d_high = d_high.max(d);
        radius = radius.max(v.abs().element_sum());
    }
    for k in 0..3 {
        group.reference[k][lane] = reference[k] as f32;
        (group.normal[k][lane], group.spread[k][lane]) = middle(n_low[k], n_high[k]);
    }
    (group.offset[lane], group.offset_spread[lane]) = middle(d_low, d_high);
    group.radius[lane] = (radius as f32).next_up();
    reference
}

/// Middle and half extent of an interval, rounded so that they cover it.
fn middle(low: f64, high: f64) -> (f32, f32) {
    let centre = ((low + high) * 0.5) as f32;
    let half = (high - f64::from(centre)).max(f64::from(centre) - low) as f32;
    (centre, half.next_up().max(TINY))
}

/// Appends the planes of a leaf: normals by component and offsets, of the first faces and then of the second.
fn push_planes(planes: &mut Vec<f32>, adjacency: &Adjacency, edges: &[u32], reference: DVec3) {
    for side in 0..2 {
        let face = |e: &u32| adjacency.faces(*e as usize)[side] as usize;
        for k in 0..3 {
            planes.extend(edges.iter().map(|e| adjacency.normals[face(e)][k] as f32));
        }
        planes.extend(edges.iter().map(|e| {
            let f = face(e);
            let v = DVec3::from(adjacency.anchors[f].map(f64::from)) - reference;
            adjacency.normals[f].dot(v) as f32
        }));
    }
}
