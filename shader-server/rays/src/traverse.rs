//! One traversal for both levels and both kinds of query, one ray at a time.

use crate::{
    Ray,
    kernel::Kernel,
    node::{Link, LocalRay, Tree, WIDTH},
    prefetch::prefetch,
    query::Query,
    triangle::{Block, BlockHits},
    world::{Instance, World},
};

/// A place in a tree still to be visited and where the ray enters it; of two, the smaller is entered first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Entry(u64);

impl Entry {
    /// Nothing yet.
    pub(crate) const NONE: Self = Self(0);

    /// `enter` must not be negative: then its bits rise as it does.
    #[inline(always)]
    pub(crate) fn new(enter: f32, place: u32) -> Self {
        Self(u64::from(enter.to_bits()) << 32 | u64::from(place))
    }

    #[inline(always)]
    pub(crate) fn enter(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }

    #[inline(always)]
    pub(crate) fn place(self) -> u32 {
        self.0 as u32
    }
}

/// What is done at a tree's leaves.
pub(crate) trait Leaves {
    /// Whether they are tried as soon as they are met, which suits blocks of triangles, or when it is their turn.
    const AT_ONCE: bool;

    /// Says that one will be visited soon.
    fn prefetch(&self, leaf: usize);

    /// Visits one; returns whether the query is answered. `t_max` may be shortened.
    fn visit(&mut self, leaf: usize, t_max: &mut f32, stack: &mut [Entry]) -> bool;
}

/// Visits the leaves of `tree` below node `start` that the ray meets no later than `t_max`.
#[inline(always)]
fn walk<K: Kernel, L: Leaves, const ORDERED: bool>(
    kernel: K,
    (tree, start): (&Tree, usize),
    ray: &LocalRay,
    t_max: &mut f32,
    stack: &mut [Entry],
    leaves: &mut L,
) -> bool {
    if tree.nodes.is_empty() {
        return false;
    }
    let mut enter = [0.; WIDTH];
    let mut current = start;
    let mut top = 0;
    loop {
        let node = &tree.nodes[current];
        let met = kernel.slabs(node, &ray.near, &ray.far, *t_max, &mut enter);
        let at_once = if L::AT_ONCE { met & node.leaves } else { 0 };
        for lane in lanes(at_once) {
            leaves.prefetch(node.children[lane].index());
        }
        // The nearest stays in hand, the others go on the stack with the farthest first.
        let mut next = None;
        let first = top;
        for lane in lanes(met & !at_once) {
            let link = node.children[lane];
            if !link.is_leaf() {
                prefetch(&tree.nodes[link.index()]);
            }
            let mut entry = Entry::new(enter[lane], link.bits());
            if let Some(other) = next.replace(entry) {
                if ORDERED && other < entry {
                    next = Some(other);
                } else {
                    entry = other;
                }
                stack[top] = entry;
                top += 1;
            }
        }
        if ORDERED {
            sort_nearest_last(&mut stack[first..top]);
        }
        // Neighbours may share a leaf.
        let mut last = Link::NONE;
        for lane in lanes(at_once) {
            let link = node.children[lane];
            if link == last || (ORDERED && enter[lane] > *t_max) {
                continue;
            }
            last = link;
            if leaves.visit(link.index(), t_max, &mut stack[top..]) {
                return true;
            }
        }
        current = loop {
            let entry = match next.take() {
                Some(entry) => entry,
                None if top == 0 => return false,
                None => {
                    top -= 1;
                    stack[top]
                }
            };
            if ORDERED && entry.enter() > *t_max {
                continue;
            }
            let link = Link::from_bits(entry.place());
            if L::AT_ONCE || !link.is_leaf() {
                break link.index();
            }
            if leaves.visit(link.index(), t_max, &mut stack[top..]) {
                return true;
            }
        };
    }
}

/// [`walk`] in the order that queries `Q` want.
#[inline(always)]
pub(crate) fn walk_for<K: Kernel, Q: Query, L: Leaves>(
    kernel: K,
    from: (&Tree, usize),
    ray: &LocalRay,
    t_max: &mut f32,
    stack: &mut [Entry],
    leaves: &mut L,
) -> bool {
    if Q::ORDERED {
        walk::<_, _, true>(kernel, from, ray, t_max, stack, leaves)
    } else {
        walk::<_, _, false>(kernel, from, ray, t_max, stack, leaves)
    }
}

/// The bits that are set, from the lowest.
#[inline(always)]
pub(crate) fn lanes(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        if bits == 0 {
            return None;
        }
        let lane = bits.trailing_zeros() as usize & (WIDTH - 1);
        bits &= bits - 1;
        Some(lane)
    })
}

