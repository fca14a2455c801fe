//! Random images for the tests of this folder and of the filters.

use fearless_simd::Level;
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed};

use super::classify::classify;
use super::code::Places;
use super::grid::Grid;
use super::image::{Epi, SamplePlaces};
use crate::edges::crossings::Crossings;
use crate::points::PixelSamples;

/// Fixed seed, no files.
pub(crate) fn config(cases: u32, seed: u64) -> Config {
    Config {
        cases,
        rng_seed: RngSeed::Fixed(seed),
        failure_persistence: None,
        ..Config::default()
    }
}

/// A small generator for bulk data that proptest need not shrink (xorshift64*).
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    pub(crate) fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    /// In 0..1.
    pub(crate) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(crate) fn chance(&mut self, share: f64) -> bool {
        self.unit() < share
    }
}

/// Each boundary has a crossing with this chance, now and then two.
pub(crate) fn random_crossings(
    width: usize,
    height: usize,
    share: f64,
    random: &mut Random,
) -> Crossings {
    let mut crossings = Crossings::new(width, height);
    let Crossings {
        horizontal,
        vertical,
        half_horizontal,
        half_vertical,
        ..
    } = &mut crossings;
    for mask in [horizontal, vertical, half_horizontal, half_vertical]
        .into_iter()
        .flatten()
    {
        if random.chance(share) {
            *mask |= 1 << (random.next() >> 61);
        }
        if random.chance(share * share * 0.2) {
            *mask |= 1 << (random.next() >> 61);
        }
    }
    crossings
}

/// Records where a line from `from` to `to` (image space, pixels) crosses full and half boundaries, in f64.
pub(crate) fn draw_line(crossings: &mut Crossings, from: [f64; 2], to: [f64; 2]) {
    let (width, height) = (crossings.width, crossings.height);
    for axis in 0..2 {
        let (lines, across) = if axis == 0 {
            (width, height)
        } else {
            (height, width)
        };
        for half in 0..=2 * lines {
            let at = half as f64 / 2.0;
            if (from[axis] < at) == (to[axis] < at) {
                continue;
            }
            let t = (at - from[axis]) / (to[axis] - from[axis]);
            let other = from[1 - axis] + t * (to[1 - axis] - from[1 - axis]);
            if !(0.0..across as f64).contains(&other) {
                continue;
            }
            let (line, cell, bit) = (half / 2, other as usize, 1 << (other.fract() * 8.0) as u32);
            let mask = match (axis, half % 2) {
                (0, 0) => &mut crossings.vertical[cell * (width + 1) + line],
                (0, _) => &mut crossings.half_vertical[cell * width + line],
                (_, 0) => &mut crossings.horizontal[line * width + cell],
                _ => &mut crossings.half_horizontal[line * width + cell],
            };
            *mask |= bit;
        }
    }
}

/// `count` random lines through an image.
pub(crate) fn lines(width: usize, height: usize, count: usize, random: &mut Random) -> Crossings {
    let mut crossings = Crossings::new(width, height);
    for _ in 0..count {
        let mut place = || {
            let margin = 4.0;
            [width, height].map(|n| (n as f64 + 2.0 * margin) * random.unit() - margin)
        };
        let (from, to) = (place(), place());
        draw_line(&mut crossings, from, to);
    }
    crossings
}

/// Samples at random places, each pixel with this chance; black.
pub(crate) fn random_samples(grid: Grid, share: f64, random: &mut Random) -> PixelSamples {
    let mut samples = PixelSamples::new(grid);
    for (x, y) in (0..grid.height).flat_map(|y| (0..grid.width).map(move |x| (x, y))) {
        let ((word, bit), at) = (grid.bit(x, y), grid.at(x, y));
        samples.has[word] |= u64::from(random.chance(share)) << bit;
        samples.x[at] = random.unit() as f32;
        samples.y[at] = random.unit() as f32;
    }
    samples
}

/// Where they lie.
pub(crate) fn places(samples: &PixelSamples) -> SamplePlaces<'_> {
    SamplePlaces {
        present: &samples.has,
        x: &samples.x,
        y: &samples.y,
    }
}

/// A classified image with random samples.
pub(crate) fn image(
    crossings: &Crossings,
    share: f64,
    places_bits: Places,
    random: &mut Random,
) -> Epi {
    let mut epi = Epi::new(crossings.width, crossings.height, places_bits);
    classify(Level::new(), crossings, &mut epi);
    epi.set_primary(&places(&random_samples(epi.grid, share, random)));
    epi
}

/// Image sizes, degenerate ones among them.
pub(crate) fn sizes() -> impl Strategy<Value = (usize, usize)> {
    prop_oneof![
        Just((1, 1)),
        (1usize..200).prop_map(|w| (w, 1)),
        (1usize..40).prop_map(|h| (1, h)),
        (60usize..70, 1usize..6),
        (1usize..9, 1usize..9),
        (250usize..330, 3usize..7),
    ]
}

/// Crossings of every character: none, few lines, many lines, scattered bits, every boundary crossed.
pub(crate) fn any_crossings() -> impl Strategy<Value = Crossings> {
    (sizes(), 0usize..5, any::<u64>()).prop_map(|((width, height), kind, seed)| {
        let random = &mut Random::new(seed);
        match kind {
            0 => Crossings::new(width, height),
            1 => lines(width, height, 3, random),
            2 => lines(width, height, (width + height) / 2, random),
            3 => random_crossings(width, height, 0.3, random),
            _ => random_crossings(width, height, 1.0, random),
        }
    })
}
