use proptest::prelude::*;

use super::*;
use crate::edges::crossings::Crossings;
use crate::epi::code::{Class, EdgeCode, Places};
use crate::epi::geometry::Boundary;
use crate::epi::reach_tables::{
    OFFSETS, TABLES, mirrored, neighbour_relation, reach_by_tables, relation,
};
use crate::epi::testing::{Random, any_crossings, config, image, random_crossings};

fn assert_equals_tables(epi: &Epi, map: &ReachMap) -> Result<(), TestCaseError> {
    let (width, height) = (epi.grid.width, epi.grid.height);
    let reach = reach_by_tables(epi);
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        for (i, &(dx, dy)) in OFFSETS.iter().enumerate() {
            let mask = reach[y * width + x];
            prop_assert_eq!(
                map.reachable_at((x, y), (dx, dy)),
                mask >> i & 1 != 0,
                "{:?}",
                (x, y, dx, dy)
            );
            let opposite = mask >> (12 + i) & 1 != 0;
            prop_assert_eq!(
                map.reachable_at((x, y), (-dx, -dy)),
                opposite,
                "{:?}",
                (x, y, -dx, -dy)
            );
        }
    }
    Ok(())
}

fn assert_no_bits_outside(map: &ReachMap) -> Result<(), TestCaseError> {
    let steps = map.steps.right.iter().chain(&map.steps.down);
    for plane in map.planes.iter().chain(steps) {
        for (i, word) in plane.iter().enumerate() {
            prop_assert_eq!(word & !map.grid.valid(i % map.grid.words), 0);
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(config(150, 21))]

    #[test]
    fn bit_slicing_equals_tables(crossings in any_crossings(), share in 0.0..1.0f64, seed: u64) {
        let epi = image(&crossings, share, Places::Bits4, &mut Random::new(seed));
        let mut map = ReachMap::new(7, 3);
        map.compute(Level::new(), &epi);
        assert_equals_tables(&epi, &map)?;
        assert_no_bits_outside(&map)?;
        // A map that is used again gives the same.
        let before = map.planes.clone();
        map.compute(Level::new(), &epi);
        prop_assert_eq!(before, map.planes);
    }

    #[test]
    fn portable_and_dispatched_code_agree(crossings in any_crossings(), seed: u64) {
        let epi = image(&crossings, 0.3, Places::Bits4, &mut Random::new(seed));
        let (mut fast, mut plain) = (ReachMap::new(1, 1), ReachMap::new(1, 1));
        fast.compute(Level::new(), &epi);
        plain.compute(Level::baseline(), &epi);
        prop_assert_eq!(fast.planes, plain.planes);
    }

    #[test]
    fn steps_equal_the_neighbour_tables(crossings in any_crossings(), seed: u64) {
        let epi = image(&crossings, 0.5, Places::Bits4, &mut Random::new(seed));
        let mut map = ReachMap::new(1, 1);
        map.compute(Level::new(), &epi);
        for (x, y) in (0..epi.grid.height).flat_map(|y| (0..epi.grid.width).map(move |x| (x, y))) {
            let (word, bit) = epi.grid.bit(x, y);
            for (planes, step) in [(&map.steps.right, (1, 0)), (&map.steps.down, (0, 1))] {
                let found = (0..4).fold(0, |all, k| all | (planes[k][word] >> bit & 1) << k);
                let expected = neighbour_relation(&epi, (x as i32, y as i32), step);
                prop_assert_eq!(found as u8, expected, "{:?}", (x, y, step));
            }
        }
    }

    #[test]
    fn reach_is_symmetric(crossings in any_crossings(), seed: u64) {
        let epi = image(&crossings, 0.5, Places::Bits4, &mut Random::new(seed));
        let (width, height) = (epi.grid.width as i32, epi.grid.height as i32);
        let random = &mut Random::new(seed ^ 1);
        for _ in 0..200 {
            let (x, y) = ((random.next() >> 33) as i32 % width, (random.next() >> 33) as i32 % height);
            for &(dx, dy) in &OFFSETS {
                let there = relation(&epi, (x, y), (dx, dy));
                prop_assert_eq!(mirrored(there), relation(&epi, (x + dx, y + dy), (-dx, -dy)));
            }
        }
    }
}

#[test]
fn empty_image_is_reachable_up_to_its_border() {
    let epi = image(
        &Crossings::new(65, 3),
        0.0,
        Places::Bits4,
        &mut Random::new(1),
    );
    let mut map = ReachMap::new(65, 3);
    map.compute(Level::new(), &epi);
    for (x, y) in (0..3).flat_map(|y| (0..65).map(move |x| (x, y))) {
        for (dx, dy) in (-2..=2).flat_map(|dy| (-2..=2).map(move |dx| (dx, dy))) {
            let inside = (0..65).contains(&(x + dx)) && (0..3).contains(&(y + dy));
            let expected = inside && (dx, dy) != (0, 0);
            assert_eq!(
                map.reachable_at((x as usize, y as usize), (dx, dy)),
                expected,
                "{:?}",
                (x, y, dx, dy)
            );
        }
    }
}

/// Half of the 5x5 neighbourhood's cells a side of a pixel.
const FINE: i32 = 32;
/// Segment mid-points and the centres of the fine cells have integer coordinates in this square.
const UNITS: Boundary = Boundary::new(8, FINE / 8);

/// Flood fill of a 5x5 image from the centre's primary region over fine cells; edges and complex pixels stop it. Yields
/// for each pixel whether its primary region was reached.
fn flood(epi: &Epi) -> [[bool; 5]; 5] {
    let size = 5 * FINE;
    let inner = |cell: (i32, i32), place: (i32, i32)| {
        let code = epi.code_at((cell.0 / FINE) as usize, (cell.1 / FINE) as usize);
        let (a, b) = code.ends();
        code.is_simple() && UNITS.is_inner(a as i32, b as i32, place)
    };
    // Units are half a fine cell long: centres are odd.
    let centre = |cell: (i32, i32)| (2 * (cell.0 % FINE) + 1, 2 * (cell.1 % FINE) + 1);
    let primary = |cell: (i32, i32)| {
        let (x, y) = (cell.0 / FINE, cell.1 / FINE);
        let (word, bit) = epi.grid.bit(x as usize, y as usize);
        let code = epi.code_at(x as usize, y as usize);
        code != EdgeCode::COMPLEX
            && (!code.is_simple()
                || inner(cell, centre(cell)) == (epi.primary_inner[word] >> bit & 1 != 0))
    };
    let open = |from: (i32, i32), (dx, dy): (i32, i32)| {
        let to = (from.0 + dx, from.1 + dy);
        if !(0..size).contains(&to.0) || !(0..size).contains(&to.1) {
            return false;
        }
        if epi.code_at((to.0 / FINE) as usize, (to.1 / FINE) as usize) == EdgeCode::COMPLEX {
            return false;
        }
        let (here, there) = (centre(from), centre(to));
        inner(from, here) == inner(from, (here.0 + dx, here.1 + dy))
            && inner(to, there) == inner(to, (there.0 - dx, there.1 - dy))
    };
    let mut seen = vec![false; (size * size) as usize];
    let all = || (0..size).flat_map(|y| (0..size).map(move |x| (x, y)));
    let mut stack: Vec<_> = all()
        .filter(|&c| c.0 / FINE == 2 && c.1 / FINE == 2 && primary(c))
        .collect();
    stack
        .iter()
        .for_each(|c| seen[(c.1 * size + c.0) as usize] = true);
    while let Some(cell) = stack.pop() {
        for step in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
            if open(cell, step) {
                let next = (cell.0 + step.0, cell.1 + step.1);
                let seen = &mut seen[(next.1 * size + next.0) as usize];
                if !*seen {
                    *seen = true;
                    stack.push(next);
                }
            }
        }
    }
    let mut reached = [[false; 5]; 5];
    for cell in all().filter(|&c| seen[(c.1 * size + c.0) as usize] && primary(c)) {
        reached[(cell.1 / FINE) as usize][(cell.0 / FINE) as usize] = true;
    }
    reached
}

