//! What is raced: a built-in scene, its light at some size, and a receiver for each pixel.

use std::sync::Arc;

use glam::{Affine3A, DVec3, Vec3};
use penumbra::{BlockerMesh, Caster, Instance, Light, LightError, Receivers, Sampling, Shape};
use protocol::messages::{Camera, SampleRequest};
use rays::{Ray, TriangleMesh, World};
use scenes::LoadedScene;
use shader_server::camera::Pinhole;

use crate::ray_speed::sets::Flat;

/// Side of the tiles in whose order receivers are listed, pixels.
const TILE: u32 = 8;
/// Receivers leave their surface by this share of the scene's size.
const LIFT: f32 = 1e-5;
/// Where the samples' jitter starts.
const SEED: u64 = 11;

/// A scene in one piece.
pub struct Subject {
    /// Its name.
    pub name: String,
    /// Triangles, the light's not among them.
    pub triangles: usize,
    /// For rays.
    pub world: World,
    mesh: Arc<BlockerMesh>,
    flat: Flat,
    loaded: LoadedScene,
    corners: Vec<DVec3>,
}

impl Subject {
    /// Of a loaded scene; none if its first light is not an area light.
    pub fn new(name: &str, loaded: LoadedScene) -> Option<Self> {
        let Some(protocol::scene::Light::Area { vertices, .. }) = loaded.scene.lights.first()
        else {
            return None;
        };
        let corners = vertices.iter().map(|v| Vec3::from(*v).as_dvec3()).collect();
        let mut dark = loaded.scene.clone();
        dark.lights.clear();
        let flat = Flat::of(&dark);
        let tree = TriangleMesh::build(&flat.positions, &flat.faces);
        Some(Self {
            name: name.to_owned(),
            triangles: flat.faces.len(),
            world: World::new(vec![(Arc::new(tree), Affine3A::IDENTITY)]),
            mesh: Arc::new(BlockerMesh::new(&flat.positions, &flat.faces)),
            flat,
            loaded,
            corners,
        })
    }

    /// The light with `samples` samples in eight sets, its sides `scale` times as long.
    ///
    /// # Errors
    /// The number of samples is not possible.
    pub fn caster(&self, samples: u32, scale: f64) -> Result<Caster, LightError> {
        let middle = self.corners.iter().sum::<DVec3>() / self.corners.len() as f64;
        let corners = self.corners.iter().map(|c| middle + (*c - middle) * scale);
        let sampling = Sampling {
            samples,
            sets: 8,
            seed: SEED,
        };
        let light = Light::new(Shape::Polygon(corners.collect()), sampling)?;
        let instance = Instance {
            mesh: Arc::clone(&self.mesh),
            to_world: Affine3A::IDENTITY,
        };
        Ok(Caster::new(vec![instance], light, None))
    }

    /// What the camera sees through the middle of each pixel, tile by tile.
    pub fn receivers(&self, [width, height]: [u32; 2], light: &Light) -> Receivers {
        let camera = &self.loaded.camera;
        let pinhole = Pinhole::new(&Camera {
            eye: camera.eye,
            target: camera.target,
            up: camera.up,
            fov_y: camera.fov_y,
            width,
            height,
        });
        let lift = LIFT * self.world.bounds().max_abs();
        let mut receivers = Receivers::default();
        let (mut rays, mut pixels, mut hits) = (Vec::new(), Vec::new(), Vec::new());
        for tile_y in (0..height).step_by(TILE as usize) {
            for tile_x in (0..width).step_by(TILE as usize) {
                rays.clear();
                pixels.clear();
                for i in 0..TILE * TILE {
                    let (x, y) = (tile_x + i % TILE, tile_y + i / TILE);
                    if x < width && y < height {
                        pixels.push((x, y));
                        rays.push(pinhole.ray(&SampleRequest {
                            id: 0,
                            x: x as u16,
                            y: y as u16,
                            offset: [0.5; 2],
                        }));
                    }
                }
                self.world.closest_each(&rays, f32::INFINITY, &mut hits);
                for ((ray, (x, y)), hit) in rays.iter().zip(&pixels).zip(&hits) {
                    let Some(hit) = hit else { continue };
                    let normal = self.normal_towards(hit.face, ray);
                    let origin = ray.at(hit.t) + normal * lift;
                    let set = light.set_of_pixel(*x, *y);
                    receivers.push(origin, normal, (0, hit.face), set);
                }
            }
        }
        receivers
    }

    fn normal_towards(&self, face: u32, ray: &Ray) -> Vec3 {
        let corners = self.flat.faces[face as usize];
        let [a, b, c] = corners.map(|i| self.flat.positions[i as usize]);
        let normal = (b - a).cross(c - a).normalize_or(Vec3::Y);
        if normal.dot(ray.direction) > 0. {
            -normal
        } else {
            normal
        }
    }
}

/// Tiles of receivers spread over all of them, at most about `most` in number.
pub fn some_of(all: &Receivers, most: usize) -> Receivers {
    let tile = (TILE * TILE) as usize;
    let step = all.len().div_ceil(most.max(1)).max(1);
    let mut some = Receivers::default();
    for start in (0..all.len()).step_by(tile * step) {
        for i in start..(start + tile).min(all.len()) {
            some.push(all.origins[i], all.normals[i], all.own[i], all.sets[i]);
        }
    }
    some
}
