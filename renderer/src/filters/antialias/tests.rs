use fearless_simd::Level;
use proptest::prelude::*;

use super::*;
use crate::edges::crossings::Crossings;
use crate::epi::code::{NO_NEIGHBOUR, Places};
use crate::epi::reach_tables::relation;
use crate::epi::testing::{Random, any_crossings, config, draw_line, image};

fn reach_of(epi: &Epi) -> ReachMap {
    let mut reach = ReachMap::new(1, 1);
    reach.compute(Level::new(), epi);
    reach
}

/// Signed distance of a place from a line, positive on one side.
fn side(line: [[f64; 2]; 2], place: [f64; 2]) -> f64 {
    let [from, to] = line;
    (to[0] - from[0]) * (place[1] - from[1]) - (to[1] - from[1]) * (place[0] - from[0])
}

/// Where the primary region has its middle, image space.
fn primary_centre(epi: &Epi, x: usize, y: usize) -> [f64; 2] {
    let at = epi.grid.at(x, y);
    [
        x as f64 + f64::from(epi.centre_px[0][at]),
        y as f64 + f64::from(epi.centre_px[1][at]),
    ]
}

/// Red on one side of a line through the whole image, blue on the other.
fn two_colours(epi: &Epi, line: [[f64; 2]; 2]) -> [Vec<f32>; 3] {
    let mut colours = [(); 3].map(|()| vec![f32::NAN; epi.grid.elements()]);
    for (x, y) in (0..epi.grid.height).flat_map(|y| (0..epi.grid.width).map(move |x| (x, y))) {
        let red = side(line, primary_centre(epi, x, y)) > 0.0;
        let at = epi.grid.at(x, y);
        colours[0][at] = f32::from(u8::from(red));
        colours[1][at] = 0.0;
        colours[2][at] = f32::from(u8::from(!red));
    }
    colours
}

/// A line that crosses an image from beyond one border to beyond another.
fn crossing_line(width: usize, height: usize, random: &mut Random) -> [[f64; 2]; 2] {
    let (w, h) = (width as f64, height as f64);
    let middle = [w * random.unit(), h * random.unit()];
    let angle = std::f64::consts::PI * random.unit();
    let reach = 2.0 * (w + h);
    [-reach, reach].map(|t| [middle[0] + t * angle.cos(), middle[1] + t * angle.sin()])
}

#[test]
fn two_colours_mix_only_on_the_edge_and_by_area() {
    let random = &mut Random::new(19);
    let (mut blended, mut kept) = (0, 0);
    for _ in 0..300 {
        let line = crossing_line(23, 17, random);
        let mut crossings = Crossings::new(23, 17);
        draw_line(&mut crossings, line[0], line[1]);
        let epi = image(&crossings, 0.3, Places::Bits4, random);
        let reach = reach_of(&epi);
        let before = two_colours(&epi, line);
        let mut after = before.clone();
        let bare = vec![0; epi.grid.plane_words()];
        let inputs = Inputs {
            epi: &epi,
            reach: &reach,
            bare: &bare,
            direct: None,
        };
        let outcome = Antialias::default().apply(&inputs, &mut after);
        blended += outcome.blended;
        for (x, y) in (0..17).flat_map(|y| (0..23).map(move |x| (x, y))) {
            let (at, code) = (epi.grid.at(x, y), epi.code_at(x, y));
            let (red, blue) = (after[0][at], after[2][at]);
            if !code.is_simple() {
                assert_eq!(
                    (red, blue),
                    (before[0][at], before[2][at]),
                    "not simple, yet changed"
                );
                continue;
            }
            let (word, bit) = epi.grid.bit(x, y);
            let inner = epi.tables().inner_area(code);
            let primary = if epi.primary_inner[word] >> bit & 1 != 0 {
                inner
            } else {
                1.0 - inner
            };
            let share = if before[0][at] == 1.0 { red } else { blue };
            assert!((red + blue - 1.0).abs() < 1e-6);
            assert!(
                (share - primary).abs() < 1e-6 || share == 1.0,
                "{share} of {primary}"
            );
            // Beyond the border there is nobody to borrow from.
            if (1..22).contains(&x) && (1..16).contains(&y) {
                kept += usize::from(share == 1.0);
            }
        }
    }
    println!("blended {blended}, kept {kept}");
    assert!(
        kept * 200 < blended,
        "{kept} of {blended} pixels found no lender"
    );
}

