use super::super::testing::Random;
use super::*;
use crate::epi::classify::clockwise;

const ALL_PLACES: [Places; 3] = [Places::Bits4, Places::Bits6, Places::Bits8];

/// Place on the boundary, `along` pixels clockwise from the top-left corner.
fn boundary(along: f64) -> [f64; 2] {
    let t = along.fract();
    match along as u32 % 4 {
        0 => [t, 0.0],
        1 => [1.0, t],
        2 => [1.0 - t, 1.0],
        _ => [0.0, 1.0 - t],
    }
}

/// Positive if `p` lies on the outer side of the chord from a to b, negative on the inner one.
fn outside_of(from: [f64; 2], to: [f64; 2], p: [f64; 2]) -> f64 {
    (to[0] - from[0]) * (p[1] - from[1]) - (to[1] - from[1]) * (p[0] - from[0])
}

fn middle(segment: u32) -> [f64; 2] {
    boundary((f64::from(segment) + 0.5) / 8.0)
}

#[test]
fn codes_keep_their_ends() {
    assert_eq!(EdgeCode::all_simple().count(), 6 * 64);
    for (a, b) in (0..32).flat_map(|a| (0..32).map(move |b| (a, b))) {
        let code = EdgeCode::from_boundary(1 << a | 1 << b);
        if a / 8 == b / 8 {
            assert_eq!(code, EdgeCode::COMPLEX);
        } else {
            assert_eq!(code.ends(), (a.min(b), a.max(b)));
            assert!(code.is_simple());
        }
    }
    assert_eq!(EdgeCode::from_boundary(0), EdgeCode::EMPTY);
    assert_eq!(
        EdgeCode::from_boundary(1 | 1 << 9 | 1 << 20),
        EdgeCode::COMPLEX
    );
    assert!(!EdgeCode::EMPTY.is_simple() && !EdgeCode::COMPLEX.is_simple());
}

#[test]
fn classes_keep_sides_and_primary_region() {
    let mut seen = [false; Class::COUNT];
    for code in EdgeCode::all_simple() {
        for inner in [false, true] {
            let class = Class::new(code, inner);
            let (a, b) = code.ends();
            assert_eq!(class.edge(), Some((((a / 8) as u8, (b / 8) as u8), inner)));
            seen[usize::from(class.0)] = true;
        }
    }
    for (class, code) in [
        (Class::EMPTY, EdgeCode::EMPTY),
        (Class::COMPLEX, EdgeCode::COMPLEX),
    ] {
        assert_eq!((Class::new(code, false), class.edge()), (class, None));
        seen[usize::from(class.0)] = true;
    }
    assert_eq!(seen, [true; Class::COUNT]);
}

/// Areas and centroids against counting the cells of a fine grid.
#[test]
fn areas_and_centroids_equal_counts() {
    let tables = CodeTables::new(Places::Bits4);
    let n = 200;
    for code in EdgeCode::all_simple() {
        let (from, to) = (middle(code.ends().0), middle(code.ends().1));
        let mut counted = [[0.0; 3]; 2];
        for (i, j) in (0..n).flat_map(|j| (0..n).map(move |i| (i, j))) {
            let p = [i, j].map(|k| (f64::from(k) + 0.5) / f64::from(n));
            let region = usize::from(outside_of(from, to, p) < 0.0);
            for (sum, value) in counted[region].iter_mut().zip([1.0, p[0], p[1]]) {
                *sum += value;
            }
        }
        let area = f64::from(tables.inner_area(code));
        assert!(
            (area - counted[1][0] / f64::from(n * n)).abs() < 0.005,
            "{code:?}"
        );
        assert_eq!(tables.inner_larger(code), area > 0.5);
        for (region, [count, x, y]) in counted.into_iter().enumerate() {
            let centroid = tables.centroid_px(code, region == 1);
            // The smallest regions hold few cells of the grid.
            let bound = 0.004 + 0.3 / count;
            assert!(
                (f64::from(centroid[0]) - x / count).abs() < bound,
                "{code:?} {centroid:?}"
            );
            assert!(
                (f64::from(centroid[1]) - y / count).abs() < bound,
                "{code:?} {centroid:?}"
            );
        }
    }
}

/// The paper's rule for ambiguous cells against many edges of each code: where none passes through a cell, all of its
/// places lie on the side that the table gives; where the table says ambiguous, some edge comes close at least.
#[test]
fn sides_of_cells_hold_for_every_edge_of_a_code() {
    for places in ALL_PLACES {
        let tables = CodeTables::new(places);
        let (n, mut ambiguous) = (places.per_axis(), 0);
        for code in EdgeCode::all_simple() {
            let (a, b) = code.ends();
            let ends = |segment: u32| {
                [0.0, 0.25, 0.5, 0.75, 1.0].map(|t| boundary((f64::from(segment) + t) / 8.0))
            };
            for cell in 0..n * n {
                let corners = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| {
                    [
                        (cell % n + dx) as f64 / n as f64,
                        (cell / n + dy) as f64 / n as f64,
                    ]
                });
                // Distances of the corners from all the edges, positive on the outer side.
                let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
                for (from, to) in ends(a)
                    .into_iter()
                    .flat_map(|p| ends(b).map(move |q| (p, q)))
                {
                    for corner in corners {
                        let side = outside_of(from, to, corner);
                        (low, high) = (low.min(side), high.max(side));
                    }
                }
                match tables.side(code, cell as u8) {
                    Side::Outer => assert!(low > -1e-9, "{code:?} {cell}: {low}"),
                    Side::Inner => assert!(high < 1e-9, "{code:?} {cell}: {high}"),
                    Side::Ambiguous => {
                        assert!(low < 1e-9 && high > -1e-9, "{code:?} {cell}: {low} {high}");
                        ambiguous += 1;
                    }
                }
            }
        }
        let share = f64::from(ambiguous) / (384 * n * n) as f64;
        println!("{places:?}: {share:.3} of all cells are ambiguous");
        assert!(share < 1.3 / n as f64 + 0.1);
    }
}

