//! Drawn shadow edges of point lights against those that dense ray casting finds.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use glam::Vec3;
use image::{Rgb, RgbImage};
use protocol::messages::{SampleRequest, Triple};
use protocol::scene::{Light, Scene};
use renderer::camera::View;
use renderer::config::{Choices, ShadowEdges};
use renderer::edges::crossings::Crossings;
use renderer::edges::finder::EdgeFinder;
use renderer::edges::tree::EdgeKind;
use renderer::edges::truth::{Score, Truth};
use renderer::edges::visible::VisibleEdges;
use renderer::edges::world::world_of;
use renderer::epi::grid::Grid;
use renderer::frame::EdgeStage;
use renderer::points::PixelSamples;
use renderer::shadows::store::Shadows;
use renderer::shadows::truth::{Flip, Place, ShadowTruth, score_together};
use renderer::shadows::worker::Lines;
use renderer::stats::StageMs;
use shader_server::camera::Pinhole;
use shader_server::shadows::ShadowRays;
use shader_server::{Shader, Stage, StageError};

/// Eighths of a pixel that a crossing may lie from what it stands for.
const REACH: usize = 1;
/// Side of the squares that places are gathered in, pixels.
const TILE_PX: usize = 32;
/// Squares that are named.
const WORST: usize = 6;

/// What was counted.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Shadow edges of each light by themselves, with the light's index.
    pub shadows: Vec<(usize, Score)>,
    /// Edges of every kind together.
    pub together: Score,
    /// Time to compute the shadow edges of all pairs anew, ms: each pair cut by all blockers of its light, and by its own
    /// receivers alone.
    pub ms: [f64; 2],
    /// What the false crossings of shadow edges lie on.
    pub causes: Causes,
    /// Squares with the most wrong places: their corner in the picture, pixels; missed; false.
    pub worst: Vec<([usize; 2], usize, usize)>,
}

/// Crossings of shadow edges where there is no shadow's edge, by what is there.
#[derive(Clone, Copy, Debug, Default)]
pub struct Causes {
    /// In the light on both sides.
    pub lit: usize,
    /// In shadow on both sides.
    pub dark: usize,
    /// Turned away from the light.
    pub away: usize,
}

/// What is measured.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// With point lights; others have no edges to be right about.
    pub scene: &'a Scene,
    /// From where.
    pub view: &'a View,
    /// Rays are cast along every so many lines of pixel boundaries.
    pub stride: usize,
    /// Share of the depth from which on steps count.
    pub step: f32,
}

/// Puts a point of the same power per direction at the middle of each light that is not one.
#[must_use]
pub fn with_points(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    for light in &mut scene.lights {
        let points: Vec<Vec3> = match light {
            Light::Point { .. } => continue,
            Light::Linear { from, to, .. } => vec![Vec3::from(*from), Vec3::from(*to)],
            Light::Area { vertices, .. } => vertices.iter().map(|v| Vec3::from(*v)).collect(),
        };
        let middle = points.iter().sum::<Vec3>() / points.len().max(1) as f32;
        *light = Light::Point {
            position: middle.into(),
            intensity: [1.0; 3],
        };
    }
    scene
}

/// Measures the shadow edges of a scene with every pixel of the picture shaded once, and draws a map, if one is wanted:
/// green where edges are right, red where they are missed, yellow where they are false.
///
/// # Errors
/// If the scene cannot be shaded.
pub fn measure(subject: Subject<'_>, map: Option<&mut RgbImage>) -> Result<Report, StageError> {
    let Subject {
        scene,
        view,
        stride,
        step,
    } = subject;
    let triples = triples_of(scene, view)?;
    let world = world_of(scene);
    let mut report = Report::default();
    let mut tiles = Tiles::new(view);
    let mut truths = Vec::new();
    let mut map = map;
    for (index, light) in scene.lights.iter().enumerate() {
        let Light::Point { position, .. } = light else {
            continue;
        };
        let truth = ShadowTruth::new(scene, &world, view, Vec3::from(*position), stride);
        let own = triples.iter().filter(|t| t.light as usize == index);
        let drawn = draw(scene, view, &own.copied().collect::<Vec<_>>());
        truth.places(&drawn.shadows, REACH, |place| {
            report.causes.count(place);
            tiles.count(place);
            if let Some(map) = &mut map {
                paint(map, place);
            }
        });
        let score = truth.score_within(&drawn.shadows, REACH);
        report.shadows.push((index, score));
        truths.push(truth);
    }
    let depth = Truth::new(scene, &world, view, stride, step);
    let drawn = draw(scene, view, &triples);
    report.together = score_together(&depth, &truths, &drawn.all, REACH);
    report.worst = tiles.worst();
    report.ms = time(scene, &triples);
    Ok(report)
}

