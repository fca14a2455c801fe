//! Adaptive anti-aliasing as a second pass (the paper's section 3.4): all receivers must be known before casting, so a picture is
//! first made with one a pixel, and more are cast where it needs them.

use glam::{Vec2, Vec3, vec2};

use crate::{
    batch::{Route, Seen, Wanted},
    caster::Caster,
    receivers::Receivers,
};

/// A picture of one receiver a pixel, rows from the top.
#[derive(Clone, Copy, Debug)]
pub struct FirstPass<'a> {
    /// Pixels a row.
    pub width: usize,
    /// What each pixel shows: a share of light, or what was made of it.
    pub values: &'a [f32],
    /// Which surface each pixel shows, by any number.
    pub surfaces: &'a [u32],
}

impl FirstPass<'_> {
    /// Pixels that differ from one of their eight neighbours by more than `contrast`, or show another surface, in order.
    #[must_use]
    pub fn needs_more(&self, contrast: f32) -> Vec<u32> {
        let count = self.values.len().min(self.surfaces.len());
        if self.width == 0 {
            return Vec::new();
        }
        let height = count / self.width;
        let differs = |a: usize, b: usize| {
            let apart = (self.values[a] - self.values[b]).abs();
            self.surfaces[a] != self.surfaces[b] || apart.is_nan() || apart > contrast
        };
        let mut needing = vec![false; count];
        for y in 0..height {
            for x in 0..self.width {
                let here = y * self.width + x;
                // Each pair of neighbours once.
                for (dx, dy) in [(1, 0), (0, 1), (1, 1), (-1, 1)] {
                    let (nx, ny) = (x.wrapping_add_signed(dx), y + dy);
                    if nx < self.width && ny < height {
                        let there = ny * self.width + nx;
                        if differs(here, there) {
                            needing[here] = true;
                            needing[there] = true;
                        }
                    }
                }
            }
        }
        let chosen = (0..count as u32).filter(|pixel| needing[*pixel as usize]);
        chosen.collect()
    }
}

/// A receiver of the second pass: origin, normal, own instance and face, set of samples, as in [`Receivers`].
pub type SubReceiver = (Vec3, Vec3, (u32, u32), u8);

/// Places in a pixel, spread evenly; none is the middle, which is that of the first pass.
pub fn places(count: u32) -> impl Iterator<Item = Vec2> {
    // Multiples of powers of the plastic number's inverse, after Roberts 2018, "The Unreasonable Effectiveness of
    // Quasirandom Sequences".
    let plastic = 1.324_717_957_244_746;
    let step = [1. / plastic, 1. / (plastic * plastic)];
    (1..=count).map(move |i| {
        let [x, y] = step.map(|step: f64| (0.5 + f64::from(i) * step).fract() as f32);
        vec2(x, y)
    })
}

impl Caster {
    /// Casts `more` receivers for each of `pixels` and gives their mean share with the first pass's one in `shares`, which is
    /// changed. `receiver` says what is at a place in a pixel, (0, 0) to (1, 1); nothing there counts as unlit.
    pub fn refine(
        &self,
        (pixels, more): (&[u32], u32),
        mut receiver: impl FnMut(u32, Vec2) -> Option<SubReceiver>,
        route: Route<'_>,
        shares: &mut [f32],
    ) {
        let mut receivers = Receivers::default();
        let mut pixel_of = Vec::new();
        for pixel in pixels {
            let Some(share) = shares.get_mut(*pixel as usize) else {
                continue;
            };
            *share /= (more + 1) as f32;
            for place in places(more) {
                if let Some((origin, normal, own, set)) = receiver(*pixel, place) {
                    receivers.push(origin, normal, own, set);
                    pixel_of.push(*pixel);
                }
            }
        }
        let mut seen = Seen::default();
        self.cast(&receivers, route, Wanted::default(), &mut seen);
        for (pixel, share) in pixel_of.into_iter().zip(&seen.shares) {
            shares[pixel as usize] += share / (more + 1) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{Affine3A, dvec3, vec3};

    use super::*;
    use crate::{BlockerMesh, Instance, Light, Sampling, Shape};

    const WIDTH: u32 = 48;

    /// A floor of two by two metres seen from above.
    fn at(pixel: u32, place: Vec2) -> Option<SubReceiver> {
        let corner = vec2((pixel % WIDTH) as f32, (pixel / WIDTH) as f32);
        let spot = (corner + place) / WIDTH as f32 * 2. - 1.;
        Some((vec3(spot.x, 0., spot.y), Vec3::Y, (u32::MAX, 0), 0))
    }

    #[test]
    fn pixels_on_shadows_edges_get_more_and_come_closer_to_the_truth() {
        let corners = [vec3(-0.6, 1., -0.5), vec3(0.5, 1., -0.3), vec3(0., 1., 0.7)];
        let mesh = Arc::new(BlockerMesh::new(&corners, &[[0, 2, 1]]));
        let lamp = [[-1., -1.], [1., -1.], [1., 1.], [-1., 1.]];
        let lamp = lamp.map(|[x, z]| dvec3(x * 0.01, 3., z * 0.01)).to_vec();
        let sampling = Sampling {
            samples: 32,
            sets: 1,
            seed: 1,
        };
        let light = Light::new(Shape::Polygon(lamp), sampling).expect("a square");
        let to_world = Affine3A::IDENTITY;
        let caster = Caster::new(vec![Instance { mesh, to_world }], light, None);
        let all: Vec<u32> = (0..WIDTH * WIDTH).collect();
        let made = |more: u32| {
            let mut shares = vec![0.; all.len()];
            caster.refine((&all, more), at, Route::Cast, &mut shares);
            shares
                .iter_mut()
                .for_each(|s| *s *= (more + 1) as f32 / more as f32);
            shares
        };
        let truth = made(400);
        let mut receivers = Receivers::default();
        for pixel in &all {
            if let Some((origin, normal, own, set)) = at(*pixel, Vec2::splat(0.5)) {
                receivers.push(origin, normal, own, set);
            }
        }
        let mut seen = Seen::default();
        caster.cast(&receivers, Route::Cast, Wanted::default(), &mut seen);
        let mut shares = seen.shares;
        let error = |shares: &[f32]| {
            let off = shares.iter().zip(&truth).map(|(a, b)| (a - b).abs());
            off.sum::<f32>()
        };
        let before = error(&shares);
        let first = FirstPass {
            width: WIDTH as usize,
            values: &shares,
            surfaces: &vec![0; all.len()],
        };
        let pixels = first.needs_more(0.05);
        assert!(
            pixels.len() > 100 && pixels.len() < all.len() / 2,
            "{}",
            pixels.len()
        );
        caster.refine((&pixels, 15), at, Route::Cast, &mut shares);
        assert!(
            error(&shares) < 0.3 * before,
            "{before} to {}",
            error(&shares)
        );
    }

    #[test]
    fn neighbours_of_other_surfaces_and_numbers_that_are_none_get_more() {
        let mut values = [1f32; 20];
        let mut surfaces = [4u32; 20];
        let needs = |values: &[f32], surfaces: &[u32]| {
            let first = FirstPass {
                width: 5,
                values,
                surfaces,
            };
            first.needs_more(0.1)
        };
        assert!(needs(&values, &surfaces).is_empty());
        surfaces[0] = 5;
        assert_eq!(needs(&values, &surfaces), [0, 1, 5, 6]);
        surfaces[0] = 4;
        values[19] = f32::NAN;
        assert_eq!(needs(&values, &surfaces), [13, 14, 18, 19]);
    }
}
