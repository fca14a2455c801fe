//! Precision and recall of drawn shadow edges of a point light against dense ray casting.

use glam::Vec3;
use protocol::scene::Scene;
use rays::{Ray, World};

use crate::camera::View;
use crate::edges::crossings::Crossings;
use crate::edges::truth::{Score, Seen, Step, Truth, between, see, smooth_parts};

/// How near to a receiver something may lie, as a share of its distance from the light, without being looked for: the
/// receiver's own neighbours meet it there.
const CONTACT: f32 = 1e-5;

/// What lies between two neighbouring points of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flip {
    /// One surface, lit at both.
    Lit,
    /// One surface that faces the light, in shadow at both.
    Dark,
    /// One surface, seen from the side that is turned away from the light at both.
    Away,
    /// One surface that faces the light, lit at one and in shadow at the other.
    Shadow,
    /// One surface, turned away from the light at one: its brightness ends there of itself, and a shadow's edge is neither
    /// missed nor wrong.
    Terminator,
    /// Two surfaces, or none: a shadow's edge is neither missed nor wrong here.
    Apart,
}

/// Where the light of one point light begins and ends along the pixel boundaries of a picture; every `stride`-th line
/// only.
#[derive(Clone, Debug)]
pub struct ShadowTruth {
    width: usize,
    stride: usize,
    /// Eighths of a pixel along every line, first horizontal lines.
    rows: Vec<Vec<Flip>>,
    columns: Vec<Vec<Flip>>,
}

/// How the light falls on a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Light {
    /// It reaches the side that is seen.
    Reaches,
    /// Something is in the way.
    Hidden,
    /// It lies behind the side that is seen.
    Behind,
}

/// A point that is seen, and how the light falls on it.
#[derive(Clone, Copy)]
struct Lit {
    seen: Seen,
    light: Light,
}

/// An eighth of a pixel boundary that was drawn wrongly, or rightly where something is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Its middle, pixels.
    pub image_px: [f32; 2],
    /// What is there.
    pub flip: Flip,
    /// Something is drawn there; otherwise the flip lies more than the reach from everything drawn.
    pub drawn: bool,
    /// What is drawn is a flip, or what is a flip is drawn.
    pub right: bool,
}

impl ShadowTruth {
    /// Looks at every `stride`-th line of the view's picture, eight times a pixel. `light` is in world space, metres;
    /// `world` is the scene as [`world_of`](crate::edges::world::world_of) gives it.
    pub fn new(scene: &Scene, world: &World, view: &View, light: Vec3, stride: usize) -> Self {
        let (width, height) = (view.width as usize, view.height as usize);
        let parts: Vec<Vec<u32>> = scene.meshes.iter().map(smooth_parts).collect();
        let at = |x: f32, y: f32| {
            let seen = see(scene, world, view, &parts, x, y)?;
            let light = falls_on(world, view, light, &seen);
            Some(Lit { seen, light })
        };
        let line = |count: usize, at: &dyn Fn(f32) -> Option<Lit>| -> Vec<Flip> {
            let points: Vec<_> = (0..=8 * count).map(|k| at(k as f32 / 8.0)).collect();
            points.windows(2).map(|p| flip(p[0], p[1])).collect()
        };
        let lines = |size: usize| (stride..size).step_by(stride.max(1));
        Self {
            width,
            stride,
            rows: lines(height)
                .map(|y| line(width, &|x| at(x, y as f32)))
                .collect(),
            columns: lines(width)
                .map(|x| line(height, &|y| at(x as f32, y)))
                .collect(),
        }
    }

    /// What lies along horizontal boundary `y`, a multiple of the stride: eighths of pixels, left to right.
    pub fn row(&self, y: usize) -> &[Flip] {
        line_of(&self.rows, y, self.stride)
    }

    /// What lies along vertical boundary `x`, a multiple of the stride: eighths of pixels, downwards.
    pub fn column(&self, x: usize) -> &[Flip] {
        line_of(&self.columns, x, self.stride)
    }

    /// Scores crossings of this light's shadow edges alone. They and flips match if they are at most `reach` eighths apart.
    pub fn score_within(&self, crossings: &Crossings, reach: usize) -> Score {
        let mut score = Score::default();
        self.places(crossings, reach, |place| {
            if place.flip == Flip::Shadow {
                score.steps += 1;
                let drawn = place.drawn || place.right;
                score.steps_drawn += usize::from(drawn);
            }
            if place.drawn {
                score.drawn += 1;
                score.drawn_true += usize::from(place.right);
            }
        });
        score
    }

