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
    Shader, Stage,
    camera::Pinhole,
    lights::{Emitter, Receiver, Shape},
    random::Stream,
    shadows::{ShadowRays, Shadows},
};

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let number = |i: usize, or: u32| args.get(i).map_or(or, |a| a.parse().expect("a number"));
    let scene = Path::new(
        args.get(1)
            .expect("measure SCENE [REFERENCE] [SPP] [SHADOW_RAYS]"),
    );
    let defaults = ShadowRays::default();
    let shadows = ShadowRays {
        max_rays: number(4, defaults.max_rays),
        ..defaults
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
    noise_of_shadows(&stage, &camera);
    error_by_setting(&stage, &camera);
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

/// No shortcut.
const TRUTH: ShadowRays = ShadowRays {
    max_rays: 0,
    strata: 32,
    drawn_faces: 0,
};

/// Noise of a single question about a light, by what share of it is seen.
fn noise_of_shadows(stage: &Stage, camera: &Camera) {
    let pinhole = Pinhole::new(camera);
    let stream = |i: usize, seed: u64| Stream::new(seed, i as u64);
    let points: Vec<(Receiver, &Emitter)> = (0..picture::SIZE * picture::SIZE)
        .step_by(37)
        .filter_map(|pixel| {
            let ray = pinhole.ray(&picture::request(pixel, 0, 1));
            let hit = stage.world().closest(&ray, f32::INFINITY)?;
            stage.light_of(hit.instance).is_none().then_some(())?;
            let surface = stage.surface(&hit)?;
            Some(surface.seen_along(ray.direction.as_dvec3(), hit.instance, hit.face))
        })
        .flat_map(|at| stage.emitters().iter().map(move |light| (at, light)))
        .filter(|(at, light)| light.unoccluded(at) > 0.)
        .collect();
    let ask = |shadows: &ShadowRays, seed: u64| -> Vec<(f32, u64)> {
        let fraction = |(i, (at, light)): (usize, &(Receiver, &Emitter))| {
            let mut met = Shadows::default();
            let mut stream = stream(i, seed);
            let seen = shadows.fraction(stage, light, at, &mut stream, &mut met);
            (seen, met.rays)
        };
        points.iter().enumerate().map(fraction).collect()
    };
    let runs: Vec<Vec<(f32, u64)>> = (0..4).map(|seed| ask(&TRUTH, 1000 + seed)).collect();
    let truth = |i: usize| runs.iter().map(|run| run[i].0).sum::<f32>() / runs.len() as f32;
    for drawn_faces in [0, ShadowRays::default().drawn_faces] {
        let shadows = ShadowRays {
            drawn_faces,
            ..ShadowRays::default()
        };
        let start = thread_seconds();
        let found = ask(&shadows, 7);
        let each_us = (thread_seconds() - start) * 1e6 / points.len() as f64;
        println!("at most {drawn_faces} faces drawn: {each_us:.2} µs a light");
        for (class, low, high) in [
            ("hidden", -1., 0.),
            ("sliver", 0., 0.05),
            ("penumbra", 0.05, 0.95),
            ("almost lit", 0.95, 0.999_99),
            ("lit", 0.999_99, 2.),
        ] {
            let own = (0..points.len()).filter(|i| truth(*i) > low && truth(*i) <= high);
            let (mut n, mut sum, mut squares, mut rays, mut missed) = (0., 0., 0., 0., 0.);
            for i in own {
                n += 1.;
                sum += truth(i);
                squares += (found[i].0 - truth(i)).powi(2);
                rays += found[i].1 as f32;
                missed += f32::from(u8::from(found[i].0 == 0. && truth(i) > 0.));
            }
            println!(
                "  {class:10} {n:7} questions: rms error {:.4} of a mean of {:.4}, {missed} taken for hidden, {:.1} rays",
                (squares / n).sqrt(),
                sum / n,
                rays / n
            );
        }
    }
}

/// Error of single samples against 32x32 strata without any shortcut, and its price, for several settings.
fn error_by_setting(stage: &Stage, camera: &Camera) {
    let pinhole = Pinhole::new(camera);
    let points: Vec<(u64, Ray)> = (0..picture::SIZE * picture::SIZE)
        .step_by(37)
        .map(|pixel| {
            (
                u64::from(pixel),
                pinhole.ray(&picture::request(pixel, 0, 1)),
            )
        })
        .collect();
    let shade = |shadows: &ShadowRays, seed: u64| {
        let mut shader = Shader::new(stage, shadows, seed);
        let start = thread_seconds();
        let values: Vec<f64> = points
            .iter()
            .map(|(id, ray)| f64::from(shader.shade(*id, ray).sample.radiance[1]))
            .collect();
        let n = points.len() as f64;
        (
            values,
            shader.rays() as f64 / n,
            (thread_seconds() - start) / n * 1e6,
        )
    };
    let (truth, ..) = shade(&TRUTH, 1000);
    let mean = truth.iter().sum::<f64>() / truth.len() as f64;
    println!(
        "strata, most rays, faces drawn: rays a sample, µs, rms error and bias in % of the picture's mean"
    );
    for (strata, max_rays, drawn_faces) in [
        (3, 256, 0),
        (4, 64, 0),
        (4, 256, 0),
        (5, 256, 0),
        (5, 256, 16),
        (5, 256, 32),
        (5, 256, 64),
        (5, 256, 128),
        (5, 256, 256),
        (8, 256, 0),
        (16, 0, 0),
    ] {
        let (mut squares, mut bias, mut cost) = (0., 0., (0., 0.));
        let runs = 4;
        for seed in 0..runs {
            let (values, rays, time) = shade(
                &ShadowRays {
                    max_rays,
                    strata,
                    drawn_faces,
                },
                seed,
            );
            cost = (rays, time);
            for (value, truth) in values.iter().zip(&truth) {
                squares += (value - truth).powi(2);
                bias += value - truth;
            }
        }
        let n = runs as f64 * truth.len() as f64;
        println!(
            "{strata:3} {max_rays:5} {drawn_faces:5}: {:6.1} {:6.2} {:7.3} {:+.4}",
            cost.0,
            cost.1,
            100. * (squares / n).sqrt() / mean,
            100. * bias / n / mean
        );
    }
}
