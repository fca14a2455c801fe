//! Which parts of edges can be seen, by rays from the eye.
//!
//! Visibility changes rarely along an outline, so edges are joined into chains, tested every few pixels, and only where
//! two answers differ is the place of the change found, by bisection.

use glam::Vec3;
use rays::{Ray, World};

use super::chain::{Chains, Joint, Link};
use super::clip::{ImageSegment, SUBPIXELS};
use super::list::EdgeList;
use super::visible::VisibleEdges;
use crate::camera::View;

/// How finely visibility is tested.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RaySettings {
    /// Greatest distance between tests along a chain, px.
    pub spacing_px: f32,
    /// The place of a change is found to within this, px.
    pub precision_px: f32,
    /// An occluder must be nearer than the edge by this share of the distance.
    pub tolerance: f32,
}

impl RaySettings {
    /// For pictures that move.
    pub const DEFAULT: Self = Self {
        spacing_px: 6.0,
        precision_px: 0.25,
        tolerance: 1e-5,
    };

    /// For edges that stay as they are: moving ones have to be done with too soon for that.
    pub const AT_REST: Self = Self {
        spacing_px: 1.0,
        precision_px: 0.125,
        tolerance: Self::DEFAULT.tolerance,
    };
}

impl Default for RaySettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Edges of a view in chains, and how far each pass over them has come. Keeps its memory from frame to frame.
#[derive(Clone, Debug, Default)]
pub(super) struct RayScratch {
    chains: Chains,
    joints: Vec<Joint>,
    pieces: Vec<Piece>,
    reach: Vec<f32>,
    cuts: Vec<f32>,
    /// Chains in the order in which they are looked at, if not all of them can be at once.
    order: Vec<(f32, u32)>,
    /// The next chain to be looked at.
    next: usize,
}

/// The part of an edge that lies in the picture.
#[derive(Clone, Copy, Debug)]
struct Piece {
    edge: u32,
    segment: ImageSegment,
    /// Part of the segment, 0..1 in image space.
    range: [f64; 2],
    length_px: f32,
}

/// What rays are cast at.
#[derive(Clone, Copy)]
pub(super) struct Target<'a> {
    pub(super) view: &'a View,
    pub(super) edges: &'a EdgeList,
    pub(super) world: &'a World,
}

impl RayScratch {
    /// Takes the edges of a view over, as segments of the image, and begins with the first chain. If more than `many` tests
    /// are needed, long chains come first.
    pub(super) fn prepare(
        &mut self,
        Target { view, edges, .. }: Target<'_>,
        segments: impl Iterator<Item = (u32, ImageSegment)>,
        settings: RaySettings,
        many: usize,
    ) {
        self.pieces.clear();
        self.joints.clear();
        for (edge, segment) in segments {
            let Some(range) = in_picture(&segment, view) else {
                continue;
            };
            let whole = range == [0.0, 1.0] && segment.along == [0.0, 1.0];
            let [a, b] = segment.ends;
            let length = ((b[0] - a[0]) as f32).hypot((b[1] - a[1]) as f32) / SUBPIXELS as f32;
            self.joints.push(Joint {
                object: edges.object[edge as usize],
                vertices: edges.vertices[edge as usize],
                free: whole,
            });
            let length_px = length * (range[1] - range[0]) as f32;
            self.pieces.push(Piece {
                edge,
                segment,
                range,
                length_px,
            });
        }
        self.chains.join(&self.joints);
        self.sort(settings.spacing_px, many);
        self.next = 0;
    }

    fn sort(&mut self, spacing_px: f32, many: usize) {
        let Self {
            chains,
            pieces,
            order,
            ..
        } = self;
        order.clear();
        if pieces.len() <= many {
            return;
        }
        order.extend((0..chains.len()).map(|index| {
            let links = chains.get(index).iter();
            let length_px: f32 = links.map(|l| pieces[l.edge as usize].length_px).sum();
            (length_px, index as u32)
        }));
        let needed: f32 = order.iter().map(|(px, _)| tests(*px, spacing_px)).sum();
        if needed <= many as f32 {
            order.clear();
        } else {
            order.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        }
    }

    /// Begins with the first chain again.
    pub(super) fn restart(&mut self) {
        self.next = 0;
    }

    /// Goes on from where the last call ended until the chains or about this many rays are at an end; appends the parts of
    /// edges that nothing hides, and adds the rays to `cast`. Says whether all chains have been looked at.
    pub(super) fn advance(
        &mut self,
        target: Target<'_>,
        settings: RaySettings,
        most_rays: usize,
        cast: &mut usize,
        out: &mut VisibleEdges,
    ) -> bool {
        let mut eye = Eye {
            target,
            settings,
            rays: 0,
        };
        while self.next < self.chains.len() && eye.rays < most_rays {
            let index = match self.order.get(self.next) {
                Some((_, index)) => *index as usize,
                None => self.next,
            };
            let chain = self.chains.get(index);
            self.reach.clear();
            let mut length = 0.0;
            for link in chain {
                length += self.pieces[link.edge as usize].length_px;
                self.reach.push(length);
            }
            let walk = Walk {
                chain,
                pieces: &self.pieces,
                reach: &self.reach,
            };
            let first = walk.changes(&mut self.cuts, &mut eye);
            walk.emit(first, &self.cuts, out);
            self.next += 1;
        }
        *cast += eye.rays;
        self.next == self.chains.len()
    }
}

/// How many tests a chain of this length needs.
fn tests(length_px: f32, spacing_px: f32) -> f32 {
    (length_px / spacing_px).ceil().max(1.0)
}

