use fearless_simd::Level;
use proptest::prelude::*;

use super::subpixels::sub_bit;
use super::*;
use crate::epi::code::Places;
use crate::epi::grid::Grid;
use crate::epi::reach::ReachMap;
use crate::epi::reach_tables::relation;
use crate::epi::testing::{
    Random, any_crossings, config, draw_line, image, places, random_crossings, random_samples,
};
use crate::filters::interpolate::{self, Interpolated, Interpolator, Method, Neighbours};

/// The 6x6 sub-pixels around a pixel as pixels of an image of their own. Quarters of a side become every other eighth.
fn enlarged(crossings: &Crossings, (x, y): (usize, usize)) -> Crossings {
    let mut large = Crossings::new(6, 6);
    let quarters = |mask: u8, high: usize| {
        (0..4).fold(0, |all, k| all | (mask >> (4 * high + k) & 1) << (2 * k))
    };
    let pixel = |column: usize, row: usize| {
        let (px, py) = (
            (x + column / 2).checked_sub(1)?,
            (y + row / 2).checked_sub(1)?,
        );
        (px < crossings.width && py < crossings.height).then_some((px, py))
    };
    for (column, row) in (0..6).flat_map(|row| (0..6).map(move |column| (column, row))) {
        let Some((px, py)) = pixel(column, row) else {
            continue;
        };
        let at = py * crossings.width + px;
        let [top, right, bottom, left] = crossings.around(px, py);
        let middle = (crossings.half_horizontal[at], crossings.half_vertical[at]);
        let (above, below) = if row % 2 == 0 {
            (top, middle.0)
        } else {
            (middle.0, bottom)
        };
        let (before, after) = if column % 2 == 0 {
            (left, middle.1)
        } else {
            (middle.1, right)
        };
        large.horizontal[row * 6 + column] = quarters(above, column % 2);
        large.horizontal[(row + 1) * 6 + column] = quarters(below, column % 2);
        large.vertical[row * 7 + column] = quarters(before, row % 2);
        large.vertical[row * 7 + column + 1] = quarters(after, row % 2);
    }
    large
}

