//! A batch of receivers, tile by tile on all threads.

use std::cell::Cell;

use rayon::prelude::*;
use rays::World;

use crate::{
    cast::{self, Counts, Done, Scratch},
    caster::Caster,
    costs::Costs,
    lanes::LANES,
    receivers::{Leaf, Point, Receivers, sort_into_leaves},
    shadow_rays, weigh,
};

/// Receivers a tile, which is cast by one thread.
const TILE: usize = 32 * LANES;
/// Leaves after which a tile that found rays cheaper asks again whether they are.
const ASK_AGAIN: usize = 16;

thread_local! {
    static SCRATCH: Cell<Option<Box<Scratch>>> = const { Cell::new(None) };
}

/// What a batch of receivers sees; kept from batch to batch for its memory.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// Of each receiver the share of the light's unoccluded irradiance that reaches it, in [0, 1].
    pub shares: Vec<f32>,
    /// Of each receiver one bit a sample, set where it is blocked; empty unless asked for.
    pub masks: Vec<u32>,
    /// Receiver's instance and blocker's instance, each pair once, sorted. Of things one behind the other not all may be told.
    pub pairs: Vec<(u32, u32)>,
    /// What it took.
    pub counts: Counts,
    points: Vec<Point>,
    sorted_shares: Vec<f32>,
    sorted_masks: Vec<u32>,
}

/// What is to be found out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wanted {
    /// Fill [`Seen::masks`].
    pub masks: bool,
    /// Fill [`Seen::pairs`].
    pub pairs: bool,
}

/// By what way to find out. Rays go to the same samples: masks differ for ties alone, those that pass through an edge.
#[derive(Clone, Copy, Debug, Default)]
pub enum Route<'a> {
    /// Casting.
    #[default]
    Cast,
    /// Rays in a world of the caster's instances, eight together or one by one as [`Costs::packets`] says.
    Rays(&'a World, Costs),
    /// Whichever costs a tile of receivers less, by the work that its first leaf was.
    Cheaper(&'a World, Costs),
}

impl Caster {
    /// Finds out what each receiver sees of the light. On all threads of the current rayon pool, with the same result for any
    /// number of them.
    pub fn cast(&self, receivers: &Receivers, route: Route<'_>, wanted: Wanted, seen: &mut Seen) {
        let groups = self.light().groups();
        seen.begin(self, receivers, wanted);
        let words = if wanted.masks { groups } else { 0 };
        // Without masks every tile gets an empty slice.
        let mut masks: Vec<&mut [u32]> = if wanted.masks {
            seen.sorted_masks.chunks_mut(TILE * words).collect()
        } else {
            Vec::new()
        };
        masks.resize_with(seen.points.len().div_ceil(TILE), Default::default);
        let tiles = seen
            .points
            .par_chunks(TILE)
            .zip(seen.sorted_shares.par_chunks_mut(TILE))
            .zip(masks);
        let done = tiles.map(|((points, shares), masks)| {
            with_scratch(|scratch| {
                let mut tile = Tile {
                    caster: self,
                    receivers,
                    route,
                    wanted,
                    pairs: Vec::new(),
                };
                tile.cast(points, shares, masks, scratch);
                (tile.pairs, std::mem::take(&mut scratch.counts))
            })
        });
        let (pairs, counts) = done.reduce(
            || (Vec::new(), Counts::default()),
            |(mut pairs, mut counts), (more, other)| {
                pairs.extend(more);
                pairs.sort_unstable();
                pairs.dedup();
                counts.add(&other);
                (pairs, counts)
            },
        );
        seen.pairs = pairs;
        seen.counts = counts;
        seen.unsort(words);
    }
}

/// Lends this thread's scratch memory.
fn with_scratch<T>(work: impl FnOnce(&mut Scratch) -> T) -> T {
    let mut scratch = SCRATCH.take().unwrap_or_default();
    let result = work(&mut scratch);
    SCRATCH.set(Some(scratch));
    result
}

impl Seen {
    /// Everything dark, and the receivers that may see something in the order of leaves.
    fn begin(&mut self, caster: &Caster, receivers: &Receivers, wanted: Wanted) {
        let light = caster.light();
        self.shares.clear();
        self.shares.resize(receivers.len(), 0.);
        self.masks.clear();
        self.points.clear();
        self.points.par_extend(
            (0..receivers.len())
                .into_par_iter()
                .map(|index| Point::new(light, receivers, index, |own| caster.key(own)))
                .filter(|point| point.may_see(light)),
        );
        sort_into_leaves(&mut self.points);
        self.sorted_shares.clear();
        self.sorted_shares.resize(self.points.len(), 0.);
        self.sorted_masks.clear();
        if wanted.masks {
            let groups = light.groups();
            self.masks.resize(receivers.len() * groups, u32::MAX);
            self.sorted_masks.resize(self.points.len() * groups, 0);
        }
    }

    /// Brings results into the receivers' order.
    fn unsort(&mut self, words: usize) {
        for (i, point) in self.points.iter().enumerate() {
            let index = point.index as usize;
            self.shares[index] = self.sorted_shares[i];
            let from = &self.sorted_masks[i * words..(i + 1) * words];
            self.masks[index * words..(index + 1) * words].copy_from_slice(from);
        }
    }
}

/// Receivers near each other.
struct Tile<'a> {
    caster: &'a Caster,
    receivers: &'a Receivers,
    route: Route<'a>,
    wanted: Wanted,
    pairs: Vec<(u32, u32)>,
}