    /// Visits everything that [`ShadowTruth::score_within`] counts.
    pub fn places(&self, crossings: &Crossings, reach: usize, mut visit: impl FnMut(Place)) {
        for (y, flips, drawn) in rows(&self.rows, self.stride, self.width, crossings) {
            let at = |k: usize| [(k as f32 + 0.5) / 8.0, y as f32];
            places(flips, reach, &drawn, at, &mut visit);
        }
        for (x, flips, drawn) in columns(&self.columns, self.stride, self.width, crossings) {
            let at = |k: usize| [x as f32, (k as f32 + 0.5) / 8.0];
            places(flips, reach, &drawn, at, &mut visit);
        }
    }
}

/// Scores crossings of edges of all kinds against steps in depth and the shadows of all lights. All truths are of one view
/// and stride. Crossings and what they stand for match if they are at most `reach` eighths apart.
pub fn score_together(
    depth: &Truth,
    shadows: &[ShadowTruth],
    crossings: &Crossings,
    reach: usize,
) -> Score {
    let mut score = Score::default();
    let (width, stride) = (depth.width, depth.stride);
    for (i, (_, steps, drawn)) in rows(&depth.rows, stride, width, crossings).enumerate() {
        let of_lights = shadows.iter().filter_map(|s| s.rows.get(i));
        let both = merged(steps, of_lights.map(Vec::as_slice));
        score.add(&both, reach, drawn);
    }
    for (i, (_, steps, drawn)) in columns(&depth.columns, stride, width, crossings).enumerate() {
        let of_lights = shadows.iter().filter_map(|s| s.columns.get(i));
        let both = merged(steps, of_lights.map(Vec::as_slice));
        score.add(&both, reach, drawn);
    }
    score
}

/// Shadow edges are to be found as steps are; a terminator may be drawn.
fn merged<'a>(steps: &[Step], of_lights: impl Iterator<Item = &'a [Flip]>) -> Vec<Step> {
    let mut both = steps.to_vec();
    for flips in of_lights {
        for (step, flip) in both.iter_mut().zip(flips) {
            match (*step, flip) {
                (_, Flip::Shadow) => *step = Step::Depth,
                (Step::Nothing, Flip::Terminator) => *step = Step::Meeting,
                _ => {}
            }
        }
    }
    both
}

/// Horizontal lines with their place and what is drawn on them.
fn rows<'a, T>(
    lines: &'a [Vec<T>],
    stride: usize,
    width: usize,
    crossings: &'a Crossings,
) -> impl Iterator<Item = (usize, &'a [T], impl Fn(usize) -> bool + 'a)> {
    lines.iter().enumerate().map(move |(i, line)| {
        let y = (i + 1) * stride;
        let drawn = move |k: usize| crossings.horizontal[y * width + k / 8] >> (k % 8) & 1 == 1;
        (y, line.as_slice(), drawn)
    })
}

/// Vertical lines with their place and what is drawn on them.
fn columns<'a, T>(
    lines: &'a [Vec<T>],
    stride: usize,
    width: usize,
    crossings: &'a Crossings,
) -> impl Iterator<Item = (usize, &'a [T], impl Fn(usize) -> bool + 'a)> {
    lines.iter().enumerate().map(move |(i, line)| {
        let x = (i + 1) * stride;
        let drawn = move |k: usize| crossings.vertical[k / 8 * (width + 1) + x] >> (k % 8) & 1 == 1;
        (x, line.as_slice(), drawn)
    })
}

fn line_of(lines: &[Vec<Flip>], at: usize, stride: usize) -> &[Flip] {
    let index = (at / stride.max(1)).checked_sub(1);
    index
        .and_then(|i| lines.get(i))
        .map(Vec::as_slice)
        .unwrap_or_default()
}

fn places(
    flips: &[Flip],
    reach: usize,
    drawn: impl Fn(usize) -> bool,
    at: impl Fn(usize) -> [f32; 2],
    visit: &mut impl FnMut(Place),
) {
    let near = |k: usize| k.saturating_sub(reach)..(k + reach + 1).min(flips.len());
    let doubtful = |j: usize| matches!(flips[j], Flip::Apart | Flip::Terminator);
    for k in 0..flips.len() {
        let is_shadow = flips[k] == Flip::Shadow;
        let here = drawn(k);
        let right = if here {
            near(k).any(|j| flips[j] == Flip::Shadow)
        } else {
            is_shadow && near(k).any(&drawn)
        };
        let counts = is_shadow || (here && (right || !near(k).any(doubtful)));
        if counts {
            visit(Place {
                image_px: at(k),
                flip: flips[k],
                drawn: here,
                right,
            });
        }
    }
}

