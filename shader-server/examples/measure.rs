//! Measures a scene: time to build, rays and samples a second, noise of samples, and distance from a reference picture.
//!
//! `measure SCENE [REFERENCE.exr] [SAMPLES_A_PIXEL] [SHADOW_RAYS]`

#[path = "../tests/common/picture.rs"]
mod picture;

use std::{
    path::Path,
    sync::{Arc, OnceLock},
    time::Instant,
};

use glam::{Vec3, vec3};
use protocol::messages::Camera;
use rays::{Ray, World};
use shader_server::{
    Shader, Stage, camera::Pinhole, lights::Shape, random::Stream, shadows::ShadowRays,
};

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let number = |i: usize, or: u32| args.get(i).map_or(or, |a| a.parse().expect("a number"));
    let scene = Path::new(
        args.get(1)
            .expect("measure SCENE [REFERENCE] [SPP] [SHADOW_RAYS]"),
    );
    let shadows = ShadowRays {
        max_rays: number(4, ShadowRays::default().max_rays),
    };

    let start = Instant::now();
    let loaded = picture::load(scene);
    println!("load {:.2} s", start.elapsed().as_secs_f64());
    let camera = picture::camera(&loaded.camera);
    let triangles: usize = loaded.scene.meshes.iter().map(|m| m.faces.len()).sum();
    let scene = Arc::new(loaded.scene);
    let start = Instant::now();
    let stage = Stage::build(scene).expect("the scene is sound");
    println!(
        "build {:.3} s, {triangles} triangles",
        start.elapsed().as_secs_f64()
    );

    rays_a_second(&stage, &camera);
    samples_alone(&stage, &camera, &shadows);
    for threads in [1, 2] {
        samples_a_second(&stage, &camera, &shadows, threads);
    }
    noise(&stage, &camera, &shadows);
    if let Some(reference) = args.get(2) {
        let reference = picture::load_picture(Path::new(reference));
        let start = Instant::now();
        let ours = picture::render(&stage, &camera, number(3, 16), &shadows);
        println!("render {:.1} s", start.elapsed().as_secs_f64());
        println!("{:#?}", picture::difference(&ours, &reference));
    }
}

/// Seconds of processor time of this thread, which other programs do not lengthen; of the clock where that is not known.
fn thread_seconds() -> f64 {
    let start = *START.get_or_init(Instant::now);
    std::fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|text| text.split(' ').next()?.parse::<f64>().ok())
        .map_or(start.elapsed().as_secs_f64(), |ns| ns * 1e-9)
}

static START: OnceLock<Instant> = OnceLock::new();

fn best_rate(what: &str, count: usize, mut pass: impl FnMut() -> usize) {
    let mut best = f64::INFINITY;
    let mut hits = 0;
    for _ in 0..7 {
        let start = thread_seconds();
        hits = pass();
        best = best.min(thread_seconds() - start);
    }
    let rate = count as f64 / best / 1e6;
    println!(
        "{what}: {rate:.2} Mrays/s, {:.0} % hit",
        100. * hits as f64 / count as f64
    );
}