/// The part of a segment within a pixel of the picture, 0..1; nothing if it passes by.
fn in_picture(segment: &ImageSegment, view: &View) -> Option<[f64; 2]> {
    let mut range = [0.0_f64, 1.0];
    for (axis, size) in [view.width, view.height].into_iter().enumerate() {
        let (low, high) = (-SUBPIXELS, (i64::from(size) + 1) * SUBPIXELS);
        let (a, b) = (segment.ends[0][axis], segment.ends[1][axis]);
        if a.max(b) < low || a.min(b) > high {
            return None;
        }
        for (end, outside_a, outside_b) in [(low, a < low, b < low), (high, a > high, b > high)] {
            let at = (end - a) as f64 / (b - a) as f64;
            if outside_a {
                range[0] = range[0].max(at);
            } else if outside_b {
                range[1] = range[1].min(at);
            }
        }
    }
    (range[0] < range[1]).then_some(range)
}

/// A chain with distances along it.
struct Walk<'a> {
    chain: &'a [Link],
    pieces: &'a [Piece],
    /// Distance at the far end of each link, px.
    reach: &'a [f32],
}

impl Walk<'_> {
    /// Whether the point at this distance can be seen.
    fn sees(&self, at_px: f32, eye: &mut Eye<'_>) -> bool {
        let index = self
            .reach
            .partition_point(|r| *r < at_px)
            .min(self.chain.len() - 1);
        let link = self.chain[index];
        let piece = &self.pieces[link.edge as usize];
        let left = if piece.length_px > 0.0 {
            ((self.reach[index] - at_px) / piece.length_px).clamp(0.0, 1.0)
        } else {
            0.5
        };
        let share = f64::from(if link.reversed { left } else { 1.0 - left });
        eye.sees(
            piece,
            piece.range[0] + share * (piece.range[1] - piece.range[0]),
        )
    }

    /// Finds the distances at which visibility changes; returns whether the start can be seen.
    fn changes(&self, cuts: &mut Vec<f32>, eye: &mut Eye<'_>) -> bool {
        cuts.clear();
        let length = self.reach.last().copied().unwrap_or(0.0);
        let tests = tests(length, eye.settings.spacing_px);
        let step = length / tests;
        // Not at the ends, where the chain meets other faces.
        let mut before = 0.5 * step;
        let first = self.sees(before, eye);
        let mut state = first;
        for i in 1..tests as usize {
            let after = (i as f32 + 0.5) * step;
            if self.sees(after, eye) != state {
                let (mut low, mut high) = (before, after);
                while high - low > 2.0 * eye.settings.precision_px {
                    let middle = 0.5 * (low + high);
                    if self.sees(middle, eye) == state {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                cuts.push(0.5 * (low + high));
                state = !state;
            }
            before = after;
        }
        first
    }

    /// Appends the parts between changes that can be seen.
    fn emit(&self, first: bool, cuts: &[f32], out: &mut VisibleEdges) {
        let mut cuts = cuts.iter().copied().peekable();
        let mut state = first;
        let mut start = 0.0;
        for (link, end) in self.chain.iter().zip(self.reach) {
            let piece = &self.pieces[link.edge as usize];
            let mut from = 0.0;
            loop {
                let cut = cuts.next_if(|c| c <= end);
                let to = cut.map_or(1.0, |c| {
                    f64::from((c - start) / piece.length_px).clamp(from, 1.0)
                });
                if state && (from < to || piece.length_px == 0.0) {
                    out.push(
                        piece.edge,
                        piece.segment,
                        piece.part(from, to, link.reversed),
                    );
                }
                from = to;
                match cut {
                    Some(_) => state = !state,
                    None => break,
                }
            }
            start = *end;
        }
    }
}

impl Piece {
    /// A part of the piece, given along the chain, as a range of the segment.
    fn part(&self, from: f64, to: f64, reversed: bool) -> [f64; 2] {
        let (from, to) = if reversed {
            (1.0 - to, 1.0 - from)
        } else {
            (from, to)
        };
        let [low, high] = self.range;
        let at = |share: f64| {
            if share == 1.0 {
                high
            } else {
                low + share * (high - low)
            }
        };
        [at(from), at(to)]
    }
}

/// Casts rays at points on edges.
struct Eye<'a> {
    target: Target<'a>,
    settings: RaySettings,
    rays: usize,
}

impl Eye<'_> {
    /// Whether nothing hides a point of a segment; `share` is linear in image space.
    fn sees(&mut self, piece: &Piece, share: f64) -> bool {
        let edge = piece.edge as usize;
        let segment = &piece.segment;
        let Target { view, edges, world } = self.target;
        // Depth is not linear in image space: go through 1/depth to a place along the edge.
        let [i0, i1] = segment.inverse_depth;
        let within = share * i1 / ((1.0 - share) * i0 + share * i1);
        let along = (segment.along[0] + within * (segment.along[1] - segment.along[0])) as f32;
        let (a, b) = (Vec3::from(edges.from[edge]), Vec3::from(edges.to[edge]));
        let p = a + (b - a) * along;
        let ray = Ray {
            origin: view.eye,
            direction: view.right * p.x + view.up * p.y + view.forward * p.z,
        };
        let objects = [edges.object[edge], edges.second[edge]];
        let own = edges.faces[edge];
        let light = own == [super::list::NO_FACE; 2];
        self.rays += 1;
        world
            .occluder_where(&ray, 1.0 - self.settings.tolerance, |instance, face| {
                let is_own = |k: usize| instance == objects[k] && (light || face == own[k]);
                !(is_own(0) || is_own(1))
            })
            .is_none()
    }
}
