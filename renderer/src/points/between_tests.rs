//! What neighbours say, against its definition.

use super::*;
use crate::edges::clip::{ImageSegment, SUBPIXELS};
use crate::edges::crossings::Crossings;
use crate::epi::classify::classify;
use crate::epi::code::Places;
use crate::points::around::HIDDEN;
use crate::sampling::place::hash_unit;

const PX: f32 = 1.0 / 300.0;

fn is_set(plane: &[u64], grid: Grid, (x, y): (usize, usize)) -> bool {
    let (word, bit) = grid.bit(x, y);
    plane[word] >> bit & 1 == 1
}

/// Neighbours in the picture, with the pixel itself.
fn ring(grid: Grid, (x, y): (usize, usize)) -> impl Iterator<Item = (usize, usize)> {
    let rows = y.saturating_sub(1)..(y + 2).min(grid.height);
    rows.flat_map(move |y| (x.saturating_sub(1)..(x + 2).min(grid.width)).map(move |x| (x, y)))
}

/// Is it doubtful, or behind the mean of those around it?
fn unsure(pixels: &PixelSamples, (x, y): (usize, usize)) -> bool {
    let grid = pixels.grid;
    let inverse = |(x, y)| 1.0 / f64::from(pixels.depth[grid.at(x, y)]);
    let others: Vec<f64> = ring(grid, (x, y))
        .filter(|&p| p != (x, y) && is_set(&pixels.has, grid, p))
        .map(inverse)
        .collect();
    let mean = others.iter().sum::<f64>() / others.len().max(1) as f64;
    is_set(&pixels.doubtful, grid, (x, y)) || mean > 1.03 * inverse((x, y))
}

/// The same by its definition: hidden and vouched for.
fn plain(pixels: &PixelSamples, epi: &Epi, p: (usize, usize)) -> [bool; 2] {
    let grid = pixels.grid;
    let free = |(x, y): (usize, usize)| {
        let edge = [&epi.simple, &epi.complex].map(|plane| is_set(plane, grid, (x, y)));
        x >= 2 && x + 2 < grid.width && edge == [false; 2]
    };
    let mut around = Around {
        most: 0.0,
        least: f32::INFINITY,
    };
    let inverse = |(x, y)| 1.0 / pixels.depth[grid.at(x, y)];
    if !free(p) {
        return [false; 2];
    }
    for middle in ring(grid, p).filter(|&q| free(q)) {
        for q in ring(grid, middle).filter(|&q| free(q)) {
            if is_set(&pixels.has, grid, q) && !unsure(pixels, q) {
                around.most = around.most.max(inverse(q));
                around.least = around.least.min(inverse(q));
            }
        }
    }
    let verdict = around.judge(inverse(p), PX);
    if unsure(pixels, p) {
        [verdict == Verdict::Hidden, verdict == Verdict::Visible]
    } else {
        [inverse(p) < HIDDEN * around.most, false]
    }
}

fn random_pixels(width: usize, edge: f32) -> (PixelSamples, Epi) {
    let grid = Grid::new(width, 40);
    let mut pixels = PixelSamples::new(grid);
    let mut epi = Epi::new(width, 40, Places::Bits8);
    for y in 0..40 {
        for x in 0..width {
            let random = |salt: u64| hash_unit(salt, (y * width + x) as u64);
            let (word, bit) = grid.bit(x, y);
            if random(1) < 0.4 {
                pixels.has[word] |= 1 << bit;
                let depth = [2.0, 2.004, 2.01, 2.05, 2.1, 2.5, 4.0, 1e30];
                pixels.depth[grid.at(x, y)] = depth[(random(2) * 8.0) as usize];
                pixels.doubtful[word] |= u64::from(random(3) < 0.5) << bit;
            }
            epi.simple[word] |= u64::from(random(4) < edge) << bit;
            epi.complex[word] |= u64::from(random(5) < 0.5 * edge) << bit;
        }
    }
    (pixels, epi)
}

