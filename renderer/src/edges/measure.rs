//! Timings and counts on real scenes; run with `--ignored --nocapture`.

use std::path::PathBuf;
use std::time::Instant;

use glam::Vec3;
use protocol::messages::Camera;
use scenes::{CameraSpec, LoadedScene};

use super::adjacency::{Adjacency, EyeBox};
use super::by_rays::RaySettings;
use super::crossings::Crossings;
use super::depth::{DepthBuffer, DepthOffset};
use super::finder::EdgeFinder;
use super::list::EdgeList;
use super::raster::draw_all;
use super::tree::{EdgeKind, EdgeTree, FindOptions, TreeScratch};
use super::truth::Truth;
use super::visibility::{EdgeDrawer, Hiding};
use super::world::world_of;
use crate::camera::View;

/// A scene beside the checkout, or nothing, said aloud.
pub(super) fn shared(path: &str) -> Option<LoadedScene> {
    let root = std::env::var_os("EDGE_POINT_SHARED").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared"),
        PathBuf::from,
    );
    let path = root.join(path);
    if !path.exists() {
        eprintln!("skipped: {} is not there", path.display());
        return None;
    }
    Some(scenes::load(&path).unwrap())
}

pub(super) fn view(camera: &CameraSpec, size: u32) -> View {
    View::new(&Camera {
        eye: camera.eye,
        target: camera.target,
        up: camera.up,
        fov_y: camera.fov_y,
        width: size,
        height: size,
    })
}

/// Best of some runs, ms: the machine may be shared.
pub(super) fn best_ms(runs: usize, mut run: impl FnMut()) -> f64 {
    (0..runs)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64() * 1e3
        })
        .fold(f64::INFINITY, f64::min)
}

#[test]
#[ignore = "a measurement"]
fn trees() {
    for path in [
        "references/chains/chains.toml",
        "references/rooms/rooms.toml",
        "references/dragon/dragon.toml",
    ] {
        let Some(loaded) = shared(path) else { continue };
        for object in &loaded.scene.objects {
            let mesh = &loaded.scene.meshes[object.mesh as usize];
            if mesh.faces.len() < 1000 {
                continue;
            }
            let start = Instant::now();
            let adjacency = Adjacency::new(mesh);
            let adjacency_ms = start.elapsed().as_secs_f64() * 1e3;
            let start = Instant::now();
            let tree = EdgeTree::new(&adjacency, object.crease_angle);
            let tree_ms = start.elapsed().as_secs_f64() * 1e3;
            let mut found = Vec::new();
            let mut scratch = TreeScratch::default();
            let mut eyes = Vec::new();
            let camera = &loaded.camera;
            let (eye, target) = (
                Vec3::from(camera.eye).as_dvec3(),
                Vec3::from(camera.target).as_dvec3(),
            );
            for i in 0..9 {
                let turn = glam::DQuat::from_rotation_y(f64::from(i) * 0.7);
                eyes.push(EyeBox::point(target + turn * (eye - target)));
            }
            let mut cost = Default::default();
            let mut silhouettes = 0;
            let mut i = 0;
            let ms = best_ms(45, || {
                found.clear();
                let eye = &eyes[i % eyes.len()];
                cost = tree.find(
                    &adjacency,
                    eye,
                    FindOptions::default(),
                    &mut scratch,
                    &mut found,
                );
                silhouettes = found.len();
                i += 1;
            });
            let brute_ms = best_ms(9, || {
                let eye = &eyes[i % eyes.len()];
                found.clear();
                for edge in 0..adjacency.edges.len() {
                    let faces = adjacency.faces(edge);
                    if faces.len() == 2
                        && adjacency.facing(faces[0], eye) != adjacency.facing(faces[1], eye)
                    {
                        found.push((edge as u32, EdgeKind::Silhouette));
                    }
                }
                i += 1;
            });
            println!(
                "{path} {}: {} faces, {} edges, {} special, adjacency {adjacency_ms:.0} ms, tree {tree_ms:.0} ms, \
                 {} MB, {silhouettes} found in {ms:.3} ms (brute {brute_ms:.3}), {cost:?}",
                object.name,
                mesh.faces.len(),
                adjacency.edges.len(),
                tree.special.len(),
                tree.bytes() >> 20,
            );
        }
    }
}

#[test]
#[ignore = "a measurement"]
fn frames() {
    for (path, size) in [
        ("references/chains/chains.toml", 512),
        ("references/rooms/rooms.toml", 512),
        ("references/dragon/dragon.toml", 512),
    ] {
        let Some(loaded) = shared(path) else { continue };
        let mut finder = EdgeFinder::new(&loaded.scene);
        let mut view = view(&loaded.camera, size);
        let mut edges = EdgeList::default();
        let mut crossings = Crossings::new(size as usize, size as usize);
        let find_ms = best_ms(21, || {
            view.eye.x += 1e-3;
            finder.find(&view, &mut edges);
        });
        let still_ms = best_ms(21, || {
            finder.find(&view, &mut edges);
        });
        let draw_ms = best_ms(21, || {
            crossings.clear();
            draw_all(&view, &edges, true, &mut crossings);
        });
        println!(
            "{path}: {} edges found in {find_ms:.3} ms (still {still_ms:.4}), drawn in {draw_ms:.3} ms",
            edges.len()
        );
    }
}

