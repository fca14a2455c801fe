//! Times of the stages of this folder: `cargo test --release -p renderer timing -- --ignored --nocapture`.

use std::time::Instant;

use fearless_simd::Level;

use super::classify::classify;
use super::code::Places;
use super::image::Epi;
use super::reach::ReachMap;
use super::testing::{Random, lines, places, random_samples};

/// Best of many runs, milliseconds.
pub(crate) fn best_ms(mut work: impl FnMut()) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..40 {
        let start = Instant::now();
        work();
        best = best.min(start.elapsed().as_secs_f64() * 1e3);
    }
    best
}

/// Image sizes that are timed, with a number of lines that makes about a tenth of the pixels not empty.
pub(crate) const SIZES: [(usize, usize, usize); 3] =
    [(512, 512, 40), (1920, 1080, 110), (3840, 2160, 220)];

#[test]
#[ignore = "prints times"]
fn timing_of_classification_and_reachability() {
    for (width, height, count) in SIZES {
        let random = &mut Random::new(3);
        let crossings = lines(width, height, count, random);
        let mut epi = Epi::new(width, height, Places::Bits4);
        let mut map = ReachMap::new(width, height);
        let classified = best_ms(|| classify(Level::new(), &crossings, &mut epi));
        let samples = random_samples(epi.grid, 0.3, random);
        let settled = best_ms(|| epi.set_primary(&places(&samples)));
        let reached = best_ms(|| map.compute(Level::new(), &epi));
        let portable = best_ms(|| map.compute(Level::baseline(), &epi));
        println!(
            "{width}x{height} {:?}: classify {classified:.3} ms, set_primary {settled:.3} ms, \
             reach {reached:.3} ms ({portable:.3} ms portable), {:.3} ns a pixel",
            epi.counts,
            reached * 1e6 / (width * height) as f64,
        );
    }
}
