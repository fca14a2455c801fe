//! Blocks of 8x8 pixels against a picture by an independent renderer, and why some differ.

use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};
use protocol::messages::{Camera, SampleRequest};
use shader_server::camera::Pinhole;
use shader_server::lights::{Emitter, Receiver};
use shader_server::random::Stream;
use shader_server::shadows::{ShadowRays, Shadows, Visibility};
use shader_server::{Shader, Stage};
use system_tests::picture::Picture;
use system_tests::places;

const BLOCK_PX: usize = 8;

/// Shadow rays that start as far off the surface as Mitsuba's: 9e-5 (1 + the largest coordinate), metres.
struct Lifted(ShadowRays);

impl Visibility for Lifted {
    fn fraction(
        &self,
        stage: &Stage,
        light: &Emitter,
        receiver: &Receiver,
        stream: &mut Stream,
        shadows: &mut Shadows,
    ) -> f32 {
        let reach = receiver.position.abs().max_element() as f32;
        let lifted = Receiver {
            clearance: 9e-5 * (1.0 + reach),
            ..*receiver
        };
        self.0.fraction(stage, light, &lifted, stream, shadows)
    }
}

/// Mean of a block's samples, `side`² a pixel in strata, and of each of its pixels.
fn shade(
    stage: &Stage,
    how: &dyn Visibility,
    camera: &Camera,
    block: [usize; 2],
    side: u32,
) -> Vec<f64> {
    let (pinhole, mut shader) = (Pinhole::new(camera), Shader::new(stage, how, 5));
    let mut pixels = Vec::new();
    for j in 0..BLOCK_PX * BLOCK_PX {
        let [x, y] = [
            block[0] * BLOCK_PX + j % BLOCK_PX,
            block[1] * BLOCK_PX + j / BLOCK_PX,
        ];
        let mut sum = DVec3::ZERO;
        for i in 0..side * side {
            let id = ((y * 512 + x) as u64) << 12 | u64::from(i);
            let cell = Vec2::new((i % side) as f32, (i / side) as f32);
            let offset =
                ((cell + Stream::new(7, id).square()) / side as f32).min(Vec2::splat(0.999_999_9));
            let request = SampleRequest {
                id,
                x: x as u16,
                y: y as u16,
                offset: offset.into(),
            };
            sum += Vec3::from(shader.shade(id, &pinhole.ray(&request)).radiance).as_dvec3();
        }
        pixels.push(sum.element_sum() / 3.0 / f64::from(side * side));
    }
    pixels
}

#[test]
fn explore() {
    let Some(shared) = places::shared() else {
        println!("skipped: no references in ../shared");
        return;
    };
    let folder = shared.join("references/chains");
    let loaded = scenes::load(&folder.join("chains.toml")).unwrap();
    let stage = Stage::build(Arc::new(loaded.scene.clone())).unwrap();
    let reference = Picture::open(&folder.join("ref.exr")).unwrap();
    let c = loaded.camera;
    let camera = Camera {
        eye: c.eye,
        target: c.target,
        up: c.up,
        fov_y: c.fov_y,
        width: 512,
        height: 512,
    };
    let rays = ShadowRays::default();
    let lifted = Lifted(ShadowRays::default());
    let fine = ShadowRays {
        max_rays: 0,
        strata: 16,
    };
    let their = |b: [usize; 2]| -> Vec<f64> {
        (0..64)
            .map(|j| {
                let p = reference.rgb()[(b[1] * 8 + j / 8) * 512 + b[0] * 8 + j % 8];
                p.iter().map(|v| f64::from(*v)).sum::<f64>() / 3.0
            })
            .collect()
    };
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let whole = 0.2260;
    let blocks: Vec<[usize; 2]> = (0..4096).map(|i| [i % 64, i / 64]).collect();
    let odd: Vec<[usize; 2]> = blocks
        .into_iter()
        .filter(|b| {
            let (o, t) = (
                mean(&shade(&stage, &rays, &camera, *b, 1)),
                mean(&their(*b)),
            );
            (o - t).abs() > 0.03 * t + 0.01 * whole
        })
        .collect();
    println!("{} odd at one sample", odd.len());
    for b in odd {
        let (o, t) = (shade(&stage, &rays, &camera, b, 8), their(b));
        let (mo, mt) = (mean(&o), mean(&t));
        if (mo - mt).abs() < 0.007 * mt + 0.001 * whole {
            continue;
        }
        let o = shade(&stage, &rays, &camera, b, 16);
        let l = shade(&stage, &lifted, &camera, b, 16);
        let f = shade(&stage, &fine, &camera, b, 4);
        println!(
            "block {b:?}: ours {:.5} theirs {mt:.5} = {:+.2} %; lifted {:+.2} %, fine {:+.2} %",
            mean(&o),
            100.0 * (mean(&o) - mt) / whole,
            100.0 * (mean(&l) - mt) / whole,
            100.0 * (mean(&f) - mt) / whole
        );
        let mut worst: Vec<(f64, usize)> = o
            .iter()
            .zip(&t)
            .map(|(a, b)| a - b)
            .enumerate()
            .map(|(i, d)| (d, i))
            .collect();
        worst.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
        for (_, i) in worst.iter().take(5) {
            println!(
                "   ({}, {}) ours {:.4} theirs {:.4} lifted {:.4}",
                b[0] * 8 + i % 8,
                b[1] * 8 + i / 8,
                o[*i],
                t[*i],
                l[*i]
            );
        }
    }
}
