//! The edge stages of a frame: found, hidden ones left out, drawn into crossings.

use fearless_simd::Level;
use glam::Affine3A;
use protocol::messages::Triple;
use protocol::scene::{Light, Scene};
use rays::{Ray, World};
use serde::Serialize;

use super::Display;
use super::placed::{Changes, Placed};
use crate::camera::View;
use crate::config::{Choices, Culling, Method, PointCulling, ShadowEdges};
use crate::edges::by_rays::RaySettings;
use crate::edges::crossings::Crossings;
use crate::edges::depth::{DepthBuffer, DepthOffset};
use crate::edges::finder::EdgeFinder;
use crate::edges::list::EdgeList;
use crate::edges::visibility::{EdgeDrawer, Hiding};
use crate::edges::visible::VisibleEdges;
use crate::edges::world::{affine, polygon, world_of};
use crate::epi::Epi;
use crate::epi::bends::mark_bends;
use crate::epi::classify::classify;
use crate::epi::grid::Grid;
use crate::points::PixelSamples;
use crate::points::cull::Suspect;
use crate::points::project::FAR_DEPTH;
use crate::shadows::list::append;
use crate::shadows::store::Shadows;
use crate::shadows::worker::Lines;
use crate::shadows::worth::{Tally, Worth};
use crate::stats::{Stage, StageMs};

/// How often edges had to be worked on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Effort {
    /// Frames with edges.
    pub frames: u64,
    /// Those in which edges of meshes were searched for.
    pub searches: u64,
    /// Those in which shadow edges were judged.
    pub judgements: u64,
}

/// Everything about edges that lasts from frame to frame.
pub struct EdgeStage {
    finder: EdgeFinder,
    list: EdgeList,
    drawer: EdgeDrawer,
    depth: DepthBuffer,
    world: Option<World>,
    culling: Culling,
    half: bool,
    crossings: Crossings,
    changed: bool,
    shadows: Option<Shadows>,
    choices: Choices,
    worth: Worth,
    /// More than any mesh has vertices.
    vertices: u32,
    /// Edges of meshes in the list; the others follow.
    of_meshes: usize,
    /// What became of the shadow edges of each light.
    tallies: Vec<Tally>,
    effort: Effort,
    /// Generation of the shadows that the list holds.
    known: u64,
    /// The list that was drawn last.
    drawn: [u64; 2],
}

impl EdgeStage {
    /// Ready to find the edges of this scene.
    pub fn new(scene: &Scene, choices: Choices, grid: Grid) -> Self {
        let rays = (choices.edges() && choices.culling == Culling::Rays)
            || choices.point_culling == PointCulling::Rays;
        let finder = EdgeFinder::new(scene);
        let shadows = choices
            .edges()
            .then(|| Shadows::new(scene, &finder, lines_of(choices)));
        Self {
            shadows,
            choices,
            worth: Worth::ALL,
            vertices: scene
                .meshes
                .iter()
                .map(|m| m.positions.len() as u32)
                .max()
                .unwrap_or(0),
            of_meshes: 0,
            tallies: Vec::new(),
            effort: Effort::default(),
            known: 0,
            drawn: [0; 2],
            finder,
            list: EdgeList::default(),
            drawer: EdgeDrawer::default(),
            depth: DepthBuffer::default(),
            world: rays.then(|| world_of(scene)),
            culling: choices.culling,
            half: choices.method == Method::EdgeAndPoint,
            crossings: Crossings::new(grid.width, grid.height),
            changed: true,
        }
    }

    /// Makes ready for pictures of another layout or made by other choices; finding starts afresh, the scene's trees stay.
    pub(super) fn reshape(&mut self, choices: Choices, grid: Grid) {
        self.list = EdgeList::default();
        self.drawer = EdgeDrawer::default();
        self.culling = choices.culling;
        self.half = choices.method == Method::EdgeAndPoint;
        self.crossings = Crossings::new(grid.width, grid.height);
        self.changed = true;
        self.choices = choices;
        if let Some(shadows) = &mut self.shadows {
            shadows.set_lines(lines_of(choices));
        }
    }

    /// Takes in what samples met.
    pub fn learn(&mut self, triples: &[Triple]) {
        if let Some(shadows) = &mut self.shadows {
            shadows.learn(triples);
        }
    }

