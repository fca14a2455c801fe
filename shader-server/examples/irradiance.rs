//! Time and error of indirect light: the cache, cold and warm, beside rays from every pixel.
//!
//! `cargo run --release -p shader-server --example irradiance -- SCENE.toml [REFERENCE.exr]`; the scene must ask for `global`.
#![allow(clippy::print_stdout, reason = "this is a program")]

use std::{path::Path, sync::Arc};

use glam::Vec3;
use protocol::messages::{Camera, SampleRequest};
use rayon::prelude::*;
use rays::Ray;
use shader_server::{
    Stage, camera::Pinhole, irradiance::hemisphere::Strata, lights::Receiver, random::Stream,
};

#[path = "../tests/common/picture.rs"]
mod picture;

use picture::SIZE;

/// Places at which errors are measured.
const PLACES: usize = 800;

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let scene = Path::new(args.get(1).expect("a scene file"));
    let loaded = picture::load(scene);
    let camera = picture::camera(&loaded.camera);
    let stage = Stage::build(Arc::new(loaded.scene)).expect("the scene is sound");
    let places = places(&stage, &camera, 1);
    let cache = stage.irradiance().expect("the scene asks for global");

    let cold = cpu_s();
    let all: Vec<Vec3> = indirect(&stage, &places, &camera);
    let cold = cpu_s() - cold;
    let warm = cpu_s();
    let again = indirect(&stage, &places, &camera);
    let warm = cpu_s() - warm;
    assert_eq!(all, again);
    let tally = cache.tally();
    println!(
        "{} places: cold {cold:.2} s, warm {warm:.2} s, {tally:?}",
        places.len()
    );

    let step = places.len() / PLACES;
    let some: Vec<(usize, &Receiver)> =
        (0..PLACES).map(|i| (i * step, &places[i * step])).collect();
    let truth = by_rays(&stage, &some, 40, 110, 9);
    let of_cache: Vec<Vec3> = some.iter().map(|(i, _)| all[*i]).collect();
    println!(
        "cache: error {:.4}, bias {:+.4}",
        error(&of_cache, &truth),
        bias(&of_cache, &truth)
    );
    let mut each: Vec<(f32, usize)> = (0..PLACES)
        .map(|i| (error(&of_cache[i..=i], &truth[i..=i]), i))
        .collect();
    each.sort_by(|a, b| b.0.total_cmp(&a.0));
    let at = |q: f32| each[((1. - q) * PLACES as f32) as usize].0;
    println!(
        "relative error, quantiles .5 {:.4} .8 {:.4} .95 {:.4} .99 {:.4}",
        at(0.5),
        at(0.8),
        at(0.95),
        at(0.99)
    );
    for (e, i) in &each[..12] {
        let (pixel, p) = (some[*i].0, some[*i].1.position);
        println!(
            "  {e:.3} pixel {} {} at {p:.3} cache {:.4} rays {:.4}",
            pixel as u32 % SIZE,
            pixel as u32 / SIZE,
            of_cache[*i].x,
            truth[*i].x
        );
    }
    for (rings, sectors) in [(8, 20), (14, 36)] {
        let start = cpu_s();
        let values = by_rays(&stage, &some, rings, sectors, 4);
        let seconds = (cpu_s() - start) * places.len() as f64 / PLACES as f64;
        println!(
            "{} rays: error {:.4}, {seconds:.1} s for all, {:.1} times the cold cache",
            rings * sectors,
            error(&values, &truth),
            seconds / cold
        );
    }
    if let Some(reference) = args.get(2) {
        let start = cpu_s();
        let ours = picture::render(
            &stage,
            &camera,
            1,
            &shader_server::shadows::ShadowRays::default(),
        );
        println!("picture {:.2} s", (cpu_s() - start));
        println!(
            "{:#?}",
            picture::difference(&ours, &picture::load_picture(Path::new(reference)))
        );
    }
}

/// Processor time of all threads so far, seconds: what else the machine does counts for nothing.
fn cpu_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").expect("Linux");
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    let ticks = |i: usize| after_name.split_whitespace().nth(i)?.parse::<f64>().ok();
    // User and system time, hundredths of a second.
    (ticks(11).unwrap_or(0.) + ticks(12).unwrap_or(0.)) / 100.
}

/// What each pixel sees, where that is a surface.
fn places(stage: &Stage, camera: &Camera, every: u32) -> Vec<Receiver> {
    let pinhole = Pinhole::new(camera);
    (0..SIZE * SIZE)
        .step_by(every as usize)
        .filter_map(|pixel| {
            let ray: Ray = pinhole.ray(&SampleRequest {
                id: 0,
                x: (pixel % SIZE) as u16,
                y: (pixel / SIZE) as u16,
                offset: [0.5; 2],
            });
            let hit = stage.world().closest(&ray, f32::INFINITY)?;
            stage.light_of(hit.instance).is_none().then_some(())?;
            let surface = stage.surface(&hit)?;
            Some(surface.seen_along(ray.direction.as_dvec3(), hit.instance, hit.face))
        })
        .collect()
}

fn indirect(stage: &Stage, places: &[Receiver], camera: &Camera) -> Vec<Vec3> {
    let cache = stage.irradiance().expect("the scene asks for global");
    let (slope, eye) = (
        Pinhole::new(camera).pixel_slope(),
        Vec3::from(camera.eye).as_dvec3(),
    );
    places
        .par_iter()
        .with_min_len(64)
        .map(|at| {
            cache
                .irradiance(stage, at, slope * (at.position - eye).length())
                .irradiance
        })
        .collect()
}

fn by_rays(
    stage: &Stage,
    places: &[(usize, &Receiver)],
    rings: usize,
    sectors: usize,
    seed: u64,
) -> Vec<Vec3> {
    let cache = stage.irradiance().expect("the scene asks for global");
    places
        .par_iter()
        .map(|(i, at)| {
            let stream = Stream::new(seed, *i as u64);
            cache
                .by_rays(stage, at, &Strata { rings, sectors }, &stream)
                .irradiance
        })
        .collect()
}

/// Root mean square of differences, as a share of the mean.
fn error(values: &[Vec3], truth: &[Vec3]) -> f32 {
    let squares: f32 = values
        .iter()
        .zip(truth)
        .map(|(a, b)| (*a - *b).length_squared())
        .sum();
    (squares / truth.len() as f32 / 3.).sqrt() / mean(truth)
}

fn bias(values: &[Vec3], truth: &[Vec3]) -> f32 {
    mean(values) / mean(truth) - 1.
}

fn mean(values: &[Vec3]) -> f32 {
    values.iter().sum::<Vec3>().element_sum() / (3 * values.len()) as f32
}
