//! One frame after another, without ever waiting for a server. Knows nothing of windows.

use std::collections::VecDeque;
use std::time::Instant;

use protocol::messages::Camera;
use protocol::scene::Scene;
use protocol::trace::Step;

use super::baseline::Baseline;
use super::budget::Budget;
use super::grab::{Grab, markers, near_light};
use super::pace::Pace;
use super::tell::Figures;
use crate::camera::View;
use crate::config::{Choices, Method, ShadowEdges};
use crate::epi::grid::Grid;
use crate::explain::Explanation;
use crate::frame::{Display, Edit, Received, Wanted};
use crate::link::LinkStatus;
use crate::servers::{Servers, ServersError};
use crate::show::{Show, Stages, show};
use crate::stats::FrameStats;
use crate::tone::ToneMap;
use crate::traces::{planned, shaped};

/// Views whose requests may still be under way, at most.
const VIEWS_REMEMBERED: usize = 32;
/// How far the eye may have moved, as a share of the distance to the target, for samples of a view to be of use still.
const NEAR_SHARE: f32 = 0.1;
/// How far the line of sight may have turned for that, as a share of the field of view.
const NEAR_TURN: f32 = 0.2;
/// The display and its servers, frame after frame.
pub(super) struct Session {
    display: Display,
    servers: Servers,
    choices: Choices,
    budget: Budget,
    baseline: Option<Baseline>,
    tone: ToneMap,
    wanted: Wanted,
    received: Vec<Received>,
    shown: Vec<u32>,
    size: (u32, u32),
    view: Option<View>,
    number: u32,
    views: VecDeque<(u32, View)>,
    rebuild: Option<Keep>,
    paused: bool,
    frozen: bool,
    settled: bool,
    frames: usize,
    stats: FrameStats,
    pace: Pace,
}

/// Whether points outlive a rebuild.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Keep {
    Points,
    Nothing,
}

impl Session {
    /// Ready for the first frame. Methods that trace every pixel become the baseline over the default method.
    pub(super) fn new(
        scene: &Scene,
        choices: Choices,
        seed: u64,
        servers: Servers,
        most: Option<usize>,
    ) -> Self {
        // The display is made for the method that needs most, so that every other can be switched to.
        let all = Choices {
            method: Method::EdgeAndPoint,
            ..choices
        };
        let every_pixel = matches!(choices.method, Method::Full | Method::Reference);
        servers.note(|| shaped(&all, (1, 1), false));
        Self {
            display: Display::new(scene, all, 1, 1, seed),
            servers,
            choices: if every_pixel { all } else { choices },
            budget: Budget::new(most),
            baseline: every_pixel.then(|| Baseline::new(Grid::new(1, 1))),
            tone: ToneMap::new(),
            wanted: Wanted::default(),
            received: Vec::new(),
            shown: Vec::new(),
            size: (0, 0),
            view: None,
            number: 0,
            views: VecDeque::new(),
            rebuild: None,
            paused: false,
            frozen: false,
            settled: false,
            frames: 0,
            stats: FrameStats::default(),
            pace: Pace::default(),
        }
    }

    /// Lets the display use this many threads.
    ///
    /// # Errors
    /// If they cannot be started.
    pub(super) fn use_threads(
        &mut self,
        threads: usize,
    ) -> Result<(), rayon::ThreadPoolBuildError> {
        self.display.use_threads(threads)
    }

    /// Which models are chosen for the scene.
    pub(super) fn explain(&self, scene: &Scene) -> Explanation {
        Explanation::of(&self.display, scene, &self.servers.shadows())
    }

    /// Draws the next frame and asks for what it lacks. `next` is where the camera will be in the frame after, if it
    /// moves; `reach` the distance to what it looks at, metres.
    ///
    /// # Errors
    /// If the camera makes no picture; the frame before stays.
    pub(super) fn frame(
        &mut self,
        camera: &Camera,
        next: Option<&Camera>,
        reach: f32,
        what: Show,
    ) -> Result<(), ServersError> {
        let start = Instant::now();
        let frame_s = self.pace.begin(start);
        let view = View::new(camera);
        self.fit(camera, &view);
        if self.view != Some(view) {
            self.look(camera, view, reach)?;
        }
        self.take_samples();
        if self.baseline.is_none() {
            self.display.draw(&view, self.number);
            self.servers.note(|| Step::Drawn {
                view: self.number,
                camera: *camera,
            });
        } else {
            self.servers.note(|| Step::Passed);
        }
        self.paint(what);
        self.ask(frame_s, next)?;
        self.stats = self.display.take_stats(self.frames);
        if let Some(baseline) = &self.baseline {
            self.stats.samples_visible = baseline.traced();
        }
        self.frames += 1;
        self.pace.end(start.elapsed().as_secs_f64() * 1e3);
        Ok(())
    }

