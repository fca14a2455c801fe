//! How wrong a soft shadow map is going to be, before there is one.

use glam::Vec3;

use crate::{Light, Transition, light::Linear};

/// A bound of the error of shares, see [`predicted_error`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Predicted {
    /// Largest error within a penumbra, as share of the light.
    pub transition: f32,
    /// Width on the receiver, metres, of two texels: shadows may be displaced by so much.
    pub displacement: f32,
}

/// Predicts the error on a receiver at `position` with unit `normal`, for `samples` on the light, or on each edge of a
/// polygon, whose texels are `texel_angle` radians apart. `clearance` is the distance from the light of the nearest thing
/// that throws a shadow, metres; at least the length between two samples is assumed.
///
/// The line from a receiver over a blocker's outline maps the receiver's plane to the light. With heights h₁ and h₂ of two
/// samples over that plane and h of the outline it is v(q) = q/(q + k·(1 − q)), k = (h₂ − h)/(h₁ − h), of which linear
/// interpolation keeps the ends; the two differ by |√k − 1|/(√k + 1) at most, about a quarter of the slope between light
/// and receiver where the outline is the light's length away (section 3.1, Eq. 1). [`Transition::Rational`] has no such
/// error. A polygon is taken for its edges: a shadow's outline along one of them hides all of that edge at once, which is
/// wrong by up to that edge's share of the light, with either transition.
#[must_use]
pub fn predicted_error(
    light: &Light,
    [position, normal]: [Vec3; 2],
    samples: u32,
    texel_angle: f32,
    clearance: f32,
    transition: Transition,
) -> Predicted {
    let Ok(edges) = light.linear() else {
        return Predicted::default();
    };
    let total: f32 = edges.iter().map(Linear::length).sum();
    let mut predicted = Predicted::default();
    for edge in &edges {
        let share = if total > 0. {
            edge.length() / total
        } else {
            1.
        };
        let pieces = samples.max(2) - 1;
        for piece in 0..pieces {
            let ends = [piece, piece + 1].map(|i| {
                let place = edge.ends[0].lerp(edge.ends[1], i as f32 / pieces as f32);
                (place - position).dot(normal)
            });
            let length = edge.length() / pieces as f32;
            let error = match transition {
                Transition::Linear => of_heights(ends, clearance.max(length)) / pieces as f32,
                Transition::Rational => 0.,
            };
            predicted.transition = predicted.transition.max(error * share);
        }
        if edge.facing.is_some() {
            predicted.transition = predicted.transition.max(share);
        }
        let away = (0.5 * (edge.ends[0] + edge.ends[1]) - position).length();
        predicted.displacement = predicted.displacement.max(2. * texel_angle * away);
    }
    predicted
}

/// Largest difference between linear and true visibility for samples at these heights over the receiver's plane, with an
/// outline `clearance` below the lower one; 0 if neither is above the receiver.
fn of_heights([first, second]: [f32; 2], clearance: f32) -> f32 {
    let (low, high) = (first.max(0.).min(second.max(0.)), first.max(second));
    if high <= 0. || high == low {
        return 0.;
    }
    // Below the plane nothing hides anything.
    let down = clearance.min(low);
    let ratio = ((down + high - low) / down.max(1e-6 * high)).sqrt();
    (ratio - 1.) / (ratio + 1.)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_about_a_quarter_of_the_slope() {
        for slope in [0f32, 0.1, 0.5, 1.] {
            let light = Light::Segment([Vec3::new(-0.5, 4., 0.), Vec3::new(0.5, 4. + slope, 0.)]);
            let length = (1. + slope * slope).sqrt();
            let error = |samples, transition| {
                predicted_error(
                    &light,
                    [Vec3::ZERO, Vec3::Y],
                    samples,
                    0.01,
                    length,
                    transition,
                )
            };
            let linear = error(2, Transition::Linear).transition;
            let sine = slope / length;
            assert!(
                linear <= sine / 4. && linear >= sine / 4. * 0.7,
                "{slope}: {linear}"
            );
            assert!(error(3, Transition::Linear).transition <= 0.3 * linear);
            assert_eq!(error(2, Transition::Rational).transition, 0.);
            assert!(error(2, Transition::Linear).displacement > 0.079);
        }
    }

    #[test]
    fn a_polygon_is_wrong_by_an_edge() {
        let square = Light::Polygon {
            vertices: vec![Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Z, Vec3::Z],
            instance: None,
        };
        let at = [Vec3::NEG_Y, Vec3::Y];
        let predicted = predicted_error(&square, at, 2, 0.01, 1., Transition::Rational);
        assert_eq!(predicted.transition, 0.25);
    }
}
