//! One frame: the stages in their order, each reading what the ones before it left.

mod edges;
mod edit;
mod filters;
mod ingest;
mod placed;
mod plan;
mod rebuild;
mod renew;

use fearless_simd::Level;
use protocol::messages::Triple;
use protocol::scene::Scene;
use protocol::trace::Shadowed;
use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

use crate::camera::View;
use crate::config::{Choices, Culling, PlaceBits, PointCulling, Priority};
use crate::epi::code::{Places, Side};
use crate::epi::grid::Grid;
use crate::epi::reach::ReachMap;
use crate::epi::{Epi, SamplePlaces};
use crate::maps::Maps;
use crate::points::between::Between;
use crate::points::cache::ALL_ASKED;
use crate::points::cull::{Suspect, cull, cull_by_depth};
use crate::points::project::{Nearest, Projected, project};
use crate::points::renew::Renewal;
use crate::points::still::Mean;
use crate::points::{Due, PixelSamples, PointCache, Still};
use crate::sampling::choose::Chooser;
use crate::sampling::predict::Prediction;
use crate::sampling::priority::{self, Priorities, Rule};
use crate::shadows::worth::Tally;
use crate::stats::{FrameStats, PixelKinds, Stage, StageMs};

use filters::Filters;

pub use edges::{EdgeStage, Effort, SPARSEST_PX};
pub use ingest::Received;
pub(crate) use placed::wide;
pub use placed::{Changes, Edit, Placed, Thing};
pub use plan::Wanted;

/// The display without its sockets and windows: takes samples, draws frames, says what it wants next.
pub struct Display {
    level: Level,
    pool: Option<ThreadPool>,
    choices: Choices,
    seed: u64,
    grid: Grid,
    view: Option<View>,
    stale: bool,
    /// The frame's view is not that of the one before.
    moving: bool,
    /// Frames for which points are still projected and told hidden from visible after the view came to rest.
    unrest: u8,
    view_number: u32,
    cache: PointCache,
    nearest: Nearest,
    batch: Projected,
    pixels: PixelSamples,
    still: Still,
    edges: EdgeStage,
    placed: Placed,
    /// Nothing in a scene without maps.
    maps: Option<Maps>,
    epoch: u32,
    late: u64,
    due: Due,
    renewal: Renewal,
    marks: Vec<u8>,
    revealed: Vec<u64>,
    displaced: bool,
    epi: Epi,
    reach: ReachMap,
    filters: Filters,
    ageing: f32,
    between: Between,
    priorities: Priorities,
    chooser: Chooser,
    prediction: Prediction,
    chosen: Vec<(u16, u16)>,
    uncovered: Vec<(u16, u16)>,
    plans: u64,
    last_id: u64,
    samples_new: usize,
    stage_ms: StageMs,
}

impl Display {
    /// A display of an image of `width` x `height` pixels for this scene, with nothing in its cache.
    pub fn new(scene: &Scene, choices: Choices, width: u32, height: u32, seed: u64) -> Self {
        let grid = Grid::new(width as usize, height as usize);
        let pixels = (width * height) as f32;
        let capacity = ((pixels * choices.cache.max(0.0)) as usize).max(16);
        let places = match choices.place_bits {
            PlaceBits::Four => Places::Bits4,
            PlaceBits::Six => Places::Bits6,
            PlaceBits::Eight => Places::Bits8,
        };
        let mut display = Self {
            level: Level::new(),
            pool: None,
            choices,
            seed,
            grid,
            view: None,
            stale: true,
            moving: false,
            unrest: 0,
            view_number: 0,
            cache: PointCache::new(capacity),
            nearest: Nearest::default(),
            batch: Projected::default(),
            pixels: PixelSamples::new(grid),
            still: Still::new(grid),
            edges: EdgeStage::new(scene, choices, grid),
            placed: Placed::new(scene),
            maps: Maps::new(scene),
            epoch: 0,
            late: 0,
            due: Due::new(capacity),
            renewal: Renewal::new(scene),
            marks: Vec::new(),
            revealed: vec![0; grid.plane_words()],
            displaced: false,
            epi: Epi::new(grid.width, grid.height, places),
            reach: ReachMap::new(grid.width, grid.height),
            filters: Filters::new(grid),
            ageing: 0.0,
            between: Between::new(grid),
            priorities: Priorities::new(grid),
            chooser: Chooser::default(),
            prediction: Prediction::default(),
            chosen: Vec::new(),
            uncovered: Vec::new(),
            plans: 0,
            last_id: 0,
            samples_new: 0,
            stage_ms: StageMs::default(),
        };
        display.make_room_for_maps();
        display
    }