/// See [`Report::ms`].
fn time(scene: &Scene, triples: &[Triple]) -> [f64; 2] {
    let finder = EdgeFinder::new(scene);
    let anew = |triples: &[Triple]| {
        let mut shadows = Shadows::new(scene, &finder, Some(Lines::Boundaries));
        shadows.learn(triples);
        shadows.update(true);
        // Trees have been built; the answer to a question that is asked again is what costs.
        shadows.set_lines(None);
        shadows.set_lines(Some(Lines::Boundaries));
        let start = Instant::now();
        shadows.update(true);
        start.elapsed().as_secs_f64() * 1e3
    };
    let mut pairs: BTreeMap<(u32, u32), Vec<Triple>> = BTreeMap::new();
    for triple in triples {
        let pair = pairs.entry((triple.light, triple.blocker)).or_default();
        pair.push(*triple);
    }
    [anew(triples), pairs.values().map(|own| anew(own)).sum()]
}

/// What a display draws of a resting view.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// Edges of all kinds.
    pub all: Crossings,
    /// Shadow edges alone.
    pub shadows: Crossings,
}

/// What a display draws that knows these triples.
#[must_use]
pub fn draw(scene: &Scene, view: &View, triples: &[Triple]) -> Drawn {
    let choices = Choices {
        shadow_edges: ShadowEdges::All,
        ..Choices::default()
    };
    let grid = Grid::new(view.width as usize, view.height as usize);
    let mut stage = EdgeStage::new(scene, choices, grid);
    stage.learn(triples);
    stage.update_shadows(true);
    let pixels = PixelSamples::new(grid);
    let mut ms = StageMs::default();
    stage.find(view, &scene.lights, &pixels, &mut ms);
    while !stage.is_settled() {
        stage.find(view, &scene.lights, &pixels, &mut ms);
    }
    let (list, visible) = (stage.list(), stage.visible());
    let mut parts = VisibleEdges::default();
    for ((edge, segment), range) in visible
        .edge
        .iter()
        .zip(&visible.segment)
        .zip(&visible.range)
    {
        if matches!(list.kind[*edge as usize], EdgeKind::Shadow(_)) {
            parts.push(*edge, *segment, *range);
        }
    }
    let mut shadows = Crossings::new(grid.width, grid.height);
    parts.draw(false, &mut shadows);
    Drawn {
        all: stage.crossings().clone(),
        shadows,
    }
}

/// What one sample in the middle of every pixel meets.
///
/// # Errors
/// If the scene cannot be shaded.
pub fn triples_of(scene: &Scene, view: &View) -> Result<Vec<Triple>, StageError> {
    let stage = Stage::build(Arc::new(scene.clone()))?;
    let rays = ShadowRays::default();
    let mut shader = Shader::new(&stage, &rays, 1);
    let pinhole = Pinhole::new(&view.camera());
    for y in 0..view.height {
        for x in 0..view.width {
            let id = u64::from(y) << 16 | u64::from(x);
            let request = SampleRequest {
                id,
                x: x as u16,
                y: y as u16,
                offset: [0.5, 0.5],
            };
            shader.shade(id, &pinhole.ray(&request));
        }
    }
    Ok(shader.take_triples())
}

