//! Precision and recall of drawn edges against dense ray casting.

use glam::Vec3;
use protocol::scene::Scene;
use rays::{Hit, Ray, World};

use super::adjacency::Adjacency;
use super::crossings::Crossings;
use crate::camera::View;

/// What a point of a picture shows.
#[derive(Clone, Copy)]
pub(crate) struct Seen {
    pub(crate) hit: Hit,
    /// Direction with depth 1, so that the hit's distance is its depth.
    pub(crate) direction: Vec3,
    pub(crate) normal: Vec3,
    part: u32,
}

/// What lies between two neighbouring points.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Step {
    Nothing,
    /// Surfaces that meet without a step in depth, and are no neighbours in a mesh or meet at a sharp angle.
    Meeting,
    /// A step in depth.
    Depth,
}

/// Counts of eighths of pixel boundaries.
#[derive(Clone, Copy, Debug, Default)]
pub struct Score {
    /// Steps in depth.
    pub steps: usize,
    /// Those of them with a crossing within an eighth.
    pub steps_drawn: usize,
    /// Crossings drawn.
    pub drawn: usize,
    /// Those of them with a step or a meeting within an eighth.
    pub drawn_true: usize,
}

impl Score {
    /// Share of the steps in depth that are drawn.
    pub fn recall(&self) -> f64 {
        self.steps_drawn as f64 / self.steps.max(1) as f64
    }

    /// Share of the drawn crossings that separate something.
    pub fn precision(&self) -> f64 {
        self.drawn_true as f64 / self.drawn.max(1) as f64
    }
}

/// What the pixel boundaries of a picture really separate; every `stride`-th line only.
pub struct Truth {
    pub(crate) width: usize,
    pub(crate) stride: usize,
    /// Eighths along every line, first horizontal lines.
    pub(crate) rows: Vec<Vec<Step>>,
    pub(crate) columns: Vec<Vec<Step>>,
}

impl Truth {
    /// Looks at every `stride`-th line of the view's picture, eight times a pixel. `world` is the scene as
    /// [`world_of`](super::world::world_of) gives it; steps in depth count from the share `step` of the depth on.
    pub fn new(scene: &Scene, world: &World, view: &View, stride: usize, step: f32) -> Self {
        let (width, height) = (view.width as usize, view.height as usize);
        let parts: Vec<Vec<u32>> = scene.meshes.iter().map(smooth_parts).collect();
        let see = |x: f32, y: f32| see(scene, world, view, &parts, x, y);
        let line = |count: usize, at: &dyn Fn(f32) -> Option<Seen>| -> Vec<Step> {
            let seen: Vec<_> = (0..=8 * count).map(|k| at(k as f32 / 8.0)).collect();
            let ends = |k: usize| {
                [
                    (k as f32 / 8.0, seen[k]),
                    ((k + 1) as f32 / 8.0, seen[k + 1]),
                ]
            };
            (0..8 * count).map(|k| settled(at, ends(k), step)).collect()
        };
        let rows = (stride..height)
            .step_by(stride)
            .map(|y| line(width, &|x| see(x, y as f32)))
            .collect();
        let columns = (stride..width)
            .step_by(stride)
            .map(|x| line(height, &|y| see(x as f32, y)))
            .collect();
        Self {
            width,
            stride,
            rows,
            columns,
        }
    }

    /// Crossings and steps match if they are neighbours.
    pub fn score(&self, crossings: &Crossings) -> Score {
        self.score_within(crossings, 1)
    }

    /// Crossings and steps match if they are at most so many eighths apart.
    pub fn score_within(&self, crossings: &Crossings, reach: usize) -> Score {
        let mut score = Score::default();
        for (i, steps) in self.rows.iter().enumerate() {
            let y = (i + 1) * self.stride;
            score.add(steps, reach, |k| {
                crossings.horizontal[y * self.width + k / 8] >> (k % 8) & 1 == 1
            });
        }
        for (i, steps) in self.columns.iter().enumerate() {
            let x = (i + 1) * self.stride;
            score.add(steps, reach, |k| {
                crossings.vertical[k / 8 * (self.width + 1) + x] >> (k % 8) & 1 == 1
            });
        }
        score
    }
}

