//! The camera as a person moves it. Knows nothing of windows: it is told what is held, dragged and turned, and gives poses.

use glam::{Quat, Vec3};
use protocol::messages::Camera;
use protocol::scene::Scene;
use scenes::{CameraPath, CameraSpec};

/// Radians that a drag over the height of the window turns.
const TURN_A_HEIGHT: f32 = std::f32::consts::PI;
/// Radians a second that the arrow keys turn.
const TURN_A_SECOND: f32 = 1.2;
/// Share of the distance to the target that a second of flight covers.
const FLY_A_SECOND: f32 = 0.6;
/// How much faster flight is with shift.
const FAST: f32 = 4.0;
/// Factor of the distance to the target that one notch of the wheel leaves.
const DOLLY: f32 = 0.88;
/// Least angle between the line of sight and the vertical, radians.
const LEAST_TILT: f32 = 0.02;
/// Longest time a single frame may move the camera for, seconds: a stall must not become a leap.
const LONGEST_STEP_S: f32 = 0.1;

/// Where the camera stands, world space, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pose {
    /// The pinhole.
    pub(super) eye: Vec3,
    /// The point in the middle of the picture, round which it orbits.
    pub(super) target: Vec3,
}

/// What can be held down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Held {
    Forward,
    Back,
    Left,
    Right,
    Up,
    Down,
    LookLeft,
    LookRight,
    LookUp,
    LookDown,
    /// Moves faster.
    Fast,
}

/// What a drag of the mouse does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Drag {
    /// Turns round the target.
    Orbit,
    /// Moves sideways, so that the target's plane stays under the pointer.
    Pan,
}

/// The state of what moves the camera.
#[derive(Clone, Debug)]
pub(super) struct Controller {
    home: Pose,
    up: Vec3,
    fov_y: f32,
    extent: f32,
    pose: Pose,
    before: Pose,
    step_s: f32,
    held: u16,
    drag: Option<Drag>,
    path: Option<CameraPath>,
    playing: Option<f32>,
}

impl Controller {
    /// At the scene's camera; `extent` is the size of the scene, metres; `path` is what can be played.
    pub(super) fn new(camera: &CameraSpec, extent: f32, path: Option<CameraPath>) -> Self {
        let home = Pose {
            eye: camera.eye.into(),
            target: camera.target.into(),
        };
        let distance = (home.target - home.eye).length();
        Self {
            home,
            up: Vec3::from(camera.up).normalize_or(Vec3::Y),
            fov_y: camera.fov_y,
            extent: if extent.is_finite() && extent > 0.0 {
                extent
            } else {
                distance.max(1.0)
            },
            pose: home,
            before: home,
            step_s: 0.0,
            held: 0,
            drag: None,
            path,
            playing: None,
        }
    }

    /// A key went down.
    pub(super) fn press(&mut self, held: Held) {
        self.held |= 1 << held as u16;
        if held != Held::Fast {
            self.playing = None;
        }
    }

    /// A key went up.
    pub(super) fn release(&mut self, held: Held) {
        self.held &= !(1 << held as u16);
    }

    /// Nothing is held any more: the window lost the keyboard.
    pub(super) fn release_all(&mut self) {
        self.held = 0;
        self.drag = None;
    }

    /// A mouse button went down.
    pub(super) fn grab(&mut self, drag: Drag) {
        self.drag = Some(drag);
    }

    /// It went up.
    pub(super) fn let_go(&mut self, drag: Drag) {
        if self.drag == Some(drag) {
            self.drag = None;
        }
    }

    /// The mouse moved, pixels, x right and y down, in a window this high.
    pub(super) fn drag(&mut self, dx_px: f32, dy_px: f32, height_px: f32) {
        let Some(drag) = self.drag else { return };
        if !(dx_px.is_finite() && dy_px.is_finite() && height_px >= 1.0) {
            return;
        }
        self.playing = None;
        let (dx, dy) = (dx_px / height_px, dy_px / height_px);
        match drag {
            Drag::Orbit => {
                let offset = self.pose.eye - self.pose.target;
                let turned = self.turned(offset, -dx * TURN_A_HEIGHT, dy * TURN_A_HEIGHT);
                self.pose.eye = self.pose.target + turned;
            }
            Drag::Pan => {
                let sight = self.pose.target - self.pose.eye;
                let height = 2.0 * sight.length() * (self.fov_y.to_radians() * 0.5).tan();
                let right = self.right();
                let up = right.cross(sight).normalize_or(self.up);
                self.shift((right * -dx + up * dy) * height);
            }
        }
    }

    /// The wheel turned by so many notches, away from the person positive.
    pub(super) fn wheel(&mut self, notches: f32) {
        if !notches.is_finite() {
            return;
        }
        self.playing = None;
        let offset = self.pose.eye - self.pose.target;
        let distance = offset.length() * DOLLY.powf(notches.clamp(-20.0, 20.0));
        let distance = distance.clamp(self.extent * 1e-4, self.extent * 100.0);
        self.pose.eye = self.pose.target + offset.normalize_or(Vec3::Z) * distance;
    }

    /// Back to the scene's camera.
    pub(super) fn go_home(&mut self) {
        self.playing = None;
        (self.pose, self.before) = (self.home, self.home);
    }

    /// Starts or stops the scene's path; false if there is none.
    pub(super) fn toggle_path(&mut self) -> bool {
        self.playing = match self.playing {
            Some(_) => None,
            None => self.path.as_ref().map(|_| 0.0),
        };
        self.path.is_some()
    }

