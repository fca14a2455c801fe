//! The edge stages of a frame: found, hidden ones left out, drawn into crossings.

use std::sync::Arc;

use fearless_simd::Level;
use glam::{Affine3A, Mat3A, Vec3, Vec3A};
use protocol::scene::{Affine, Light, Scene};
use rays::{Ray, TriangleMesh, World};

use crate::camera::View;
use crate::config::{Choices, Culling, Method, PointCulling};
use crate::edges::crossings::Crossings;
use crate::edges::finder::EdgeFinder;
use crate::edges::list::EdgeList;
use crate::edges::raster::draw_all;
use crate::epi::Epi;
use crate::epi::classify::classify;
use crate::epi::grid::Grid;
use crate::points::{PixelSamples, PointCache};
use crate::stats::{Stage, StageMs};

/// Everything about edges that lasts from frame to frame.
pub struct EdgeStage {
    finder: EdgeFinder,
    list: EdgeList,
    world: Option<World>,
    culling: Culling,
    half: bool,
    crossings: Crossings,
    changed: bool,
}

impl EdgeStage {
    /// Ready to find the edges of this scene.
    pub fn new(scene: &Scene, choices: Choices, grid: Grid) -> Self {
        let rays = (choices.edges() && choices.culling == Culling::Rays)
            || choices.point_culling == PointCulling::Rays;
        Self {
            finder: EdgeFinder::new(scene),
            list: EdgeList::default(),
            world: rays.then(|| world_of(scene)),
            culling: choices.culling,
            half: choices.method == Method::EdgeAndPoint,
            crossings: Crossings::new(grid.width, grid.height),
            changed: true,
        }
    }

    /// Finds the view's edges and draws those that can be seen. Does nothing while nothing moves.
    pub fn find(&mut self, view: &View, _moved: bool, _pixels: &PixelSamples, ms: &mut StageMs) {
        let Self {
            finder,
            list,
            crossings,
            ..
        } = self;
        let new = ms.time(Stage::FindEdges, || finder.find(view, list));
        if !new {
            return;
        }
        ms.time(Stage::Rasterize, || {
            crossings.clear();
            let projector = crate::edges::clip::Projector::new(view);
            for i in 0..list.len() {
                let (a, b) = (Vec3::from(list.from[i]), Vec3::from(list.to[i]));
                if let Some(w) = &self.world {
                    let m = (a + b) * 0.5;
                    let d = view.right * m.x + view.up * m.y + view.forward * m.z;
                    let f = list.faces[i];
                    let o = list.object[i];
                    if w.occluder_where(
                        &Ray {
                            origin: view.eye,
                            direction: d,
                        },
                        1.0 - 1e-4,
                        |inst, face| !(inst == o && f.contains(&face)),
                    )
                    .is_some()
                    {
                        continue;
                    }
                }
                if let Some(segment) = projector.project(list.from[i], list.to[i]) {
                    crossings.draw(&segment, self.half);
                }
            }
        });
        self.changed = true;
    }

    /// Turns crossings into edge codes, if they changed.
    pub fn classify(&mut self, level: Level, epi: &mut Epi) {
        if std::mem::take(&mut self.changed) {
            classify(level, &self.crossings, epi);
        }
    }

    /// Crossings of the frame.
    pub fn crossings(&self) -> &Crossings {
        &self.crossings
    }

    /// Edges found in the frame, before culling.
    pub fn found(&self) -> usize {
        self.list.len()
    }

    /// The scene for rays, where the choices need it.
    pub fn world(&self) -> Option<&World> {
        self.world.as_ref()
    }
}

/// The scene's objects, then its area lights, for rays of the display's own: they only ask what is visible.
fn world_of(scene: &Scene) -> World {
    let meshes: Vec<Arc<TriangleMesh>> = scene
        .meshes
        .iter()
        .map(|mesh| {
            let positions: Vec<Vec3> = mesh.positions.iter().map(|&p| p.into()).collect();
            Arc::new(TriangleMesh::build(&positions, &mesh.faces))
        })
        .collect();
    let objects = scene.objects.iter().filter_map(|o| {
        Some((
            Arc::clone(meshes.get(o.mesh as usize)?),
            affine(&o.transform),
        ))
    });
    let lights = scene.lights.iter().filter_map(|light| match light {
        Light::Area { vertices, .. } => {
            let corners: Vec<Vec3> = vertices.iter().map(|&v| v.into()).collect();
            let fan: Vec<[u32; 3]> = (2..corners.len() as u32).map(|i| [0, i - 1, i]).collect();
            Some((
                Arc::new(TriangleMesh::build(&corners, &fan)),
                Affine3A::IDENTITY,
            ))
        }
        Light::Point { .. } | Light::Linear { .. } => None,
    });
    World::new(objects.chain(lights).collect())
}

/// Rows of a scene's transform as a matrix.
fn affine(rows: &Affine) -> Affine3A {
    let column = |k: usize| Vec3A::new(rows[0][k], rows[1][k], rows[2][k]);
    Affine3A {
        matrix3: Mat3A::from_cols(column(0), column(1), column(2)),
        translation: column(3),
    }
}

/// How much nearer than a point something must be to hide it, as a share of the distance.
const HIDES: f32 = 1e-3;

/// Whether nothing hides a cached point from the eye.
pub(super) fn sees(world: &World, view: &View, cache: &PointCache, point: u32) -> bool {
    let w = cache.w[point as usize];
    let direction = cache.point(point) - view.eye * w;
    let limit = if w > 0.0 { 1.0 - HIDES } else { f32::INFINITY };
    world
        .occluder(
            &Ray {
                origin: view.eye,
                direction,
            },
            limit,
        )
        .is_none()
}
