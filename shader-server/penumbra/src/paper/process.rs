//! One polygon through the hierarchy.

use std::time::Instant;

use fearless_simd::{Level, dispatch, prelude::*};
use glam::{DVec3, Vec3};

use super::{Hierarchy, Masks, PaperOrder, hierarchy::Node, volume::Volume};
use crate::{
    blocker::{ALPHA, Blocker, CUTS, FROM_BEHIND, FROM_FRONT, REVERSED},
    caster::Caster,
    kernel::{Conditions, Kernel},
    lanes::{LANES, bits},
    light::SampleRow,
    mesh::NONE,
    predicate::{CONDITIONS, Pair, meets_hull},
    receivers::Point,
};

/// Buckets of area, each half of the one before, and one for polygons with holes.
pub(super) const BUCKETS: usize = 64;
/// Share of a hierarchy's points in the dark at which it is built anew.
const DARK_SHARE: f64 = 0.25;
/// Hard shadow planes are sure of what is so far from them, in units of the scene's size; the blocking rule says about the
/// rest. An edge's planes are scaled by its length and the scene's size, as that rule's rounding is.
const SURE: f32 = 1e-5;

/// Which bucket of the coarse sorting a polygon belongs to.
pub(super) fn bucket(blocker: &Blocker) -> usize {
    if blocker.flags & ALPHA != 0 {
        return BUCKETS - 1;
    }
    let [a, b, c, d] = blocker.corners.map(Vec3::from);
    let area = 0.5 * ((b - a).cross(c - a).length() + (c - a).cross(d - a).length());
    (16. - area.log2()).clamp(0., (BUCKETS - 2) as f32) as usize
}

/// The planes of hard shadow volumes of sixteen neighbouring samples: condition; normal and constant; sample.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct HardRow {
    pub(crate) planes: [[[f32; LANES]; 4]; CONDITIONS],
    pub(crate) count: usize,
}

/// What is known about a polygon.
struct Current<'a> {
    part: u32,
    blocker: &'a Blocker,
    whole: Volume,
    /// Empty until needed.
    groups: Vec<Volume>,
    /// Of each set of samples, empty until needed.
    hard: Vec<Vec<HardRow>>,
}

/// A group and the planes of its volume that are still to be tried.
type Active = (u8, u32);

pub(super) struct Process<'a> {
    caster: &'a Caster,
    points: &'a [Point],
    order: PaperOrder,
    size: f32,
    every_group: u32,
    hierarchy: Hierarchy,
    dark: usize,
    pub(super) masks: Masks,
    /// Of each point the groups that are dark.
    pub(super) umbra: Vec<u32>,
    pub(super) build_s: f64,
    pub(super) hierarchy_bytes: usize,
    pub(super) builds: u32,
    active: Vec<Active>,
    level: Level,
}

impl<'a> Process<'a> {
    pub(super) fn new(caster: &'a Caster, points: &'a [Point], order: &PaperOrder) -> Self {
        let groups = caster.light().groups();
        let mut masks = Masks::new(points.len(), groups);
        if !order.masks_on_demand {
            for point in 0..points.len() as u32 {
                masks.of(point);
            }
        }
        let coordinates = points.iter().flat_map(|point| point.at);
        let mut process = Self {
            caster,
            points,
            order: *order,
            size: coordinates.fold(caster.light().bounds.max_abs(), |most, x| most.max(x.abs())),
            every_group: u32::MAX >> (32 - groups),
            hierarchy: Hierarchy::default(),
            dark: 0,
            masks,
            umbra: vec![0; points.len()],
            build_s: 0.,
            hierarchy_bytes: 0,
            builds: 0,
            active: Vec::new(),
            level: caster.level,
        };
        process.build();
        process
    }

    /// Builds the hierarchy over what is not dark.
    fn build(&mut self) {
        let start = Instant::now();
        let left = (0..self.points.len() as u32)
            .filter(|point| self.umbra[*point as usize] != self.every_group)
            .collect();
        self.hierarchy = Hierarchy::build(self.points, left, &self.umbra);
        self.dark = 0;
        self.builds += 1;
        self.hierarchy_bytes = self.hierarchy_bytes.max(self.hierarchy.bytes());
        self.build_s += start.elapsed().as_secs_f64();
    }

    /// PROCESS-BLOCKER of Figures 2 and 3.
    pub(super) fn blocker(&mut self, part: u32, blocker: &Blocker) {
        let limit = DARK_SHARE * self.hierarchy.order.len() as f64;
        if self.order.umbra_bits && self.dark as f64 > limit {
            self.build();
        }
        if self.hierarchy.nodes.is_empty() {
            return;
        }
        let light = self.caster.light();
        let size = self.size.max(blocker.bounds.max_abs());
        let mut current = Current {
            part,
            blocker,
            whole: Volume::new(blocker, &light.bounds, light.is_planar(), size),
            groups: Vec::new(),
            hard: vec![Vec::new(); light.sampling().sets as usize],
        };
        if !self.order.lazy_volumes {
            self.make_group_volumes(&mut current);
            if self.order.hard_volumes {
                for set in 0..light.sampling().sets {
                    self.make_hard_volumes(&mut current, set);
                }
            }
        }
        self.active.clear();
        let groups = 0..light.groups();
        self.active
            .extend(groups.map(|group| (group as u8, u32::MAX)));
        let every = 0..self.active.len();
        let all = current.whole.all();
        self.node(0, &mut current, all, every);
    }

