//! From samples and edges to the picture: the filters in their order.

use fearless_simd::Level;
use rayon::ThreadPool;

use super::Placed;
use crate::camera::View;
use crate::config::{Choices, Interpolation, Method};
use crate::edges::crossings::Crossings;
use crate::epi::Epi;
use crate::epi::grid::Grid;
use crate::epi::reach::ReachMap;
use crate::filters::antialias::{self, Antialias};
use crate::filters::complex::{self, ComplexFilter};
use crate::filters::interpolate::{self, Interpolated, Interpolator, Neighbours};
use crate::filters::settle::settle;
use crate::maps::Maps;
use crate::maps::paint::{self, Paint};
use crate::points::{PixelSamples, PointCache, Still};
use crate::stats::{Stage, StageMs};

/// What a picture is made from.
#[derive(Clone, Copy)]
pub(super) struct Inputs<'a> {
    pub(super) level: Level,
    /// Threads of interpolation and maps; none means the caller's own.
    pub(super) pool: Option<&'a ThreadPool>,
    pub(super) choices: &'a Choices,
    pub(super) view: Option<&'a View>,
    pub(super) samples: &'a PixelSamples,
    /// The points that samples are.
    pub(super) cache: &'a PointCache,
    /// Raw samples of a still camera.
    pub(super) still: &'a Still,
    pub(super) epi: &'a Epi,
    pub(super) reach: &'a ReachMap,
    pub(super) crossings: &'a Crossings,
    pub(super) placed: &'a Placed,
    /// Nothing in a scene without maps.
    pub(super) maps: Option<&'a Maps>,
}

/// The filters, what they keep from frame to frame, and the picture.
pub(super) struct Filters {
    interpolator: Interpolator,
    /// Primary regions, before maps are put on.
    pub(super) interpolated: Interpolated,
    paint: Option<Paint>,
    complex: ComplexFilter,
    antialias: Antialias,
    /// Plane: the secondary region's colour is known without a neighbour's.
    secondary_known: Vec<u64>,
    secondary: [Vec<f32>; 3],
    /// Linear radiance, planes by [`Grid`].
    pub(super) image: [Vec<f32>; 3],
}

impl Filters {
    /// Room for an image of this layout.
    pub(super) fn new(grid: Grid) -> Self {
        let plane = || vec![0.0; grid.elements()];
        Self {
            interpolator: Interpolator::new(grid),
            interpolated: Interpolated::new(grid),
            paint: None,
            complex: ComplexFilter::default(),
            antialias: Antialias::default(),
            secondary_known: vec![0; grid.plane_words()],
            secondary: [plane(), plane(), plane()],
            image: [plane(), plane(), plane()],
        }
    }

    /// Makes room for putting on maps.
    pub(super) fn expect_maps(&mut self, grid: Grid) {
        self.paint = Some(Paint::new(grid));
    }

    /// Makes the picture, and notes what each filter took.
    pub(super) fn draw(&mut self, inputs: &Inputs<'_>, ms: &mut StageMs) {
        ms.time(Stage::Interpolate, || self.interpolate(inputs));
        if inputs.choices.method == Method::EdgeAndPoint {
            ms.time(Stage::Complex, || self.reconstruct_complex(inputs));
        }
        if inputs.choices.antialias.is_on() {
            ms.time(Stage::Antialias, || self.blend_simple(inputs));
        }
        if inputs.choices.settle.is_on() {
            ms.time(Stage::Antialias, || {
                settle(inputs.still, inputs.epi, &mut self.image);
            });
        }
    }

    fn interpolate(&mut self, from: &Inputs<'_>) {
        let method = match from.choices.interpolation {
            Interpolation::Paper => interpolate::Method::FixedWeights,
            Interpolation::Linear => interpolate::Method::LinearFit,
        };
        let inputs = interpolate::Inputs {
            method,
            samples: from.samples,
            near: neighbours(from),
            centre_x: &from.epi.centre_px[0],
            centre_y: &from.epi.centre_px[1],
        };
        self.interpolator
            .interpolate(from.level, from.pool, &inputs, &mut self.interpolated);
        for (to, from) in self.image.iter_mut().zip(&self.interpolated.rgb) {
            to.copy_from_slice(from);
        }
        self.put_on_maps(from);
    }

    /// Multiplies the colours of primary regions by what their maps are there.
    fn put_on_maps(&mut self, from: &Inputs<'_>) {
        let (Some(maps), Some(paint), Some(view)) = (from.maps, &mut self.paint, from.view) else {
            return;
        };
        let inputs = paint::Inputs {
            view,
            samples: from.samples,
            cache: from.cache,
            near: neighbours(from),
            placed: from.placed,
        };
        paint.find(from.pool, maps, &inputs);
        paint.apply(&mut self.image);
    }

    fn reconstruct_complex(&mut self, from: &Inputs<'_>) {
        let inputs = complex::Inputs {
            epi: from.epi,
            crossings: from.crossings,
            samples: from.samples,
            bare: &self.interpolated.bare,
            paint: self.paint.as_ref(),
            sources: complex::Sources::default(),
        };
        self.complex.apply(&inputs, &mut self.image);
    }

    fn blend_simple(&mut self, from: &Inputs<'_>) {
        self.find_secondary(from);
        let inputs = antialias::Inputs {
            epi: from.epi,
            reach: from.reach,
            bare: &self.interpolated.bare,
            direct: Some(antialias::Direct {
                known: &self.secondary_known,
                rgb: self.secondary.each_ref().map(Vec::as_slice),
            }),
        };
        self.antialias.apply(&inputs, &mut self.image);
    }

    /// Colours of secondary regions that have samples of their own, which a still camera gathers.
    fn find_secondary(&mut self, &Inputs { epi, still, .. }: &Inputs<'_>) {
        self.secondary_known.fill(0);
        if still.samples() == 0 {
            return;
        }
        let grid = epi.grid;
        grid.for_each_set(&epi.simple, |x, y| {
            let Some(split) = still.split(x, y, epi.code_at(x, y).0) else {
                return;
            };
            let (word, bit) = grid.bit(x, y);
            let region = usize::from(epi.primary_inner[word] >> bit & 1 == 0);
            let mean = &split.regions[region];
            if mean.count > 0.0 {
                self.secondary_known[word] |= 1 << bit;
                for (plane, value) in self.secondary.iter_mut().zip(mean.rgb) {
                    plane[grid.at(x, y)] = value;
                }
            }
        });
    }
}

/// Which primary regions of the frame reach those beside them.
fn neighbours<'a>(from: &Inputs<'a>) -> Neighbours<'a> {
    Neighbours {
        right: &from.reach.steps.right[0],
        down: &from.reach.steps.down[0],
        simple: &from.epi.simple,
        complex: &from.epi.complex,
        has: &from.epi.has_sample,
    }
}