/// Paper section 5.2 wants "a reasonably direct path": what is reachable only by detours is missed, by design.
#[test]
fn never_reaches_across_an_edge() {
    let random = &mut Random::new(5);
    let (mut reached, mut missed) = (0, 0);
    for case in 0..600 {
        let crossings = match case % 3 {
            0 => crate::epi::testing::lines(5, 5, 1 + case % 4, random),
            1 => random_crossings(5, 5, 0.3, random),
            _ => random_crossings(5, 5, 0.5, random),
        };
        let epi = image(&crossings, 0.5, Places::Bits4, random);
        let mut map = ReachMap::new(5, 5);
        map.compute(Level::new(), &epi);
        let flooded = flood(&epi);
        for (dx, dy) in (-2..=2).flat_map(|dy| (-2..=2).map(move |dx| (dx, dy))) {
            let oracle = flooded[(dy + 2) as usize][(dx + 2) as usize] && (dx, dy) != (0, 0);
            let found = map.reachable_at((2, 2), (dx, dy));
            assert!(
                oracle || !found,
                "reached {:?} across an edge, case {case}",
                (dx, dy)
            );
            reached += usize::from(oracle);
            missed += usize::from(oracle && !found);
        }
    }
    let share = missed as f64 / reached as f64;
    println!("missed {missed} of {reached} reachable: {share:.4}");
    assert!(share < 0.08, "missed {share} of what is reachable");
}

#[test]
fn tables_hold_what_geometry_says() {
    let pp_only = 1 << PP;
    // Two empty pixels; complex ones reach nothing.
    assert_eq!((TABLES.right[0], TABLES.down[0]), (pp_only, pp_only));
    for other in 0..16 {
        for i in [16 + other, 16 * other + 1] {
            assert_eq!((TABLES.right[i], TABLES.down[i]), (0, 0));
        }
    }
    // The identity (PP, SS) chains to the other mask; nothing chains to nothing; chaining mirrors.
    for mask in 0..16usize {
        assert_eq!(usize::from(TABLES.chain[16 * 0b1001 + mask]), mask);
        assert_eq!(usize::from(TABLES.chain[16 * mask + 0b1001]), mask);
        assert_eq!((TABLES.chain[mask], TABLES.chain[16 * mask]), (0, 0));
        for other in 0..16usize {
            let turned = 16 * mirrored(other as u8) + mirrored(mask as u8);
            assert_eq!(
                mirrored(TABLES.chain[16 * mask + other]),
                TABLES.chain[usize::from(turned)]
            );
        }
    }
    // An upright edge in the middle (top to bottom), outer region primary: its right neighbour sees the inner region.
    let upright = Class::new(EdgeCode(4 << 5 | 20), false).0;
    assert_eq!(TABLES.right[usize::from(16 * upright)], 1 << SP);
    assert_eq!(TABLES.right[usize::from(upright)], 1 << PP);
    assert_eq!(TABLES.down[usize::from(16 * upright + upright)], 0b1001);
}
