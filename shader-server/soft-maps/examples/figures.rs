//! Time against error of soft shadow maps and of shadow rays, on built-in scenes or scene files, and pictures of both.
//!
//! `figures [--size N] [--out DIR] [--texels ANGLE,...] SCENE...`; of area lights the maps are those of their edges. Pictures show the
//! share of the light that is seen: by dense rays, by maps, and ten times the difference.

use std::{path::PathBuf, sync::Arc};

use glam::{Affine3A, Mat3A, Vec3};
use protocol::scene::{self, Scene};
use rayon::prelude::*;
use rays::{Ray, TriangleMesh, World};
use soft_maps::{Light, Receiver, measure};

fn main() {
    let mut size = 256;
    let mut out = None;
    let mut angles = vec![0.012f32, 0.006, 0.003, 0.0015];
    let mut names = Vec::new();
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        let mut value = || args.next().expect("a value");
        match arg.as_str() {
            "--size" => size = value().parse().expect("pixels a side"),
            "--out" => out = Some(PathBuf::from(value())),
            "--texels" => {
                angles = value()
                    .split(',')
                    .map(|a| a.parse().expect("an angle"))
                    .collect();
            }
            _ => names.push(arg),
        }
    }
    if names.is_empty() {
        names = ["soft2", "soft6", "soft8", "soft9"]
            .map(String::from)
            .to_vec();
    }
    for name in names {
        let loaded = scenes::open(&name).expect("a scene");
        let stage = Stage::new(&loaded.scene);
        let pixels = stage.receivers(&loaded.camera, size);
        for (index, light) in stage.lights.iter().enumerate() {
            let out = out
                .as_ref()
                .map(|dir: &PathBuf| dir.join(format!("{name}-{index}")));
            compare(
                &format!("{name}, light {index}"),
                &stage,
                light,
                &pixels,
                &angles,
                out.as_deref(),
                size,
            );
        }
    }
}

/// A scene as rays see it.
struct Stage {
    world: World,
    lights: Vec<Light>,
    /// Corners of an instance's faces, object space.
    meshes: Vec<Vec<[Vec3; 3]>>,
    places: Vec<Affine3A>,
}

impl Stage {
    fn new(scene: &Scene) -> Self {
        let built: Vec<(Arc<TriangleMesh>, Vec<[Vec3; 3]>)> = scene
            .meshes
            .par_iter()
            .map(|mesh| {
                let positions: Vec<Vec3> = mesh.positions.iter().map(|p| Vec3::from(*p)).collect();
                let corners = |f: &[u32; 3]| f.map(|v| positions[v as usize]);
                let faces = mesh.faces.iter().map(corners).collect();
                (
                    Arc::new(TriangleMesh::build(&positions, &mesh.faces)),
                    faces,
                )
            })
            .collect();
        let (mut instances, mut meshes, mut places) = (vec![], vec![], vec![]);
        for object in &scene.objects {
            let (mesh, faces) = &built[object.mesh as usize];
            let rows = object.transform.map(glam::Vec4::from);
            let column = |i: usize| Vec3::new(rows[0][i], rows[1][i], rows[2][i]);
            let matrix = Mat3A::from_cols(column(0).into(), column(1).into(), column(2).into());
            let place = Affine3A::from_mat3_translation(matrix.into(), column(3));
            instances.push((Arc::clone(mesh), place));
            meshes.push(faces.clone());
            places.push(place);
        }
        let mut lights = Vec::new();
        for light in &scene.lights {
            match light {
                scene::Light::Point { position, .. } => {
                    lights.push(Light::Segment([Vec3::from(*position); 2]));
                }
                scene::Light::Linear { from, to, .. } => {
                    lights.push(Light::Segment([*from, *to].map(Vec3::from)));
                }
                scene::Light::Area { vertices, .. } => {
                    let vertices: Vec<Vec3> = vertices.iter().map(|v| Vec3::from(*v)).collect();
                    let faces: Vec<[u32; 3]> =
                        (2..vertices.len() as u32).map(|i| [0, i - 1, i]).collect();
                    let mesh = Arc::new(TriangleMesh::build(&vertices, &faces));
                    let instance = Some(instances.len() as u32);
                    instances.push((mesh, Affine3A::IDENTITY));
                    meshes.push(
                        faces
                            .iter()
                            .map(|f| f.map(|v| vertices[v as usize]))
                            .collect(),
                    );
                    places.push(Affine3A::IDENTITY);
                    lights.push(Light::Polygon { vertices, instance });
                }
            }
        }
        Self {
            world: World::new(instances),
            lights,
            meshes,
            places,
        }
    }

