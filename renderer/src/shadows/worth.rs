//! Which shadow edges are worth drawing ("identify the perceptually important discontinuities", the paper's future work).
//!
//! A barrier keeps samples on its two sides apart. Along a hard shadow that is right; in a wide penumbra it cuts a smooth
//! ramp into strips with too few samples each, and makes the picture worse. So an edge is drawn only where its penumbra is
//! narrow on screen, and only if its light can change what the display shows there by a step at all.

use glam::Vec3;
use protocol::scene::Light;
use serde::Serialize;
use smallvec::{SmallVec, smallvec};

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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
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

    /// All of them.
    pub fn all(&self) -> usize {
        self.drawn + self.wide + self.dim
    }
}

impl std::iter::Sum for Tally {
    fn sum<I: Iterator<Item = Self>>(tallies: I) -> Self {
        tallies.fold(Self::default(), |a, b| Self {
            drawn: a.drawn + b.drawn,
            wide: a.wide + b.wide,
            dim: a.dim + b.dim,
        })
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
        let (points, intensity): (SmallVec<[Vec3; 8]>, f32) = match light {
            Light::Point {
                position,
                intensity,
            } => (smallvec![Vec3::from(*position)], strongest(intensity)),
            Light::Linear {
                from,
                to,
                intensity,
            } => {
                let (from, to) = (Vec3::from(*from), Vec3::from(*to));
                (
                    smallvec![from, to],
                    strongest(intensity) * from.distance(to),
                )
            }
            Light::Area { vertices, radiance } => {
                let points: SmallVec<[Vec3; 8]> = vertices.iter().map(|v| Vec3::from(*v)).collect();
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
        let nearest = (nearest_distance(self.middle, from, to) - 0.5 * self.extent).max(0.0);
        // The most that the light can add, over black, where encoding is steepest. Against a light it is not a number.
        let most = self.white / (nearest * nearest);
        if srgb(most.min(1.0)) * 255.0 < self.worth.steps {
            return Verdict::Dim;
        }
        let middle = 0.5 * (from + to);
        let depth = view.to_view(middle).z.max(f32::MIN_POSITIVE);
        let beyond = (0.5 * (edge.t[0] + edge.t[1]) - 1.0).max(0.0) as f32;
        let width_px = self.extent * beyond * view.focal_px / depth;
        if width_px > self.worth.width_px {
            return Verdict::Wide;
        }
        Verdict::Drawn
    }
}

/// Distance of a point from a segment.
fn nearest_distance(point: Vec3, from: Vec3, to: Vec3) -> f32 {
    let along = to - from;
    let share = (point - from).dot(along) / along.length_squared();
    let share = if share.is_finite() {
        share.clamp(0.0, 1.0)
    } else {
        0.0
    };
    (from + along * share).distance(point)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shadows::wedge::EventKind;
    use protocol::messages::Camera;

    /// 100 px a metre at the origin.
    fn view() -> View {
        let half: f32 = 0.5 * 64.0 / 1000.0;
        View::new(&Camera {
            eye: [0.0, 0.0, 10.0],
            target: [0.0; 3],
            up: [0.0, 1.0, 0.0],
            fov_y: 2.0 * half.atan().to_degrees(),
            width: 64,
            height: 64,
        })
    }

    fn edge(from: [f64; 3], to: [f64; 3], t: [f64; 2]) -> ShadowEdge {
        ShadowEdge {
            from: from.into(),
            to: to.into(),
            s: [0.0, 1.0],
            t,
            receiver: 0,
            face: 0,
            kind: EventKind::Hard,
        }
    }

    const WORTH: Worth = Worth {
        width_px: 8.0,
        steps: 1.0,
    };

    fn area(side: f32, radiance: f32) -> Light {
        let h = 0.5 * side;
        let vertices = [[-h, -h], [h, -h], [h, h], [-h, h]].map(|[x, z]| [x, 5.0, z]);
        Light::Area {
            vertices: vertices.to_vec(),
            radiance: [0.0, radiance, 0.0],
        }
    }

    #[test]
    fn wide_penumbrae_are_left_out_and_contacts_are_not() {
        let (view, ends) = (view(), ([-0.1, 0.0, 0.0], [0.1, 0.0, 0.0]));
        assert!((view.focal_px - 1000.0).abs() < 0.5);
        let verdict = |side: f32, t: f64| {
            let judge = Judge::new(&area(side, 100.0 / (side * side)), WORTH);
            judge.judge(&view, &edge(ends.0, ends.1, [t, t]))
        };
        // A square of side a is 1.414 a across: 100 px a metre times that times t - 1.
        assert_eq!(verdict(1.0, 1.0), Verdict::Drawn);
        assert_eq!(verdict(1.0, 1.05), Verdict::Drawn);
        assert_eq!(verdict(1.0, 1.06), Verdict::Wide);
        assert_eq!(verdict(0.1, 1.5), Verdict::Drawn);
        assert_eq!(verdict(0.1, 1.6), Verdict::Wide);
        let all = Judge::new(&area(4.0, 1.0), Worth::ALL);
        let wide = edge(ends.0, ends.1, [3.0; 2]);
        assert_eq!(all.judge(&view, &wide), Verdict::Drawn);
    }

    #[test]
    fn what_is_too_dim_is_so_everywhere_on_the_edge() {
        let view = view();
        // As much as a white surface needs for a step at 1 m.
        let step = 1.0 / (255.0 * 12.92);
        let light = |intensity: f32| Light::Point {
            position: [0.0; 3],
            intensity: [intensity * std::f32::consts::PI, 0.0, 0.0],
        };
        let long = edge([1.0, -9.0, 0.0], [1.0, 20.0, 0.0], [1.0; 2]);
        let far = edge([1.0, 9.0, 0.0], [1.0, 20.0, 0.0], [1.0; 2]);
        let verdict = |intensity: f32, edge: &ShadowEdge| {
            Judge::new(&light(intensity * step), WORTH).judge(&view, edge)
        };
        assert_eq!(verdict(0.99, &long), Verdict::Dim);
        assert_eq!(verdict(1.01, &long), Verdict::Drawn);
        assert_eq!(verdict(1.01, &far), Verdict::Dim);
        assert_eq!(verdict(83.0, &far), Verdict::Drawn);
        // A light is as near as its nearest corner can be, and lights where it touches.
        let near = edge([0.0, 4.0, 0.0], [0.0, 4.0, 0.1], [1.0; 2]);
        let weak = Judge::new(&area(2.0, 1e-9), WORTH);
        assert_eq!(weak.judge(&view, &near), Verdict::Drawn);
        let point = edge([0.0; 3], [0.0; 3], [1.0; 2]);
        assert_eq!(verdict(1e-9, &point), Verdict::Drawn);
    }

    #[test]
    fn tallies_add_up() {
        let mut tally = Tally::default();
        for verdict in [Verdict::Drawn, Verdict::Wide, Verdict::Dim, Verdict::Dim] {
            tally.count(verdict);
        }
        assert_eq!((tally.drawn, tally.wide, tally.dim), (1, 1, 2));
        let sum: Tally = [tally, tally].into_iter().sum();
        assert_eq!((sum.all(), sum.dim), (8, 4));
    }
}