    /// Keeps what maps need, if the scene has any.
    fn make_room_for_maps(&mut self) {
        if self.maps.is_some() {
            self.cache.remember_maps();
            self.filters.expect_maps(self.grid);
        }
    }

    /// Lets interpolation use this many threads; one means the caller's own. Pictures are the same.
    ///
    /// # Errors
    /// If the threads cannot be started.
    pub fn use_threads(&mut self, threads: usize) -> Result<(), ThreadPoolBuildError> {
        let name = |i| format!("display-{i}");
        let builder = ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(name);
        self.pool = (threads > 1).then(|| builder.build()).transpose()?;
        Ok(())
    }

    /// Takes in which lights, blockers and receivers samples have met.
    pub fn learn(&mut self, triples: &[Triple]) {
        self.edges.learn(triples);
    }

    /// Has shadow edges computed that are wanting, in the background, and takes in those that are ready. With `wait` it
    /// waits for all of them, so that what is drawn next does not depend on how fast that goes.
    pub fn update_shadows(&mut self, wait: bool) {
        self.edges.update_shadows(wait);
    }

    /// As [`Display::update_shadows`] was in another run: either it waited for all, or it took these
    /// [answers](crate::shadows::store::Shadows::taken).
    pub fn update_shadows_as(&mut self, shadowed: &Shadowed) {
        match shadowed {
            Shadowed::All => self.edges.update_shadows(true),
            Shadowed::Answers(taken) => self.edges.update_shadows_as(taken),
        }
    }

    /// What the last [`Display::update_shadows`] took in, for a run that is to be the same.
    pub fn shadowed(&self, waited: bool) -> Shadowed {
        if waited {
            return Shadowed::All;
        }
        let taken = self.edges.shadows().map(|shadows| shadows.taken().to_vec());
        Shadowed::Answers(taken.unwrap_or_default())
    }

    /// What became of the shadow edges of the last frame.
    pub fn shadow_tally(&self) -> Tally {
        self.edges.tally()
    }

    /// Says where the first frame will be drawn from, before any samples come in.
    pub fn begin(&mut self, view: &View, view_number: u32) {
        self.view = Some(*view);
        self.view_number = view_number;
    }

    /// Draws the frame for this view from what the cache holds. `view_number` is the number under which the servers know
    /// the view: samples asked for under it may be averaged while it lasts.
    pub fn draw(&mut self, view: &View, view_number: u32) {
        self.moving = self.view != Some(*view);
        self.view_number = view_number;
        if self.moving {
            if self.view.is_some_and(|before| self.jumps(&before, view)) {
                self.cache.doubt_all();
            }
            self.view = Some(*view);
            self.still.clear();
            self.unrest = ALL_ASKED;
        }
        let moved = self.moving || self.stale || self.unrest > 0;
        self.unrest = self.unrest.saturating_sub(1);
        self.stale = false;
        let settling = self.choices.settle.is_on();
        // Edges that rays decide about need no points; those edges then help to tell hidden points.
        let edges_first = self.choices.edges() && self.choices.culling != Culling::Points;
        if edges_first {
            self.find_edges(view);
        }
        if moved || !settling {
            self.reproject(view, edges_first);
        }
        if self.choices.edges() && !edges_first {
            self.find_edges(view);
        }
        let mut ms = std::mem::take(&mut self.stage_ms);
        ms.time(Stage::Classify, || self.settle_primary());
        ms.time(Stage::Reach, || self.reach.compute(self.level, &self.epi));
        let inputs = filters::Inputs {
            level: self.level,
            pool: self.pool.as_ref(),
            choices: &self.choices,
            view: self.view.as_ref(),
            samples: &self.pixels,
            cache: &self.cache,
            still: &self.still,
            epi: &self.epi,
            reach: &self.reach,
            crossings: self.edges.crossings(),
            placed: &self.placed,
            maps: self.maps.as_ref(),
        };
        self.filters.draw(&inputs, &mut ms);
        self.stage_ms = ms;
    }