    /// Computes the shadow edges and intersection creases that are wanting, in the background, and waits for them if `wait`
    /// is set.
    pub fn update_shadows(&mut self, wait: bool) {
        if let Some(shadows) = &mut self.shadows {
            shadows.update(wait);
        }
    }

    /// As [`Self::update_shadows`] was in another run, that took these answers.
    pub fn update_shadows_as(&mut self, taken: &[(u64, bool)]) {
        if let Some(shadows) = &mut self.shadows {
            shadows.update_as(taken);
        }
    }

    /// Moves what an edit changed; `placed` is the scene after it.
    pub(super) fn edit(&mut self, placed: &Placed, changes: &Changes) {
        for (object, _, after) in &changes.objects {
            self.finder.set_transform(*object as usize, after);
            if let Some(world) = &mut self.world {
                world.set_transform(*object, affine(after));
            }
        }
        let objects = placed.objects();
        for (light, _, after) in &changes.lights {
            let (Light::Area { vertices, .. }, Some(k)) = (after, placed.area_light(*light)) else {
                continue;
            };
            self.finder.set_light(k, vertices);
            if let Some(world) = &mut self.world {
                world.set_instance((objects + k) as u32, polygon(vertices), Affine3A::IDENTITY);
            }
        }
        if let Some(world) = &mut self.world {
            world.refit();
        }
        if let Some(shadows) = &mut self.shadows {
            for (object, _, after) in &changes.objects {
                shadows.move_object(*object, after);
            }
            for (light, _, after) in &changes.lights {
                shadows.change_light(*light, after);
            }
        }
    }

    /// Finds the view's edges and draws those that can be seen. With rays it looks closer once when edges stay as they are,
    /// some in each frame, and does nothing while nothing moves after that; with points the answer depends on the samples, so that edges are
    /// drawn anew in every frame.
    pub fn find(&mut self, view: &View, lights: &[Light], pixels: &PixelSamples, ms: &mut StageMs) {
        let Self {
            finder,
            list,
            drawer,
            depth,
            crossings,
            shadows,
            ..
        } = self;
        let worth = worth_of(self.choices, pixels);
        let judged_anew = std::mem::replace(&mut self.worth, worth) != worth;
        let vertices = self.vertices;
        let (of_meshes, tallies) = (&mut self.of_meshes, &mut self.tallies);
        let (known, effort) = (&mut self.known, &mut self.effort);
        effort.frames += 1;
        ms.time(Stage::FindEdges, || {
            let anew = finder.find(view, list);
            if anew {
                *of_meshes = list.len();
                effort.searches += 1;
            }
            let Some(shadows) = shadows else { return };
            if anew || judged_anew || *known != shadows.generation() {
                list.truncate(*of_meshes);
                append(shadows, lights, view, worth, vertices, tallies, list);
                effort.judgements += 1;
                *known = shadows.generation();
                list.appended += 1;
            }
        });
        if self.culling == Culling::Points {
            ms.time(Stage::Depth, || copy_depth(pixels, depth));
        }
        let drawn = [list.generation, list.appended];
        let rests = std::mem::replace(&mut self.drawn, drawn) == drawn;
        let hiding = match (self.culling, &self.world) {
            (Culling::Rays, Some(world)) => Hiding::Rays(world, RaySettings::default()),
            (Culling::Points, _) => Hiding::Points(depth, DepthOffset::default()),
            (Culling::None | Culling::Rays, _) => Hiding::None,
        };
        let (half, edges) = (self.half, (&*list, self.of_meshes));
        self.changed |= ms.time(Stage::Rasterize, || {
            let changed = drawer.draw_within(view, edges, hiding, half, MOST_RAYS, crossings);
            match hiding {
                Hiding::Rays(world, _) if rests && !changed => drawer.look_closer(
                    (view, list, world),
                    RaySettings::AT_REST,
                    MOST_RAYS_AT_REST,
                    crossings,
                ),
                _ => changed,
            }
        });
    }

    /// Whether the edges have been looked at as closely as they ever are while nothing moves.
    pub fn is_settled(&self) -> bool {
        self.culling != Culling::Rays || self.drawer.is_done()
    }

    /// Turns crossings into edge codes, if they changed.
    pub fn classify(&mut self, level: Level, epi: &mut Epi) {
        if std::mem::take(&mut self.changed) {
            classify(level, &self.crossings, epi);
            if self.culling == Culling::Rays {
                mark_bends(self.drawer.visible(), epi);
            }
        }
    }