impl Causes {
    fn count(&mut self, place: Place) {
        if place.right || !place.drawn {
            return;
        }
        match place.flip {
            Flip::Lit => self.lit += 1,
            Flip::Dark => self.dark += 1,
            Flip::Away => self.away += 1,
            Flip::Shadow | Flip::Terminator | Flip::Apart => {}
        }
    }
}

/// Wrong places by squares of the picture.
struct Tiles {
    across: usize,
    missed_and_false: Vec<[usize; 2]>,
}

impl Tiles {
    fn new(view: &View) -> Self {
        let [across, down] = [view.width, view.height].map(|n| (n as usize).div_ceil(TILE_PX) + 1);
        Self {
            across,
            missed_and_false: vec![[0; 2]; across * down],
        }
    }

    fn count(&mut self, place: Place) {
        if !place.right {
            let [x, y] = place.image_px.map(|c| c as usize / TILE_PX);
            self.missed_and_false[y * self.across + x][usize::from(place.drawn)] += 1;
        }
    }

    fn worst(&self) -> Vec<([usize; 2], usize, usize)> {
        let mut all: Vec<_> = self
            .missed_and_false
            .iter()
            .enumerate()
            .filter(|(_, [missed, wrong])| missed + wrong > 0)
            .map(|(i, [missed, wrong])| {
                let corner = [i % self.across, i / self.across].map(|c| c * TILE_PX);
                (corner, *missed, *wrong)
            })
            .collect();
        all.sort_by_key(|(_, missed, wrong)| std::cmp::Reverse(missed + wrong));
        all.truncate(WORST);
        all
    }
}

/// Marks a place; what is wrong stays on top.
fn paint(map: &mut RgbImage, place: Place) {
    let [x, y] = place.image_px.map(|c| c as u32);
    let Some(pixel) = map.get_pixel_mut_checked(x, y) else {
        return;
    };
    let wrong = [Rgb([255, 0, 0]), Rgb([255, 230, 0])];
    *pixel = match (place.right, place.drawn) {
        (false, drawn) => wrong[usize::from(drawn)],
        (true, _) if wrong.contains(pixel) => *pixel,
        (true, _) => Rgb([0, 160, 0]),
    };
}

/// Why a map was not written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write the map {path}: {source}")]
pub struct MapError {
    /// Where to.
    pub path: String,
    /// Why not.
    pub source: image::ImageError,
}

/// Writes a map.
///
/// # Errors
/// If the file cannot be written.
pub fn write_map(map: &RgbImage, path: &Path) -> Result<(), MapError> {
    map.save(path).map_err(|source| MapError {
        path: path.display().to_string(),
        source,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::messages::Camera;

    #[test]
    fn shadow_edges_are_told_from_what_is_missing() {
        let loaded = scenes::open("chains").unwrap();
        let scene = with_points(&loaded.scene);
        let view = View::new(&Camera {
            eye: loaded.camera.eye,
            target: loaded.camera.target,
            up: loaded.camera.up,
            fov_y: loaded.camera.fov_y,
            width: 192,
            height: 192,
        });
        let subject = Subject {
            scene: &scene,
            view: &view,
            stride: 8,
            step: 2e-3,
        };
        let mut map = RgbImage::new(192, 192);
        let report = measure(subject, Some(&mut map)).unwrap();
        let recall = report.together.recall();
        assert!(recall > 0.95, "{report:?}");
        assert_eq!(report.shadows.len(), 2);
        assert!(map.pixels().any(|p| *p == Rgb([0, 160, 0])));
        let nothing = Crossings::new(192, 192);
        let (_, light) = report.shadows[1];
        let Light::Point { position, .. } = scene.lights[1] else {
            panic!("a point light")
        };
        let world = world_of(&scene);
        let truth = ShadowTruth::new(&scene, &world, &view, position.into(), 8);
        let missed = truth.score_within(&nothing, REACH);
        assert_eq!(missed.steps, light.steps);
        assert_eq!([missed.steps_drawn, missed.drawn], [0, 0]);
    }
}
