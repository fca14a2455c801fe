//! Which shadow edges are worth drawing ("identify the perceptually important discontinuities", the paper's future work).
//!
//! A barrier keeps samples on its two sides apart. Along a hard shadow that is right; in a wide penumbra it cuts a smooth
//! ramp into strips with too few samples each, and makes the picture worse. So an edge is drawn only where its penumbra is
//! narrow on screen, and only if its light can change what the display shows there by a step at all: altogether, and within
//! the neighbourhood of pixels that lend each other colour. A penumbra may be narrow at one end of an edge, as at a
//! contact, and wide at the other: then a part of the edge is drawn.

use glam::{Vec3, Vec3Swizzles};
use protocol::scene::Light;
use serde::Serialize;

use super::cast::ShadowEdge;
use super::grade::Grade;
use crate::camera::View;
use crate::tone::linear;

/// Side of the neighbourhood whose samples lend a pixel colour (paper section 5.2), pixels.
const NEIGHBOURHOOD_PX: f32 = 5.0;

/// Ends nearer to the plane of the eye than this share of the other end's depth are cut off before they are judged.
const NEAR: f32 = 1e-3;

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
    /// Drawn, or a part of it.
    Drawn,
    /// Its penumbra is too wide on screen.
    Wide,
    /// Its light is too weak there.
    Dim,
    /// Its penumbra is so wide that a pixel's neighbourhood hardly changes across it.
    Faint,
}

/// How many edges were drawn and why the others were not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Tally {
    /// Drawn, all of each or a part.
    pub drawn: usize,
    /// Left out for the width of their penumbra.
    pub wide: usize,
    /// Left out since their light changes nothing that the display shows.
    pub dim: usize,
    /// Left out since it changes nothing that the display shows within a pixel's neighbourhood.
    pub faint: usize,
    /// Of those drawn the ones of which a part is left out, for its width.
    pub cut: usize,
}

impl Tally {
    /// Counts one more.
    pub fn count(&mut self, verdict: Verdict) {
        match verdict {
            Verdict::Drawn => self.drawn += 1,
            Verdict::Wide => self.wide += 1,
            Verdict::Dim => self.dim += 1,
            Verdict::Faint => self.faint += 1,
        }
    }

    /// All of them.
    pub fn all(&self) -> usize {
        self.drawn + self.wide + self.dim + self.faint
    }
}

impl std::iter::Sum for Tally {
    fn sum<I: Iterator<Item = Self>>(tallies: I) -> Self {
        tallies.fold(Self::default(), |a, b| Self {
            drawn: a.drawn + b.drawn,
            wide: a.wide + b.wide,
            dim: a.dim + b.dim,
            faint: a.faint + b.faint,
            cut: a.cut + b.cut,
        })
    }
}

/// A light as edges are judged by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judge {
    worth: Worth,
    /// Greatest radiance, W/(m² sr), of a white surface at 1 m that it lights from straight above.
    white: f32,
    /// Radiance that over black is as much as an edge must be worth, W/(m² sr): there encoding is steepest.
    least: f32,
}

impl Judge {
    /// For the edges of a light.
    pub fn new(light: &Light, worth: Worth) -> Self {
        Self {
            worth,
            white: strength(light) * std::f32::consts::FRAC_1_PI,
            least: linear(worth.steps / 255.0).max(f32::MIN_POSITIVE),
        }
    }

    /// Whether an edge is worth drawing in a view, and which part of it, as shares of its length.
    pub fn judge(&self, view: &View, edge: &ShadowEdge, grade: &Grade) -> (Verdict, [f32; 2]) {
        const WHOLE: [f32; 2] = [0.0, 1.0];
        let most = self.white * grade.form;
        // Against a light it is infinite, or not a number.
        if most < self.least {
            return (Verdict::Dim, WHOLE);
        }
        // Over its whole width the penumbra makes all of the difference, over a neighbourhood a share of it.
        let wide_px = self.worth.width_px;
        let limit_px = wide_px.min(NEIGHBOURHOOD_PX * (most / self.least).max(1.0));
        let over = if limit_px < wide_px {
            Verdict::Faint
        } else {
            Verdict::Wide
        };
        match narrow_part(view, edge, grade, limit_px) {
            Some(part) => (Verdict::Drawn, part),
            None => (over, WHOLE),
        }
    }
}

/// Radiant intensity, or what comes to the same far from the light, W/sr.
fn strength(light: &Light) -> f32 {
    let strongest = |rgb: &[f32; 3]| rgb.iter().fold(0.0f32, |a, b| a.max(*b));
    match light {
        Light::Point { intensity, .. } => strongest(intensity),
        Light::Linear {
            from,
            to,
            intensity,
        } => strongest(intensity) * Vec3::from(*from).distance(Vec3::from(*to)),
        Light::Area { vertices, radiance } => {
            let at = |v: &[f32; 3]| Vec3::from(*v);
            let first = vertices.first().map(at).unwrap_or_default();
            let cross = |w: &[[f32; 3]]| (at(&w[0]) - first).cross(at(&w[1]) - first);
            let area = 0.5 * vertices.windows(2).map(cross).sum::<Vec3>().length();
            strongest(radiance) * area
        }
    }
}

/// The part of an edge, as shares of its length, along which its penumbra is at most so wide on screen.
fn narrow_part(view: &View, edge: &ShadowEdge, grade: &Grade, limit_px: f32) -> Option<[f32; 2]> {
    let ends = [edge.from, edge.to].map(|p| view.to_view(p.as_vec3()));
    let depth = ends.map(|p| p.z);
    let near = NEAR * depth[0].max(depth[1]);
    let before = part_not_negative([0.0, 1.0], depth.map(|z| z - near))?;
    let along = view.turn((edge.to - edge.from).as_vec3());
    let across = view.turn(grade.across);
    // Times the depth, what is linear along the edge stays so on screen.
    let excess = [0, 1].map(|k| {
        let at = ends[0].lerp(ends[1], before[k]);
        let width = grade.width[0] + (grade.width[1] - grade.width[0]) * before[k];
        (limit_px - width * spread_px(view.focal_px, at, along, across)) * at.z
    });
    let [from, to] = part_not_negative([0.0, 1.0], excess)?;
    let share = |x: f32| before[0] + (before[1] - before[0]) * x;
    Some([share(from), share(to)])
}

/// How far apart on screen lines through a point and a metre beside it are that run along each other, pixels; all in view
/// space.
fn spread_px(focal_px: f32, at: Vec3, along: Vec3, across: Vec3) -> f32 {
    let (scale, slope) = (focal_px / at.z, at.xy() / at.z);
    let on_screen = |direction: Vec3| (direction.xy() - direction.z * slope) * scale;
    let (along, across) = (on_screen(along), on_screen(across));
    let length = along.length();
    // An edge that is seen end on is a point.
    if length > 0.0 {
        along.perp_dot(across).abs() / length
    } else {
        across.length()
    }
}

/// The part of a stretch along which a linear measure with these values at its ends is not negative.
fn part_not_negative([from, to]: [f32; 2], [a, b]: [f32; 2]) -> Option<[f32; 2]> {
    let zero = || from + (to - from) * (a / (a - b)).clamp(0.0, 1.0);
    match (a >= 0.0, b >= 0.0) {
        (true, true) => Some([from, to]),
        (true, false) => Some([from, zero()]),
        (false, true) => Some([zero(), to]),
        (false, false) => None,
    }
}

#[cfg(test)]
#[path = "worth_tests.rs"]
mod tests;
