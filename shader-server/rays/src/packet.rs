//! Eight rays that run alike, together.
//!
//! A node's boxes are tested against the hull of all rays first, all eight boxes at once as for a single ray; a child that
//! the hull meets is tested against the rays themselves when it is its turn. Blocks of triangles, and subtrees that only few
//! rays meet, are left to the code for single rays, so that hits are those of single rays to the bit.

use glam::{BVec3A, Vec3A};

use crate::{
    Ray,
    kernel::Kernel,
    node::{LocalRay, Planes, Row, Tree, WIDTH},
    prefetch::prefetch,
    query::Query,
    traverse::{Entry, Leaves, MeshLeaves, WorldLeaves, lanes, sort_nearest_last, walk_for},
    world::World,
};

/// Subtrees that at most so many rays meet are walked ray by ray.
const FEW: u32 = 2;

/// Eight rays of one octant as structure of arrays, and their hull.
#[derive(Clone, Debug)]
pub(crate) struct Bundle {
    /// For the hull.
    pub(crate) near: Planes,
    /// For the hull.
    pub(crate) far: Planes,
    pub(crate) near_origin: [[f32; WIDTH]; 3],
    pub(crate) far_origin: [[f32; WIDTH]; 3],
    pub(crate) inverse: [[f32; WIDTH]; 3],
}

impl Bundle {
    /// The bundle of `rays`, unless they run into different octants.
    #[inline(always)]
    pub(crate) fn new(rays: &[LocalRay; WIDTH]) -> Option<Self> {
        let (near, far) = (rays[0].near, rays[0].far);
        let mut bundle = Self {
            near,
            far,
            near_origin: [[0.; WIDTH]; 3],
            far_origin: [[0.; WIDTH]; 3],
            inverse: [[0.; WIDTH]; 3],
        };
        let mut near_origins = Range::EMPTY;
        let mut far_origins = Range::EMPTY;
        let mut inverses = Range::EMPTY;
        for (i, ray) in rays.iter().enumerate() {
            if ray.near.rows != near.rows {
                return None;
            }
            for axis in 0..3 {
                bundle.near_origin[axis][i] = ray.near.origin[axis];
                bundle.far_origin[axis][i] = ray.far.origin[axis];
                bundle.inverse[axis][i] = ray.near.inverse[axis];
            }
            near_origins.add(ray.near.origin);
            far_origins.add(ray.far.origin);
            inverses.add(ray.near.inverse);
        }
        // No ray enters a box earlier than one from the foremost origin that runs slowest, nor leaves it later than one from
        // the hindmost that runs fastest; where that is wrong the distance is negative, and means nothing.
        let forwards = BVec3A::new(
            near.rows[0] == Row::MinX,
            near.rows[1] == Row::MinY,
            near.rows[2] == Row::MinZ,
        );
        let pick = |a: Vec3A, b: Vec3A| Vec3A::select(forwards, a, b).to_array();
        bundle.near.origin = pick(near_origins.most, near_origins.least);
        bundle.near.inverse = pick(inverses.least, inverses.most);
        bundle.far.origin = pick(far_origins.least, far_origins.most);
        bundle.far.inverse = pick(inverses.most, inverses.least);
        Some(bundle)
    }
}

/// Least and largest of several vectors' components.
struct Range {
    least: Vec3A,
    most: Vec3A,
}

impl Range {
    const EMPTY: Self = Self {
        least: Vec3A::INFINITY,
        most: Vec3A::NEG_INFINITY,
    };

    #[inline(always)]
    fn add(&mut self, values: [f32; 3]) {
        let values = Vec3A::from_array(values);
        self.least = self.least.min(values);
        self.most = self.most.max(values);
    }
}

/// Eight queries, and how far each ray still matters: less than 0 for those that are answered or were never asked.
pub(crate) struct Asked<Q> {
    pub(crate) queries: [Q; WIDTH],
    pub(crate) t_max: [f32; WIDTH],
}

impl<Q> Asked<Q> {
    /// Nothing asked yet.
    #[inline(always)]
    pub(crate) fn new(queries: [Q; WIDTH]) -> Self {
        Self {
            queries,
            t_max: [-1.; WIDTH],
        }
    }

    #[inline(always)]
    fn farthest(&self) -> f32 {
        let mut farthest = -1.;
        for t in self.t_max {
            farthest = if t > farthest { t } else { farthest };
        }
        farthest
    }
}

/// What is done at a tree's leaves, and with rays that go on alone.
trait PacketLeaves<Q> {
    /// Whether leaves are tried as soon as they are met.
    const AT_ONCE: bool;

    /// Says that a leaf will be visited soon.
    fn prefetch(&self, leaf: usize);

    /// Visits a leaf with the rays whose bits are set.
    fn visit(&mut self, leaf: usize, rays: u32, asked: &mut Asked<Q>, stack: &mut [Entry]);