    /// Moves on by this much time; true if the camera is in another place than after the last call.
    pub(super) fn advance(&mut self, seconds: f32) -> bool {
        let seconds = seconds.clamp(0.0, LONGEST_STEP_S);
        if let (Some(before), Some(path)) = (self.playing, &self.path) {
            let time = before + seconds;
            let key = path.at_seconds(time);
            let pose = Pose {
                eye: key.eye.into(),
                target: key.target.into(),
            };
            self.playing = (!path.open || time < path.seconds).then_some(time);
            if self.can_look(&pose) {
                self.pose = pose;
            }
        } else {
            self.fly(seconds);
        }
        let moved = self.pose != self.before;
        self.step_s = seconds;
        moved
    }

    /// Says that the pose has been drawn: the next one's motion counts from it.
    pub(super) fn drawn(&mut self) {
        self.before = self.pose;
    }

    /// Whether time alone moves the camera.
    pub(super) fn moving(&self) -> bool {
        self.playing.is_some() || self.held & !(1 << Held::Fast as u16) != 0
    }

    /// Whether the path is being played.
    pub(super) fn playing(&self) -> bool {
        self.playing.is_some()
    }

    /// Where it stands.
    pub(super) fn pose(&self) -> Pose {
        self.pose
    }

    /// The camera for a picture of this size.
    pub(super) fn camera(&self, width: u32, height: u32) -> Camera {
        self.camera_at(&self.pose, width, height)
    }

    /// Where it will be if the motion since the pose that was drawn last goes on for another frame; nothing if it stands.
    pub(super) fn predicted(&self, width: u32, height: u32) -> Option<Camera> {
        let pose = Pose {
            eye: 2.0 * self.pose.eye - self.before.eye,
            target: 2.0 * self.pose.target - self.before.target,
        };
        // A camera that was moved by hand and is let go stands.
        let goes_on = self.moving() || self.drag.is_some();
        (goes_on && self.pose != self.before && self.can_look(&pose))
            .then(|| self.camera_at(&pose, width, height))
    }

    fn camera_at(&self, pose: &Pose, width: u32, height: u32) -> Camera {
        Camera {
            eye: pose.eye.into(),
            target: pose.target.into(),
            up: self.up.into(),
            fov_y: self.fov_y,
            width,
            height,
        }
    }

    fn can_look(&self, pose: &Pose) -> bool {
        let sight = pose.target - pose.eye;
        let length = sight.length();
        length.is_finite() && length > 1e-6 && sight.cross(self.up).length() > 1e-3 * length
    }

    fn is_held(&self, held: Held) -> bool {
        self.held >> held as u16 & 1 == 1
    }

    fn along(&self, plus: Held, minus: Held) -> f32 {
        f32::from(u8::from(self.is_held(plus))) - f32::from(u8::from(self.is_held(minus)))
    }

    fn fly(&mut self, seconds: f32) {
        let sight = self.pose.target - self.pose.eye;
        let look = [
            self.along(Held::LookLeft, Held::LookRight),
            self.along(Held::LookUp, Held::LookDown),
        ];
        if look != [0.0; 2] {
            let [yaw, pitch] = look.map(|l| l * TURN_A_SECOND * seconds);
            self.pose.target = self.pose.eye + self.turned(sight, yaw, pitch);
        }
        let sight = self.pose.target - self.pose.eye;
        let direction = sight.normalize_or(Vec3::NEG_Z) * self.along(Held::Forward, Held::Back)
            + self.right() * self.along(Held::Right, Held::Left)
            + self.up * self.along(Held::Up, Held::Down);
        if direction == Vec3::ZERO {
            return;
        }
        let reach = sight.length().clamp(self.extent * 0.02, self.extent * 2.0);
        let hurry = if self.is_held(Held::Fast) { FAST } else { 1.0 };
        self.shift(direction.normalize_or(Vec3::ZERO) * (reach * FLY_A_SECOND * hurry * seconds));
    }

    fn shift(&mut self, by: Vec3) {
        let limit = self.extent * 1e3;
        if by.is_finite() && (self.pose.eye + by - self.home.eye).length() <= limit {
            self.pose.eye += by;
            self.pose.target += by;
        }
    }

    fn right(&self) -> Vec3 {
        (self.pose.target - self.pose.eye)
            .cross(self.up)
            .normalize_or(self.up.any_orthonormal_vector())
    }

    /// A vector turned about the vertical and then towards it, but never quite into it.
    fn turned(&self, v: Vec3, yaw: f32, pitch: f32) -> Vec3 {
        let v = Quat::from_axis_angle(self.up, yaw) * v;
        let tilt = v.angle_between(self.up);
        let most = std::f32::consts::PI - LEAST_TILT;
        let wanted = (tilt - pitch).clamp(LEAST_TILT, most);
        let axis = self.up.cross(v).normalize_or_zero();
        if axis == Vec3::ZERO {
            return v;
        }
        Quat::from_axis_angle(axis, wanted - tilt) * v
    }
}

/// Length of the diagonal of the box round all objects, metres; 0 if there are none.
pub(super) fn extent(scene: &Scene) -> f32 {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for object in &scene.objects {
        let Some(mesh) = scene.meshes.get(object.mesh as usize) else {
            continue;
        };
        let [x, y, z] = object.transform;
        for p in &mesh.positions {
            let row = |r: [f32; 4]| r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3];
            let world = Vec3::new(row(x), row(y), row(z));
            if world.is_finite() {
                (low, high) = (low.min(world), high.max(world));
            }
        }
    }
    if low.x <= high.x {
        (high - low).length()
    } else {
        0.0
    }
}

#[cfg(test)]
#[path = "controller_tests.rs"]
mod tests;
