//! Where a picture is taken from: projection between world space and image space.

use glam::Vec3;
use protocol::messages::Camera;

/// A camera made ready for projecting.
///
/// Image space is in pixels, x right, y down, pixel (0, 0) covering [0, 1) x [0, 1). Depth is the distance along the
/// line of sight (not along the ray), metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// World position of the pinhole, metres.
    pub eye: Vec3,
    /// Unit line of sight, world space.
    pub forward: Vec3,
    /// Unit vector to the right in the image, world space.
    pub right: Vec3,
    /// Unit vector upwards in the image, world space.
    pub up: Vec3,
    /// Pixels a unit of slope: `x_px = width/2 + focal_px · (right·d)/(forward·d)`.
    pub focal_px: f32,
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    /// Vertical field of view, degrees.
    pub fov_y: f32,
}

impl View {
    /// Makes the camera ready. The camera must be valid: see [`Camera`].
    pub fn new(camera: &Camera) -> Self {
        let eye = Vec3::from(camera.eye);
        let forward = (Vec3::from(camera.target) - eye).normalize();
        let right = forward.cross(Vec3::from(camera.up)).normalize();
        let up = right.cross(forward);
        let half_height = (camera.fov_y.to_radians() * 0.5).tan();
        Self {
            eye,
            forward,
            right,
            up,
            focal_px: camera.height as f32 * 0.5 / half_height,
            width: camera.width,
            height: camera.height,
            fov_y: camera.fov_y,
        }
    }

    /// The camera to send to a shader server.
    pub fn camera(&self) -> Camera {
        Camera {
            eye: self.eye.into(),
            target: (self.eye + self.forward).into(),
            up: self.up.into(),
            fov_y: self.fov_y,
            width: self.width,
            height: self.height,
        }
    }

    /// World point to view space: (right, up, depth), metres.
    pub fn to_view(&self, world: Vec3) -> Vec3 {
        self.turn(world - self.eye)
    }

    /// World direction to view space: (right, up, depth), of the same length.
    pub fn turn(&self, direction: Vec3) -> Vec3 {
        let d = direction;
        Vec3::new(self.right.dot(d), self.up.dot(d), self.forward.dot(d))
    }

    /// View-space point to image space: (x px, y px). Depth must be positive.
    pub fn view_to_image(&self, view: Vec3) -> (f32, f32) {
        let s = self.focal_px / view.z;
        (
            self.width as f32 * 0.5 + view.x * s,
            self.height as f32 * 0.5 - view.y * s,
        )
    }

    /// World point to (x px, y px, depth m), or nothing where it lies in or behind the plane of the eye.
    pub fn project(&self, world: Vec3) -> Option<(f32, f32, f32)> {
        let v = self.to_view(world);
        if v.z > 0.0 {
            let (x, y) = self.view_to_image(v);
            Some((x, y, v.z))
        } else {
            None
        }
    }

    /// Direction of the ray through an image point, world space, with depth 1 (not a unit vector).
    pub fn direction(&self, x_px: f32, y_px: f32) -> Vec3 {
        let sx = (x_px - self.width as f32 * 0.5) / self.focal_px;
        let sy = (self.height as f32 * 0.5 - y_px) / self.focal_px;
        self.forward + self.right * sx + self.up * sy
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn projecting_a_ray_gives_back_its_pixel() {
        let view = View::new(&Camera {
            eye: [0.6, 4.6, 8.0],
            target: [0.0, 1.05, 0.0],
            up: [0.0, 1.0, 0.0],
            fov_y: 40.0,
            width: 640,
            height: 480,
        });
        for (x, y) in [(0.0, 0.0), (320.0, 240.0), (639.5, 12.25)] {
            let (px, py, depth) = view.project(view.eye + view.direction(x, y) * 7.0).unwrap();
            assert!((px - x).abs() < 1e-3 && (py - y).abs() < 1e-3 && (depth - 7.0).abs() < 1e-4);
        }
    }
}