/// Whether the light lies on the side of the surface that is seen, with nothing between.
fn falls_on(world: &World, view: &View, light: Vec3, seen: &Seen) -> Light {
    let place = view.eye + seen.direction * seen.hit.t;
    let towards = |p: Vec3| seen.normal.dot(p - place);
    if towards(light) * towards(view.eye) <= 0.0 {
        return Light::Behind;
    }
    let ray = Ray {
        origin: light,
        direction: place - light,
    };
    let own = (seen.hit.instance, seen.hit.face);
    let occluder = world.occluder_where(&ray, 1.0 - CONTACT, |instance, face| {
        (instance, face) != own
    });
    match occluder {
        Some(_) => Light::Hidden,
        None => Light::Reaches,
    }
}

fn flip(a: Option<Lit>, b: Option<Lit>) -> Flip {
    let (Some(a), Some(b)) = (a, b) else {
        return Flip::Apart;
    };
    if between(Some(a.seen), Some(b.seen), SAME_SURFACE) != Step::Nothing {
        return Flip::Apart;
    }
    match (a.light, b.light) {
        (Light::Reaches, Light::Reaches) => Flip::Lit,
        (Light::Hidden, Light::Hidden) => Flip::Dark,
        (Light::Behind, Light::Behind | Light::Hidden) | (Light::Hidden, Light::Behind) => {
            Flip::Away
        }
        (Light::Behind, Light::Reaches) | (Light::Reaches, Light::Behind) => Flip::Terminator,
        (Light::Reaches, Light::Hidden) | (Light::Hidden, Light::Reaches) => Flip::Shadow,
    }
}