#[test]
fn every_level_agrees_with_the_definition() {
    for (width, edge) in [(150, 0.006), (128, 0.006), (70, 0.2), (5, 0.0), (3, 0.0)] {
        let (pixels, epi) = random_pixels(width, edge);
        let grid = pixels.grid;
        for level in [Level::new(), Level::baseline()] {
            let mut between = Between::new(grid);
            // What an earlier frame has left changes nothing.
            between.find(level, &random_pixels(width, 0.5).0, None, 1.0);
            between.find(level, &pixels, Some(&epi), 1.0 / PX);
            let mut counts = [0; 2];
            for p in (0..40).flat_map(|y| (0..width).map(move |x| (x, y))) {
                let has = is_set(&pixels.has, grid, p);
                let wanted = if has {
                    plain(&pixels, &epi, p)
                } else {
                    [false; 2]
                };
                let found = [&between.hidden, &between.vouched].map(|b| is_set(b, grid, p));
                assert_eq!(found, wanted, "{width} {p:?}");
                assert_eq!(
                    is_set(&between.unsure, grid, p),
                    has && unsure(&pixels, p),
                    "{width} {p:?}"
                );
                counts = [0, 1].map(|k| counts[k] + usize::from(found[k]));
            }
            assert!(width < 60 || counts.iter().all(|&c| c > 50), "{counts:?}");
        }
    }
}

#[test]
fn only_points_behind_their_neighbours_are_unsure_on_a_slanted_plane() {
    let grid = Grid::new(80, 5);
    let mut pixels = PixelSamples::new(grid);
    for (x, y) in (0..5).flat_map(|y| (0..80).map(move |x| (x, y))) {
        pixels.depth[grid.at(x, y)] = 1.0 / (0.5 - 0.004 * x as f32);
        pixels.has[grid.bit(x, y).0] |= 1 << grid.bit(x, y).1;
    }
    pixels.depth[grid.at(70, 2)] *= 3.0;
    let mut between = Between::new(grid);
    between.find(Level::new(), &pixels, None, 1.0 / PX);
    let inner = |p: (usize, usize)| (1..79).contains(&p.0) && (1..4).contains(&p.1);
    for p in (0..5)
        .flat_map(|y| (0..80).map(move |x| (x, y)))
        .filter(|&p| inner(p))
    {
        assert_eq!(is_set(&between.unsure, grid, p), p == (70, 2), "{p:?}");
    }
}

#[test]
fn what_a_ray_finds_tells_neighbours_but_not_across_edges() {
    let grid = Grid::new(80, 9);
    let pixels = PixelSamples::new(grid);
    // An upright line through the middle of column 40.
    let mut crossings = Crossings::new(80, 9);
    let ends = [[40.5, 9.0], [40.5, 0.0]].map(|p| p.map(|v| (v * SUBPIXELS as f64) as i64));
    let segment = ImageSegment {
        ends,
        along: [0.0, 1.0],
        inverse_depth: [1.0; 2],
    };
    crossings.draw(&segment, false);
    let mut epi = Epi::new(80, 9, Places::Bits8);
    classify(Level::new(), &crossings, &mut epi);
    assert!(epi.code_at(40, 4).is_simple());
    let mut between = Between::new(grid);
    between.find(Level::new(), &pixels, Some(&epi), 1.0 / PX);
    between.learn((38, 4), 0.5);
    between.learn((40, 4), 5.0);
    between.learn((41, 6), 0.1);
    let ask = |p, place, inverse| between.ask(&epi, p, [place, 0.5], inverse, PX);
    let middle = 0.5;
    assert_eq!(ask((37, 3), middle, 0.502), Verdict::Visible);
    assert_eq!(ask((37, 3), middle, 0.2), Verdict::Hidden);
    assert_eq!(ask((37, 3), middle, 0.48), Verdict::Unknown);
    assert_eq!(ask((36, 2), middle, 0.5), Verdict::Visible);
    assert_eq!(ask((39, 4), middle, 0.5), Verdict::Visible);
    assert_eq!(ask((41, 4), middle, 0.5), Verdict::Unknown);
    assert_eq!(ask((42, 5), middle, 0.1), Verdict::Visible);
    assert_eq!(ask((1, 4), middle, 0.5), Verdict::Unknown);
    // In the pixels of the edge its sides differ.
    assert_eq!(ask((40, 4), 0.1, 0.5), Verdict::Visible);
    assert_eq!(ask((40, 5), 0.9, 0.1), Verdict::Visible);
    assert_eq!(ask((40, 5), 0.1, 0.1), Verdict::Hidden);
    assert_eq!(ask((40, 2), 0.9, 0.5), Verdict::Unknown);
}
