//! One traversal for both levels and both kinds of query.

use std::marker::PhantomData;

use crate::{
    Hit, Occluder, Ray,
    kernel::Kernel,
    mesh::TriangleMesh,
    node::{Link, LocalRay, Tree, WIDTH},
    triangle::{Block, BlockHits},
    world::World,
};

/// A node still to be visited.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    node: u32,
    near: f32,
}

impl Entry {
    pub(crate) fn node(index: usize) -> Self {
        Self {
            node: index as u32,
            near: 0.,
        }
    }

    pub(crate) fn index(self) -> usize {
        self.node as usize
    }
}

/// Nodes still to be visited, shared by both levels.
pub(crate) type Stack = Vec<Entry>;

/// What is done at a tree's leaves.
trait Leaves {
    /// Visits one; returns whether the query is answered.
    fn visit(&mut self, leaf: usize, t_max: &mut f32, stack: &mut Stack) -> bool;
}

/// What a query makes of hits.
pub(crate) trait Query {
    /// Whether nearer nodes are worth visiting first.
    const ORDERED: bool;

    /// A leaf to try before all others, as instance and block.
    fn first_try(&self) -> Option<(u32, u32)> {
        None
    }

    /// Notes the leaf that answered the query.
    fn answered_by(&mut self, _instance: u32, _block: u32) {}

    /// Takes the hits of one block, in `lanes`, shortening `t_max` if only nearer ones matter; returns whether the query is answered.
    fn take(
        &mut self,
        instance: u32,
        block: &Block,
        lanes: u32,
        hits: &BlockHits,
        t_max: &mut f32,
    ) -> bool;
}

/// Visits the leaves of `tree` that the ray meets no later than `t_max`, which visits may shorten.
#[inline(always)]
fn walk<K: Kernel, const ORDERED: bool>(
    tree: &Tree,
    ray: &LocalRay,
    t_max: &mut f32,
    stack: &mut Stack,
    leaves: &mut impl Leaves,
) -> bool {
    if tree.nodes.is_empty() {
        return false;
    }
    let base = stack.len();
    let mut near = [0.; WIDTH];
    let mut current = 0;
    loop {
        let node = &tree.nodes[current];
        let mut lanes = K::slabs(node, ray, *t_max, &mut near);
        let first = stack.len();
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let child: Link = node.children[lane];
            if child.is_leaf() {
                if near[lane] <= *t_max && leaves.visit(child.index(), t_max, stack) {
                    stack.truncate(base);
                    return true;
                }
            } else {
                stack.push(Entry {
                    node: child.index() as u32,
                    near: near[lane],
                });
            }
        }
        if ORDERED {
            sort_nearest_last(&mut stack[first..]);
        }
        current = loop {
            if stack.len() == base {
                return false;
            }
            match stack.pop() {
                Some(entry) if entry.near <= *t_max => break entry.node as usize,
                Some(_) => {}
                None => return false,
            }
        };
    }
}

#[inline(always)]
fn sort_nearest_last(entries: &mut [Entry]) {
    for i in 1..entries.len() {
        let entry = entries[i];
        let mut j = i;
        while j > 0 && entries[j - 1].near < entry.near {
            entries[j] = entries[j - 1];
            j -= 1;
        }
        entries[j] = entry;
    }
}

struct MeshLeaves<'a, K, Q> {
    kernel: PhantomData<K>,
    hits: BlockHits,
    blocks: &'a [Block],
    ray: &'a LocalRay,
    instance: u32,
    query: &'a mut Q,
}

impl<K: Kernel, Q: Query> Leaves for MeshLeaves<'_, K, Q> {
    #[inline(always)]
    fn visit(&mut self, leaf: usize, t_max: &mut f32, _: &mut Stack) -> bool {
        let block = &self.blocks[leaf];
        let lanes = K::triangles(block, self.ray, *t_max, &mut self.hits);
        if lanes == 0
            || !self
                .query
                .take(self.instance, block, lanes, &self.hits, t_max)
        {
            return false;
        }
        self.query.answered_by(self.instance, leaf as u32);
        true
    }
}

struct WorldLeaves<'a, K, Q> {
    kernel: PhantomData<K>,
    world: &'a World,
    ray: &'a Ray,
    query: &'a mut Q,
}

impl<K: Kernel, Q: Query> Leaves for WorldLeaves<'_, K, Q> {
    #[inline(always)]
    fn visit(&mut self, leaf: usize, t_max: &mut f32, stack: &mut Stack) -> bool {
        let instance = &self.world.instances[leaf];
        if !instance.traceable {
            return false;
        }
        let ray = instance.to_object(self.ray);
        walk_mesh::<K, Q>(&instance.mesh, &ray, leaf as u32, t_max, stack, self.query)
    }
}

