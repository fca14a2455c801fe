//! Which shadow edges are worth drawing ("identify the perceptually important discontinuities", the paper's future work).
//!
//! A barrier keeps samples on its two sides apart. Along a hard shadow that is right; in a wide penumbra it cuts a smooth
//! ramp into strips with too few samples each, and makes the picture worse. So an edge is drawn only where its penumbra is
//! narrow on screen, and only if its light can change what the display shows there by a step at all.

use glam::Vec3;
use protocol::scene::Light;

use super::cast::ShadowEdge;
use crate::camera::View;
use crate::tone::srgb;

/// What is asked of an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Worth {
    /// Greatest width of the penumbra, pixels.
    pub width_px: f32,
    /// Least change of the picture, steps of the display (1/255).
    pub steps: f32,
}

impl Worth {
    /// Everything is worth drawing: the paper's way.
    pub const ALL: Self = Self {
        width_px: f32::INFINITY,
        steps: 0.0,
    };
}

/// What became of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Drawn.
    Drawn,
    /// Its penumbra is too wide on screen.
    Wide,
    /// Its light is too weak there.
    Dim,
}

/// How many edges were drawn and why the others were not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Drawn.
    pub drawn: usize,
    /// Left out for the width of their penumbra.
    pub wide: usize,
    /// Left out since their light changes nothing that the display shows.
    pub dim: usize,
}

impl Tally {
    /// Counts one more.
    pub fn count(&mut self, verdict: Verdict) {
        match verdict {
            Verdict::Drawn => self.drawn += 1,
            Verdict::Wide => self.wide += 1,
            Verdict::Dim => self.dim += 1,
        }
    }
}

/// A light as edges are judged by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judge {
    worth: Worth,
    /// Middle of the light, world space, metres.
    middle: Vec3,
    /// Greatest distance of two of its points, metres.
    extent: f32,
    /// Greatest radiance, W/(m² sr), of a white surface at 1 m that it lights from straight above.
    white: f32,
}

impl Judge {
    /// For the edges of a light.
    pub fn new(light: &Light, worth: Worth) -> Self {
        let strongest = |rgb: &[f32; 3]| rgb.iter().fold(0.0f32, |a, b| a.max(*b));
        let (points, intensity): (Vec<Vec3>, f32) = match light {
            Light::Point {
                position,
                intensity,
            } => (vec![Vec3::from(*position)], strongest(intensity)),
            Light::Linear {
                from,
                to,
                intensity,
            } => {
                let (from, to) = (Vec3::from(*from), Vec3::from(*to));
                (vec![from, to], strongest(intensity) * from.distance(to))
            }
            Light::Area { vertices, radiance } => {
                let points: Vec<Vec3> = vertices.iter().map(|v| Vec3::from(*v)).collect();
                let first = points.first().copied().unwrap_or_default();
                let cross = |w: &[Vec3]| (w[0] - first).cross(w[1] - first);
                let area = 0.5 * points.windows(2).map(cross).sum::<Vec3>().length();
                (points, strongest(radiance) * area)
            }
        };
        let middle = points.iter().sum::<Vec3>() / points.len().max(1) as f32;
        let pairs = points.iter().enumerate();
        let distances = pairs.flat_map(|(i, a)| points[i + 1..].iter().map(|b| a.distance(*b)));
        Self {
            worth,
            middle,
            extent: distances.fold(0.0, f32::max),
            white: intensity * std::f32::consts::FRAC_1_PI,
        }
    }

    /// Whether an edge is worth drawing in a view.
    pub fn judge(&self, view: &View, edge: &ShadowEdge) -> Verdict {
        let (from, to) = (edge.from.as_vec3(), edge.to.as_vec3());
        let middle = 0.5 * (from + to);
        let distance2 = (middle - self.middle).length_squared();
        // The most that the light can add, over black, where encoding is steepest.
        if srgb((self.white / distance2).min(1.0)) * 255.0 < self.worth.steps {
            return Verdict::Dim;
        }
        let depth = view.to_view(middle).z.max(f32::MIN_POSITIVE);
        let beyond = (0.5 * (edge.t[0] + edge.t[1]) - 1.0).max(0.0) as f32;
        let width_px = self.extent * beyond * view.focal_px / depth;
        if width_px > self.worth.width_px {
            return Verdict::Wide;
        }
        Verdict::Drawn
    }
}