#[inline(always)]
pub(crate) fn sort_nearest_last(entries: &mut [Entry]) {
    for i in 1..entries.len() {
        let entry = entries[i];
        let mut j = i;
        while j > 0 && entries[j - 1] < entry {
            entries[j] = entries[j - 1];
            j -= 1;
        }
        entries[j] = entry;
    }
}

/// Blocks of triangles.
pub(crate) struct MeshLeaves<'a, K, Q> {
    kernel: K,
    blocks: &'a [Block],
    ray: &'a LocalRay,
    instance: u32,
    query: &'a mut Q,
    hits: BlockHits,
}

impl<'a, K: Kernel, Q: Query> MeshLeaves<'a, K, Q> {
    #[inline(always)]
    pub(crate) fn new(
        kernel: K,
        blocks: &'a [Block],
        ray: &'a LocalRay,
        instance: u32,
        query: &'a mut Q,
    ) -> Self {
        Self {
            kernel,
            blocks,
            ray,
            instance,
            query,
            hits: BlockHits::default(),
        }
    }
}

impl<K: Kernel, Q: Query> Leaves for MeshLeaves<'_, K, Q> {
    const AT_ONCE: bool = true;

    #[inline(always)]
    fn prefetch(&self, leaf: usize) {
        prefetch(&self.blocks[leaf]);
    }

    #[inline(always)]
    fn visit(&mut self, leaf: usize, t_max: &mut f32, _: &mut [Entry]) -> bool {
        let block = &self.blocks[leaf];
        let hits = &mut self.hits;
        let lanes = self.kernel.triangles(block, self.ray, *t_max, hits);
        lanes != 0
            && self
                .query
                .take((self.instance, leaf as u32), block, lanes, hits, t_max)
    }
}

/// Instances.
pub(crate) struct WorldLeaves<'a, K, Q> {
    kernel: K,
    instances: &'a [Instance],
    ray: &'a Ray,
    query: &'a mut Q,
}

impl<'a, K: Kernel, Q: Query> WorldLeaves<'a, K, Q> {
    #[inline(always)]
    pub(crate) fn new(kernel: K, world: &'a World, ray: &'a Ray, query: &'a mut Q) -> Self {
        Self {
            kernel,
            instances: &world.instances,
            ray,
            query,
        }
    }
}

impl<K: Kernel, Q: Query> Leaves for WorldLeaves<'_, K, Q> {
    const AT_ONCE: bool = false;

    #[inline(always)]
    fn prefetch(&self, _: usize) {}

    #[inline(always)]
    fn visit(&mut self, leaf: usize, t_max: &mut f32, stack: &mut [Entry]) -> bool {
        let instance = &self.instances[leaf];
        let Some(ray) = instance.to_object(self.ray) else {
            return false;
        };
        let mesh = &instance.mesh;
        let local = LocalRay::new(&ray, mesh.extent);
        let tree = (&mesh.tree, 0);
        let mut leaves =
            MeshLeaves::new(self.kernel, &mesh.blocks, &local, leaf as u32, self.query);
        walk_for::<_, Q, _>(self.kernel, tree, &local, t_max, stack, &mut leaves)
    }
}

/// Runs a query; the ray must be valid.
#[inline(always)]
pub(crate) fn run<K: Kernel, Q: Query>(
    kernel: K,
    world: &World,
    ray: &Ray,
    mut t_max: f32,
    stack: &mut [Entry],
    query: &mut Q,
) {
    if let Some(leaf) = query.first_try()
        && try_block(kernel, world, ray, &mut t_max, leaf, query)
    {
        return;
    }
    let mut leaves = WorldLeaves::new(kernel, world, ray, query);
    if world.instances.len() == 1 {
        leaves.visit(0, &mut t_max, stack);
        return;
    }
    let local = LocalRay::with_slack(ray, world.extent, world.slack);
    let tree = (&world.tree, 0);
    walk_for::<_, Q, _>(kernel, tree, &local, &mut t_max, stack, &mut leaves);
}

/// Tries one leaf; returns whether that answers the query.
#[inline(always)]
fn try_block<K: Kernel, Q: Query>(
    kernel: K,
    world: &World,
    ray: &Ray,
    t_max: &mut f32,
    (index, block): (u32, u32),
    query: &mut Q,
) -> bool {
    let Some(instance) = world.instances.get(index as usize) else {
        return false;
    };
    let (Some(ray), true) = (
        instance.to_object(ray),
        (block as usize) < instance.mesh.blocks.len(),
    ) else {
        return false;
    };
    let mesh = &instance.mesh;
    let local = LocalRay::new(&ray, mesh.extent);
    MeshLeaves::new(kernel, &mesh.blocks, &local, index, query).visit(
        block as usize,
        t_max,
        &mut [],
    )
}