    /// What the camera sees, by pixels.
    fn receivers(&self, camera: &scenes::CameraSpec, size: u32) -> Vec<Option<Receiver>> {
        let [eye, target, up] = [camera.eye, camera.target, camera.up].map(Vec3::from);
        let forward = (target - eye).normalize();
        let right = forward.cross(up).normalize();
        let above = right.cross(forward);
        let half = (0.5f32 * camera.fov_y.to_radians()).tan();
        let pixel = |i: u32| {
            let at = |k: u32| (k as f32 + 0.5) / size as f32 * 2. - 1.;
            let (x, y) = (at(i % size), -at(i / size));
            let ray = Ray {
                origin: eye,
                direction: forward + (right * x + above * y) * half,
            };
            let hit = self.world.closest(&ray, f32::INFINITY)?;
            let face = self.meshes[hit.instance as usize][hit.face as usize];
            let [a, b, c] = face.map(|p| self.places[hit.instance as usize].transform_point3(p));
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let normal = if normal.dot(ray.direction) > 0. {
                -normal
            } else {
                normal
            };
            Some(Receiver {
                position: ray.at(hit.t),
                normal,
                face_normal: normal,
            })
        };
        (0..size * size).map(pixel).collect()
    }
}

fn compare(
    name: &str,
    stage: &Stage,
    light: &Light,
    pixels: &[Option<Receiver>],
    angles: &[f32],
    out: Option<&std::path::Path>,
    size: u32,
) {
    let receivers: Vec<Receiver> = pixels.iter().flatten().copied().collect();
    let truth = measure::by_rays(&stage.world, light, &receivers, 1024, 7);
    let given = (&receivers[..], &truth[..]);
    let triangles: usize = stage.meshes.iter().map(Vec::len).sum();
    println!(
        "{name}: {triangles} triangles, {} receivers",
        receivers.len()
    );
    let measured = measure::compare(&stage.world, light, given, angles).expect("a sound light");
    for one in measured {
        let row = &one.row;
        println!(
            "  {:24} {:3} samples {:8} texels, build {:7.1} ms, look {:7.1} ms ({:6.0} ns), rms {:.4}, worst {:.3}, flagged {:.4}, {:.1} MB",
            one.name,
            row.samples,
            row.texels,
            row.build_s * 1e3,
            row.look_s * 1e3,
            row.look_s * 1e9 / receivers.len() as f64,
            row.rms,
            row.worst,
            row.flagged,
            row.bytes as f64 / 1e6
        );
        if let (Some(out), false) = (out, one.shares.is_empty()) {
            let name = one.name.replace([',', ' '], "");
            let file = format!("{}-{name}.png", out.display());
            picture(pixels, size, &truth, &one.shares)
                .save(file)
                .expect("a folder");
        }
    }
}

/// Truth, what was found, and ten times the difference, side by side.
fn picture(
    pixels: &[Option<Receiver>],
    size: u32,
    truth: &[f32],
    shares: &[f32],
) -> image::GrayImage {
    let mut picture = image::GrayImage::new(3 * size, size);
    let hits = pixels.iter().enumerate().filter(|(_, p)| p.is_some());
    for ((i, _), (truth, share)) in hits.zip(truth.iter().zip(shares)) {
        let (x, y) = (i as u32 % size, i as u32 / size);
        let values = [*truth, *share, 10. * (truth - share).abs()];
        for (column, value) in values.into_iter().enumerate() {
            let grey = (255. * value.clamp(0., 1.)) as u8;
            picture.put_pixel(x + column as u32 * size, y, image::Luma([grey]));
        }
    }
    picture
}
