//! Leaf after leaf of receivers: all polygons between it and the light are tried on it.

use fearless_simd::{dispatch, prelude::*};
use rays::{Occluder, Ray};

use crate::{
    blocker::{ALPHA, Blocker},
    caster::Caster,
    costs::Costs,
    kernel::{Coefficients, Conditions, Kernel, View},
    lanes::{LANES, bits},
    light::MAX_SAMPLES,
    predicate::{Pair, horizon},
    receivers::Leaf,
    tree::LEAF,
};

/// Words a mask at most.
const WORDS: usize = MAX_SAMPLES as usize / 32;
/// Rows of sixteen samples at most.
const ROWS: usize = 2 * WORDS;
/// Casting is given up when it has cost this many times what rays would, and counts as dear above the second number: costs are
/// means, and what was begun is not thrown away for a little.
const GIVE_UP: f64 = 1.5;
const DEAR: f64 = 1.15;
/// All samples of a row.
const ROW: u32 = 0xFFFF;
/// Rows that a polygon must meet before it is asked whether it hides one as a whole.
const WIDE: u32 = 5;
/// Polygons that are gathered before they are tried.
const GATHERED: usize = 128;
/// In place of a part's number: the tree over parts.
const TOP: u32 = u32::MAX;

/// How much was done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Polygons that were tried on a leaf of up to sixteen receivers.
    pub polygons: u64,
    /// Receivers in the penumbra volume of a polygon.
    pub pairs: u64,
    /// Of these, rows of sixteen samples that were tried one by one.
    pub rows: u64,
    /// Shadow rays.
    pub rays: u64,
}

impl Counts {
    /// What came on top of `before`.
    pub(crate) fn since(&self, before: &Self) -> Self {
        Self {
            polygons: self.polygons - before.polygons,
            pairs: self.pairs - before.pairs,
            rows: self.rows - before.rows,
            rays: self.rays - before.rays,
        }
    }

    /// Adds what another batch took.
    pub fn add(&mut self, other: &Self) {
        self.polygons += other.polygons;
        self.pairs += other.pairs;
        self.rows += other.rows;
        self.rays += other.rays;
    }
}

/// What a thread needs to cast, kept from leaf to leaf.
pub(crate) struct Scratch {
    /// Of the receivers of a leaf.
    pub(crate) masks: [[u32; WORDS]; LANES],
    /// Rows of samples that are not dark yet.
    open: [u64; LANES],
    coefficients: Coefficients,
    stack: Vec<(u32, u32)>,
    gathered: Vec<(u32, u32)>,
    /// Receiver and row.
    work: Box<[(u8, u8); LANES * ROWS]>,
    /// Receiver of the leaf and instance that darkened some of its samples; may repeat.
    pub(crate) blocked: Vec<(u32, u32)>,
    /// Rays of a receiver, the samples that they go to, and what blocks them.
    pub(crate) rays: Vec<Ray>,
    pub(crate) samples: Vec<u32>,
    pub(crate) found: Vec<Option<Occluder>>,
    pub(crate) counts: Counts,
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            masks: [[0; WORDS]; LANES],
            open: [0; LANES],
            coefficients: Coefficients::default(),
            stack: Vec::new(),
            gathered: Vec::with_capacity(GATHERED + LANES),
            work: Box::new([(0, 0); LANES * ROWS]),
            blocked: Vec::new(),
            rays: Vec::new(),
            samples: Vec::new(),
            found: Vec::new(),
            counts: Counts::default(),
        }
    }
}

/// How casting a leaf went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Done {
    /// All masks are there, for no more than rays would have cost.
    Cheaply,
    /// All masks are there, but rays would have cost less.
    Dearly,
    /// Given up half done.
    Not,
}

/// Fills `scratch.masks` for the receivers of a leaf. With costs it gives up when rays would clearly have cost less.
pub(crate) fn cast(
    caster: &Caster,
    leaf: &Leaf,
    costs: Option<&Costs>,
    scratch: &mut Scratch,
) -> Done {
    dispatch!(caster.level, simd => {
        let mut casting = Casting::new(Kernel(simd), caster, leaf, scratch);
        casting.begin();
        let rays_ns = costs.map_or(f64::INFINITY, |costs| {
            f64::from(casting.open_samples()) * costs.ray_ns
        });
        casting.walk(costs.unwrap_or(&Costs::TYPICAL), rays_ns)
    })
}