proptest! {
    #![proptest_config(config(300, 54))]

    /// The 6x6 sub-pixels against an image that is classified and searched by the paper's tables.
    #[test]
    fn subpixels_equal_an_enlarged_image(seed: u64, share in 0.0..0.8f64) {
        let random = &mut Random::new(seed);
        let crossings = random_crossings(4, 3, share, random);
        let place = (random.next() as usize % 4, random.next() as usize % 3);
        let sub = Subpixels::load(&crossings, place);
        let mut large = image(&enlarged(&crossings, place), 0.0, Places::Bits4, random);
        // Region 0 is the outer one: let it be primary.
        large.primary_inner.fill(0);
        for (column, row) in (0..6).flat_map(|row| (0..6).map(move |column| (column, row))) {
            let (px, py) = ((place.0 + column / 2).wrapping_sub(1), (place.1 + row / 2).wrapping_sub(1));
            let code = large.code_at(column, row);
            let inside = px < 4 && py < 3;
            if !inside {
                large.code[large.grid.at(column, row)] = crate::epi::code::EdgeCode::COMPLEX.0;
            }
            let is_complex = code == crate::epi::code::EdgeCode::COMPLEX;
            prop_assert_eq!(sub.is_open((column, row)), inside && !is_complex);
            let (a, b) = code.ends();
            // Segments along +x and +y land on even eighths, the others on odd ones.
            let expected = code.is_simple().then_some((16 * (a / 2) + b / 2) as usize);
            prop_assert_eq!(sub.code((column, row)), expected);
        }
        for window in &WINDOWS {
            let (x, y) = (window.centre.0 as i32, window.centre.1 as i32);
            for (dx, dy) in (-2..=2).flat_map(|dy| (-2..=2).map(move |dx| (dx, dy))) {
                if (dx, dy) == (0, 0) {
                    continue;
                }
                let relation = relation(&large, (x, y), (dx, dy));
                let bit = sub_bit((x + dx) as usize, (y + dy) as usize);
                for from in 0..2 {
                    let reached = sub.reach(window, from);
                    for (to, plane) in reached.iter().enumerate() {
                        // The inner region of a sub-pixel without an edge is not there.
                        let expected = relation >> (2 * from + to) & 1 != 0;
                        if sub.code(window.centre).is_some() || from == 0 {
                            prop_assert_eq!(plane & bit != 0, expected, "{:?}", (dx, dy, from, to));
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn neighbourhoods_are_taken_bit_by_bit(width in 1usize..200, height in 1usize..5, seed: u64) {
        let random = &mut Random::new(seed);
        let grid = Grid::new(width, height);
        let plane: Vec<u64> =
            (0..grid.plane_words()).map(|i| random.next() & grid.valid(i % grid.words)).collect();
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let around = neighbourhood(grid, &plane, (x, y));
            for pixel in 0..9 {
                let (px, py) = ((x + pixel % 3).wrapping_sub(1), (y + pixel / 3).wrapping_sub(1));
                let set = px < width && py < height && {
                    let (word, bit) = grid.bit(px, py);
                    plane[word] >> bit & 1 != 0
                };
                prop_assert_eq!(around >> pixel & 1 != 0, set, "{:?}", (x, y, pixel));
            }
        }
    }

    /// Samples are found in the sub-pixel and on the side of its edge where they lie.
    #[test]
    fn samples_are_located_by_their_place(seed: u64) {
        let random = &mut Random::new(seed);
        let crossings = random_crossings(5, 5, 0.4, random);
        let sub = Subpixels::load(&crossings, (2, 2));
        let tables = SubTables::default();
        // The place on the sub-pixel's boundary, quarters of a side clockwise from the top left.
        let boundary = |along: f64| match along as usize / 4 {
            0 => [along / 4.0, 0.0],
            1 => [1.0, along / 4.0 - 1.0],
            2 => [3.0 - along / 4.0, 1.0],
            _ => [0.0, 4.0 - along / 4.0],
        };
        for pixel in 0..9 {
            let place = [random.unit(), random.unit()];
            let (column, row) = (pixel % 3, pixel / 3);
            let [high_x, high_y] = place.map(|v| usize::from(v >= 0.5));
            let at = (2 * column + high_x, 2 * row + high_y);
            let found = tables.locate(&sub, (column, row), place.map(|v| v as f32));
            let Some(code) = sub.code(at) else {
                prop_assert_eq!(found, sub.is_open(at).then(|| (sub_bit(at.0, at.1), 0)));
                continue;
            };
            let within = [place[0] * 2.0 - high_x as f64, place[1] * 2.0 - high_y as f64];
            let [a, b] = [code / 16, code % 16].map(|segment| boundary(segment as f64 + 0.5));
            let side = (b[0] - a[0]) * (within[1] - a[1]) - (b[1] - a[1]) * (within[0] - a[0]);
            if let Some((bit, region)) = found {
                prop_assert_eq!(bit, sub_bit(at.0, at.1));
                prop_assert_eq!(region, usize::from(side < 0.0));
            } else {
                // Half a segment and a cell's diagonal away the side is certain.
                let distance = side.abs() / (b[0] - a[0]).hypot(b[1] - a[1]);
                prop_assert!(distance < 0.125 + 0.18, "{} is not ambiguous", distance);
            }
        }
    }

    #[test]
    fn writes_complex_pixels_only_and_invents_no_colour(crossings in any_crossings(), seed: u64) {
        let random = &mut Random::new(seed);
        let epi = image(&crossings, 0.3, Places::Bits4, random);
        let mut samples = random_samples(epi.grid, 0.3, random);
        for plane in &mut samples.rgb {
            plane.iter_mut().for_each(|v| *v = random.unit() as f32);
        }
        let elements = epi.grid.elements();
        let mut colours = [(); 3].map(|()| (0..elements).map(|_| random.unit() as f32).collect());
        let before = colours.clone();
        let bare: Vec<u64> = (0..epi.grid.plane_words()).map(|_| random.next()).collect();
        let sources = if seed & 1 == 0 { Sources::Samples } else { Sources::SamplesAndNeighbours };
        let inputs = Inputs { epi: &epi, crossings: &crossings, samples: &samples, bare: &bare, paint: None, sources };
        let outcome = ComplexFilter::default().apply(&inputs, &mut colours);
        prop_assert_eq!(outcome.pixels, epi.counts.complex);
        for (x, y) in (0..epi.grid.height).flat_map(|y| (0..epi.grid.width).map(move |x| (x, y))) {
            let ((word, bit), at) = (epi.grid.bit(x, y), epi.grid.at(x, y));
            if epi.complex[word] >> bit & 1 == 0 {
                prop_assert_eq!(colours[1][at], before[1][at]);
            }
            prop_assert!((-1e-6..=1.0 + 1e-6).contains(&colours[1][at]));
        }
    }
}

#[test]
fn corners_of_pixels_are_corners_of_their_subpixels() {
    for (corner, (right, low)) in [(0, 0), (1, 0), (1, 1), (0, 1)].into_iter().enumerate() {
        for pixel in 0..9 {
            let expected = sub_bit(2 * (pixel % 3) + right, 2 * (pixel / 3) + low);
            assert_eq!(at_corner(1 << pixel, corner), expected);
        }
    }
}

/// A picture of straight edges, every face between them of a random colour that changes slowly.
struct Faces {
    lines: Vec<[[f64; 2]; 2]>,
    salt: u64,
}

impl Faces {
    /// `count` thin bars.
    fn bars(size: usize, count: usize, random: &mut Random) -> Self {
        let mut lines = Vec::new();
        for _ in 0..count {
            let middle = [(); 2].map(|()| size as f64 * random.unit());
            let angle = std::f64::consts::PI * random.unit();
            let along = [angle.cos(), angle.sin()];
            let width = 0.3 + 1.5 * random.unit();
            for side in [0.0, width] {
                let through = [middle[0] - side * along[1], middle[1] + side * along[0]];
                lines.push(
                    [-1e3, 1e3].map(|t| [through[0] + t * along[0], through[1] + t * along[1]]),
                );
            }
        }
        Self {
            lines,
            salt: random.next(),
        }
    }

    fn colour(&self, place: [f64; 2]) -> [f32; 3] {
        let face = self.lines.iter().fold(self.salt, |face, [from, to]| {
            let side =
                (to[0] - from[0]) * (place[1] - from[1]) - (to[1] - from[1]) * (place[0] - from[0]);
            face.rotate_left(5).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ u64::from(side > 0.0)
        });
        let random = &mut Random::new(face);
        let slope = [(); 2].map(|()| 0.1 * (random.unit() - 0.5));
        let shade = (place[0] * slope[0] + place[1] * slope[1]) as f32;
        [(); 3].map(|()| random.unit() as f32 + shade)
    }

    /// Mean over a pixel.
    fn pixel(&self, x: usize, y: usize) -> [f32; 3] {
        let n = 16;
        let mut sum = [0.0; 3];
        for i in 0..n * n {
            let offset = [i % n, i / n].map(|k| (k as f64 + 0.5) / n as f64);
            let colour = self.colour([x as f64 + offset[0], y as f64 + offset[1]]);
            sum = std::array::from_fn(|k| sum[k] + colour[k] / (n * n) as f32);
        }
        sum
    }
}

/// Everything up to the complex filter.
struct Scene {
    crossings: Crossings,
    epi: Epi,
    samples: PixelSamples,
    plain: Interpolated,
}

fn scene(faces: &Faces, size: usize, share: f64, random: &mut Random) -> Scene {
    let mut crossings = Crossings::new(size, size);
    faces
        .lines
        .iter()
        .for_each(|line| draw_line(&mut crossings, line[0], line[1]));
    let mut samples = random_samples(Grid::new(size, size), share, random);
    for (x, y) in (0..size).flat_map(|y| (0..size).map(move |x| (x, y))) {
        let at = samples.grid.at(x, y);
        let place = [
            x as f64 + f64::from(samples.x[at]),
            y as f64 + f64::from(samples.y[at]),
        ];
        let colour = faces.colour(place);
        samples
            .rgb
            .iter_mut()
            .zip(colour)
            .for_each(|(plane, value)| plane[at] = value);
    }
    let mut epi = image(&crossings, 0.0, Places::Bits4, random);
    epi.set_primary(&places(&samples));
    let mut reach = ReachMap::new(size, size);
    reach.compute(Level::new(), &epi);
    let mut plain = Interpolated::new(samples.grid);
    let near = Neighbours {
        right: &reach.steps.right[0],
        down: &reach.steps.down[0],
        simple: &epi.simple,
        complex: &epi.complex,
        has: &epi.has_sample,
    };
    let inputs = interpolate::Inputs {
        method: Method::FixedWeights,
        samples: &samples,
        near,
        centre_x: &epi.centre_px[0],
        centre_y: &epi.centre_px[1],
    };
    Interpolator::new(samples.grid).interpolate(Level::new(), None, &inputs, &mut plain);
    Scene {
        crossings,
        epi,
        samples,
        plain,
    }
}

/// Mean squared errors over complex pixels with an estimate: of the estimate, and after each filter.
fn errors(share: f64, bars: usize, filters: &[(Sources, f32)]) -> Vec<f64> {
    let random = &mut Random::new(77);
    let mut squares = vec![0.0; filters.len() + 1];
    let mut pixels = 0.0;
    for _ in 0..4 {
        let size = 64;
        let faces = Faces::bars(size, bars, random);
        let scene = scene(&faces, size, share, random);
        let filtered = filters.iter().map(|&(sources, lent_weight)| {
            let inputs = Inputs {
                epi: &scene.epi,
                crossings: &scene.crossings,
                samples: &scene.samples,
                bare: &scene.plain.bare,
                paint: None,
                sources,
            };
            let mut colours = scene.plain.rgb.clone();
            ComplexFilter {
                lent_weight,
                ..ComplexFilter::default()
            }
            .apply(&inputs, &mut colours);
            colours
        });
        let pictures: Vec<_> = [scene.plain.rgb.clone()]
            .into_iter()
            .chain(filtered)
            .collect();
        for (x, y) in (0..size).flat_map(|y| (0..size).map(move |x| (x, y))) {
            let ((word, bit), at) = (scene.epi.grid.bit(x, y), scene.epi.grid.at(x, y));
            if (scene.epi.complex[word] & !scene.plain.bare[word]) >> bit & 1 == 0 {
                continue;
            }
            let truth = faces.pixel(x, y);
            pixels += 1.0;
            for (sum, picture) in squares.iter_mut().zip(&pictures) {
                *sum += (0..3)
                    .map(|k| f64::from(picture[k][at] - truth[k]).powi(2))
                    .sum::<f64>();
            }
        }
    }
    squares.iter().map(|sum| sum / pixels).collect()
}

#[test]
fn lowers_the_error_of_complex_pixels() {
    for (share, bars) in [(0.1, 8), (0.3, 8), (1.0, 8), (0.3, 40), (1.0, 40)] {
        let filters = [
            (Sources::Samples, 1.0),
            (Sources::SamplesAndNeighbours, LENT_WEIGHT),
        ];
        let errors = errors(share, bars, &filters);
        println!("{share} of pixels sampled, {bars} bars: {errors:.4?}");
        assert!(
            errors[1] < 1.02 * errors[0],
            "the paper's filter does harm: {errors:?}"
        );
        assert!(
            errors[2] < 0.95 * errors[0],
            "no better than the estimate: {errors:?}"
        );
    }
}

/// From the paper's 1-3 % of the pixels to all of them, no other weight does much better than the one in use.
#[test]
fn the_weight_of_lent_colours_suits_every_share() {
    for (share, bars) in [(0.03, 8), (0.3, 8), (1.0, 8), (0.3, 40)] {
        let weights = [0.01, 0.1, 0.5, 1.0, 2.0, LENT_WEIGHT];
        let filters = weights.map(|w| (Sources::SamplesAndNeighbours, w));
        let errors = errors(share, bars, &filters);
        println!("{share} of pixels sampled, {bars} bars: {errors:.4?}");
        let (&used, others) = errors.split_last().unwrap();
        let best = others.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(used < 1.1 * best, "{share}, {bars} bars: {errors:?}");
    }
}

/// Where every pixel is complex there is nothing to lend, and the filter must not do harm (the paper's promise).
#[test]
fn does_no_harm_where_all_is_complex() {
    let random = &mut Random::new(3);
    let size = 32;
    let mut lines = Vec::new();
    for i in 0..3 * size {
        let at = i as f64 / 2.9 + 0.07;
        lines.push([[at, -1e3], [at + 0.003, 1e3]]);
        lines.push([[-1e3, at], [1e3, at + 0.003]]);
    }
    let faces = Faces { lines, salt: 5 };
    let scene = scene(&faces, size, 0.5, random);
    assert_eq!(scene.epi.counts.complex, size * size);
    let mut colours = scene.plain.rgb.clone();
    let inputs = Inputs {
        epi: &scene.epi,
        crossings: &scene.crossings,
        samples: &scene.samples,
        bare: &scene.plain.bare,
        paint: None,
        sources: Sources::default(),
    };
    ComplexFilter::default().apply(&inputs, &mut colours);
    let (mut before, mut after) = (0.0, 0.0);
    for (x, y) in (0..size).flat_map(|y| (0..size).map(move |x| (x, y))) {
        let (truth, at) = (faces.pixel(x, y), scene.epi.grid.at(x, y));
        for (k, truth) in truth.into_iter().enumerate() {
            before += (scene.plain.rgb[k][at] - truth).powi(2);
            after += (colours[k][at] - truth).powi(2);
        }
    }
    assert!(after <= 1.05 * before, "{before} to {after}");
}