/// With the donor that the table ranks first, however it is joined, colours would leak: a thin bar between two
/// surfaces must be blended with the bar, or not at all, never with what lies beyond it.
#[test]
fn never_borrows_across_another_edge() {
    let random = &mut Random::new(7);
    for _ in 0..300 {
        let line = crossing_line(19, 19, random);
        let [[x0, y0], [x1, y1]] = line;
        let length = (x1 - x0).hypot(y1 - y0);
        let width = 0.3 + 2.0 * random.unit();
        let normal = [-(y1 - y0) / length * width, (x1 - x0) / length * width];
        let mut crossings = Crossings::new(19, 19);
        draw_line(&mut crossings, line[0], line[1]);
        let other = [
            [x0 + normal[0], y0 + normal[1]],
            [x1 + normal[0], y1 + normal[1]],
        ];
        draw_line(&mut crossings, other[0], other[1]);
        let epi = image(&crossings, 0.3, Places::Bits4, random);
        let reach = reach_of(&epi);
        // Red before the first line, green in the bar, blue beyond the second.
        let mut colours = [(); 3].map(|()| vec![0.0f32; epi.grid.elements()]);
        for (x, y) in (0..19).flat_map(|y| (0..19).map(move |x| (x, y))) {
            let centre = primary_centre(&epi, x, y);
            let (first, second) = (side(line, centre) > 0.0, side(other, centre) > 0.0);
            let colour = if second { 2 } else { usize::from(first) };
            colours[colour][epi.grid.at(x, y)] = 1.0;
        }
        let bare = vec![0; epi.grid.plane_words()];
        let inputs = Inputs {
            epi: &epi,
            reach: &reach,
            bare: &bare,
            direct: None,
        };
        Antialias::default().apply(&inputs, &mut colours);
        for (x, y) in (0..19).flat_map(|y| (0..19).map(move |x| (x, y))) {
            let at = epi.grid.at(x, y);
            let leaked = colours[0][at] > 0.0 && colours[2][at] > 0.0;
            assert!(!leaked, "red and blue met across the bar at {:?}", (x, y));
        }
    }
}

proptest! {
    #![proptest_config(config(100, 5))]

    #[test]
    fn stays_within_the_range_of_the_colours(crossings in any_crossings(), seed: u64) {
        let random = &mut Random::new(seed);
        let epi = image(&crossings, 0.3, Places::Bits4, random);
        let reach = reach_of(&epi);
        let elements = epi.grid.elements();
        let mut colours = [(); 3].map(|()| (0..elements).map(|_| random.unit() as f32).collect());
        let before = colours.clone();
        let bare: Vec<u64> = (0..epi.grid.plane_words()).map(|_| random.next()).collect();
        let inputs = Inputs { epi: &epi, reach: &reach, bare: &bare, direct: None };
        let outcome = Antialias::default().apply(&inputs, &mut colours);
        prop_assert_eq!(outcome.blended + outcome.kept, epi.counts.simple);
        for (x, y) in (0..epi.grid.height).flat_map(|y| (0..epi.grid.width).map(move |x| (x, y))) {
            let at = epi.grid.at(x, y);
            if !epi.code_at(x, y).is_simple() {
                prop_assert_eq!(colours[0][at], before[0][at]);
            }
            prop_assert!((0.0..=1.0).contains(&colours[0][at]));
        }
    }

    /// The lender against the paper's tables, neighbour by neighbour.
    #[test]
    fn lender_is_the_first_that_the_tables_join(crossings in any_crossings(), seed: u64) {
        let random = &mut Random::new(seed);
        let epi = image(&crossings, 0.5, Places::Bits4, random);
        let reach = reach_of(&epi);
        let bare: Vec<u64> = (0..epi.grid.plane_words()).map(|_| random.next() & random.next()).collect();
        let inputs = Inputs { epi: &epi, reach: &reach, bare: &bare, direct: None };
        for (x, y) in (0..epi.grid.height).flat_map(|y| (0..epi.grid.width).map(move |x| (x, y))) {
            let code = epi.code_at(x, y);
            if !code.is_simple() {
                continue;
            }
            let (word, bit) = epi.grid.bit(x, y);
            let donors = epi.tables().donors(code, epi.primary_inner[word] >> bit & 1 == 0);
            let expected = donors.iter().filter(|&&n| n != NO_NEIGHBOUR).find_map(|&n| {
                let (dx, dy) = NEIGHBOURS[usize::from(n)];
                if relation(&epi, (x as i32, y as i32), (dx, dy)) >> SP & 1 == 0 {
                    return None;
                }
                let (nx, ny) = ((x as i32 + dx) as usize, (y as i32 + dy) as usize);
                let (word, bit) = epi.grid.bit(nx, ny);
                (bare[word] >> bit & 1 == 0).then(|| epi.grid.at(nx, ny))
            });
            let sides = lending_sides(&reach, x / 64, y);
            prop_assert_eq!(lender(&inputs, &sides, (x, y), donors), expected);
        }
    }

    #[test]
    fn takes_the_callers_colours_where_known(crossings in any_crossings(), seed: u64) {
        let random = &mut Random::new(seed);
        let epi = image(&crossings, 0.3, Places::Bits4, random);
        let reach = reach_of(&epi);
        let mut colours = [(); 3].map(|()| vec![0.0; epi.grid.elements()]);
        let ones = vec![1.0; epi.grid.elements()];
        let known: Vec<u64> = (0..epi.grid.plane_words()).map(|_| random.next()).collect();
        let bare = vec![0; epi.grid.plane_words()];
        let direct = Some(Direct { known: &known, rgb: [&ones, &ones, &ones] });
        let inputs = Inputs { epi: &epi, reach: &reach, bare: &bare, direct };
        Antialias::default().apply(&inputs, &mut colours);
        for (x, y) in (0..epi.grid.height).flat_map(|y| (0..epi.grid.width).map(move |x| (x, y))) {
            let (word, bit) = epi.grid.bit(x, y);
            let expected = if epi.code_at(x, y).is_simple() && known[word] >> bit & 1 != 0 {
                let inner = epi.tables().inner_area(epi.code_at(x, y));
                if epi.primary_inner[word] >> bit & 1 != 0 { 1.0 - inner } else { inner }
            } else {
                0.0
            };
            prop_assert_eq!(colours[0][epi.grid.at(x, y)], expected);
        }
    }
}
