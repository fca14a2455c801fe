//! Rays through a view.

use glam::DVec3;
use protocol::messages::{Camera, SampleRequest};
use rays::Ray;

/// A camera's frame, computed once a view.
#[derive(Clone, Copy, Debug)]
pub struct Pinhole {
    eye: glam::Vec3,
    forward: DVec3,
    right: DVec3,
    up: DVec3,
    width: f64,
    height: f64,
}

impl Pinhole {
    /// Prepares `camera`, whose values must be those that the protocol allows.
    #[must_use]
    pub fn new(camera: &Camera) -> Self {
        let vector = |v: [f32; 3]| glam::Vec3::from(v).as_dvec3();
        let forward = (vector(camera.target) - vector(camera.eye)).normalize_or_zero();
        let right = forward.cross(vector(camera.up)).normalize_or_zero();
        let (width, height) = (f64::from(camera.width), f64::from(camera.height));
        let slope = (f64::from(camera.fov_y).to_radians() / 2.).tan();
        Self {
            eye: camera.eye.into(),
            forward,
            right: right * slope * width / height,
            up: right.cross(forward) * slope,
            width,
            height,
        }
    }

    /// Width of a pixel in the middle of the image a metre away, metres.
    #[must_use]
    pub fn pixel_slope(&self) -> f64 {
        2. * self.up.length() / self.height
    }

    /// The ray through a request's place in the image, with a unit direction.
    #[must_use]
    pub fn ray(&self, request: &SampleRequest) -> Ray {
        let x = f64::from(request.x) + f64::from(request.offset[0]);
        let y = f64::from(request.y) + f64::from(request.offset[1]);
        let direction = self.forward
            + self.right * (2. * x / self.width - 1.)
            + self.up * (1. - 2. * y / self.height);
        Ray {
            origin: self.eye,
            direction: direction.normalize_or_zero().as_vec3(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_and_centre_are_where_the_protocol_says() {
        let camera = Camera {
            eye: [0., 0., 4.],
            target: [0., 0., 0.],
            up: [0., 1., 0.],
            fov_y: 90.,
            width: 200,
            height: 100,
        };
        let pinhole = Pinhole::new(&camera);
        let through = |x: u16, y: u16| {
            let ray = pinhole.ray(&SampleRequest {
                id: 0,
                x,
                y,
                offset: [0.; 2],
            });
            assert_eq!(ray.origin, glam::vec3(0., 0., 4.));
            ray.direction
        };
        assert!(through(100, 50).abs_diff_eq(-glam::Vec3::Z, 1e-7));
        assert!(through(0, 0).abs_diff_eq(glam::vec3(-2., 1., -1.).normalize(), 1e-7));
        assert!(through(200, 100).abs_diff_eq(glam::vec3(2., -1., -1.).normalize(), 1e-7));
    }
}
