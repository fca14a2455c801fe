//! The rasteriser against exact geometry.

use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::clip::{Projector, SUBPIXELS};
use super::crossings::Crossings;
use super::raster::{Crossing, crossings_of};
use crate::camera::View;
use protocol::messages::Camera;

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: RngSeed::Fixed(11),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// Side of the test pictures, px.
const SIDE: i64 = 4;

/// Crossings by exact arithmetic on ends that really are moved, by 2⁻³⁰ along x and 2⁻⁵⁰ along y.
fn exact(ends: [[i64; 2]; 2], half: bool) -> Vec<Crossing> {
    let moved = ends.map(|[x, y]| [(i128::from(x) << 50) + (1 << 20), (i128::from(y) << 50) + 1]);
    let mut found = Vec::new();
    for horizontal in [true, false] {
        let axis = usize::from(horizontal);
        for line in (0..=2 * SIDE).filter(|l| half || l % 2 == 0) {
            let at = i128::from(line * SUBPIXELS / 2) << 50;
            let [p, q] = moved;
            if (p[axis] < at) == (q[axis] < at) {
                continue;
            }
            let (du, dv) = (q[axis] - p[axis], q[1 - axis] - p[1 - axis]);
            let numerator = p[1 - axis] * du + (at - p[axis]) * dv;
            let denominator = du * (i128::from(SUBPIXELS / 8) << 50);
            let (n, d) = if denominator < 0 {
                (-numerator, -denominator)
            } else {
                (numerator, denominator)
            };
            let eighth = n.div_euclid(d) as i64;
            if (0..SIDE * 8).contains(&eighth) {
                found.push(Crossing {
                    horizontal,
                    line,
                    eighth,
                });
            }
        }
    }
    found
}

fn all(ends: [[i64; 2]; 2], half: bool) -> Vec<Crossing> {
    let mut found = Vec::new();
    crossings_of(ends, [SIDE, SIDE], half, |c| found.push(c));
    found
}

/// How often each pixel's boundary is crossed.
fn tally(polygon: &[[i64; 2]]) -> Vec<usize> {
    let mut count = vec![0; (SIDE * SIDE) as usize];
    let mut add = |x: i64, y: i64| {
        if (0..SIDE).contains(&x) && (0..SIDE).contains(&y) {
            count[(y * SIDE + x) as usize] += 1;
        }
    };
    for (i, p) in polygon.iter().enumerate() {
        for c in all([*p, polygon[(i + 1) % polygon.len()]], false) {
            let (line, cell) = (c.line / 2, c.eighth / 8);
            for beside in [line - 1, line] {
                if c.horizontal {
                    add(cell, beside);
                } else {
                    add(beside, cell);
                }
            }
        }
    }
    count
}

/// Coordinates that often lie on lines, eighths and corners; none is far outside of the picture.
fn coordinate() -> impl Strategy<Value = i64> {
    let size = SIDE * SUBPIXELS;
    prop_oneof![
        -300..size + 300,
        (0..=SIDE).prop_map(|p| p * SUBPIXELS),
        (0..=8 * SIDE).prop_map(|e| e * SUBPIXELS / 8),
        (0..=2 * SIDE, -2..=2_i64).prop_map(|(p, d)| p * SUBPIXELS / 2 + d),
    ]
}

fn point() -> impl Strategy<Value = [i64; 2]> {
    [coordinate(), coordinate()]
}

