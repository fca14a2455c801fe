//! Edges of a frame that change together, and how closely it has been seen which of them are hidden.

use std::ops::Range;

use super::by_rays::{RayScratch, RaySettings, Target};
use super::clip::{ImageSegment, Projector};
use super::list::EdgeList;
use super::visible::VisibleEdges;
use crate::camera::View;

/// Some of the edges of a list.
#[derive(Clone, Debug, Default)]
pub(super) struct Layer {
    rays: RayScratch,
    /// The parts that are seen, as far as that is known.
    pub(super) visible: VisibleEdges,
    /// The same from a closer look that has not come to its end.
    closer: VisibleEdges,
    look: Look,
}

/// How closely edges have been looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Look {
    /// Some have not been yet.
    #[default]
    Partial,
    /// All have once.
    First,
    /// Some have once more.
    Closer,
    /// All have twice.
    Done,
}

impl Layer {
    /// Takes some edges over, of which nothing is known yet. If more than `most_rays` are needed, long chains of edges come
    /// first.
    pub(super) fn begin(
        &mut self,
        target: Target<'_>,
        range: Range<usize>,
        settings: RaySettings,
        most_rays: usize,
    ) {
        self.visible.clear();
        self.look = Look::Partial;
        let segments = segments(target.view, target.edges, range);
        self.rays.prepare(target, segments, settings, most_rays);
    }

    /// Looks at edges that have not been looked at. Says whether more are seen now, and adds the rays to `cast`.
    pub(super) fn first_look(
        &mut self,
        target: Target<'_>,
        settings: RaySettings,
        most_rays: usize,
        cast: &mut usize,
    ) -> bool {
        if self.look != Look::Partial {
            return false;
        }
        let before = self.visible.len();
        let done = self
            .rays
            .advance(target, settings, most_rays, cast, &mut self.visible);
        if done {
            self.look = Look::First;
        }
        self.visible.len() != before
    }

    /// Whether more looks will be of use.
    pub(super) fn is_done(&self) -> bool {
        self.look == Look::Done
    }

    /// Whether [`Layer::closer_look`] has something to do.
    pub(super) fn can_look_closer(&self) -> bool {
        matches!(self.look, Look::First | Look::Closer)
    }

    /// Looks at all edges once more. Says whether that is done and something else is seen now.
    pub(super) fn closer_look(
        &mut self,
        target: Target<'_>,
        settings: RaySettings,
        most_rays: usize,
        cast: &mut usize,
    ) -> bool {
        if self.look == Look::First {
            self.rays.restart();
            self.closer.clear();
            self.look = Look::Closer;
        }
        let done = self
            .rays
            .advance(target, settings, most_rays, cast, &mut self.closer);
        if done {
            std::mem::swap(&mut self.visible, &mut self.closer);
            self.look = Look::Done;
        }
        done
    }
}

/// The image of some edges of a list.
pub(super) fn segments(
    view: &View,
    edges: &EdgeList,
    range: Range<usize>,
) -> impl Iterator<Item = (u32, ImageSegment)> {
    let projector = Projector::new(view);
    range.filter_map(move |i| {
        let segment = projector.project(edges.from[i], edges.to[i])?;
        Some((i as u32, segment))
    })
}
