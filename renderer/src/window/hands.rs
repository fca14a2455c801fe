//! What a person does to the scene: drags, undoes, plays paths of objects and lights.

use std::sync::Arc;

use glam::Vec3;
use protocol::messages::Camera;
use protocol::scene::Scene;
use winit::keyboard::ModifiersState;

use super::grab::{Grab, Plane};
use super::moves::Moves;
use super::session::Session;
use crate::camera::View;
use crate::frame::{Edit, Thing};
use crate::servers::ServersError;

/// Drags that can be undone, at most.
const REMEMBERED: usize = 256;

/// Longest time between two frames that a path goes on by, seconds: a stall must not become a leap.
const LONGEST_STEP_S: f32 = 0.1;

/// Whatever moves things.
pub(super) struct Hands {
    scene: Arc<Scene>,
    up: Vec3,
    moves: Moves,
    held: Option<Grab>,
    undo: Vec<Edit>,
}

impl Hands {
    /// `up` is the world direction that is up.
    pub(super) fn new(scene: &Arc<Scene>, up: Vec3, moves: Moves) -> Self {
        Self {
            scene: Arc::clone(scene),
            up: up.normalize_or(Vec3::Y),
            moves,
            held: None,
            undo: Vec::new(),
        }
    }

    /// Takes hold of what is under the pointer, px; false if nothing is.
    pub(super) fn take(&mut self, session: &Session, pointer: Option<(f64, f64)>) -> bool {
        self.held = pointer.and_then(|(x, y)| session.grab((x as f32, y as f32)));
        if let Some(grab) = &self.held {
            if self.undo.len() == REMEMBERED {
                self.undo.remove(0);
            }
            self.undo.push(grab.before().clone());
        }
        self.held.is_some()
    }

    /// Leaves what is held where it is.
    pub(super) fn let_go(&mut self) {
        self.held = None;
    }

    /// Whether something is held.
    pub(super) fn holding(&self) -> bool {
        self.held.is_some()
    }

    /// Whether time alone moves something.
    pub(super) fn playing(&self) -> bool {
        self.moves.playing().is_some()
    }

    /// Moves what is held or played to where it is to be in the frame of this camera: one edit a frame, however often the
    /// pointer moved. Level with control.
    ///
    /// # Errors
    /// If such a place is not allowed; everything stays.
    pub(super) fn work(
        &mut self,
        session: &mut Session,
        camera: &Camera,
        pointer: Option<(f64, f64)>,
        modifiers: ModifiersState,
        seconds: f32,
    ) -> Result<(), ServersError> {
        let mut edit = self.moves.advance(seconds.clamp(0.0, LONGEST_STEP_S));
        if let (Some(grab), Some((x, y))) = (&self.held, pointer) {
            let plane = if modifiers.control_key() {
                Plane::Ground
            } else {
                Plane::Screen
            };
            let view = View::new(camera);
            if let Some(drag) = grab.to(&view, (x as f32, y as f32), plane, self.up) {
                edit.objects.extend(drag.objects);
                edit.lights.extend(drag.lights);
            }
        }
        session.move_to(&edit)
    }

    /// Undoes the last drag; says so if there is none.
    pub(super) fn undo(
        &mut self,
        session: &mut Session,
    ) -> Result<Option<&'static str>, ServersError> {
        self.held = None;
        match self.undo.pop() {
            Some(edit) => session.move_to(&edit).map(|()| None),
            None => Ok(Some("nothing has been moved")),
        }
    }

    /// Plays the next name's paths; says so if there are none.
    pub(super) fn play_next(
        &mut self,
        session: &mut Session,
    ) -> Result<Option<&'static str>, ServersError> {
        if self.moves.is_empty() {
            return Ok(Some("the scene has no path of an object or a light"));
        }
        let back = self.moves.play_next();
        session.move_to(&back).map(|()| None)
    }

    /// What is held and played, for the status line.
    pub(super) fn status(&self) -> Vec<String> {
        let held = self.held.as_ref().map(|grab| match grab.thing() {
            Thing::Object(i) => match self.scene.objects.get(i as usize) {
                Some(object) => format!("moving {}", object.name),
                None => "moving an object".into(),
            },
            Thing::Light(i) => format!("moving light {i}"),
        });
        let playing = self.moves.playing().map(|name| format!("playing {name}"));
        held.into_iter().chain(playing).collect()
    }
}
