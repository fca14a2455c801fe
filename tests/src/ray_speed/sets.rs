//! The rays that are raced, and the scene that they meet.

use std::sync::Arc;

use glam::{Affine3A, Vec3, vec3};
use protocol::messages::{Camera, SampleRequest};
use protocol::scene::{Light, Scene};
use rays::{Hit, Ray, TriangleMesh, World};
use renderer::edges::world::{affine, world_of};
use scenes::LoadedScene;
use shader_server::camera::Pinhole;
use shader_server::random::Stream;

/// Side of the tiles in whose order rays from the eye are listed, pixels.
const TILE: u32 = 8;
/// Origins leave their surface by this share of the scene's size.
const LIFT: f32 = 1e-5;
/// Shadow rays end at this share of their length.
pub const STOP_SHORT: f32 = 0.999;

/// Every triangle of a scene in world space, area lights included.
#[derive(Debug, Default)]
pub struct Flat {
    /// Corners, metres.
    pub positions: Vec<Vec3>,
    /// Indices of the corners of each face.
    pub faces: Vec<[u32; 3]>,
}

impl Flat {
    /// The triangles of `scene`.
    pub fn of(scene: &Scene) -> Self {
        let mut flat = Self::default();
        for object in &scene.objects {
            let Some(mesh) = scene.meshes.get(object.mesh as usize) else {
                continue;
            };
            let to_world = affine(&object.transform);
            let corners = mesh
                .positions
                .iter()
                .map(|p| to_world.transform_point3(Vec3::from(*p)));
            flat.add(corners, mesh.faces.iter().copied());
        }
        for light in &scene.lights {
            if let Light::Area { vertices, .. } = light {
                let fan = (2..vertices.len() as u32).map(|i| [0, i - 1, i]);
                flat.add(vertices.iter().map(|v| Vec3::from(*v)), fan);
            }
        }
        flat
    }

    fn add(&mut self, corners: impl Iterator<Item = Vec3>, faces: impl Iterator<Item = [u32; 3]>) {
        let first = self.positions.len() as u32;
        self.positions.extend(corners);
        self.faces.extend(faces.map(|face| face.map(|i| i + first)));
    }
}

/// What is asked about rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Question {
    /// The closest hit.
    Closest,
    /// Whether there is any.
    Any,
}

/// Rays of one kind.
#[derive(Debug)]
pub struct RaySet {
    /// Short name.
    pub name: &'static str,
    /// What is asked.
    pub question: Question,
    /// Whether neighbours in the list are neighbours in space.
    pub coherent: bool,
    /// Largest distance.
    pub t_max: f32,
    /// The rays.
    pub rays: Vec<Ray>,
}

/// A scene with its rays.
pub struct Subject {
    /// Its triangles.
    pub flat: Flat,
    /// The same as a tree of one level: one mesh.
    pub one_level: World,
    /// Time to build that, seconds.
    pub build_s: f64,
    /// The scene as it is: a mesh an object, and a tree over objects.
    pub two_levels: World,
    /// From the eye, off diffuse surfaces, to the first light.
    pub sets: Vec<RaySet>,
}

impl Subject {
    /// The scene with rays for a picture of `size_px` by `size_px`.
    pub fn new(loaded: &LoadedScene, size_px: u32) -> Self {
        let flat = Flat::of(&loaded.scene);
        let start = std::time::Instant::now();
        let mesh = TriangleMesh::build(&flat.positions, &flat.faces);
        let build_s = start.elapsed().as_secs_f64();
        let one_level = World::new(vec![(Arc::new(mesh), Affine3A::IDENTITY)]);
        let primary = from_eye(loaded, size_px);
        let (bounce, shadow) = secondary(&loaded.scene, &flat, &one_level, &primary);
        let set = |name, question, coherent, t_max, rays| RaySet {
            name,
            question,
            coherent,
            t_max,
            rays,
        };
        let far = f32::INFINITY;
        let mut sets = vec![
            set("primary", Question::Closest, true, far, primary),
            set(
                "shuffled bounce, closest",
                Question::Closest,
                false,
                far,
                bounce.clone(),
            ),
            set("shuffled bounce, any", Question::Any, false, far, bounce),
            set("shadow", Question::Any, true, STOP_SHORT, shadow),
        ];
        sets.retain(|set| !set.rays.is_empty());
        Self {
            flat,
            one_level,
            build_s,
            two_levels: world_of(&loaded.scene),
            sets,
        }
    }
}

/// One ray a pixel, tile by tile; in a tile, blocks of 4x2 pixels follow one another.
fn from_eye(loaded: &LoadedScene, size_px: u32) -> Vec<Ray> {
    let camera = &loaded.camera;
    let pinhole = Pinhole::new(&Camera {
        eye: camera.eye,
        target: camera.target,
        up: camera.up,
        fov_y: camera.fov_y,
        width: size_px,
        height: size_px,
    });
    let tiles = size_px / TILE;
    let mut rays = Vec::with_capacity((tiles * TILE).pow(2) as usize);
    for tile in 0..tiles * tiles {
        for i in 0..TILE * TILE {
            let (block, within) = (i / 8, i % 8);
            let x = tile % tiles * TILE + block % 2 * 4 + within % 4;
            let y = tile / tiles * TILE + block / 2 * 2 + within / 4;
            let id = u64::from(y * size_px + x);
            rays.push(pinhole.ray(&SampleRequest {
                id,
                x: x as u16,
                y: y as u16,
                offset: Stream::new(99, id).square().into(),
            }));
        }
    }
    rays
}

/// From where rays from the eye hit: cosine-distributed ones in random order, and ones to the first light in theirs.
fn secondary(scene: &Scene, flat: &Flat, world: &World, primary: &[Ray]) -> (Vec<Ray>, Vec<Ray>) {
    let lift = LIFT * world.bounds().max_abs();
    let light = scene.lights.first().map(middle);
    let mut stream = Stream::new(3, 4);
    let (mut bounce, mut shadow) = (Vec::new(), Vec::new());
    for ray in primary {
        let Some(hit) = world.closest(ray, f32::INFINITY) else {
            continue;
        };
        let normal = normal_towards(flat, &hit, ray);
        let origin = ray.at(hit.t) + normal * lift;
        let (a, b) = (stream.square(), stream.unit());
        let ball = (vec3(a.x, a.y, b) * 2. - 1.).normalize_or(Vec3::Y);
        let direction = (normal + ball * 0.999).normalize();
        bounce.push(Ray { origin, direction });
        shadow.extend(light.map(|light| Ray {
            origin,
            direction: light - origin,
        }));
    }
    for i in (1..bounce.len()).rev() {
        let j = (stream.bits() % (i as u64 + 1)) as usize;
        bounce.swap(i, j);
    }
    (bounce, shadow)
}

fn normal_towards(flat: &Flat, hit: &Hit, ray: &Ray) -> Vec3 {
    let [a, b, c] = flat.faces[hit.face as usize].map(|i| flat.positions[i as usize]);
    let normal = (b - a).cross(c - a).normalize_or(Vec3::Y);
    if normal.dot(ray.direction) > 0. {
        -normal
    } else {
        normal
    }
}

fn middle(light: &Light) -> Vec3 {
    match light {
        Light::Point { position, .. } => Vec3::from(*position),
        Light::Linear { from, to, .. } => 0.5 * (Vec3::from(*from) + Vec3::from(*to)),
        Light::Area { vertices, .. } => {
            let sum: Vec3 = vertices.iter().map(|v| Vec3::from(*v)).sum();
            sum / vertices.len().max(1) as f32
        }
    }
}