    /// Walks the subtree of a node with one ray.
    fn walk_alone(&mut self, node: usize, ray: usize, asked: &mut Asked<Q>, stack: &mut [Entry]);
}

/// Visits what the rays meet in `tree`.
#[inline(always)]
fn walk_together<K: Kernel, Q: Query, L: PacketLeaves<Q>>(
    kernel: K,
    tree: &Tree,
    bundle: &Bundle,
    asked: &mut Asked<Q>,
    stack: &mut [Entry],
    leaves: &mut L,
) {
    if tree.nodes.is_empty() {
        return;
    }
    let mut enter = [0.; WIDTH];
    let mut current = 0;
    let mut top = 0;
    let mut farthest = asked.farthest();
    loop {
        let node = &tree.nodes[current];
        let met = kernel.slabs(node, &bundle.near, &bundle.far, farthest, &mut enter);
        let at_once = if L::AT_ONCE { met & node.leaves } else { 0 };
        for lane in lanes(at_once) {
            leaves.prefetch(node.children[lane].index());
        }
        let first = top;
        for lane in lanes(met & !at_once) {
            let link = node.children[lane];
            if !link.is_leaf() {
                prefetch(&tree.nodes[link.index()]);
            }
            stack[top] = Entry::new(enter[lane], (current * WIDTH + lane) as u32);
            top += 1;
        }
        if Q::ORDERED {
            sort_nearest_last(&mut stack[first..top]);
        }
        if at_once != 0 {
            let mut left = at_once;
            let mut rays = 0;
            for lane in lanes(left) {
                left &= left - 1;
                rays |= kernel.rays_in_box(node, lane, bundle, &asked.t_max);
                // Neighbours may share a leaf.
                let link = node.children[lane];
                if left != 0 && node.children[left.trailing_zeros() as usize % WIDTH] == link {
                    continue;
                }
                if rays != 0 {
                    leaves.visit(link.index(), rays, asked, &mut stack[top..]);
                    farthest = -1.;
                }
                rays = 0;
            }
            if farthest < 0. {
                farthest = asked.farthest();
            }
        }
        current = loop {
            if top == 0 || farthest < 0. {
                return;
            }
            top -= 1;
            if stack[top].enter() > farthest {
                continue;
            }
            let place = stack[top].place() as usize;
            let (node, lane) = (&tree.nodes[place / WIDTH], place % WIDTH);
            let rays = kernel.rays_in_box(node, lane, bundle, &asked.t_max);
            if rays == 0 {
                continue;
            }
            let link = node.children[lane];
            if !L::AT_ONCE && link.is_leaf() {
                leaves.visit(link.index(), rays, asked, &mut stack[top..]);
                farthest = asked.farthest();
            } else if rays.count_ones() <= FEW {
                for ray in lanes(rays) {
                    leaves.walk_alone(link.index(), ray, asked, &mut stack[top..]);
                }
                farthest = asked.farthest();
            } else {
                break link.index();
            }
        };
    }
}

struct MeshPacket<'a, K> {
    kernel: K,
    world: &'a World,
    instance: u32,
    rays: &'a [LocalRay; WIDTH],
}

impl<K: Kernel> MeshPacket<'_, K> {
    /// Runs `visit` on one ray's leaves, and notes whether its query is answered.
    #[inline(always)]
    fn alone<Q: Query>(
        &self,
        ray: usize,
        asked: &mut Asked<Q>,
        visit: impl FnOnce(&mut MeshLeaves<'_, K, Q>, &mut f32) -> bool,
    ) {
        let blocks = &self.world.instances[self.instance as usize].mesh.blocks;
        let query = &mut asked.queries[ray];
        let mut leaves =
            MeshLeaves::new(self.kernel, blocks, &self.rays[ray], self.instance, query);
        if visit(&mut leaves, &mut asked.t_max[ray]) {
            asked.t_max[ray] = -1.;
        }
    }
}

impl<K: Kernel, Q: Query> PacketLeaves<Q> for MeshPacket<'_, K> {
    const AT_ONCE: bool = true;

    #[inline(always)]
    fn prefetch(&self, leaf: usize) {
        prefetch(&self.world.instances[self.instance as usize].mesh.blocks[leaf]);
    }

    #[inline(always)]
    fn visit(&mut self, leaf: usize, rays: u32, asked: &mut Asked<Q>, _: &mut [Entry]) {
        for ray in lanes(rays) {
            self.alone(
                ray,
                asked,
                #[inline(always)]
                |leaves, t_max| leaves.visit(leaf, t_max, &mut []),
            );
        }
    }

    #[inline(always)]
    fn walk_alone(&mut self, node: usize, ray: usize, asked: &mut Asked<Q>, stack: &mut [Entry]) {
        let mesh = &self.world.instances[self.instance as usize].mesh;
        let (tree, local) = ((&mesh.tree, node), &self.rays[ray]);
        self.alone(
            ray,
            asked,
            #[inline(always)]
            |leaves, t_max| walk_for::<_, Q, _>(self.kernel, tree, local, t_max, stack, leaves),
        );
    }
}