fn rays_a_second(stage: &Stage, camera: &Camera) {
    let world: &World = stage.world();
    let pinhole = Pinhole::new(camera);
    let primary: Vec<Ray> = (0..picture::SIZE * picture::SIZE)
        .map(|pixel| pinhole.ray(&picture::request(pixel, 0, 1)))
        .collect();
    let far = f32::INFINITY;
    let closest = |rays: &[Ray]| {
        rays.iter()
            .filter(|r| world.closest(r, far).is_some())
            .count()
    };
    best_rate("primary", primary.len(), || closest(&primary));
    let plain = world.clone().without_simd();
    best_rate("primary, plain", primary.len(), || {
        primary
            .iter()
            .filter(|r| plain.closest(r, far).is_some())
            .count()
    });

    let mut stream = Stream::new(3, 4);
    let mut bounces = vec![];
    let mut shadow = vec![];
    let light = stage
        .emitters()
        .first()
        .map(|emitter| match &emitter.shape {
            Shape::Point(p) | Shape::Segment(p, _) => p.as_vec3(),
            Shape::Polygon(shape) => shape.vertices[0].as_vec3(),
        });
    for ray in &primary {
        let Some(hit) = world.closest(ray, far) else {
            continue;
        };
        let Some(surface) = stage.surface(&hit) else {
            continue;
        };
        let side = if surface.face_normal.dot(ray.direction) > 0. {
            -1.
        } else {
            1.
        };
        let normal = surface.face_normal * side;
        let origin = surface.position.as_vec3() + normal * surface.clearance;
        let (a, b) = (stream.square(), stream.unit());
        let random = (vec3(a.x, a.y, b) * 2. - 1.).normalize_or(Vec3::Y);
        bounces.push(Ray {
            origin,
            direction: (normal + random * 0.999).normalize(),
        });
        shadow.extend(light.map(|light| Ray {
            origin,
            direction: light - origin,
        }));
    }
    for i in (1..bounces.len()).rev() {
        let j = (stream.bits() % (i as u64 + 1)) as usize;
        bounces.swap(i, j);
    }
    best_rate("shuffled bounce, closest", bounces.len(), || {
        closest(&bounces)
    });
    best_rate("shuffled bounce, any", bounces.len(), || {
        bounces
            .iter()
            .filter(|r| world.occluder(r, far).is_some())
            .count()
    });
    best_rate("shadow", shadow.len(), || {
        shadow
            .iter()
            .filter(|r| world.occluder(r, 0.999).is_some())
            .count()
    });
}

fn samples_a_second(stage: &Stage, camera: &Camera, shadows: &ShadowRays, threads: usize) {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .expect("a pool");
    pool.install(|| {
        let start = Instant::now();
        let picture = picture::render(stage, camera, 1, shadows);
        let rate = picture.len() as f64 / start.elapsed().as_secs_f64();
        println!("{threads} threads: {rate:.0} samples/s");
    });
}

fn samples_alone(stage: &Stage, camera: &Camera, shadows: &ShadowRays) {
    let mut shader = Shader::new(stage, shadows, 1);
    let pinhole = Pinhole::new(camera);
    let start = thread_seconds();
    for pixel in (0..picture::SIZE * picture::SIZE).step_by(16) {
        let request = picture::request(pixel, 0, 1);
        shader.shade(request.id, &pinhole.ray(&request));
    }
    let seconds = thread_seconds() - start;
    let samples = f64::from(picture::SIZE * picture::SIZE / 16);
    println!(
        "scattered, one thread: {:.0} samples/s, {:.1} rays a sample",
        samples / seconds,
        shader.rays() as f64 / samples
    );
}

/// Spread of samples of the same points that differ in their random numbers alone, against their mean.
fn noise(stage: &Stage, camera: &Camera, shadows: &ShadowRays) {
    let pinhole = Pinhole::new(camera);
    let (mut noisy, mut points, mut relative, mut absolute) = (0, 0, 0., 0.);
    for pixel in (0..picture::SIZE * picture::SIZE).step_by(37) {
        let ray = pinhole.ray(&picture::request(pixel, 0, 1));
        let (mut sum, mut squares) = (0f64, 0f64);
        let runs = 24;
        for seed in 0..runs {
            let sample = Shader::new(stage, shadows, seed).shade(u64::from(pixel), &ray);
            let value = f64::from(sample.radiance[1]);
            sum += value;
            squares += value * value;
        }
        let n = runs as f64;
        let (mean, variance) = (sum / n, (squares - sum * sum / n) / (n - 1.));
        points += 1;
        if mean > 0. && variance > 1e-12 * mean * mean {
            noisy += 1;
            relative += variance / (mean * mean);
            absolute += variance;
        }
    }
    let share = f64::from(noisy) / f64::from(points);
    let rms = |sum: f64| (sum / f64::from(noisy.max(1))).sqrt();
    println!(
        "noise: {:.1} % of points have any; there {:.2} % of the mean (rms), {:.4} in radiance (rms)",
        100. * share,
        100. * rms(relative),
        rms(absolute)
    );
}