    fn make_group_volumes(&self, current: &mut Current<'_>) {
        let light = self.caster.light();
        let size = self.size.max(current.blocker.bounds.max_abs());
        let volume = |bounds| Volume::new(current.blocker, bounds, light.is_planar(), size);
        current.groups = light.group_bounds.iter().map(volume).collect();
    }

    fn make_hard_volumes(&self, current: &mut Current<'_>, set: u32) {
        let light = self.caster.light();
        let size = self.size.max(current.blocker.bounds.max_abs());
        let rows = (0..light.groups()).flat_map(|group| light.group(set, group));
        current.hard[set as usize] = rows
            .map(|row| hard_row(current.blocker, row, size))
            .collect();
    }

    /// PROCESS-RECURSIVE. `active` is where in the list the groups are that may be hidden from points below the node.
    fn node(
        &mut self,
        index: u32,
        current: &mut Current<'_>,
        planes: u32,
        active: std::ops::Range<usize>,
    ) {
        let Node {
            bounds,
            children,
            umbra,
            ..
        } = self.hierarchy.nodes[index as usize];
        if self.order.umbra_bits && umbra & self.every_group == self.every_group {
            return;
        }
        let Some(cut) = current.whole.cut(&bounds, planes) else {
            return;
        };
        let first = self.active.len();
        for i in active {
            let (group, planes) = self.active[i];
            if self.order.umbra_bits && umbra >> group & 1 == 1 {
                continue;
            }
            match current.groups.get(group as usize) {
                Some(volume) => {
                    if let Some(cut) = volume.cut(&bounds, planes & volume.all()) {
                        let left = if self.order.active_planes {
                            cut
                        } else {
                            u32::MAX
                        };
                        self.active.push((group, left));
                    }
                }
                None => self.active.push((group, u32::MAX)),
            }
        }
        let own = first..self.active.len();
        if own.is_empty() {
            return;
        }
        let planes = if self.order.active_planes {
            cut
        } else {
            planes
        };
        if children == NONE {
            let level = self.level;
            dispatch!(level, simd => self.leaf(Kernel(simd), index, current, planes, own));
        } else {
            self.node(children, current, planes, own.clone());
            self.node(children + 1, current, planes, own);
            if self.order.umbra_bits {
                let child = children as usize;
                let nodes = &mut self.hierarchy.nodes;
                nodes[index as usize].umbra = nodes[child].umbra & nodes[child + 1].umbra;
            }
        }
        self.active.truncate(first);
    }

    #[inline(always)]
    fn leaf<S: Simd>(
        &mut self,
        kernel: Kernel<S>,
        index: u32,
        current: &mut Current<'_>,
        planes: u32,
        active: std::ops::Range<usize>,
    ) {
        let node = &self.hierarchy.nodes[index as usize];
        let points = node.first as usize..(node.first + node.count) as usize;
        let mut dark = u32::MAX;
        for i in points {
            let point = self.hierarchy.order[i];
            let is_dark = self.umbra[point as usize] == self.every_group;
            if !(self.order.umbra_bits && is_dark)
                && current
                    .whole
                    .contains(self.points[point as usize].at, planes)
            {
                self.point(kernel, point, current, active.clone());
            }
            dark &= self.umbra[point as usize];
        }
        if self.order.umbra_bits {
            self.hierarchy.nodes[index as usize].umbra = dark;
        }
    }

    #[inline(always)]
    fn point<S: Simd>(
        &mut self,
        kernel: Kernel<S>,
        number: u32,
        current: &mut Current<'_>,
        active: std::ops::Range<usize>,
    ) {
        let light = self.caster.light();
        let point = &self.points[number as usize];
        if current.groups.is_empty() {
            self.make_group_volumes(current);
        }
        if self.order.hard_volumes && current.hard[point.set as usize].is_empty() {
            self.make_hard_volumes(current, point.set);
        }
        let mask = self.masks.of(number);
        let mut umbra = self.umbra[number as usize];
        let mut pair = None;
        for &(group, planes) in &self.active[active] {
            let volume = &current.groups[group as usize];
            let group = group as usize;
            if (self.order.umbra_bits && umbra >> group & 1 == 1)
                || !volume.contains(point.at, planes & volume.all())
            {
                continue;
            }
            let word = &mut mask[group];
            *word |= tried(
                kernel,
                self.caster,
                current,
                point,
                (group, !*word),
                &mut pair,
            );
            if self.order.umbra_bits && *word == u32::MAX {
                umbra |= 1 << group;
            }
        }
        if umbra != self.umbra[number as usize] {
            self.umbra[number as usize] = umbra;
            if umbra == self.every_group {
                self.dark += 1;
                if self.order.masks_on_demand {
                    self.masks.release(number);
                }
            }
        }
        debug_assert!(light.groups() <= 32);
    }
}