    /// Whether the eye goes so far at once that what hid nothing before may hide anything now.
    fn jumps(&self, before: &View, view: &View) -> bool {
        let grid = self.grid;
        let (mut near, mut all) = (0, 0);
        let reach = JUMP * before.eye.distance(view.eye);
        for y in (0..grid.height).step_by(PROBED) {
            for x in (0..grid.width).step_by(PROBED) {
                if self.pixels.has_sample(x, y) {
                    all += 1;
                    near += usize::from(self.pixels.depth[grid.at(x, y)] < reach);
                }
            }
        }
        2 * near > all
    }

    fn find_edges(&mut self, view: &View) {
        let mut ms = std::mem::take(&mut self.stage_ms);
        self.edges
            .find(view, self.placed.lights(), &self.pixels, &mut ms);
        ms.time(Stage::Classify, || {
            self.edges.classify(self.level, &mut self.epi);
        });
        self.stage_ms = ms;
    }

    fn reproject(&mut self, view: &View, edges_known: bool) {
        let mut ms = std::mem::take(&mut self.stage_ms);
        ms.time(Stage::Reproject, || {
            project(
                self.level,
                &mut self.cache,
                view,
                &mut self.nearest,
                &mut self.pixels,
            );
        });
        ms.time(Stage::Depth, || self.cull_points(view, edges_known));
        ms.time(Stage::Reproject, || self.weigh_due());
        self.still.change_all();
        self.stage_ms = ms;
    }

    fn cull_points(&mut self, view: &View, edges_known: bool) {
        let epi = edges_known.then_some(&self.epi);
        let (pixels, between) = (&mut self.pixels, &mut self.between);
        if self.choices.point_culling != PointCulling::None {
            between.find(self.level, pixels, epi, view.focal_px);
        }
        match (self.choices.point_culling, self.edges.world()) {
            (PointCulling::Depth, _) => cull_by_depth(pixels, between),
            (PointCulling::Rays, Some(world)) => {
                let front = |point: &Suspect| edges::front(world, view, point);
                cull(
                    pixels,
                    between,
                    &mut self.cache,
                    (epi, view.focal_px),
                    front,
                );
            }
            (PointCulling::None | PointCulling::Rays, _) => {}
        }
        // A point is 128 old on average when a new one takes its place (Render Cache 2002).
        self.ageing += 128.0 * self.samples_new as f32 / self.cache.capacity() as f32;
        let step = self.ageing.floor().min(255.0);
        self.ageing -= step;
        self.cache.grow_older(step as u8);
    }

    /// Puts the means of a still camera into their pixels, and settles primary regions and their middles.
    fn settle_primary(&mut self) {
        let grid = self.grid;
        for &pixel in self.still.changed() {
            let (x, y) = (pixel as usize % grid.width, pixel as usize / grid.width);
            let Some((mean, place)) = still_sample(&self.still, &self.epi, x, y) else {
                continue;
            };
            let at = grid.at(x, y);
            [self.pixels.x[at], self.pixels.y[at]] = place;
            self.pixels.count[at] = mean.count;
            for (plane, value) in self.pixels.rgb.iter_mut().zip(mean.flat) {
                plane[at] = value;
            }
            let (word, bit) = grid.bit(x, y);
            self.pixels.has[word] |= 1 << bit;
        }
        self.still.forget_changed();
        let (x, y) = (&self.pixels.x, &self.pixels.y);
        self.epi.set_primary(&SamplePlaces {
            present: &self.pixels.has,
            x,
            y,
        });
    }

