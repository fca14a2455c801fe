//! A display in lockstep with a shader, without sockets.

use std::sync::Arc;

use protocol::messages::{Camera, SampleRequest, Triple};
use renderer::camera::View;
use renderer::config::Choices;
use renderer::frame::{Display, Edit, Received, Wanted};
use scenes::LoadedScene;
use shader_server::camera::Pinhole;
use shader_server::shadows::ShadowRays;
use shader_server::{Shader, Stage};

/// A scene from the text of its file.
pub(crate) fn scene(text: &str) -> LoadedScene {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("scene.toml");
    std::fs::write(&file, text).expect("a scene file");
    scenes::load(&file).expect("a scene")
}

/// A scene with its trees.
pub(crate) struct Theatre {
    pub(crate) loaded: LoadedScene,
    pub(crate) stage: Stage,
}

impl Theatre {
    pub(crate) fn new(text: &str) -> Self {
        let loaded = scene(text);
        let stage = Stage::build(Arc::new(loaded.scene.clone())).expect("a stage");
        Self { loaded, stage }
    }

    /// Draws as many frames as there are views, shading up to `samples` a frame, and shows each to `look`.
    pub(crate) fn play(
        &self,
        choices: Choices,
        samples: usize,
        views: &[View],
        mut look: impl FnMut(usize, &View, &Display),
    ) {
        let Some(first) = views.first() else { return };
        let display = Display::new(&self.loaded.scene, choices, first.width, first.height, 1);
        let mut run = Run::new(self.stage.clone(), display, samples, first);
        for (frame, view) in views.iter().enumerate() {
            run.draw(view);
            look(frame, view, &run.display);
            run.plan(views.get(frame + 1));
        }
    }
}

/// A display on its way.
pub(crate) struct Run {
    stage: Stage,
    pub(crate) display: Display,
    wanted: Wanted,
    samples: usize,
    /// As numbered by a link: a view keeps its number while it lasts.
    asked_from: (View, u32),
    number: u32,
    epoch: u32,
    /// Samples of the last frame.
    pub(crate) received: Vec<Received>,
    /// Light, blocker and receiver triples that they met.
    pub(crate) triples: Vec<Triple>,
}

impl Run {
    /// Ready for a first frame with up to `samples` samples, as all others have.
    pub(crate) fn new(stage: Stage, mut display: Display, samples: usize, first: &View) -> Self {
        let mut wanted = Wanted::default();
        display.begin(first, 0);
        display.plan_first(samples, &mut wanted);
        Self {
            stage,
            display,
            wanted,
            samples,
            asked_from: (*first, 0),
            number: 0,
            epoch: 0,
            received: Vec::new(),
            triples: Vec::new(),
        }
    }

    /// Shades what was planned and draws the frame.
    pub(crate) fn draw(&mut self, view: &View) {
        if self.asked_from.0 != *view {
            self.number += 1;
        }
        let rays = ShadowRays::default();
        let mut shader = Shader::new(&self.stage, &rays, 1);
        self.received.clear();
        let batches = [
            (&self.wanted.here, self.asked_from),
            (&self.wanted.ahead, (*view, self.number)),
        ];
        for (requests, (from, asked)) in batches {
            let pinhole = Pinhole::new(&from.camera());
            let shaded = requests.iter().map(|request: &SampleRequest| {
                let shaded = shader.shade(request.id, &pinhole.ray(request));
                Received {
                    view: asked,
                    epoch: self.epoch,
                    sample: shaded.sample,
                    texel: shaded.texel,
                }
            });
            self.received.extend(shaded);
        }
        self.triples = shader.take_triples();
        self.triples.sort_unstable();
        self.asked_from = (*view, self.number);
        self.display.learn(&self.triples);
        self.display.update_shadows(true);
        self.display.receive(&self.received, self.number);
        self.display.draw(view, self.number);
    }

    /// Chooses the samples of the next frame, which may have another view.
    pub(crate) fn plan(&mut self, next: Option<&View>) {
        self.display.plan(self.samples, next, &mut self.wanted);
    }

    /// Moves something before the samples of the next frame are chosen.
    pub(crate) fn edit(&mut self, edit: &Edit) {
        self.stage = self
            .stage
            .edited(&edit.objects, &edit.lights)
            .expect("a lawful edit");
        self.epoch += 1;
        self.display.edit(self.epoch, edit);
    }
}

/// A view of `size_px` from `eye` to `target`.
pub(crate) fn view(size_px: [u32; 2], eye: [f32; 3], target: [f32; 3], fov_y: f32) -> View {
    View::new(&Camera {
        eye,
        target,
        up: [0.0, 1.0, 0.0],
        fov_y,
        width: size_px[0],
        height: size_px[1],
    })
}
