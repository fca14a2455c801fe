//! The upper level: meshes somewhere.

use std::{cell::Cell, sync::Arc};

use glam::{Affine3A, DAffine3, DMat3, DVec3, Mat3A, Vec3, Vec3A};

use crate::{
    Bounds, Hit, Occluder, Ray, Region,
    build::binary_tree,
    collapse::collapse,
    dispatch::{Level, any, any_each, closest, closest_each, region_touched},
    mesh::TriangleMesh,
    node::Tree,
    query::Any,
    traverse::Entry,
};

thread_local! {
    /// Places still to be visited, kept from query to query.
    static STACK: Cell<Vec<Entry>> = const { Cell::new(Vec::new()) };
}

#[derive(Clone, Debug)]
pub(crate) struct Instance {
    pub(crate) mesh: Arc<TriangleMesh>,
    /// Whether rays can reach it: it has faces, and its transform can be inverted.
    pub(crate) traceable: bool,
    identity: bool,
    to_object: Affine3A,
    to_world: Mat3A,
    bounds: Bounds,
    /// How much more than a unit transform it enlarges rounding errors.
    condition: f32,
}

impl Instance {
    fn new(mesh: Arc<TriangleMesh>, transform: Affine3A) -> Self {
        let wide = DAffine3 {
            matrix3: DMat3::from_cols(
                transform.matrix3.x_axis.as_dvec3(),
                transform.matrix3.y_axis.as_dvec3(),
                transform.matrix3.z_axis.as_dvec3(),
            ),
            translation: transform.translation.as_dvec3(),
        };
        let inverse = wide.inverse();
        let to_object = Affine3A {
            matrix3: Mat3A::from_cols(
                inverse.matrix3.x_axis.as_vec3a(),
                inverse.matrix3.y_axis.as_vec3a(),
                inverse.matrix3.z_axis.as_vec3a(),
            ),
            translation: inverse.translation.as_vec3a(),
        };
        let bounds = transformed(&wide, mesh.bounds());
        let condition = (norm(&wide.matrix3) * norm(&inverse.matrix3)) as f32;
        let traceable = !bounds.is_empty()
            && bounds.min.is_finite()
            && bounds.max.is_finite()
            && to_object.is_finite()
            && condition.is_finite();
        Self {
            mesh,
            traceable,
            identity: transform == Affine3A::IDENTITY,
            to_object,
            to_world: transform.matrix3,
            bounds: if traceable { bounds } else { Bounds::EMPTY },
            condition: if traceable { condition } else { 1. },
        }
    }

    /// The linear part of its transform, if that does anything.
    #[inline(always)]
    pub(crate) fn to_world_unless_identity(&self) -> Option<&Mat3A> {
        (!self.identity).then_some(&self.to_world)
    }

    /// A point of world space in object space.
    #[inline(always)]
    pub(crate) fn point_to_object(&self, point: Vec3) -> Vec3 {
        self.to_object.transform_point3a(Vec3A::from(point)).into()
    }

    /// The ray in object space, unless it cannot hit anything there; distances along it stay what they are.
    #[inline(always)]
    pub(crate) fn to_object(&self, ray: &Ray) -> Option<Ray> {
        if self.identity || !self.traceable {
            return self.traceable.then_some(*ray);
        }
        let local = Ray {
            origin: self
                .to_object
                .transform_point3a(Vec3A::from(ray.origin))
                .into(),
            direction: self
                .to_object
                .transform_vector3a(Vec3A::from(ray.direction))
                .into(),
        };
        local.is_valid().then_some(local)
    }
}

/// Largest sum of absolute values in a row.
fn norm(matrix: &DMat3) -> f64 {
    (matrix.x_axis.abs() + matrix.y_axis.abs() + matrix.z_axis.abs()).max_element()
}

fn transformed(transform: &DAffine3, bounds: Bounds) -> Bounds {
    if bounds.is_empty() {
        return Bounds::EMPTY;
    }
    (0..8).fold(Bounds::EMPTY, |all, corner| {
        let pick = |axis: usize| {
            if corner >> axis & 1 == 0 {
                bounds.min[axis]
            } else {
                bounds.max[axis]
            }
        };
        let point = DVec3::new(pick(0).into(), pick(1).into(), pick(2).into());
        all.with_point(transform.transform_point3(point).as_vec3())
    })
}

