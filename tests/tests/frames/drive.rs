//! A display in lockstep with a shader, without sockets.

use std::sync::Arc;

use protocol::messages::{Camera, SampleRequest};
use renderer::camera::View;
use renderer::config::Choices;
use renderer::frame::{Display, Received, Wanted};
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
        let rays = ShadowRays::default();
        let mut shader = Shader::new(&self.stage, &rays, 1);
        let mut display = Display::new(&self.loaded.scene, choices, first.width, first.height, 1);
        let mut wanted = Wanted::default();
        display.begin(first, 0);
        display.plan_first(samples, &mut wanted);
        // As numbered by a link: a view keeps its number while it lasts.
        let (mut asked_from, mut number) = ((*first, 0), 0);
        for (frame, view) in views.iter().enumerate() {
            if asked_from.0 != *view {
                number += 1;
            }
            let mut received = Vec::new();
            let batches = [(&wanted.here, asked_from), (&wanted.ahead, (*view, number))];
            for (requests, (from, asked)) in batches {
                let pinhole = Pinhole::new(&from.camera());
                received.extend(requests.iter().map(|request: &SampleRequest| Received {
                    view: asked,
                    epoch: 0,
                    sample: shader.shade(request.id, &pinhole.ray(request)),
                }));
            }
            asked_from = (*view, number);
            display.receive(&received, number);
            display.draw(view, number);
            look(frame, view, &display);
            let next = views.get(frame + 1);
            display.plan(samples, next, &mut wanted);
        }
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