impl Tile<'_> {
    fn cast(
        &mut self,
        points: &[Point],
        shares: &mut [f32],
        masks: &mut [u32],
        scratch: &mut Scratch,
    ) {
        let groups = self.caster.light().groups();
        let mut rays_left = 0;
        for (i, points) in points.chunks(LANES).enumerate() {
            let leaf = Leaf::new(points);
            self.darken(&leaf, &mut rays_left, scratch);
            for (lane, point) in points.iter().enumerate() {
                let at = i * LANES + lane;
                let mask = &scratch.masks[lane][..groups];
                shares[at] = if mask.iter().all(|word| *word == 0) {
                    1.
                } else {
                    weigh::share(self.caster.light(), point.at, point.normal, point.set, mask)
                };
                if self.wanted.masks {
                    masks[at * groups..(at + 1) * groups].copy_from_slice(mask);
                }
            }
            if self.wanted.pairs {
                self.report(&leaf, scratch);
            }
        }
        self.pairs.sort_unstable();
        self.pairs.dedup();
    }

    /// Fills in masks, by rays for the next `rays_left` leaves.
    fn darken(&self, leaf: &Leaf, rays_left: &mut usize, scratch: &mut Scratch) {
        let caster = self.caster;
        let (world, costs, either) = match self.route {
            Route::Cast => {
                cast::cast(caster, leaf, None, scratch);
                return;
            }
            Route::Rays(world, costs) => (world, costs, false),
            Route::Cheaper(world, costs) => (world, costs, true),
        };
        if either && *rays_left == 0 {
            let done = cast::cast(caster, leaf, Some(&costs), scratch);
            if done != Done::Cheaply {
                *rays_left = ASK_AGAIN - 1;
            }
            if done != Done::Not {
                return;
            }
        } else {
            *rays_left = rays_left.saturating_sub(1);
        }
        cast::begin(caster, leaf, scratch);
        shadow_rays::trace(
            caster,
            world,
            (self.receivers, leaf),
            costs.packets,
            scratch,
        );
    }

    fn report(&mut self, leaf: &Leaf, scratch: &Scratch) {
        for (lane, blocker) in &scratch.blocked {
            let index = leaf.index[*lane as usize] as usize;
            let pair = (self.receivers.own[index].0, *blocker);
            if !self.pairs.contains(&pair) {
                self.pairs.push(pair);
            }
        }
    }
}
