//! Whether anything is in a convex region, such as the shaft between a point and a light.
//!
//! A region without triangles needs no rays at all. The answer errs on one side: "nothing" is certain.

use glam::{Mat3A, Vec3, Vec3A};

use crate::{
    node::{Link, Node, Tree, WIDTH},
    traverse::{Entry, lanes},
    triangle::Block,
    world::{Instance, World},
};

/// Planes that bound a region.
const PLANES: usize = 6;

/// Points `x` with `normal·(x − apex) ≥ offset` for every plane.
///
/// Coordinates are taken relative to the apex, so that tests are sharpest around it.
#[derive(Clone, Copy, Debug)]
pub struct Region {
    apex: Vec3,
    normals: [Vec3; PLANES],
    offsets: [f32; PLANES],
}

impl Region {
    /// The region with these planes, each a normal and an offset; normals need not have unit length, and one that is zero
    /// with an offset of zero bounds nothing.
    #[must_use]
    pub fn new(apex: Vec3, planes: [(Vec3, f32); PLANES]) -> Self {
        Self {
            apex,
            normals: planes.map(|p| p.0),
            offsets: planes.map(|p| p.1),
        }
    }

    fn is_finite(&self) -> bool {
        self.apex.is_finite()
            && self.normals.iter().all(|n| n.is_finite())
            && self.offsets.iter().all(|o| o.is_finite())
    }

    /// The same region in the object space of a linear map `to_world` whose inverse takes the apex to `apex`.
    fn in_object(&self, to_world: &Mat3A, apex: Vec3) -> Self {
        let transposed = to_world.transpose();
        let normals = self.normals.map(|n| (transposed * Vec3A::from(n)).into());
        Self {
            apex,
            normals,
            offsets: self.offsets,
        }
    }

    /// Lanes whose boxes may reach into the region.
    #[inline(always)]
    fn boxes(&self, node: &Node) -> u32 {
        let mut slack = [f32::INFINITY; WIDTH];
        for (normal, offset) in self.normals.iter().zip(self.offsets) {
            // The corner of each box that is farthest along the normal.
            let row = |axis: usize| if normal[axis] < 0. { axis } else { axis + 3 };
            let (xs, ys, zs) = (
                &node.bounds[row(0)],
                &node.bounds[row(1)],
                &node.bounds[row(2)],
            );
            for lane in 0..WIDTH {
                let distance = normal.x * (xs[lane] - self.apex.x)
                    + normal.y * (ys[lane] - self.apex.y)
                    + normal.z * (zs[lane] - self.apex.z)
                    - offset;
                slack[lane] = if distance < slack[lane] {
                    distance
                } else {
                    slack[lane]
                };
            }
        }
        lanes_not_below_zero(&slack)
    }

    /// Lanes whose triangles may reach into the region.
    #[inline(always)]
    fn triangles(&self, block: &Block) -> u32 {
        let mut slack = [f32::INFINITY; WIDTH];
        for (normal, offset) in self.normals.iter().zip(self.offsets) {
            // Lanes without a triangle are NaN, which is above nothing.
            let mut farthest = [f32::NEG_INFINITY; WIDTH];
            for [xs, ys, zs] in &block.corners {
                for lane in 0..WIDTH {
                    let distance = normal.x * (xs[lane] - self.apex.x)
                        + normal.y * (ys[lane] - self.apex.y)
                        + normal.z * (zs[lane] - self.apex.z);
                    farthest[lane] = if distance > farthest[lane] {
                        distance
                    } else {
                        farthest[lane]
                    };
                }
            }
            for lane in 0..WIDTH {
                let distance = farthest[lane] - offset;
                slack[lane] = if distance < slack[lane] {
                    distance
                } else {
                    slack[lane]
                };
            }
        }
        lanes_not_below_zero(&slack)
    }
}

#[inline(always)]
fn lanes_not_below_zero(values: &[f32; WIDTH]) -> u32 {
    values
        .iter()
        .enumerate()
        .fold(0, |lanes, (lane, v)| lanes | u32::from(*v >= 0.) << lane)
}

/// Whether a face for which `accept(instance, face)` holds may reach into `region`.
#[inline(always)]
pub(crate) fn touches(
    world: &World,
    region: &Region,
    stack: &mut [Entry],
    accept: &mut dyn FnMut(u32, u32) -> bool,
) -> bool {
    if !region.is_finite() {
        return true;
    }
    let mut visit = |index: usize, stack: &mut [Entry]| {
        instance_touches(&world.instances[index], index as u32, region, stack, accept)
    };
    if world.tree.nodes.is_empty() {
        return (0..world.instances.len()).any(|index| visit(index, stack));
    }
    // The upper tree's boxes are exact to rounding, which the slack of the lower ones covers.
    let grown = region.grown(8. * f32::EPSILON * world.slack * world.extent);
    any_leaf(&world.tree, &grown, stack, visit)
}

impl Region {
    /// Larger by `by` on every side.
    fn grown(&self, by: f32) -> Self {
        let mut grown = *self;
        for (offset, normal) in grown.offsets.iter_mut().zip(&self.normals) {
            *offset -= by * normal.length();
        }
        grown
    }
}

#[inline(always)]
fn instance_touches(
    instance: &Instance,
    index: u32,
    region: &Region,
    stack: &mut [Entry],
    accept: &mut dyn FnMut(u32, u32) -> bool,
) -> bool {
    if !instance.traceable {
        return false;
    }
    let local = match instance.to_world_unless_identity() {
        Some(to_world) => region.in_object(to_world, instance.point_to_object(region.apex)),
        None => *region,
    };
    any_leaf(&instance.mesh.tree, &local, stack, |leaf, _| {
        let block = &instance.mesh.blocks[leaf];
        lanes(local.triangles(block)).any(|lane| accept(index, block.faces[lane]))
    })
}

/// Whether `visit` says yes to a leaf whose box may reach into `region`; no others are asked after that.
#[inline(always)]
fn any_leaf(
    tree: &Tree,
    region: &Region,
    stack: &mut [Entry],
    mut visit: impl FnMut(usize, &mut [Entry]) -> bool,
) -> bool {
    let mut current = tree.nodes.first();
    let mut top = 0;
    while let Some(node) = current {
        for lane in lanes(region.boxes(node)) {
            let child = node.children[lane];
            if child.is_none() {
                continue;
            }
            if !child.is_leaf() {
                stack[top] = Entry::new(0., child.bits());
                top += 1;
            } else if visit(child.index(), &mut stack[top..]) {
                return true;
            }
        }
        current = (top > 0).then(|| {
            top -= 1;
            &tree.nodes[Link::from_bits(stack[top].place()).index()]
        });
    }
    false
}
