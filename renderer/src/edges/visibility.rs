//! Drawing the edges that can be seen.

use rays::World;

use super::by_rays::{RaySettings, Target};
use super::clip::{ImageSegment, SUBPIXELS};
use super::crossings::Crossings;
use super::depth::{DepthBuffer, DepthOffset, FilteredDepth};
use super::layer::{Layer, segments};
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
    /// Of meshes, and those that follow them in the list.
    layers: [Layer; 2],
    visible: VisibleEdges,
    depth: FilteredDepth,
    drawn: Option<Key>,
    rays: usize,
}

/// What crossings depend on that were drawn without points.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Key {
    meshes: Meshes,
    appended: u64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Meshes {
    generation: u64,
    len: usize,
    half: bool,
    settings: Option<RaySettings>,
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
        self.draw_within(view, (edges, 0), hiding, half, usize::MAX, out)
    }

    /// Like [`draw`](Self::draw); the first `of_meshes` edges are those of meshes. Where only the others have changed, no
    /// ray asks about the former again, and no more than about `most_rays` in one call about the latter: those that are left
    /// are drawn by later calls with the same list.
    pub fn draw_within(
        &mut self,
        view: &View,
        (edges, of_meshes): (&EdgeList, usize),
        hiding: Hiding<'_>,
        half: bool,
        most_rays: usize,
        out: &mut Crossings,
    ) -> bool {
        let settings = match hiding {
            Hiding::None => None,
            Hiding::Rays(_, settings) => Some(settings),
            Hiding::Points(buffer, offset) => {
                self.drawn = None;
                self.depth.filter(buffer, offset);
                out.clear();
                for (_, segment) in segments(view, edges, 0..edges.len()) {
                    draw_tested(&segment, half, &self.depth, out);
                }
                return true;
            }
        };
        let meshes = Meshes {
            generation: edges.generation,
            len: of_meshes,
            half,
            settings,
        };
        let appended = edges.appended;
        let before = self.drawn.replace(Key { meshes, appended });
        let anew = before != self.drawn;
        let Hiding::Rays(world, settings) = hiding else {
            if anew {
                out.clear();
                segments(view, edges, 0..edges.len()).for_each(|(_, s)| out.draw(&s, half));
            }
            return anew;
        };
        let target = Target { view, edges, world };
        let [own, others] = &mut self.layers;
        self.rays = 0;
        if before.is_none_or(|b| b.meshes != meshes) {
            own.begin(target, 0..of_meshes, settings, usize::MAX);
            own.first_look(target, settings, usize::MAX, &mut self.rays);
        }
        if anew {
            others.begin(target, of_meshes..edges.len(), settings, most_rays);
        }
        let more = others.first_look(target, settings, most_rays, &mut self.rays);
        if anew || more {
            self.draw_visible(half, out);
        }
        anew || more
    }

    /// Casts up to about so many rays to see more exactly where the edges of the last call to
    /// [`draw_within`](Self::draw_within), which were all that there are, are hidden by the world. True if that has changed the
    /// crossings.
    pub fn look_closer(
        &mut self,
        (view, edges, world): (&View, &EdgeList, &World),
        settings: RaySettings,
        most_rays: usize,
        out: &mut Crossings,
    ) -> bool {
        let Some(drawn) = self.drawn else {
            return false;
        };
        let Some(layer) = self.layers.iter_mut().find(|l| l.can_look_closer()) else {
            return false;
        };
        let target = Target { view, edges, world };
        let changed = layer.closer_look(target, settings, most_rays, &mut self.rays);
        if changed {
            self.draw_visible(drawn.meshes.half, out);
        }
        changed
    }

    /// Whether further calls to [`draw_within`](Self::draw_within) or [`look_closer`](Self::look_closer) with the same list
    /// would cast rays.
    pub fn is_done(&self) -> bool {
        self.layers.iter().all(Layer::is_done)
    }

    fn draw_visible(&mut self, half: bool, out: &mut Crossings) {
        self.visible.clear();
        for layer in &self.layers {
            self.visible.extend(&layer.visible);
        }
        out.clear();
        self.visible.draw(half, out);
    }

    /// What is seen of the edges, by the last call with [`Hiding::Rays`].
    pub fn visible(&self) -> &VisibleEdges {
        &self.visible
    }

    /// Rays cast since the last call to [`draw_within`](Self::draw_within) with [`Hiding::Rays`] began.
    pub fn rays(&self) -> usize {
        self.rays
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
