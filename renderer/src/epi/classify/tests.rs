use proptest::prelude::*;

use super::*;
use crate::epi::code::Places;
use crate::epi::testing::{any_crossings, config};

/// Places of the crossings of a pixel as (side, eighth) in clockwise order, one by one.
fn crossings_of(crossings: &Crossings, x: usize, y: usize) -> Vec<u32> {
    let [top, right, bottom, left] = crossings.around(x, y);
    let mut found = Vec::new();
    for i in 0..8 {
        for (mask, segment) in [(top, i), (right, 8 + i), (bottom, 23 - i), (left, 31 - i)] {
            if mask >> i & 1 != 0 {
                found.push(segment);
            }
        }
    }
    found.sort_unstable();
    found
}

proptest! {
    #![proptest_config(config(150, 11))]

    #[test]
    fn equals_the_rules_one_by_one(first in any_crossings(), crossings in any_crossings()) {
        let mut epi = Epi::new(first.width, first.height, Places::Bits4);
        // Nothing of an earlier frame may stay, whatever its size.
        classify(Level::new(), &first, &mut epi);
        let mut same_size = Crossings::new(crossings.width, crossings.height);
        same_size.horizontal.fill(255);
        classify(Level::new(), &same_size, &mut epi);
        classify(Level::new(), &crossings, &mut epi);
        let mut counts = Counts::default();
        for (x, y) in (0..crossings.height).flat_map(|y| (0..crossings.width).map(move |x| (x, y))) {
            let found = crossings_of(&crossings, x, y);
            let expected = match found[..] {
                [] => EdgeCode::EMPTY,
                [a, b] if a / 8 != b / 8 => EdgeCode((32 * a + b) as u16),
                _ => EdgeCode::COMPLEX,
            };
            prop_assert_eq!(epi.code_at(x, y), expected);
            let (word, bit) = epi.grid.bit(x, y);
            let has = |plane: &[u64]| plane[word] >> bit & 1 != 0;
            prop_assert_eq!(has(&epi.simple), expected.is_simple());
            prop_assert_eq!(has(&epi.complex), expected == EdgeCode::COMPLEX);
            counts.empty += usize::from(expected == EdgeCode::EMPTY);
            counts.simple += usize::from(expected.is_simple());
            counts.complex += usize::from(expected == EdgeCode::COMPLEX);
            for corner in 1..4u32 {
                let (a, b) = expected.ends();
                let inside = expected.is_simple() && (a..b).contains(&(8 * corner - 1));
                prop_assert_eq!(has(&epi.inner_corner[corner as usize - 1]), inside);
            }
        }
        prop_assert_eq!(epi.counts, counts);
        for plane in [&epi.simple, &epi.complex] {
            for (i, word) in plane.iter().enumerate() {
                prop_assert_eq!(word & !epi.grid.valid(i % epi.grid.words), 0);
            }
        }
    }
}

#[test]
fn boundary_bits_run_clockwise() {
    assert_eq!(clockwise([1, 0, 0, 0]), 1);
    assert_eq!(clockwise([0, 1, 0, 0]), 1 << 8);
    assert_eq!(clockwise([0, 0, 0x80, 0]), 1 << 16);
    assert_eq!(clockwise([0, 0, 0, 0x80]), 1 << 24);
    assert_eq!(clockwise([0, 0, 0, 1]), 1 << 31);
}