impl Score {
    /// Counts a line.
    pub(crate) fn add(&mut self, steps: &[Step], reach: usize, drawn: impl Fn(usize) -> bool) {
        let near = |k: usize| k.saturating_sub(reach)..(k + reach + 1).min(steps.len());
        for k in 0..steps.len() {
            if steps[k] == Step::Depth {
                self.steps += 1;
                self.steps_drawn += usize::from(near(k).any(&drawn));
            }
            if drawn(k) {
                self.drawn += 1;
                self.drawn_true += usize::from(near(k).any(|j| steps[j] != Step::Nothing));
            }
        }
    }
}

pub(crate) fn see(
    scene: &Scene,
    world: &World,
    view: &View,
    parts: &[Vec<u32>],
    x: f32,
    y: f32,
) -> Option<Seen> {
    let direction = view.direction(x, y);
    let hit = world.closest(
        &Ray {
            origin: view.eye,
            direction,
        },
        f32::INFINITY,
    )?;
    let Some(object) = scene.objects.get(hit.instance as usize) else {
        return Some(Seen {
            hit,
            direction,
            normal: Vec3::ZERO,
            part: u32::MAX,
        });
    };
    let mesh = &scene.meshes[object.mesh as usize];
    let [a, b, c] = mesh.faces[hit.face as usize].map(|v| {
        super::world::affine(&object.transform).transform_point3(mesh.positions[v as usize].into())
    });
    let normal = (b - a).cross(c - a).normalize();
    Some(Seen {
        hit,
        direction,
        normal,
        part: parts[object.mesh as usize][hit.face as usize],
    })
}

/// What lies between two points: a step in depth must stay one however near it they are taken, or it is a steep slope.
fn settled(at: &dyn Fn(f32) -> Option<Seen>, ends: [(f32, Option<Seen>); 2], step: f32) -> Step {
    let [mut a, mut b] = ends;
    let first = between(a.1, b.1, step);
    if first != Step::Depth {
        return first;
    }
    for _ in 0..7 {
        let x = 0.5 * (a.0 + b.0);
        let middle = (x, at(x));
        if between(a.1, middle.1, step) == Step::Depth {
            b = middle;
        } else if between(middle.1, b.1, step) == Step::Depth {
            a = middle;
        } else {
            return Step::Meeting;
        }
    }
    Step::Depth
}

pub(crate) fn between(a: Option<Seen>, b: Option<Seen>, step: f32) -> Step {
    let (a, b) = match (a, b) {
        (None, None) => return Step::Nothing,
        (Some(a), Some(b)) => (a, b),
        _ => return Step::Depth,
    };
    // How far the plane of the one is from the other, along the line of sight.
    let off = |a: &Seen, b: &Seen| {
        let at = a.normal.dot(a.direction * a.hit.t) / a.normal.dot(b.direction);
        (at - b.hit.t).abs() / b.hit.t
    };
    let same_object = a.hit.instance == b.hit.instance;
    let light = a.part == u32::MAX || b.part == u32::MAX;
    let continuous = if light {
        same_object
    } else {
        off(&a, &b).min(off(&b, &a)) <= step
    };
    if !continuous {
        return Step::Depth;
    }
    let bent = a.normal.dot(b.normal).abs() < 0.5;
    if same_object && a.part == b.part && !bent {
        Step::Nothing
    } else {
        Step::Meeting
    }
}

/// The number of the connected surface of every face.
pub(crate) fn smooth_parts(mesh: &protocol::scene::Mesh) -> Vec<u32> {
    let adjacency = Adjacency::new(mesh);
    let mut part: Vec<u32> = (0..mesh.faces.len() as u32).collect();
    fn root(part: &mut [u32], mut f: u32) -> u32 {
        while part[f as usize] != f {
            part[f as usize] = part[part[f as usize] as usize];
            f = part[f as usize];
        }
        f
    }
    for edge in 0..adjacency.edges.len() {
        let faces = adjacency.faces(edge);
        if let [a, b] = *faces {
            let (a, b) = (root(&mut part, a), root(&mut part, b));
            part[a as usize] = b;
        }
    }
    (0..mesh.faces.len() as u32)
        .map(|f| root(&mut part, f))
        .collect()
}