struct WorldPacket<'a, K> {
    kernel: K,
    world: &'a World,
    rays: &'a [Ray; WIDTH],
    locals: &'a [LocalRay; WIDTH],
}

impl<K: Kernel, Q: Query> PacketLeaves<Q> for WorldPacket<'_, K> {
    const AT_ONCE: bool = false;

    #[inline(always)]
    fn prefetch(&self, _: usize) {}

    #[inline(always)]
    fn visit(&mut self, leaf: usize, rays: u32, asked: &mut Asked<Q>, stack: &mut [Entry]) {
        visit_instance(self.kernel, self.world, leaf, self.rays, rays, asked, stack);
    }

    #[inline(always)]
    fn walk_alone(&mut self, node: usize, ray: usize, asked: &mut Asked<Q>, stack: &mut [Entry]) {
        let query = &mut asked.queries[ray];
        let (tree, local) = ((&self.world.tree, node), &self.locals[ray]);
        let t_max = &mut asked.t_max[ray];
        let mut leaves = WorldLeaves::new(self.kernel, self.world, &self.rays[ray], query);
        if walk_for::<_, Q, _>(self.kernel, tree, local, t_max, stack, &mut leaves) {
            *t_max = -1.;
        }
    }
}

/// Runs those of `rays` whose bits are set in `taking_part` through one instance.
#[inline(always)]
fn visit_instance<K: Kernel, Q: Query>(
    kernel: K,
    world: &World,
    index: usize,
    rays: &[Ray; WIDTH],
    taking_part: u32,
    asked: &mut Asked<Q>,
    stack: &mut [Entry],
) {
    let instance = &world.instances[index];
    let mesh = &instance.mesh;
    // Rays that do not take part run along with one that does, and reach nothing.
    let mut objects = *rays;
    let mut stand_in = None;
    let mut apart = 0;
    for (i, ray) in objects.iter_mut().enumerate() {
        let local = (taking_part >> i & 1 == 1).then(|| instance.to_object(ray));
        match local.flatten() {
            Some(local) => {
                *ray = local;
                stand_in = stand_in.or(Some(local));
            }
            None => apart |= 1u32 << i,
        }
    }
    let Some(stand_in) = stand_in else {
        return;
    };
    let before = asked.t_max;
    for i in lanes(apart) {
        objects[i] = stand_in;
        asked.t_max[i] = -1.;
    }
    let locals = local_rays(&objects, mesh.extent, 1.);
    let mut packet = MeshPacket {
        kernel,
        world,
        instance: index as u32,
        rays: &locals,
    };
    match Bundle::new(&locals) {
        Some(bundle) => walk_together(kernel, &mesh.tree, &bundle, asked, stack, &mut packet),
        None => {
            for ray in lanes(!apart & 0xFF) {
                packet.walk_alone(0, ray, asked, stack);
            }
        }
    }
    for i in lanes(apart) {
        asked.t_max[i] = before[i];
    }
}

#[inline(always)]
fn local_rays(rays: &[Ray; WIDTH], extent: f32, slack: f32) -> [LocalRay; WIDTH] {
    let mut locals = [LocalRay::with_slack(&rays[0], extent, slack); WIDTH];
    for i in 1..WIDTH {
        locals[i] = LocalRay::with_slack(&rays[i], extent, slack);
    }
    locals
}

/// Runs a query for each of at most eight rays; those that are not valid are not asked.
#[inline(always)]
pub(crate) fn run_together<K: Kernel, Q: Query>(
    kernel: K,
    world: &World,
    rays: &[Ray],
    t_max: f32,
    asked: &mut Asked<Q>,
    stack: &mut [Entry],
) {
    let Some(stand_in) = rays.iter().find(|ray| ray.is_valid()).copied() else {
        return;
    };
    let mut taking_part = 0;
    let mut all = [stand_in; WIDTH];
    asked.t_max = [-1.; WIDTH];
    for (i, ray) in rays.iter().enumerate().take(WIDTH) {
        if ray.is_valid() && t_max > 0. {
            all[i] = *ray;
            asked.t_max[i] = t_max;
            taking_part |= 1 << i;
        }
    }
    if world.instances.len() == 1 {
        visit_instance(kernel, world, 0, &all, taking_part, asked, stack);
        return;
    }
    let locals = local_rays(&all, world.extent, world.slack);
    let mut packet = WorldPacket {
        kernel,
        world,
        rays: &all,
        locals: &locals,
    };
    match Bundle::new(&locals) {
        Some(bundle) => walk_together(kernel, &world.tree, &bundle, asked, stack, &mut packet),
        None => {
            for ray in lanes(taking_part) {
                packet.walk_alone(0, ray, asked, stack);
            }
        }
    }
}
