//! What moves from frame to frame: the camera, objects and lights along the paths of a name.

use protocol::messages::{Camera, LightMove, ObjectMove};
use protocol::scene::Scene;
use scenes::{CameraPath, CameraSpec, Motion};

use super::{RenderError, Subject};
use crate::cli::RenderArgs;
use crate::frame::Edit;

/// Where everything is in each frame.
pub struct Flight<'a> {
    start: &'a CameraSpec,
    scene: &'a Scene,
    path: Option<&'a CameraPath>,
    motions: Vec<&'a Motion>,
    /// What moves, as it was told last.
    told: Edit,
    fps: f32,
    size: (u32, u32),
}

impl<'a> Flight<'a> {
    /// Follows all paths of a name; without a name, or without a path of the camera, the camera stands where the scene puts
    /// it.
    ///
    /// # Errors
    /// If the scene has no path of that name.
    pub fn new(subject: Subject<'a>, args: &RenderArgs) -> Result<Self, RenderError> {
        let name = args.path.as_deref();
        let path = subject.paths.iter().find(|p| Some(&*p.name) == name);
        let own = |m: &&Motion| Some(&*m.name) == name;
        let motions: Vec<&Motion> = subject.motions.iter().filter(own).collect();
        if let Some(name) = name.filter(|_| path.is_none() && motions.is_empty()) {
            return Err(RenderError::NoPath {
                name: name.to_owned(),
                known: known(&subject),
            });
        }
        let fps = if args.fps.is_finite() && args.fps > 0.0 {
            args.fps
        } else {
            30.0
        };
        let mut flight = Self {
            start: subject.camera,
            scene: subject.scene,
            path,
            motions,
            told: Edit::default(),
            fps,
            size: args.size,
        };
        flight.told = flight.at_rest();
        Ok(flight)
    }

    /// The camera of a frame.
    pub fn camera(&self, frame: usize) -> Camera {
        let start = self.start;
        let (eye, target) = match self.path {
            Some(path) => {
                let key = path.at_seconds(frame as f32 / self.fps);
                (key.eye, key.target)
            }
            None => (start.eye, start.target),
        };
        Camera {
            eye,
            target,
            up: start.up,
            fov_y: start.fov_y,
            width: self.size.0,
            height: self.size.1,
        }
    }

    /// What is not as it was the last time this was asked, or before the first time as in the scene: nothing if all is.
    pub fn edit(&mut self, frame: usize) -> Option<Edit> {
        let now = self.places(frame as f32 / self.fps);
        let edit = Edit {
            objects: changed(&now.objects, &self.told.objects),
            lights: changed(&now.lights, &self.told.lights),
        };
        self.told = now;
        (!edit.is_empty()).then_some(edit)
    }

    fn places(&self, seconds: f32) -> Edit {
        let mut all = Edit::default();
        for motion in &self.motions {
            motion.place(self.scene, seconds, &mut all.objects, &mut all.lights);
        }
        all
    }

    fn at_rest(&self) -> Edit {
        let mut all = self.places(0.0);
        for ObjectMove { object, transform } in &mut all.objects {
            *transform = self.scene.objects[*object as usize].transform;
        }
        for LightMove { light, value } in &mut all.lights {
            *value = self.scene.lights[*light as usize].clone();
        }
        all
    }
}

/// Those of `now` that differ from their partners of `before`.
fn changed<T: Clone + PartialEq>(now: &[T], before: &[T]) -> Vec<T> {
    let pairs = now.iter().zip(before);
    pairs
        .filter(|(a, b)| a != b)
        .map(|(a, _)| a.clone())
        .collect()
}

/// Names of all paths, each once.
fn known(subject: &Subject<'_>) -> String {
    let cameras = subject.paths.iter().map(|p| p.name.as_str());
    let motions = subject.motions.iter().map(|m| m.name.as_str());
    let mut names: Vec<&str> = Vec::new();
    for name in cameras.chain(motions) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    if names.is_empty() {
        "none".to_owned()
    } else {
        names.join(", ")
    }
}