/// Starts masks as the receivers' horizons leave them.
pub(crate) fn begin(caster: &Caster, leaf: &Leaf, scratch: &mut Scratch) {
    dispatch!(caster.level, simd => {
        Casting::new(Kernel(simd), caster, leaf, scratch).begin();
    });
}

struct Casting<'a, S> {
    kernel: Kernel<S>,
    caster: &'a Caster,
    leaf: &'a Leaf,
    view: View,
    alive: u32,
    scratch: &'a mut Scratch,
}

impl<'a, S: Simd> Casting<'a, S> {
    #[inline(always)]
    fn new(
        kernel: Kernel<S>,
        caster: &'a Caster,
        leaf: &'a Leaf,
        scratch: &'a mut Scratch,
    ) -> Self {
        Self {
            kernel,
            caster,
            leaf,
            view: View {
                planar: caster.light().is_planar(),
                light: caster.light().bounds,
                receivers: leaf.bounds,
            },
            alive: (1u32 << leaf.len) - 1,
            scratch,
        }
    }

    #[inline(always)]
    fn begin(&mut self) {
        let light = self.caster.light();
        let groups = light.groups();
        self.scratch.blocked.clear();
        for lane in 0..self.leaf.len {
            let normal = self.leaf.normal(lane);
            let mask = &mut self.scratch.masks[lane][..groups];
            mask.fill(0);
            let mut open = u64::MAX >> (64 - 2 * groups);
            if normal != [0.; 3] {
                let horizon = Conditions::of_one(&horizon(self.leaf.point(lane), normal));
                for i in 0..2 * groups {
                    let row = light.row(self.leaf.set[lane], i);
                    let below = !self.kernel.samples(self.view.planar, row, &horizon) & ROW;
                    mask[i / 2] |= below << (LANES * (i % 2));
                    if below == ROW {
                        open &= !(1 << i);
                    }
                }
            }
            self.scratch.open[lane] = open;
            if open == 0 {
                self.alive &= !(1 << lane);
            }
        }
    }

    /// Samples that rays would have to go to.
    fn open_samples(&self) -> u32 {
        let groups = self.caster.light().groups();
        let masks = self.scratch.masks[..self.leaf.len].iter();
        let words = masks.flat_map(|mask| &mask[..groups]);
        words.map(|word| word.count_zeros()).sum()
    }

    /// Finds the polygons that may block and tries them, as long as that costs little more than rays would.
    #[inline(always)]
    fn walk(&mut self, costs: &Costs, rays_ns: f64) -> Done {
        let caster = self.caster;
        let before = self.scratch.counts;
        if caster.top.nodes.is_empty() || self.alive == 0 {
            return Done::Cheaply;
        }
        self.scratch.stack.clear();
        self.scratch.gathered.clear();
        self.scratch.stack.push((TOP, 0));
        while let Some((part, index)) = self.scratch.stack.pop() {
            let top = part == TOP;
            let tree = if top {
                &caster.top
            } else {
                &caster.parts[part as usize].tree
            };
            let node = &tree.nodes[index as usize];
            let met = self.kernel.node(&self.view, node);
            for lane in bits(met) {
                let child = node.children[lane];
                if child & LEAF == 0 {
                    self.scratch.stack.push((part, child));
                } else if top {
                    let part = caster.top_order[(child & !LEAF) as usize];
                    self.scratch.stack.push((part, 0));
                } else {
                    self.scratch.gathered.push((part, child & !LEAF));
                }
            }
            if self.scratch.gathered.len() >= GATHERED {
                self.try_gathered();
                if self.alive == 0 {
                    break;
                }
                if costs.casting_ns(&self.scratch.counts.since(&before)) > GIVE_UP * rays_ns {
                    return Done::Not;
                }
            }
        }
        self.try_gathered();
        if costs.casting_ns(&self.scratch.counts.since(&before)) > DEAR * rays_ns {
            Done::Dearly
        } else {
            Done::Cheaply
        }
    }