proptest! {
    #![proptest_config(config(4000))]

    #[test]
    fn crossings_are_exact(a in point(), b in point(), half: bool) {
        let mut expected = exact([a, b], half);
        for ends in [[a, b], [b, a]] {
            let mut found = all(ends, half);
            found.sort_unstable_by_key(|c| (c.horizontal, c.line));
            expected.sort_unstable_by_key(|c| (c.horizontal, c.line));
            prop_assert_eq!(&found, &expected);
        }
    }

    #[test]
    fn outlines_cross_every_pixel_evenly(polygon in prop::collection::vec(point(), 3..9)) {
        prop_assert!(tally(&polygon).iter().all(|n| n % 2 == 0));
    }

    #[test]
    fn a_segment_through_a_pixel_crosses_it_twice(a in point(), b in point()) {
        let inside = |p: [i64; 2], x: i64, y: i64| {
            p[0].div_euclid(SUBPIXELS) == x && p[1].div_euclid(SUBPIXELS) == y
        };
        let mut count = vec![0; (SIDE * SIDE) as usize];
        for c in all([a, b], false) {
            let (line, cell) = (c.line / 2, c.eighth / 8);
            for beside in [line - 1, line] {
                let (x, y) = if c.horizontal { (cell, beside) } else { (beside, cell) };
                if (0..SIDE).contains(&x) && (0..SIDE).contains(&y) {
                    count[(y * SIDE + x) as usize] += 1;
                }
            }
        }
        for (i, n) in count.into_iter().enumerate() {
            let (x, y) = (i as i64 % SIDE, i as i64 / SIDE);
            let ends = usize::from(inside(a, x, y)) + usize::from(inside(b, x, y));
            prop_assert!(n <= 2 && n % 2 == ends % 2, "{n} crossings and {ends} ends in {x}, {y}");
        }
    }

    #[test]
    fn recording_puts_each_crossing_where_it_belongs(a in point(), b in point()) {
        let mut drawn = Crossings::new(SIDE as usize, SIDE as usize);
        for c in all([a, b], true) {
            drawn.record(c);
        }
        let mut expected = Crossings::new(SIDE as usize, SIDE as usize);
        for c in exact([a, b], true) {
            let bit = 1 << (c.eighth % 8);
            let (line, cell, side) = ((c.line / 2) as usize, (c.eighth / 8) as usize, SIDE as usize);
            match (c.horizontal, c.line % 2) {
                (true, 0) => expected.horizontal[line * side + cell] |= bit,
                (true, _) => expected.half_horizontal[line * side + cell] |= bit,
                (false, 0) => expected.vertical[cell * (side + 1) + line] |= bit,
                (false, _) => expected.half_vertical[cell * side + line] |= bit,
            }
        }
        prop_assert_eq!(drawn, expected);
    }

    #[test]
    fn projecting_never_fails(
        a in prop::array::uniform3(prop_oneof![-10.0_f32..10.0, -1e30_f32..1e30, Just(0.0), any::<f32>()]),
        b in prop::array::uniform3(prop_oneof![-10.0_f32..10.0, -1e30_f32..1e30, Just(0.0), any::<f32>()]),
    ) {
        let view = view();
        if let Some(segment) = Projector::new(&view).project(a, b) {
            let bound = 4096 * SUBPIXELS;
            prop_assert!(segment.ends.as_flattened().iter().all(|c| c.abs() < bound), "{segment:?}");
            prop_assert!(segment.inverse_depth.iter().all(|d| *d > 0.0 && d.is_finite()));
            let mut drawn = Crossings::new(512, 384);
            drawn.draw(&segment, true);
        }
    }

    #[test]
    fn a_clipped_segment_crosses_where_the_whole_one_would(
        a in [-4.0_f64..4.0, -4.0..4.0, 0.1..4.0],
        b in prop::array::uniform3(-4.0_f64..4.0),
    ) {
        let (a, b) = (a.map(|x| f64::from(x as f32)), b.map(|x| f64::from(x as f32)));
        let view = view();
        let Some(segment) = Projector::new(&view).project(a.map(|x| x as f32), b.map(|x| x as f32)) else {
            return Ok(());
        };
        // Any point of the clipped segment must lie on the plane through the eye and the whole one.
        let n = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        let focal = f64::from(view.focal_px);
        let line = [n[0] / focal, -n[1] / focal, n[2]];
        let length = line[0].hypot(line[1]);
        if length < 1e-6 {
            return Ok(());
        }
        for [x, y] in segment.ends {
            let (x, y) = (x as f64 / SUBPIXELS as f64 - 256.0, y as f64 / SUBPIXELS as f64 - 192.0);
            let distance = (line[0] * x + line[1] * y + line[2]).abs() / length;
            prop_assert!(distance < 2.0 / SUBPIXELS as f64, "{distance} px off");
        }
    }
}

fn view() -> View {
    View::new(&Camera {
        eye: [0.0, 0.0, 0.0],
        target: [0.0, 0.0, -1.0],
        up: [0.0, 1.0, 0.0],
        fov_y: 50.0,
        width: 512,
        height: 384,
    })
}