/// Steps in depth from this share of the depth on divide surfaces.
const SAME_SURFACE: f32 = 1e-3;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edges::clip::Projector;
    use crate::edges::world::world_of;
    use glam::DVec3;
    use protocol::messages::Camera;
    use protocol::scene::{Material, Mesh, Model, Object, Shading};

    const LIGHT: Vec3 = Vec3::new(0.7, 5.0, -0.9);
    const LOW: Vec3 = Vec3::new(-0.5, 1.0, -0.4);
    const HIGH: Vec3 = Vec3::new(0.6, 1.5, 0.5);

    fn object(mesh: u32) -> Object {
        Object {
            name: mesh.to_string(),
            mesh,
            material: 0,
            transform: [[1., 0., 0., 0.], [0., 1., 0., 0.], [0., 0., 1., 0.]],
            crease_angle: 85.0,
        }
    }

    fn corner(i: usize) -> Vec3 {
        let pick = |k: usize| if i >> k & 1 == 0 { LOW[k] } else { HIGH[k] };
        Vec3::new(pick(0), pick(1), pick(2))
    }

    /// A box that floats over the plane y = 0.
    fn scene() -> Scene {
        let quads = [
            [0, 4, 6, 2],
            [1, 3, 7, 5],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 2, 3, 1],
            [4, 5, 7, 6],
        ];
        let solid = Mesh {
            positions: (0..8).map(|i| corner(i).into()).collect(),
            faces: quads
                .iter()
                .flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]])
                .collect(),
            ..Mesh::default()
        };
        let floor = Mesh {
            positions: [[-9., -9.], [9., -9.], [9., 9.], [-9., 9.]]
                .map(|[x, z]| [x, 0., z])
                .to_vec(),
            faces: vec![[0, 2, 1], [0, 3, 2]],
            ..Mesh::default()
        };
        Scene {
            shading: Shading {
                model: Model::Direct,
                ambient: [0.0; 3],
                background: [0.0; 3],
            },
            lights: Vec::new(),
            materials: vec![Material {
                name: String::new(),
                diffuse: [0.5; 3],
                diffuse_map: None,
                specular: [0.0; 3],
                roughness: 1.0,
            }],
            textures: Vec::new(),
            meshes: vec![floor, solid],
            objects: vec![object(0), object(1)],
        }
    }

    fn view() -> View {
        View::new(&Camera {
            eye: [2.5, 4.5, 5.0],
            target: [-0.2, 0.2, 0.3],
            up: [0.0, 1.0, 0.0],
            fov_y: 40.0,
            width: 96,
            height: 72,
        })
    }

    /// Whether the way from `from` to `to` goes through the box.
    fn blocked(from: DVec3, to: DVec3) -> bool {
        let (mut near, mut far) = (0.0_f64, 1.0_f64);
        for k in 0..3 {
            let (a, d) = (from[k], to[k] - from[k]);
            let ends = [LOW[k], HIGH[k]].map(|w| (f64::from(w) - a) / d);
            near = near.max(ends[0].min(ends[1]));
            far = far.min(ends[0].max(ends[1]));
        }
        near < far
    }

    /// By formula: nothing where the plane is not seen, else whether the light reaches it.
    fn plane_lit(view: &View, x: f32, y: f32) -> Option<bool> {
        let (eye, direction) = (view.eye.as_dvec3(), view.direction(x, y).as_dvec3());
        let place = eye - direction * (eye.y / direction.y);
        let inside = direction.y < 0.0 && place.abs().max_element() < 9.0;
        (inside && !blocked(eye, place)).then(|| !blocked(LIGHT.as_dvec3(), place))
    }

    #[test]
    fn flips_on_the_plane_are_where_the_formula_has_them() {
        let (scene, view) = (scene(), view());
        let truth = ShadowTruth::new(&scene, &world_of(&scene), &view, LIGHT, 3);
        let (mut flips, mut wrong) = (0, 0);
        let mut compare = |line: &[Flip], at: &dyn Fn(f32) -> (f32, f32)| {
            for (k, &found) in line.iter().enumerate() {
                let ends = [k, k + 1].map(|k| at(k as f32 / 8.0));
                let [a, b] = ends.map(|(x, y)| plane_lit(&view, x, y));
                let (Some(a), Some(b)) = (a, b) else { continue };
                let right = match (a, b) {
                    (true, true) => Flip::Lit,
                    (false, false) => Flip::Dark,
                    _ => Flip::Shadow,
                };
                flips += usize::from(a != b);
                wrong += usize::from(found != right);
            }
        };
        for y in (3..72).step_by(3) {
            compare(truth.row(y), &|x| (x, y as f32));
        }
        for x in (3..96).step_by(3) {
            compare(truth.column(x), &|y| (x as f32, y));
        }
        assert!(flips > 25, "{flips}");
        assert_eq!(wrong, 0, "of {flips} flips");
    }

    #[test]
    fn the_side_away_from_the_light_is_dark() {
        let (scene, view) = (scene(), view());
        let world = world_of(&scene);
        let parts: Vec<Vec<u32>> = scene.meshes.iter().map(smooth_parts).collect();
        let (x, y, _) = view.project(Vec3::new(0.05, 1.5, 0.05)).unwrap();
        let top = see(&scene, &world, &view, &parts, x, y).unwrap();
        assert_eq!(falls_on(&world, &view, LIGHT, &top), Light::Reaches);
        let (x, y, _) = view.project(Vec3::new(0.05, 1.25, 0.5)).unwrap();
        let front = see(&scene, &world, &view, &parts, x, y).unwrap();
        assert_eq!(front.hit.instance, 1);
        assert_eq!(falls_on(&world, &view, LIGHT, &front), Light::Behind);
    }

    /// The outline of the box's shadow on the plane, by the corners' projections from the light.
    fn outline() -> Vec<Vec3> {
        let shadows: Vec<Vec3> = (0..8)
            .map(|i| {
                let c = corner(i);
                LIGHT + (c - LIGHT) * (LIGHT.y / (LIGHT.y - c.y))
            })
            .collect();
        let turn = |a: Vec3, b: Vec3, c: Vec3| (b - a).cross(c - a).y;
        let start = shadows
            .iter()
            .copied()
            .min_by(|a, b| a.x.total_cmp(&b.x))
            .unwrap();
        let mut hull = vec![start];
        loop {
            let last = hull[hull.len() - 1];
            let others = shadows.iter().copied().filter(|s| *s != last);
            let next = others
                .reduce(|best, s| if turn(last, best, s) < 0.0 { s } else { best })
                .unwrap();
            if next == start {
                return hull;
            }
            hull.push(next);
        }
    }

    #[test]
    fn a_drawn_outline_scores_well_and_a_shifted_one_badly() {
        let (scene, view) = (scene(), view());
        let truth = ShadowTruth::new(&scene, &world_of(&scene), &view, LIGHT, 2);
        let score = |shift: Vec3| {
            let mut crossings = Crossings::new(96, 72);
            let hull = outline();
            for (i, a) in hull.iter().enumerate() {
                let b = hull[(i + 1) % hull.len()];
                let ends = [*a, b].map(|p| view.to_view(p + shift).into());
                let segment = Projector::new(&view).project(ends[0], ends[1]).unwrap();
                crossings.draw(&segment, false);
            }
            truth.score_within(&crossings, 1)
        };
        let right = score(Vec3::ZERO);
        assert!(right.steps > 40 && right.recall() == 1.0, "{right:?}");
        assert!(right.precision() == 1.0, "{right:?}");
        // Askew, so that no side of the outline is moved along itself.
        let shifted = score(Vec3::new(0.13, 0.0, 0.17));
        assert!(
            shifted.recall() < 0.3 && shifted.precision() < 0.3,
            "{shifted:?}"
        );
    }
}
