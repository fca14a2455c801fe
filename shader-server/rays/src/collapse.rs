//! Binary trees to eight-way ones, at the least expected cost.
//!
//! The dynamic programme of Ylitie, Karras and Laine 2017, section 3.1: the cheapest way to stand for a binary
//! subtree by at most i eight-way subtrees, for i = 1..7, from the leaves up.

use glam::Vec3;
use obvhs::bvh2::{Bvh2, node::Bvh2Node};

use crate::{
    Bounds,
    node::{Link, Node, Tree, WIDTH},
};

/// Cost of a leaf visit in node visits, estimated from the arithmetic in each.
const LEAF_COST: f32 = 1.2;
const NODE_COST: f32 = 1.;

/// The best way found for one binary node.
#[derive(Clone, Copy)]
struct Choice {
    /// `cost[i - 1]`: as at most i subtrees.
    cost: [f32; WIDTH - 1],
    /// `pieces[i - 1]`: how many subtrees that cost uses.
    pieces: [u8; WIDTH - 1],
    /// `left[j - 1]`: of j subtrees, how many the first child gets.
    left: [u8; WIDTH],
    primitives: u32,
    leaf: bool,
}

/// Collapses `binary`, with at most `leaf_size` primitives a leaf. `make_leaf` gets primitives that are kept together, at
/// most `leaf_size` too, and returns their number; small leaves of one node share one.
pub(crate) fn collapse(
    binary: &Bvh2,
    leaf_size: u32,
    mut make_leaf: impl FnMut(&[u32]) -> usize,
) -> Tree {
    if binary.nodes.is_empty() || binary.primitive_indices.is_empty() {
        return Tree::default();
    }
    let choices = choose(binary, leaf_size);
    let mut nodes = vec![Node::empty()];
    // What to fill in: a node of the result, the binary node it stands for, and its depth.
    let mut open = vec![(0usize, 0usize, 1usize)];
    let mut deepest = 0;
    let mut children = Vec::with_capacity(WIDTH);
    let mut links = Vec::with_capacity(WIDTH);
    let mut primitives = Vec::with_capacity(WIDTH);
    while let Some((slot, root, depth)) = open.pop() {
        deepest = deepest.max(depth);
        children.clear();
        if slot == 0 && choices[root].leaf {
            children.push(root);
        } else {
            split(binary, &choices, root, WIDTH, &mut children);
        }
        // Largest leaves first, so that small ones fill what they leave; then inner nodes.
        let size = |child: &usize| choices[*child].leaf.then_some(choices[*child].primitives);
        children.sort_unstable_by_key(|child| std::cmp::Reverse(size(child)));
        links.clear();
        while let Some(&child) = children.first() {
            if !choices[child].leaf {
                nodes.push(Node::empty());
                open.push((nodes.len() - 1, child, depth + 1));
                links.push((child, Link::node(nodes.len() - 1)));
                children.remove(0);
                continue;
            }
            primitives.clear();
            let first = links.len();
            children.retain(|&child| {
                let fits = choices[child].leaf
                    && primitives.len() + choices[child].primitives as usize <= leaf_size as usize;
                if fits {
                    gather(binary, child, &mut primitives);
                    links.push((child, Link::NONE));
                }
                !fits
            });
            let together = Link::leaf(make_leaf(&primitives));
            links[first..]
                .iter_mut()
                .for_each(|(_, link)| *link = together);
        }
        for (lane, &(child, link)) in links.iter().enumerate() {
            nodes[slot].set_child(lane, link, &bounds_of(&binary.nodes[child]));
        }
    }
    Tree {
        nodes,
        depth: deepest,
    }
}

fn bounds_of(node: &Bvh2Node) -> Bounds {
    let aabb = node.aabb();
    Bounds {
        min: Vec3::from(aabb.min),
        max: Vec3::from(aabb.max),
    }
}

fn choose(binary: &Bvh2, leaf_size: u32) -> Vec<Choice> {
    let unset = Choice {
        cost: [0.; WIDTH - 1],
        pieces: [1; WIDTH - 1],
        left: [0; WIDTH],
        primitives: 0,
        leaf: false,
    };
    let mut choices = vec![unset; binary.nodes.len()];
    let mut order = Vec::with_capacity(binary.nodes.len());
    let mut open = vec![0usize];
    while let Some(index) = open.pop() {
        order.push(index);
        let node = &binary.nodes[index];
        if !node.is_leaf() {
            open.push(node.first_index as usize);
            open.push(node.first_index as usize + 1);
        }
    }
    for &index in order.iter().rev() {
        let node = &binary.nodes[index];
        let area = node.aabb().half_area();
        choices[index] = if node.is_leaf() {
            Choice {
                cost: [area * LEAF_COST; WIDTH - 1],
                primitives: node.prim_count,
                leaf: true,
                ..unset
            }
        } else {
            let first = node.first_index as usize;
            choose_inner(&choices[first], &choices[first + 1], area, leaf_size)
        };
    }
    choices
}

fn choose_inner(first: &Choice, second: &Choice, area: f32, leaf_size: u32) -> Choice {
    let mut left = [0u8; WIDTH];
    let mut shared = [f32::INFINITY; WIDTH];
    for j in 2..=WIDTH {
        for k in 1..j {
            let cost = first.cost[k - 1] + second.cost[j - k - 1];
            if cost < shared[j - 1] || left[j - 1] == 0 {
                shared[j - 1] = cost;
                left[j - 1] = k as u8;
            }
        }
    }
    let primitives = first.primitives.saturating_add(second.primitives);
    let as_leaf = if primitives <= leaf_size {
        area * LEAF_COST
    } else {
        f32::INFINITY
    };
    let as_node = shared[WIDTH - 1] + area * NODE_COST;
    let leaf = as_leaf <= as_node && primitives <= leaf_size;
    let mut cost = [0.; WIDTH - 1];
    let mut pieces = [1u8; WIDTH - 1];
    cost[0] = if leaf { as_leaf } else { as_node };
    for i in 2..WIDTH {
        (cost[i - 1], pieces[i - 1]) = if shared[i - 1] < cost[i - 2] {
            (shared[i - 1], i as u8)
        } else {
            (cost[i - 2], pieces[i - 2])
        };
    }
    Choice {
        cost,
        pieces,
        left,
        primitives,
        leaf,
    }
}

/// Lists the binary nodes that become the children of the eight-way node standing for `root`, which takes `lanes` of them.
fn split(binary: &Bvh2, choices: &[Choice], root: usize, lanes: usize, children: &mut Vec<usize>) {
    let first = binary.nodes[root].first_index as usize;
    let left = usize::from(choices[root].left[lanes - 1]);
    for (child, share) in [(first, left), (first + 1, lanes - left)] {
        let pieces = usize::from(choices[child].pieces[share - 1]);
        if pieces == 1 {
            children.push(child);
        } else {
            split(binary, choices, child, pieces, children);
        }
    }
}

fn gather(binary: &Bvh2, root: usize, primitives: &mut Vec<u32>) {
    let node = &binary.nodes[root];
    let first = node.first_index as usize;
    if node.is_leaf() {
        primitives.extend(&binary.primitive_indices[first..first + node.prim_count as usize]);
    } else {
        gather(binary, first, primitives);
        gather(binary, first + 1, primitives);
    }
}