/// What blocked the last of several similar rays, see [`World::occluder_again`]. Good for any world; of use in one.
#[derive(Clone, Copy, Debug, Default)]
pub struct Recent(Option<(u32, u32)>);

/// Meshes with their places, ready for rays.
///
/// Queries take `&self` and may run on any number of threads. A ray with a number that is not finite, or without a
/// direction, hits nothing. Distances count in (0, `t_max`].
#[derive(Clone, Debug)]
pub struct World {
    pub(crate) instances: Vec<Instance>,
    pub(crate) tree: Tree,
    pub(crate) extent: f32,
    pub(crate) slack: f32,
    pub(crate) level: Level,
    stack_size: usize,
}

impl World {
    /// Places meshes by object-to-world transforms, which may scale differently along axes, and mirror. An instance whose
    /// transform has no inverse is never hit.
    #[must_use]
    pub fn new(instances: Vec<(Arc<TriangleMesh>, Affine3A)>) -> Self {
        let instances: Vec<Instance> = instances
            .into_iter()
            .map(|(mesh, at)| Instance::new(mesh, at))
            .collect();
        let boxes: Vec<Bounds> = instances
            .iter()
            .map(|i| {
                if i.traceable {
                    i.bounds
                } else {
                    Bounds::EMPTY.with_point(Vec3::ZERO)
                }
            })
            .collect();
        let tree = if boxes.len() > 1 {
            collapse(&binary_tree(&boxes), 1, |primitives| primitives[0] as usize)
        } else {
            Tree::default()
        };
        let mut world = Self {
            instances,
            tree,
            extent: 0.,
            slack: 1.,
            level: Level::Vector(fearless_simd::Level::new()),
            stack_size: 0,
        };
        world.refit();
        world
    }

    /// The same world, traced with the vector instructions that every processor of this architecture has: same results, to
    /// the bit.
    #[must_use]
    pub fn with_baseline_simd(mut self) -> Self {
        self.level = Level::Vector(fearless_simd::Level::baseline());
        self
    }

    /// The same world, traced without vector instructions: same results, to the bit.
    #[must_use]
    pub fn without_simd(mut self) -> Self {
        self.level = Level::Plain;
        self
    }

    /// Moves an instance; takes effect for queries after [`refit`](Self::refit). Returns whether there is such an instance.
    pub fn set_transform(&mut self, instance: u32, transform: Affine3A) -> bool {
        match self.instances.get_mut(instance as usize) {
            Some(slot) => {
                *slot = Instance::new(Arc::clone(&slot.mesh), transform);
                true
            }
            None => false,
        }
    }

    /// Puts another mesh in an instance's place; otherwise like [`set_transform`](Self::set_transform).
    pub fn set_instance(
        &mut self,
        instance: u32,
        mesh: Arc<TriangleMesh>,
        transform: Affine3A,
    ) -> bool {
        match self.instances.get_mut(instance as usize) {
            Some(slot) => {
                *slot = Instance::new(mesh, transform);
                true
            }
            None => false,
        }
    }

    /// Brings the upper tree's boxes up to date after moves.
    pub fn refit(&mut self) {
        for index in (0..self.tree.nodes.len()).rev() {
            for lane in 0..self.tree.nodes[index].children.len() {
                let child = self.tree.nodes[index].children[lane];
                let bounds = if child.is_none() {
                    Bounds::EMPTY
                } else if child.is_leaf() {
                    self.instances[child.index()].bounds
                } else {
                    self.tree.nodes[child.index()].total_bounds()
                };
                self.tree.nodes[index].set_bounds(lane, &bounds);
            }
        }
        let meshes = self.instances.iter().map(|i| i.mesh.tree.stack_size());
        // A packet in a mesh may leave a single ray to walk a part of it.
        self.stack_size = 2 * (self.tree.stack_size() + meshes.max().unwrap_or(0));
        self.extent = self.bounds().max_abs();
        self.slack = self
            .instances
            .iter()
            .map(|i| 2. * i.condition)
            .fold(1., f32::max);
    }

    /// Number of instances.
    #[must_use]
    pub fn len(&self) -> usize {
        self.instances.len()
    }