#[test]
fn cells_run_row_by_row() {
    assert_eq!(Places::Bits4.cell(0.0, 0.0), 0);
    assert_eq!(Places::Bits4.cell(0.26, 0.0), 1);
    assert_eq!(Places::Bits6.cell(0.99, 0.13), 15);
    assert_eq!(Places::Bits8.cell(1.0, 1.0), 255);
    assert_eq!(Places::Bits8.cell(-0.5, f32::NAN), 0);
}

#[test]
fn donors_touch_the_region_and_are_sorted() {
    let tables = CodeTables::new(Places::Bits4);
    for (code, inner) in EdgeCode::all_simple().flat_map(|c| [(c, false), (c, true)]) {
        let donors = tables.donors(code, inner);
        let listed = donors.iter().take_while(|&&n| n != NO_NEIGHBOUR).count();
        assert!(listed >= 3, "two sides and a corner at least: {code:?}");
        assert!(donors[listed..].iter().all(|&n| n == NO_NEIGHBOUR));
        let centre = tables.centroid_px(code, inner);
        let mut last = 0.0;
        for &n in &donors[..listed] {
            let (dx, dy) = NEIGHBOURS[usize::from(n)];
            let [x, y] = [dx as f32 + 0.5 - centre[0], dy as f32 + 0.5 - centre[1]];
            assert!(x * x + y * y >= last - 1e-5);
            last = x * x + y * y;
        }
    }
    // An upright edge near the left side: the inner region, at the right, is best seen in the right neighbour.
    assert_eq!(tables.donors(EdgeCode(1 << 5 | 22), true)[0], 0);
    // A cut-off corner at the top right knows its two sides and the corner, nobody else.
    let mut corner = tables.donors(EdgeCode(6 << 5 | 9), true).to_vec();
    corner.sort_unstable();
    assert_eq!(corner, [0, 3, 7, 8, 8, 8, 8, 8]);
}

/// ANCHORS test 17: coverage of a pixel by the coded edge against an exact clip, over random lines.
#[test]
fn coded_edges_cover_nearly_what_the_line_does() {
    let tables = CodeTables::new(Places::Bits4);
    let random = &mut Random::new(17);
    let (mut sum, mut worst, mut count) = (0.0f64, 0.0f64, 0);
    while count < 1_000_000 {
        // A line at a random angle and distance from the middle crosses the boundary where the corners change sides.
        let angle = std::f64::consts::PI * random.unit();
        let (normal, offset) = ([angle.cos(), angle.sin()], random.unit() * 1.5 - 0.75);
        let side = |p: [f64; 2]| (p[0] - 0.5) * normal[0] + (p[1] - 0.5) * normal[1] - offset;
        let mut ends = Vec::with_capacity(2);
        for k in 0..4 {
            let (s, t) = (
                side(boundary(f64::from(k))),
                side(boundary(f64::from((k + 1) % 4))),
            );
            if (s < 0.0) != (t < 0.0) {
                ends.push(f64::from(k) + s / (s - t));
            }
        }
        let [from, to] = ends[..] else { continue };
        let masks = [from, to].map(|along| {
            let eighth = ((along.fract() * 8.0) as u32).min(7);
            let mut sides = [0u8; 4];
            let k = along as usize;
            // Bottom and left boundaries count along +x and +y.
            sides[k] = 1 << if k < 2 { eighth } else { 7 - eighth };
            clockwise(sides)
        });
        let code = EdgeCode::from_boundary(masks[0] | masks[1]);
        assert!(code.is_simple());
        let mut polygon = vec![boundary(from)];
        polygon.extend(
            (1..4)
                .filter(|&k| from < f64::from(k) && f64::from(k) < to)
                .map(|k| boundary(f64::from(k))),
        );
        polygon.push(boundary(to));
        let n = polygon.len();
        let area: f64 = (0..n)
            .map(|i| {
                polygon[i][0] * polygon[(i + 1) % n][1] - polygon[i][1] * polygon[(i + 1) % n][0]
            })
            .sum::<f64>()
            / 2.0;
        let error = (f64::from(tables.inner_area(code)) - area).abs();
        sum += error;
        worst = worst.max(error);
        count += 1;
    }
    let mean = sum / f64::from(count);
    println!("coverage error: mean {mean:.4}, max {worst:.4}");
    assert!(mean <= 0.016 && worst <= 0.0625);
}