#[test]
#[ignore = "a measurement"]
fn short_segments() {
    let mut edges = EdgeList::default();
    let view = view(
        &CameraSpec {
            eye: [0.0; 3],
            target: [0.0, 0.0, -1.0],
            up: [0.0, 1.0, 0.0],
            fov_y: 45.0,
        },
        512,
    );
    let mut state = 1_u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32 - 0.5
    };
    for _ in 0..150_000 {
        let p = [next() * 8.0, next() * 8.0, 10.0];
        edges.from.push(p);
        edges
            .to
            .push([p[0] + next() * 0.06, p[1] + next() * 0.06, 10.0]);
    }
    let mut crossings = Crossings::new(512, 512);
    for half in [false, true] {
        let ms = best_ms(21, || {
            crossings.clear();
            draw_all(&view, &edges, half, &mut crossings);
        });
        println!("150,000 segments of about 1.5 px, half lines {half}: {ms:.3} ms");
    }
}

#[test]
#[ignore = "a measurement"]
fn precision_and_recall() {
    for path in [
        "references/chains/chains.toml",
        "references/rooms/rooms.toml",
    ] {
        let Some(loaded) = shared(path) else { continue };
        let view = view(&loaded.camera, 512);
        let world = world_of(&loaded.scene);
        let truth = Truth::new(&loaded.scene, &world, &view, 4, 0.002);
        let mut finder = EdgeFinder::new(&loaded.scene);
        let mut edges = EdgeList::default();
        finder.find(&view, &mut edges);
        let mut crossings = Crossings::new(512, 512);
        let mut score = |name: &str, hiding: Hiding<'_>| {
            let mut drawer = EdgeDrawer::default();
            let ms = best_ms(11, || {
                edges.generation += 1;
                drawer.draw(&view, &edges, hiding, true, &mut crossings);
            });
            let score = truth.score(&crossings);
            println!(
                "{path} {name}: recall {:.4}, precision {:.4}, {ms:.3} ms, {} rays, {score:?}",
                score.recall(),
                score.precision(),
                drawer.rays(),
            );
        };
        score("all", Hiding::None);
        for (spacing_px, precision_px) in [
            (1.0, 0.25),
            (3.0, 0.25),
            (3.0, 0.5),
            (4.0, 0.25),
            (4.0, 0.5),
            (6.0, 0.25),
            (6.0, 0.5),
            (8.0, 0.25),
        ] {
            let settings = RaySettings {
                spacing_px,
                precision_px,
                ..RaySettings::default()
            };
            score(
                &format!("spacing {spacing_px}, precision {precision_px}"),
                Hiding::Rays(&world, settings),
            );
        }
        for tolerance in [1e-6, 1e-4, 1e-3] {
            let settings = RaySettings {
                spacing_px: 1.0,
                tolerance,
                ..RaySettings::default()
            };
            score(
                &format!("spacing 1, tolerance {tolerance}"),
                Hiding::Rays(&world, settings),
            );
        }
        for share in [0.02, 0.1, 0.3, 1.0] {
            let buffer = sparse_depth(&view, &world, share);
            for (dense, sparse) in [(0.002, 0.01), (0.005, 0.03)] {
                let offset = DepthOffset { dense, sparse };
                score(
                    &format!("points {share}, {offset:?}"),
                    Hiding::Points(&buffer, offset),
                );
            }
        }
    }
}

/// Depth at the middle of a share of the pixels.
fn sparse_depth(view: &View, world: &rays::World, share: f32) -> DepthBuffer {
    let (width, height) = (view.width as usize, view.height as usize);
    let mut state = 1_u32;
    let depth = (0..width * height)
        .map(|i| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            if (state >> 8) as f32 / (1 << 24) as f32 >= share {
                return f32::INFINITY;
            }
            let direction = view.direction((i % width) as f32 + 0.5, (i / width) as f32 + 0.5);
            let ray = rays::Ray {
                origin: view.eye,
                direction,
            };
            world.closest(&ray, f32::INFINITY).map_or(1e30, |hit| hit.t)
        })
        .collect();
    DepthBuffer {
        width,
        height,
        depth,
    }
}

#[test]
#[ignore = "a measurement"]
fn many_draws() {
    let Some(loaded) = shared("references/chains/chains.toml") else {
        return;
    };
    let view = view(&loaded.camera, 512);
    let world = world_of(&loaded.scene);
    let mut finder = EdgeFinder::new(&loaded.scene);
    let mut edges = EdgeList::default();
    finder.find(&view, &mut edges);
    let mut crossings = Crossings::new(512, 512);
    let mut drawer = EdgeDrawer::default();
    let ms = best_ms(1000, || {
        edges.generation += 1;
        drawer.draw(
            &view,
            &edges,
            Hiding::Rays(&world, RaySettings::default()),
            true,
            &mut crossings,
        );
    });
    println!("{ms:.3} ms, {} rays", drawer.rays());
}