#[inline(always)]
fn walk_mesh<K: Kernel, Q: Query>(
    mesh: &TriangleMesh,
    ray: &Ray,
    instance: u32,
    t_max: &mut f32,
    stack: &mut Stack,
    query: &mut Q,
) -> bool {
    let local = LocalRay::new(ray, mesh.extent);
    let mut leaves = MeshLeaves {
        kernel: PhantomData::<K>,
        hits: BlockHits::default(),
        blocks: &mesh.blocks,
        ray: &local,
        instance,
        query,
    };
    if Q::ORDERED {
        walk::<K, true>(&mesh.tree, &local, t_max, stack, &mut leaves)
    } else {
        walk::<K, false>(&mesh.tree, &local, t_max, stack, &mut leaves)
    }
}

/// Runs a query; the ray must be valid.
#[inline(always)]
pub(crate) fn run<K: Kernel, Q: Query>(
    world: &World,
    ray: &Ray,
    mut t_max: f32,
    stack: &mut Stack,
    query: &mut Q,
) {
    if let Some((instance, block)) = query.first_try()
        && try_block::<K, Q>(world, ray, &mut t_max, (instance, block), query)
    {
        return;
    }
    let mut leaves = WorldLeaves {
        kernel: PhantomData::<K>,
        world,
        ray,
        query,
    };
    if world.instances.len() == 1 {
        leaves.visit(0, &mut t_max, stack);
        return;
    }
    let local = LocalRay::with_slack(ray, world.extent, world.slack);
    if Q::ORDERED {
        walk::<K, true>(&world.tree, &local, &mut t_max, stack, &mut leaves);
    } else {
        walk::<K, false>(&world.tree, &local, &mut t_max, stack, &mut leaves);
    }
}

/// Tries one leaf; returns whether that answers the query.
#[inline(always)]
fn try_block<K: Kernel, Q: Query>(
    world: &World,
    ray: &Ray,
    t_max: &mut f32,
    (index, block): (u32, u32),
    query: &mut Q,
) -> bool {
    let Some(instance) = world.instances.get(index as usize).filter(|i| i.traceable) else {
        return false;
    };
    let Some(block) = instance.mesh.blocks.get(block as usize) else {
        return false;
    };
    let local = LocalRay::new(&instance.to_object(ray), instance.mesh.extent);
    let mut hits = BlockHits::default();
    let lanes = K::triangles(block, &local, *t_max, &mut hits);
    lanes != 0 && query.take(index, block, lanes, &hits, t_max)
}

/// The closest hit.
pub(crate) struct Closest {
    best: Hit,
}

impl Closest {
    pub(crate) fn within(t_max: f32) -> Self {
        let best = Hit {
            t: t_max,
            instance: u32::MAX,
            face: u32::MAX,
            barycentric: [0.; 2],
        };
        Self { best }
    }

    pub(crate) fn hit(self) -> Option<Hit> {
        (self.best.instance != u32::MAX).then_some(self.best)
    }
}

impl Query for Closest {
    const ORDERED: bool = true;

    #[inline(always)]
    fn take(
        &mut self,
        instance: u32,
        block: &Block,
        mut lanes: u32,
        hits: &BlockHits,
        t_max: &mut f32,
    ) -> bool {
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let (t, face) = (hits.t[lane], block.faces[lane]);
            let best = &self.best;
            if t < best.t || (t == best.t && (instance, face) < (best.instance, best.face)) {
                let scale = 1. / hits.determinant[lane];
                let barycentric = [hits.v[lane] * scale, hits.w[lane] * scale];
                self.best = Hit {
                    t,
                    instance,
                    face,
                    barycentric,
                };
                *t_max = t;
            }
        }
        false
    }
}

/// The first hit met that is accepted.
pub(crate) struct Any<F> {
    pub(crate) accept: F,
    pub(crate) found: Option<Occluder>,
    /// Leaf of the last hit of a query like this.
    pub(crate) recent: Option<(u32, u32)>,
}

impl<F: FnMut(u32, u32) -> bool> Query for Any<F> {
    const ORDERED: bool = false;

    #[inline(always)]
    fn first_try(&self) -> Option<(u32, u32)> {
        self.recent
    }

    #[inline(always)]
    fn answered_by(&mut self, instance: u32, block: u32) {
        self.recent = Some((instance, block));
    }

    #[inline(always)]
    fn take(
        &mut self,
        instance: u32,
        block: &Block,
        mut lanes: u32,
        _: &BlockHits,
        _: &mut f32,
    ) -> bool {
        while lanes != 0 {
            let face = block.faces[lanes.trailing_zeros() as usize];
            lanes &= lanes - 1;
            if (self.accept)(instance, face) {
                self.found = Some(Occluder { instance, face });
                return true;
            }
        }
        false
    }
}