    /// Crossings of the frame.
    pub fn crossings(&self) -> &Crossings {
        &self.crossings
    }

    /// Edges of meshes found in the frame, before culling, and shadow edges.
    pub fn found(&self) -> [usize; 2] {
        [self.of_meshes, self.tally().drawn]
    }

    /// What became of the shadow edges.
    pub fn tally(&self) -> Tally {
        self.tallies.iter().copied().sum()
    }

    /// What became of the shadow edges of each light, by its index in the scene.
    pub fn tallies(&self) -> &[Tally] {
        &self.tallies
    }

    /// What shadow edges had to be worth in the last frame.
    pub fn worth(&self) -> Worth {
        self.worth
    }

    /// How edges are made.
    pub fn choices(&self) -> Choices {
        self.choices
    }

    /// Shadow edges and intersection creases, unless the display was made without edges.
    pub fn shadows(&self) -> Option<&Shadows> {
        self.shadows.as_ref()
    }

    /// What has been done so far.
    pub fn effort(&self) -> Effort {
        self.effort
    }

    /// The frame's edges, before culling.
    pub fn list(&self) -> &EdgeList {
        &self.list
    }

    /// Which of them can be seen, where rays decided about it.
    pub fn visible(&self) -> &VisibleEdges {
        self.drawer.visible()
    }

    /// The scene for rays, where the choices need it.
    pub fn world(&self) -> Option<&World> {
        self.world.as_ref()
    }
}

impl Display {
    /// The edges of the last frame.
    pub fn edge_stage(&self) -> &EdgeStage {
        &self.edges
    }
}

/// Rays that a frame may cast to tell hidden shadow edges from others: several milliseconds' worth.
const MOST_RAYS: usize = 8192;

/// Those that it may cast to look closer at edges that rest.
const MOST_RAYS_AT_REST: usize = 4096;

/// Samples that are sparser than this count as no sparser, pixels: they resolve nothing.
pub const SPARSEST_PX: f32 = 8.0;

/// A barrier pays where the penumbra is narrower than what the samples that there are can resolve.
fn worth_of(choices: Choices, pixels: &PixelSamples) -> Worth {
    match choices.shadow_edges {
        ShadowEdges::Off | ShadowEdges::All => Worth::ALL,
        ShadowEdges::Chosen => Worth {
            width_px: choices.shadow_width * sample_spacing(pixels).min(SPARSEST_PX),
            steps: choices.shadow_steps,
        },
    }
}

/// Mean distance between the samples that pixels have, pixels, rounded to powers of the root of 2, so that edges are
/// judged anew a few times only while samples gather.
fn sample_spacing(pixels: &PixelSamples) -> f32 {
    let all = (pixels.grid.width * pixels.grid.height) as f32;
    let share = pixels.visible().max(1) as f32 / all;
    (-0.5 * share.log2().round()).exp2()
}

fn lines_of(choices: Choices) -> Option<Lines> {
    match choices.shadow_edges {
        ShadowEdges::Off => None,
        ShadowEdges::All => Some(Lines::Boundaries),
        ShadowEdges::Chosen => Some(Lines::Middle),
    }
}

/// Depths of the points that pixels show, in the form that edges are culled with.
fn copy_depth(pixels: &PixelSamples, depth: &mut DepthBuffer) {
    let grid = pixels.grid;
    (depth.width, depth.height) = (grid.width, grid.height);
    depth.depth.clear();
    for y in 0..grid.height {
        depth
            .depth
            .extend_from_slice(&pixels.depth[grid.at(0, y)..grid.at(grid.width, y)]);
    }
}

/// How much nearer than a point something must be to hide it, as a share of the distance.
const HIDES: f32 = 1e-3;

/// Points at infinity are at least this deep, metres; nothing else is.
const INFINITELY_FAR: f32 = FAR_DEPTH * 1e-6;

/// How deep the surface is that hides a point from the eye, metres; nothing if none does. The pixel knows where the point is:
/// looking it up in the cache would cost more than half of the ray.
pub(super) fn front(world: &World, view: &View, point: &Suspect) -> Option<f32> {
    let [x, y] = point.image_px;
    let ray = Ray {
        origin: view.eye,
        direction: view.direction(x, y),
    };
    let limit = if point.depth < INFINITELY_FAR {
        point.depth * (1.0 - HIDES)
    } else {
        f32::INFINITY
    };
    // The direction is one deep.
    world.closest(&ray, limit).map(|hit| hit.t)
}