    /// Makes the display fit the camera's picture and the choices.
    fn fit(&mut self, camera: &Camera, view: &View) {
        let size = (camera.width, camera.height);
        if self.size == size && self.rebuild.is_none() {
            return;
        }
        let keep = self.rebuild.take() != Some(Keep::Nothing);
        self.display.rebuild(self.choices, size.0, size.1, keep);
        self.servers.note(|| shaped(&self.choices, size, keep));
        // Samples of another view are none of this one's: no view has the number 0.
        let number = if self.view == Some(*view) {
            self.number
        } else {
            0
        };
        self.display.begin(view, number);
        self.note_begun(number, camera);
        self.size = size;
        if self.baseline.is_some() {
            self.baseline = Some(Baseline::new(self.display.grid()));
        }
        self.settled = false;
    }

    /// Tells the servers of a new view, and that old ones that are not near it are of no interest any more.
    fn look(&mut self, camera: &Camera, view: View, reach: f32) -> Result<(), ServersError> {
        self.number = self.servers.set_view(camera)?;
        if self.view.is_none() {
            self.display.begin(&view, self.number);
            self.note_begun(self.number, camera);
        }
        self.view = Some(view);
        self.settled = false;
        if let Some(baseline) = &mut self.baseline {
            baseline.renew();
        }
        self.remember(self.number, view);
        let stale = self.views.iter().rposition(|(_, v)| !near(v, &view, reach));
        let crowd = self.views.len().saturating_sub(VIEWS_REMEMBERED);
        let gone = stale.map_or(0, |i| i + 1).max(crowd);
        if gone > 0 {
            self.views.drain(..gone);
            let first = self.views.front().map_or(self.number, |(n, _)| *n);
            self.servers.cancel_before(first);
        }
        Ok(())
    }

    fn note_begun(&self, view: u32, camera: &Camera) {
        self.servers.note(|| Step::Begun {
            view,
            camera: *camera,
        });
    }

    fn remember(&mut self, number: u32, view: View) {
        self.views.push_back((number, view));
    }

    fn take_samples(&mut self) {
        self.received.clear();
        self.servers.drain(&mut self.received);
        self.display.learn(&self.servers.new_triples());
        self.display.update_shadows(false);
        self.servers
            .note(|| Step::Shadowed(self.display.shadowed(false)));
        if self.frozen || self.received.is_empty() {
            return;
        }
        self.settled = false;
        self.display.receive(&self.received, self.number);
        self.servers.note_taken(self.number);
        if let Some(baseline) = &mut self.baseline {
            baseline.take(&self.received);
        }
    }

    fn paint(&mut self, what: Show) {
        let Self {
            display,
            baseline,
            tone,
            shown,
            ..
        } = self;
        display.time_present(|d| match baseline {
            Some(baseline) => tone.map(d.grid(), baseline.image(), shown),
            None => show(what, &Stages::of(d), tone, shown),
        });
    }

    fn ask(&mut self, frame_s: f64, next: Option<&Camera>) -> Result<(), ServersError> {
        if self.paused || self.frozen {
            return Ok(());
        }
        let status = self.servers.status();
        let budget = self.budget.next(&status, frame_s, self.pixels());
        if budget == 0 {
            return Ok(());
        }
        if let Some(baseline) = &mut self.baseline {
            self.wanted.here.clear();
            let display = &mut self.display;
            baseline.plan(budget, || display.next_id(), &mut self.wanted.here);
            self.settled = baseline.is_done() && next.is_none();
            return self.servers.request(self.number, &self.wanted.here);
        }
        let next_view = next.map(View::new);
        self.display
            .plan(budget, next_view.as_ref(), &mut self.wanted);
        self.servers.note(|| planned(budget, false, next.copied()));
        self.settled = self.wanted.is_empty() && next.is_none();
        self.servers.request(self.number, &self.wanted.here)?;
        if let (Some(camera), Some(view)) = (next, next_view)
            && !self.wanted.ahead.is_empty()
        {
            let number = self.servers.set_view(camera)?;
            self.remember(number, view);
            self.servers.request(number, &self.wanted.ahead)?;
        }
        Ok(())
    }

    fn pixels(&self) -> usize {
        self.size.0 as usize * self.size.1 as usize
    }

    /// Moves those things that are not yet in these places; the points that this leaves valid stay.
    ///
    /// # Errors
    /// If the edit holds a value that is not allowed: nothing moves.
    pub(super) fn move_to(&mut self, edit: &Edit) -> Result<(), ServersError> {
        let edit = &self.display.placed().news(edit);
        if edit.is_empty() {
            return Ok(());
        }
        let epoch = self.servers.edit(edit)?;
        self.display.edit(epoch, edit);
        self.settled = false;
        if let Some(baseline) = &mut self.baseline {
            baseline.renew();
        }
        Ok(())
    }

    /// Takes hold of what the last frame shows at (x, y) px.
    pub(super) fn grab(&self, (x, y): (f32, f32)) -> Option<Grab> {
        let view = self.view.as_ref()?;
        let placed = self.display.placed();
        let light = near_light(placed.lights(), view, (x, y));
        let (thing, at) = light.or_else(|| self.display.pick(view, (x, y)))?;
        Grab::new(placed, thing, at, view.eye)
    }