    /// Priorities of the frame just drawn.
    fn prioritize(&mut self) {
        let rule = match self.choices.priority {
            Priority::Paper => Rule::MissingWeight,
            Priority::Contrast => Rule::Contrast,
        };
        let inputs = priority::Inputs {
            grid: self.grid,
            rgb: &self.filters.interpolated.rgb,
            weight: &self.filters.interpolated.weight,
            reach: &self.reach,
            complex: &self.epi.complex,
        };
        self.priorities.compute(self.level, rule, &inputs);
        self.mark_renewals();
        self.raise_due();
    }

    /// The frame's linear radiance, planes by [`Display::grid`].
    pub fn image(&self) -> &[Vec<f32>; 3] {
        &self.filters.image
    }

    /// Layout of [`Display::image`].
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// Where everything is.
    pub fn placed(&self) -> &Placed {
        &self.placed
    }

    /// The edge-and-point image of the frame.
    pub fn epi(&self) -> &Epi {
        &self.epi
    }

    /// The samples that the pixels of the frame have.
    pub fn pixels(&self) -> &PixelSamples {
        &self.pixels
    }

    /// The priorities that the last plan was made from, by [`Display::grid`].
    pub fn priorities(&self) -> &[f32] {
        &self.priorities.priority
    }

    /// Adds the time that showing the frame took.
    pub fn time_present<T>(&mut self, run: impl FnOnce(&Self) -> T) -> T {
        let start = std::time::Instant::now();
        let result = run(self);
        *self.stage_ms.of(Stage::Present) += start.elapsed().as_secs_f64() * 1e3;
        result
    }

    /// What the frame cost since the last call and what it is made of.
    pub fn take_stats(&mut self, frame: usize) -> FrameStats {
        let stage_ms = std::mem::take(&mut self.stage_ms);
        let counts = self.epi.counts;
        FrameStats {
            frame,
            total_ms: stage_ms.total(),
            stage_ms,
            silhouette_edges: self.edges.found()[0],
            shadow_edges: self.edges.found()[1],
            pixels: PixelKinds {
                empty: counts.empty,
                simple: counts.simple,
                complex: counts.complex,
            },
            samples_new: std::mem::take(&mut self.samples_new),
            samples_visible: self.pixels.visible(),
            points: self.cache.len(),
            ..FrameStats::default()
        }
    }
}

/// The eye jumps if most of what it saw is nearer than so many times its step: what it sees then turns by more than 7 degrees
/// (one over this) from one frame to the next, where the orbit of Chains turns by 3.
const JUMP: f32 = 8.0;

/// Pixels between those at whose depth is looked for that.
const PROBED: usize = 8;

/// What stands for a pixel of a still camera and where: the mean of the region with more samples, placed so that its side
/// of the edge is sure, or of the whole pixel. Nothing for samples of which none has a sure side: their mean may mix both.
fn still_sample(still: &Still, epi: &Epi, x: usize, y: usize) -> Option<(Mean, [f32; 2])> {
    let code = epi.code_at(x, y);
    let whole = *still.whole(x, y);
    let Some(split) = Some(code)
        .filter(|c| c.is_simple())
        .and_then(|c| still.split(x, y, c.0))
    else {
        let mixes = code.is_simple() && whole.count > 1.0;
        return (!mixes).then_some((whole, whole.place));
    };
    let [outer, inner] = split.regions;
    let is_inner = match inner.count.total_cmp(&outer.count) {
        std::cmp::Ordering::Greater => true,
        std::cmp::Ordering::Less => false,
        std::cmp::Ordering::Equal => epi.tables().inner_larger(code),
    };
    let mean = if is_inner { inner } else { outer };
    let side = if is_inner { Side::Inner } else { Side::Outer };
    let [px, py] = mean.place;
    let sure = epi.tables().side(code, epi.tables().places().cell(px, py)) == side;
    let place = if sure {
        mean.place
    } else {
        epi.tables().centroid_px(code, is_inner)
    };
    Some((mean, place))
}