    #[inline(always)]
    fn try_gathered(&mut self) {
        let caster = self.caster;
        for i in 0..self.scratch.gathered.len() {
            let (part, index) = self.scratch.gathered[i];
            let blocker = &caster.parts[part as usize].blockers[index as usize];
            self.scratch.counts.polygons += 1;
            let lanes = self.kernel.polygon(
                &self.view,
                self.leaf,
                blocker,
                self.alive,
                &mut self.scratch.coefficients,
            );
            if lanes == 0 {
                continue;
            }
            self.scratch.counts.pairs += u64::from(lanes.count_ones());
            match self.scratch.coefficients.count {
                3 => self.darken::<3>(part, blocker, lanes),
                4 => self.darken::<4>(part, blocker, lanes),
                _ => self.darken::<5>(part, blocker, lanes),
            }
            if self.alive == 0 {
                break;
            }
        }
        self.scratch.gathered.clear();
    }

    /// Tries a polygon on the receivers `lanes`: first on rows of samples, then on the samples of those that are partly inside.
    #[inline(always)]
    fn darken<const N: usize>(&mut self, part: u32, blocker: &Blocker, lanes: u32) {
        let light = self.caster.light();
        let planar = self.view.planar;
        let scratch = &mut *self.scratch;
        let seen_through = blocker.flags & ALPHA != 0;
        let mut darkened = 0u32;
        let mut count = 0;
        for lane in bits(lanes) {
            let of = (&scratch.coefficients, lane);
            let open = scratch.open[lane];
            let mut met = 0u64;
            for (i, bounds) in light.row_bounds.iter().enumerate() {
                met |= u64::from(self.kernel.rows_met::<N>(planar, bounds, of)) << (LANES * i);
            }
            met &= open;
            // What meets few rows is too small to hide one.
            let mut inside = 0u64;
            if met.count_ones() >= WIDE {
                for (i, bounds) in light.row_bounds.iter().enumerate() {
                    let found = self.kernel.rows_inside::<N>(planar, bounds, of);
                    inside |= u64::from(found) << (LANES * i);
                }
                inside &= met;
            }
            if inside != 0 && !seen_through {
                met &= !inside;
                scratch.open[lane] = open & !inside;
                darkened |= 1 << lane;
                while inside != 0 {
                    let row = inside.trailing_zeros() as usize;
                    inside &= inside - 1;
                    scratch.masks[lane][row / 2] |= ROW << (LANES * (row % 2));
                }
            }
            while met != 0 {
                scratch.work[count & (LANES * ROWS - 1)] = (lane as u8, met.trailing_zeros() as u8);
                met &= met - 1;
                count += 1;
            }
        }
        scratch.counts.rows += count as u64;
        for &(lane, row) in &scratch.work[..count] {
            let (lane, row) = (lane as usize & (LANES - 1), row as usize & (ROWS - 1));
            let samples = light.row(self.leaf.set[lane], row);
            let word = &mut scratch.masks[lane][row / 2];
            let shift = LANES * (row % 2);
            let of = (&scratch.coefficients, lane);
            let blocked = self.kernel.samples_of::<N>(planar, samples, of);
            let mut new = (blocked << shift) & !*word;
            if seen_through && new != 0 {
                new = opaque(
                    self.caster,
                    self.leaf,
                    (part, blocker),
                    (lane, row / 2),
                    new,
                );
            }
            if new != 0 {
                *word |= new;
                darkened |= 1 << lane;
                if *word >> shift & ROW == ROW {
                    scratch.open[lane] &= !(1 << row);
                }
            }
        }
        for lane in bits(darkened) {
            let by = (lane as u32, part);
            if scratch.blocked.last() != Some(&by) {
                scratch.blocked.push(by);
            }
            if scratch.open[lane] == 0 {
                self.alive &= !(1 << lane);
            }
        }
    }
}

/// Of the samples `word` that a polygon with holes blocks, those that are met where it is opaque.
#[cold]
fn opaque(
    caster: &Caster,
    leaf: &Leaf,
    (part, blocker): (u32, &Blocker),
    (lane, group): (usize, usize),
    word: u32,
) -> u32 {
    let light = caster.light();
    let Some(pair) = Pair::new(light, leaf.point(lane), blocker) else {
        return 0;
    };
    let mesh = &caster.instances()[part as usize].mesh;
    let polygon = caster.polygon(part as usize, blocker);
    let mut left = 0;
    for bit in bits(word) {
        let sample = light.local_sample(leaf.set[lane], (32 * group + bit) as u32);
        if pair.is_opaque(mesh, polygon, blocker, sample) {
            left |= 1 << bit;
        }
    }
    left
}