    /// Where lights without area are in the last frame, px.
    pub(super) fn markers(&self) -> Vec<[f32; 2]> {
        let lights = self.display.placed().lights();
        let view = self.view.as_ref();
        view.map_or_else(Vec::new, |v| markers(lights, v).map(|m| m.2).collect())
    }

    /// What the last frame shows, 0x00RRGGBB row by row.
    pub(super) fn shown(&self) -> &[u32] {
        &self.shown
    }

    /// The last frame's linear radiance, planes by the grid.
    pub(super) fn picture(&self) -> (Grid, &[Vec<f32>; 3]) {
        let image = match &self.baseline {
            Some(baseline) => baseline.image(),
            None => self.display.image(),
        };
        (self.display.grid(), image)
    }

    /// Stops asking for samples, or goes on.
    pub(super) fn toggle_pause(&mut self) {
        self.paused = !self.paused;
    }

    /// Stops taking samples in, or goes on.
    pub(super) fn toggle_freeze(&mut self) {
        self.frozen = !self.frozen;
    }

    /// Forgets all points.
    pub(super) fn clear(&mut self) {
        self.rebuild = Some(Keep::Nothing);
    }

    /// From edges with the complex filter to edges without it, to points alone, and round.
    pub(super) fn next_method(&mut self) {
        self.choices.method = match self.choices.method {
            Method::EdgeAndPoint => Method::NoComplex,
            Method::NoComplex => Method::PointsOnly,
            _ => Method::EdgeAndPoint,
        };
        self.baseline = None;
        self.rebuild = self.rebuild.or(Some(Keep::Points));
    }

    /// From the shadow edges that are worth it to all of them, to none, and round.
    pub(super) fn next_shadow_edges(&mut self) {
        self.choices.shadow_edges = match self.choices.shadow_edges {
            ShadowEdges::Chosen => ShadowEdges::All,
            ShadowEdges::All => ShadowEdges::Off,
            ShadowEdges::Off => ShadowEdges::Chosen,
        };
        self.rebuild = self.rebuild.or(Some(Keep::Points));
    }

    /// Traces every pixel, or reconstructs again.
    pub(super) fn toggle_baseline(&mut self) {
        self.baseline = match self.baseline {
            Some(_) => None,
            None => Some(Baseline::new(self.display.grid())),
        };
        self.settled = false;
    }

    /// How the servers are doing.
    pub(super) fn servers(&self) -> LinkStatus {
        self.servers.status()
    }

    /// Whether the servers have nothing to do although there is something to ask for.
    pub(super) fn restless(&self) -> bool {
        let status = self.servers.status();
        let idle = status.queued + status.outstanding == 0;
        idle && !(self.settled || self.paused || self.frozen)
    }

    /// What the last frame took, smoothed, ms.
    pub(super) fn cost_ms(&self) -> f64 {
        self.pace.cost_ms
    }

    /// What is to be told about it all, item by item.
    pub(super) fn status(&self) -> Vec<String> {
        let figures = Figures {
            interval_s: self.pace.interval_s,
            cost_ms: self.pace.cost_ms,
            pixels: self.pixels(),
            stats: &self.stats,
            servers: &self.servers.status(),
            method: self.baseline.is_none().then_some(self.choices.method),
            shadow_edges: self.choices.shadow_edges,
            frozen: self.frozen,
            paused: self.paused,
            settled: self.settled,
        };
        figures.tell()
    }
}

/// Whether samples of one view are of use in another.
fn near(a: &View, b: &View, reach: f32) -> bool {
    let turn = (NEAR_TURN * b.fov_y.to_radians()).cos();
    (a.width, a.height) == (b.width, b.height)
        && (a.eye - b.eye).length() <= NEAR_SHARE * reach
        && a.forward.dot(b.forward) >= turn
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_are_near_while_the_picture_is_about_the_same() {
        let view = |eye: [f32; 3], target: [f32; 3], width: u32| {
            View::new(&Camera {
                eye,
                target,
                up: [0.0, 1.0, 0.0],
                fov_y: 45.0,
                width,
                height: 64,
            })
        };
        let here = view([0.0, 0.0, 5.0], [0.0; 3], 64);
        assert!(near(&here, &here, 5.0));
        assert!(near(
            &view([0.2, 0.0, 5.0], [0.2, 0.0, 0.0], 64),
            &here,
            5.0
        ));
        assert!(!near(
            &view([0.9, 0.0, 5.0], [0.9, 0.0, 0.0], 64),
            &here,
            5.0
        ));
        assert!(!near(
            &view([0.0, 0.0, 5.0], [2.0, 0.0, 0.0], 64),
            &here,
            5.0
        ));
        assert!(!near(&view([0.0, 0.0, 5.0], [0.0; 3], 32), &here, 5.0));
    }
}
