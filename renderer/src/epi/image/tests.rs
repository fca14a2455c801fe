use fearless_simd::Level;
use proptest::prelude::*;

use super::*;
use crate::epi::classify::classify;
use crate::epi::testing::{Random, any_crossings, config, places, random_samples};

proptest! {
    #![proptest_config(config(100, 51))]

    /// Primary regions, corners and centroids against the rules pixel by pixel (paper section 5.1).
    #[test]
    fn primary_regions_follow_the_rules(
        first in any_crossings(), crossings in any_crossings(), share in 0.0..1.0f64, seed: u64,
    ) {
        let random = &mut Random::new(seed);
        let mut epi = Epi::new(1, 1, [Places::Bits4, Places::Bits8][seed as usize % 2]);
        // Nothing of an earlier frame may stay.
        for crossings in [&first, &crossings] {
            classify(Level::new(), crossings, &mut epi);
            epi.set_primary(&places(&random_samples(epi.grid, share, random)));
        }
        let samples = random_samples(epi.grid, share, random);
        epi.set_primary(&places(&samples));
        let (width, height) = (epi.grid.width, epi.grid.height);
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let ((word, bit), at) = (epi.grid.bit(x, y), epi.grid.at(x, y));
            let has = |plane: &[u64]| plane[word] >> bit & 1 != 0;
            let code = epi.code_at(x, y);
            let cell = epi.tables().places().cell(samples.x[at], samples.y[at]);
            let side = match (samples.has_sample(x, y), code.is_simple()) {
                (true, true) => Some(epi.tables().side(code, cell)),
                _ => None,
            };
            let inner = match side {
                Some(Side::Inner) => true,
                Some(Side::Outer) => false,
                _ => code.is_simple() && epi.tables().inner_area(code) > 0.5,
            };
            prop_assert_eq!(has(&epi.primary_inner), inner);
            prop_assert_eq!(has(&epi.ambiguous), side == Some(Side::Ambiguous));
            let usable = samples.has_sample(x, y) && side != Some(Side::Ambiguous);
            prop_assert_eq!(has(&epi.has_sample), usable);
            let (a, b) = code.ends();
            for corner in 0..4u32 {
                let corner_inner = (a..b).contains(&(8 * corner).wrapping_sub(1));
                let expected = code.is_simple() && corner_inner != inner;
                prop_assert_eq!(has(&epi.corner[corner as usize]), expected);
            }
            let centre = if code.is_simple() { epi.tables().centroid_px(code, inner) } else { [0.5; 2] };
            prop_assert_eq!([epi.centre_px[0][at], epi.centre_px[1][at]], centre);
        }
    }
}
