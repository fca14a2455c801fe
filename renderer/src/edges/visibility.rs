//! Drawing the edges that can be seen.

use rays::World;

use super::by_rays::{RayScratch, RaySettings};
use super::clip::{ImageSegment, Projector, SUBPIXELS};
use super::crossings::Crossings;
use super::depth::{DepthBuffer, DepthOffset, FilteredDepth};
use super::list::EdgeList;
use super::raster::{Crossing, crossings_of};
use super::visible::VisibleEdges;
use crate::camera::View;

/// How hidden edges are told from visible ones.
#[derive(Clone, Copy, Debug)]
pub enum Hiding<'a> {
    /// Not at all: every edge is drawn.
    None,
    /// The paper's (section 4.5): crossings behind a filtered depth of reprojected points are left out.
    Points(&'a DepthBuffer, DepthOffset),
    /// By rays from the eye. The world's instances are the scene's objects and then its area lights, in order.
    Rays(&'a World, RaySettings),
}

/// Draws edges into crossings. Keeps its memory from frame to frame.
#[derive(Clone, Debug, Default)]
pub struct EdgeDrawer {
    visible: VisibleEdges,
    rays: RayScratch,
    depth: FilteredDepth,
    drawn: Option<([u64; 2], bool, Option<RaySettings>)>,
}

impl EdgeDrawer {
    /// Replaces the crossings by those of the edges that can be seen, with lines through the middle of pixels too if
    /// `half` is set. Crossings must be of the view's size, and the same ones every time: if the list is the one of the last
    /// call, and the method does not depend on points, nothing is done, and the answer is false.
    pub fn draw(
        &mut self,
        view: &View,
        edges: &EdgeList,
        hiding: Hiding<'_>,
        half: bool,
        out: &mut Crossings,
    ) -> bool {
        let key = match hiding {
            Hiding::None => Some(([edges.generation, edges.appended], half, None)),
            Hiding::Points(..) => None,
            Hiding::Rays(_, settings) => {
                Some(([edges.generation, edges.appended], half, Some(settings)))
            }
        };
        if key.is_some() && key == self.drawn {
            return false;
        }
        self.drawn = key;
        out.clear();
        let projector = Projector::new(view);
        let segments = (0..edges.len()).filter_map(|i| {
            let segment = projector.project(edges.from[i], edges.to[i])?;
            Some((i as u32, segment))
        });
        match hiding {
            Hiding::None => segments.for_each(|(_, segment)| out.draw(&segment, half)),
            Hiding::Points(buffer, offset) => {
                self.depth.filter(buffer, offset);
                segments.for_each(|(_, segment)| draw_tested(&segment, half, &self.depth, out));
            }
            Hiding::Rays(world, settings) => {
                self.rays
                    .find(view, edges, segments, (world, settings), &mut self.visible);
                self.visible.draw(half, out);
            }
        }
        true
    }

    /// What the last call with [`Hiding::Rays`] found.
    pub fn visible(&self) -> &VisibleEdges {
        &self.visible
    }

    /// Rays cast by the last call with [`Hiding::Rays`] that did anything.
    pub fn rays(&self) -> usize {
        self.rays.rays
    }
}

/// Records the crossings that lie before the depth of one of the pixels beside them.
fn draw_tested(segment: &ImageSegment, half: bool, depth: &FilteredDepth, out: &mut Crossings) {
    let [a, b] = segment.ends;
    let [i0, i1] = segment.inverse_depth;
    let size = [out.width as i64, out.height as i64];
    crossings_of(segment.ends, size, half, |crossing: Crossing| {
        let axis = usize::from(crossing.horizontal);
        let at = crossing.line * (SUBPIXELS / 2);
        let share = (at - a[axis]) as f64 / (b[axis] - a[axis]) as f64;
        let depth_here = (1.0 / (i0 + (i1 - i0) * share)) as f32;
        let (cell, after) = (crossing.eighth >> 3, crossing.line >> 1);
        let before = (crossing.line - 1) >> 1;
        let sees = |line: i64| {
            let (x, y) = if crossing.horizontal {
                (cell, line)
            } else {
                (line, cell)
            };
            depth.sees(x, y, depth_here)
        };
        if sees(before) || sees(after) {
            out.record(crossing);
        }
    });
}