/// Of the samples `open` of a group those that the polygon blocks. `pair` is the exact rule, once it is known.
#[inline(always)]
fn tried<S: Simd>(
    kernel: Kernel<S>,
    caster: &Caster,
    current: &Current<'_>,
    point: &Point,
    (group, open): (usize, u32),
    pair: &mut Option<Option<Pair>>,
) -> u32 {
    let light = caster.light();
    let blocker = current.blocker;
    if blocker.key == point.own {
        return 0;
    }
    let planar = light.is_planar();
    let mut blocked;
    let hard = &current.hard[point.set as usize];
    if hard.is_empty() {
        let pair = pair.get_or_insert_with(|| Pair::new(light, point.at, blocker));
        let Some(pair) = pair else { return 0 };
        let conditions = Conditions::from_pair(pair);
        blocked = 0;
        for (half, row) in light.group(point.set, group).iter().enumerate() {
            blocked |= kernel.samples(planar, row, &conditions) << (LANES * half);
        }
        blocked &= open;
    } else {
        let height = blocker.height(point.at);
        let behind = height < 0. && blocker.flags & FROM_BEHIND != 0;
        let before = height > 0. && blocker.flags & FROM_FRONT != 0;
        if !(behind || before) || !meets_hull(light, point.at, &blocker.bounds) {
            return 0;
        }
        let turn = if behind { 1. } else { -1. };
        let mut unsure = 0;
        blocked = 0;
        for (half, row) in hard[2 * group..2 * group + 2].iter().enumerate() {
            let (inside, outside) = kernel.hard_row(row, point.at, turn, SURE);
            blocked |= inside << (LANES * half);
            unsure |= (!(inside | outside) & 0xFFFF) << (LANES * half);
        }
        blocked &= open;
        for bit in bits(unsure & open) {
            let pair = pair.get_or_insert_with(|| Pair::new(light, point.at, blocker));
            let sample = light.local_sample(point.set, (32 * group + bit) as u32);
            if pair.is_some_and(|pair| pair.blocks(sample)) {
                blocked |= 1 << bit;
            }
        }
    }
    if blocker.flags & ALPHA != 0 && blocked != 0 {
        let mesh = &caster.instances()[current.part as usize].mesh;
        let polygon = caster.polygon(current.part as usize, blocker);
        let pair = pair.get_or_insert_with(|| Pair::new(light, point.at, blocker));
        for bit in bits(blocked) {
            let sample = light.local_sample(point.set, (32 * group + bit) as u32);
            if !pair.is_some_and(|pair| pair.is_opaque(mesh, polygon, blocker, sample)) {
                blocked &= !(1 << bit);
            }
        }
    }
    blocked
}

/// The hard shadow volumes of sixteen samples.
fn hard_row(blocker: &Blocker, row: &SampleRow, size: f32) -> HardRow {
    let mut hard = HardRow {
        planes: [[[0.; LANES]; 4]; CONDITIONS],
        count: blocker.edges(),
    };
    let size = f64::from(size);
    for i in 0..blocker.edges() {
        let [low, high] = blocker
            .edge(i)
            .map(|corner| Vec3::from(blocker.corners[corner]).as_dvec3());
        let way = if blocker.flags >> i & REVERSED == 0 {
            1.
        } else {
            -1.
        };
        let edge = (high - low) * way;
        let scale = 1. / (edge.length() * size);
        for lane in 0..LANES {
            let sample = DVec3::from_array(row.0.map(|values| f64::from(values[lane])));
            let normal = (low - sample).cross(edge) * scale;
            let plane = [-normal.x, -normal.y, -normal.z, normal.dot(sample)];
            for (coefficient, value) in hard.planes[i].iter_mut().zip(plane) {
                coefficient[lane] = value as f32;
            }
        }
    }
    if blocker.flags & CUTS != 0 {
        for lane in 0..LANES {
            let sample = row.0.map(|values| values[lane]);
            hard.planes[hard.count][3][lane] = blocker.height(sample);
        }
        hard.count += 1;
    }
    for planes in &mut hard.planes[..hard.count] {
        // So that how far is sure is a number without unit.
        planes[3]
            .iter_mut()
            .for_each(|constant| *constant /= size as f32);
        planes[..3]
            .iter_mut()
            .flatten()
            .for_each(|n| *n /= size as f32);
    }
    hard
}