    /// Whether there is no instance.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.instances.is_empty()
    }

    /// Bounds of all instances, world space.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.instances
            .iter()
            .fold(Bounds::EMPTY, |all, i| all.union(i.bounds))
    }

    /// The box around an instance, world space; empty if rays cannot reach it or there is none.
    #[must_use]
    pub fn instance_bounds(&self, instance: u32) -> Bounds {
        let instance = self.instances.get(instance as usize);
        instance.map_or(Bounds::EMPTY, |i| i.bounds)
    }

    /// The closest hit at a distance of at most `t_max`.
    #[must_use]
    pub fn closest(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        let may_hit = ray.is_valid() && t_max > 0. && !self.instances.is_empty();
        if !may_hit {
            return None;
        }
        self.with_stack(|stack| closest(self, ray, t_max, stack))
            .hit()
    }

    /// [`closest`](Self::closest) for each of `rays`, in order, into `hits`, whose contents are replaced.
    ///
    /// Eight neighbours in the list at a time are traced together, which pays where they run alike, such as those through
    /// neighbouring pixels; hits are the same as one by one, to the bit.
    pub fn closest_each(&self, rays: &[Ray], t_max: f32, hits: &mut Vec<Option<Hit>>) {
        hits.clear();
        if self.instances.is_empty() {
            hits.resize(rays.len(), None);
            return;
        }
        self.with_stack(|stack| closest_each(self, rays, t_max, stack, |c| hits.push(c.hit())));
    }

    /// Something that the ray meets at a distance of at most `t_max`: not the closest, but the first found.
    #[must_use]
    pub fn occluder(&self, ray: &Ray, t_max: f32) -> Option<Occluder> {
        self.occluder_where(ray, t_max, |_, _| true)
    }

    /// Like [`occluder`](Self::occluder), of the faces for which `accept(instance, face)` holds.
    pub fn occluder_where(
        &self,
        ray: &Ray,
        t_max: f32,
        accept: impl FnMut(u32, u32) -> bool,
    ) -> Option<Occluder> {
        self.occluder_again(ray, t_max, &mut Recent::default(), accept)
    }

    /// Like [`occluder_where`](Self::occluder_where), for rays that may well be blocked by what blocked the last one: what
    /// is in `recent` is tried first, and changed to what blocks this ray.
    pub fn occluder_again(
        &self,
        ray: &Ray,
        t_max: f32,
        recent: &mut Recent,
        mut accept: impl FnMut(u32, u32) -> bool,
    ) -> Option<Occluder> {
        let may_hit = ray.is_valid() && t_max > 0. && !self.instances.is_empty();
        if !may_hit {
            return None;
        }
        let mut query = Any {
            accept: &mut accept as &mut dyn FnMut(u32, u32) -> bool,
            found: None,
            recent: recent.0,
        };
        self.with_stack(|stack| any(self, ray, t_max, &mut query, stack));
        recent.0 = query.recent;
        query.found
    }

    /// An occluder of each of `rays`, in order, into `found`, whose contents are replaced: there is one where
    /// [`occluder_where`](Self::occluder_where) finds one, though it may be another. `accept` gets a ray's index, an instance
    /// and a face.
    ///
    /// Rays are traced together as by [`closest_each`](Self::closest_each).
    pub fn occluder_each(
        &self,
        rays: &[Ray],
        t_max: f32,
        accept: impl Fn(usize, u32, u32) -> bool,
        found: &mut Vec<Option<Occluder>>,
    ) {
        found.clear();
        if self.instances.is_empty() {
            found.resize(rays.len(), None);
            return;
        }
        self.with_stack(|stack| any_each(self, rays, t_max, &accept, stack, |o| found.push(o)));
    }

    /// Whether a face for which `accept(instance, face)` holds may reach into `region`. "No" is certain to the rounding of
    /// coordinates relative to the region's apex; "yes" may be wrong for faces near its edges.
    pub fn may_touch(&self, region: &Region, mut accept: impl FnMut(u32, u32) -> bool) -> bool {
        self.with_stack(|stack| region_touched(self, region, stack, &mut accept))
    }

    /// Lends this thread's stack, large enough for this world.
    #[inline(always)]
    fn with_stack<T>(&self, query: impl FnOnce(&mut [Entry]) -> T) -> T {
        let mut stack = STACK.take();
        if stack.len() < self.stack_size {
            stack.resize(self.stack_size, Entry::NONE);
        }
        let answer = query(&mut stack);
        STACK.set(stack);
        answer
    }
}
