//! Time of every stage of a frame, on real frames: each scene's path at 512x512 with 2 % of the pixels sampled a frame.
//!
//! The samples of a stretch of the path are computed once and replayed, so that a run measures the display alone. Frames
//! are drawn whole, and only the stage asked for is counted: what the stages before it leave in the caches is as in use.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use protocol::messages::{Camera, SampleRequest};
use renderer::camera::View;
use renderer::config::Choices;
use renderer::frame::{Display, Received, Wanted};
use renderer::stats::{Stage, StageMs};
use renderer::tone::ToneMap;
use scenes::LoadedScene;
use shader_server::Shader;
use shader_server::camera::Pinhole;
use shader_server::shadows::ShadowRays;

const SIZE_PX: u32 = 512;
/// 2 % of the pixels.
const SAMPLES: usize = 5243;
const FRAMES: usize = 20;
const FPS: f32 = 30.0;
const SEED: u64 = 1;
const STAGES: [(&str, Stage); 12] = [
    ("drain", Stage::Drain),
    ("reproject", Stage::Reproject),
    ("depth", Stage::Depth),
    ("find_edges", Stage::FindEdges),
    ("rasterize", Stage::Rasterize),
    ("classify", Stage::Classify),
    ("reach", Stage::Reach),
    ("interpolate", Stage::Interpolate),
    ("complex", Stage::Complex),
    ("antialias", Stage::Antialias),
    ("present", Stage::Present),
    ("prioritize", Stage::Prioritize),
];

/// A stretch of a scene's path with the samples that each frame received.
struct Recording {
    scene: LoadedScene,
    samples: Vec<Vec<Received>>,
}

/// A display and the next frame it is to draw.
struct Playback<'a> {
    recording: &'a Recording,
    display: Display,
    wanted: Wanted,
    shown: Vec<u32>,
    frame: usize,
}

impl Recording {
    fn new(file: &Path) -> Self {
        let scene = scenes::load(file).expect("the project's own scenes load");
        let stage = shader_server::Stage::build(Arc::new(scene.scene.clone()))
            .expect("the project's own scenes can be traced");
        let rays = ShadowRays::default();
        let mut shader = Shader::new(&stage, &rays, SEED);
        let mut recording = Self {
            scene,
            samples: Vec::new(),
        };
        let mut samples = Vec::new();
        let mut playback = Playback::new(&recording);
        for frame in 0..FRAMES {
            let pinhole = Pinhole::new(&recording.view(frame).camera());
            let mut shade = |request: &SampleRequest| {
                let shaded = shader.shade(request.id, &pinhole.ray(request));
                Received {
                    view: frame as u32,
                    epoch: 0,
                    sample: shaded.sample,
                    texel: shaded.texel,
                }
            };
            let received: Vec<Received> = playback.wanted.here.iter().map(&mut shade).collect();
            playback.draw(&received);
            samples.push(received);
        }
        recording.samples = samples;
        recording
    }

    fn view(&self, frame: usize) -> View {
        let key = self.scene.paths[0].at_seconds(frame as f32 / FPS);
        let start = &self.scene.camera;
        View::new(&Camera {
            eye: key.eye,
            target: key.target,
            up: start.up,
            fov_y: start.fov_y,
            width: SIZE_PX,
            height: SIZE_PX,
        })
    }
}

impl<'a> Playback<'a> {
    fn new(recording: &'a Recording) -> Self {
        let scene = &recording.scene.scene;
        let mut display = Display::new(scene, Choices::default(), SIZE_PX, SIZE_PX, SEED);
        let mut wanted = Wanted::default();
        display.begin(&recording.view(0), 0);
        display.plan_first(SAMPLES, &mut wanted);
        Self {
            recording,
            display,
            wanted,
            shown: Vec::new(),
            frame: 0,
        }
    }

    /// Draws the next frame with these samples and plans the one after it.
    fn draw(&mut self, received: &[Received]) -> StageMs {
        let view = self.recording.view(self.frame);
        self.display.receive(received, 1);
        self.display.draw(&view, self.frame as u32);
        let shown = &mut self.shown;
        let tone = ToneMap::new();
        self.display
            .time_present(|d| tone.map(d.grid(), d.image(), shown));
        self.frame += 1;
        let next = self.recording.view(self.frame);
        self.display.plan(SAMPLES, Some(&next), &mut self.wanted);
        self.display.take_stats(self.frame).stage_ms
    }

    /// Replays the next recorded frame, from the start again after the last.
    fn replay(&mut self) -> StageMs {
        if self.frame == FRAMES {
            *self = Self::new(self.recording);
        }
        let recording = self.recording;
        self.draw(&recording.samples[self.frame])
    }
}

fn stages(criterion: &mut Criterion) {
    let folder = system_tests::places::checkout().join("scenes");
    for name in ["chains", "rooms"] {
        let recording = Recording::new(&folder.join(format!("{name}.toml")));
        let mut group = criterion.benchmark_group(format!("{name} {SIZE_PX}x{SIZE_PX}"));
        group.sample_size(10);
        group.warm_up_time(Duration::from_millis(300));
        group.measurement_time(Duration::from_secs(2));
        for (stage_name, stage) in STAGES {
            let mut playback = Playback::new(&recording);
            group.bench_function(stage_name, |bencher| {
                bencher.iter_custom(|frames| {
                    let ms: f64 = (0..frames).map(|_| *playback.replay().of(stage)).sum();
                    // A stage that a scene does not need takes no time at all, which criterion cannot divide by.
                    Duration::from_secs_f64(ms / 1e3).max(Duration::from_nanos(1))
                });
            });
        }
    }
}

criterion_group!(benches, stages);
criterion_main!(benches);
