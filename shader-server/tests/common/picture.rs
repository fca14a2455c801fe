//! Pictures made with the library alone, and their distance from reference pictures.
#![allow(dead_code, missing_docs, unreachable_pub)]

use std::path::{Path, PathBuf};

use protocol::messages::{Camera, SampleRequest};
use rayon::prelude::*;
use scenes::{CameraSpec, LoadedScene};
use shader_server::{Shader, Stage, camera::Pinhole, random::Stream, shadows::ShadowRays};

pub const SIZE: u32 = 512;

/// The folder with reference pictures, if it is there.
pub fn shared() -> Option<PathBuf> {
    let folder = std::env::var_os("EDGE_POINT_SHARED").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared"),
        PathBuf::from,
    );
    folder.join("references").is_dir().then_some(folder)
}

pub fn camera(spec: &CameraSpec) -> Camera {
    let CameraSpec {
        eye,
        target,
        up,
        fov_y,
    } = *spec;
    Camera {
        eye,
        target,
        up,
        fov_y,
        width: SIZE,
        height: SIZE,
    }
}

/// The request of sample `index` of `spp` in a pixel: one in each cell of a grid.
pub fn request(pixel: u32, index: u32, spp: u32) -> SampleRequest {
    let id = u64::from(pixel) * u64::from(spp) + u64::from(index);
    let mut offset = Stream::new(99, id).square();
    let side = f64::from(spp).sqrt().round() as u32;
    if side * side == spp {
        let cell = glam::Vec2::new((index % side) as f32, (index / side) as f32);
        offset = ((cell + offset) / side as f32).min(glam::Vec2::splat(0.999_999_9));
    }
    SampleRequest {
        id,
        x: (pixel % SIZE) as u16,
        y: (pixel / SIZE) as u16,
        offset: offset.into(),
    }
}

/// Linear picture of `spp` jittered samples a pixel, row 0 on top.
pub fn render(stage: &Stage, camera: &Camera, spp: u32, shadows: &ShadowRays) -> Vec<[f32; 3]> {
    let pinhole = Pinhole::new(camera);
    (0..SIZE * SIZE)
        .into_par_iter()
        .with_min_len(64)
        .map_init(
            || Shader::new(stage, shadows, 1),
            |shader, pixel| {
                let mut sum = glam::DVec3::ZERO;
                for index in 0..spp {
                    let request = request(pixel, index, spp);
                    let sample = shader.shade(request.id, &pinhole.ray(&request)).sample;
                    sum += glam::Vec3::from(sample.radiance).as_dvec3();
                }
                (sum / f64::from(spp)).as_vec3().to_array()
            },
        )
        .collect()
}

pub fn load_picture(path: &Path) -> Vec<[f32; 3]> {
    let picture = image::open(path)
        .expect("the reference opens")
        .into_rgb32f();
    assert_eq!(picture.dimensions(), (SIZE, SIZE));
    picture.pixels().map(|p| p.0).collect()
}

/// How two pictures differ.
#[derive(Debug)]
pub struct Difference {
    pub mean: f64,
    pub reference_mean: f64,
    /// Ratio of means, less one.
    pub relative_mean: f64,
    /// Largest difference of an 8x8 block's mean, as a share of the picture's mean, and where.
    pub worst_block: (f64, u32, u32),
    /// Root mean square of the same over blocks.
    pub rms_block: f64,
    /// Blocks that differ by more than 2 % of their own mean plus 0.5 % of the picture's.
    pub odd_blocks: usize,
    pub rmse: f64,
}

fn luminance(pixel: &[f32; 3]) -> f64 {
    pixel.iter().map(|c| f64::from(*c)).sum::<f64>() / 3.
}

pub fn difference(picture: &[[f32; 3]], reference: &[[f32; 3]]) -> Difference {
    let mean = |p: &[[f32; 3]]| p.iter().map(luminance).sum::<f64>() / p.len() as f64;
    let (mean, reference_mean) = (mean(picture), mean(reference));
    let (mut worst, mut squares, mut odd) = ((0f64, 0, 0), 0., 0);
    let blocks = SIZE / 8;
    for by in 0..blocks {
        for bx in 0..blocks {
            let sum = |p: &[[f32; 3]]| {
                (0..64)
                    .map(|i| luminance(&p[((by * 8 + i / 8) * SIZE + bx * 8 + i % 8) as usize]))
                    .sum::<f64>()
                    / 64.
            };
            let (ours, theirs) = (sum(picture), sum(reference));
            let share = (ours - theirs) / reference_mean;
            squares += share * share;
            odd += usize::from((ours - theirs).abs() > 0.02 * theirs + 0.005 * reference_mean);
            if share.abs() > worst.0.abs() {
                worst = (share, bx, by);
            }
        }
    }
    let error = picture
        .iter()
        .zip(reference)
        .flat_map(|(a, b)| (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)))
        .sum::<f64>();
    Difference {
        mean,
        reference_mean,
        relative_mean: mean / reference_mean - 1.,
        worst_block: worst,
        rms_block: (squares / f64::from(blocks * blocks)).sqrt(),
        odd_blocks: odd,
        rmse: (error / (picture.len() * 3) as f64).sqrt(),
    }
}

pub fn load(path: &Path) -> LoadedScene {
    scenes::load(path).unwrap_or_else(|error| panic!("{error}"))
}
