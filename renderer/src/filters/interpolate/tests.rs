use super::*;
use crate::sampling::place::hash_unit;

type Pixel = (usize, usize);

/// An image with random samples, and walls between pixels at random.
struct Scene {
    samples: PixelSamples,
    right: Vec<u64>,
    down: Vec<u64>,
    simple: Vec<u64>,
    complex: Vec<u64>,
    centre: [Vec<f32>; 2],
}

impl Scene {
    /// Shares of pixels with samples, of sides that are walls, and of complex pixels.
    fn random(grid: Grid, seed: u64, [share, walls, complex]: [f32; 3]) -> Self {
        let plane = || vec![0; grid.plane_words()];
        let mut scene = Self {
            samples: PixelSamples::new(grid),
            right: plane(),
            down: plane(),
            simple: plane(),
            complex: plane(),
            centre: [vec![0.5; grid.elements()], vec![0.5; grid.elements()]],
        };
        let pixels = (0..grid.height).flat_map(|y| (0..grid.width).map(move |x| (x, y)));
        for (x, y) in pixels.clone() {
            let unit = |k: u64| hash_unit(seed ^ k << 32, (y * grid.width + x) as u64);
            let (word, bit) = grid.bit(x, y);
            scene.complex[word] |= u64::from(unit(1) < complex) << bit;
            if unit(2) < share {
                let (at, s) = (grid.at(x, y), &mut scene.samples);
                [s.x[at], s.y[at]] = [unit(3), unit(4)];
                s.count[at] = 1.0 + (3.0 * unit(5)).floor();
                for (plane, k) in s.rgb.iter_mut().zip(6..) {
                    plane[at] = unit(k);
                }
                s.has[word] |= 1 << bit;
            }
        }
        // Every pixel beside a wall has an edge in it.
        for (x, y) in pixels {
            let unit = |k: u64| hash_unit(seed ^ k << 32, (y * grid.width + x) as u64);
            for (k, there) in [(11, (x + 1, y)), (12, (x, y + 1))] {
                if there.0 >= grid.width || there.1 >= grid.height {
                    continue;
                }
                let ends = [(x, y), there].map(|(x, y)| grid.bit(x, y));
                let open =
                    unit(k) >= walls && ends.iter().all(|&(w, b)| scene.complex[w] >> b & 1 == 0);
                let (word, bit) = ends[0];
                if open {
                    let plane = if k == 11 {
                        &mut scene.right
                    } else {
                        &mut scene.down
                    };
                    plane[word] |= 1 << bit;
                } else {
                    for (word, bit) in ends {
                        scene.simple[word] |= 1 << bit & !scene.complex[word];
                    }
                }
            }
        }
        scene.place_middles(seed);
        scene
    }

    /// Primary regions of simple pixels have their middles anywhere.
    fn place_middles(&mut self, seed: u64) {
        let grid = self.samples.grid;
        for (x, y) in (0..grid.height).flat_map(|y| (0..grid.width).map(move |x| (x, y))) {
            if self.bit(&self.simple, (x, y)) {
                for (centre, k) in self.centre.iter_mut().zip(9..) {
                    let key = (y * grid.width + x) as u64;
                    centre[grid.at(x, y)] = hash_unit(seed ^ k << 32, key);
                }
            }
        }
    }

    fn run(&self, level: Level, pool: Option<&ThreadPool>, method: Method) -> Interpolated {
        let grid = self.samples.grid;
        let near = Neighbours {
            right: &self.right,
            down: &self.down,
            simple: &self.simple,
            complex: &self.complex,
            has: &self.samples.has,
        };
        let inputs = Inputs {
            method,
            samples: &self.samples,
            near,
            centre_x: &self.centre[0],
            centre_y: &self.centre[1],
        };
        let mut out = Interpolated::new(grid);
        let mut interpolator = Interpolator::new(grid);
        // What the frame before left must not show.
        interpolator.interpolate(level, pool, &inputs, &mut out);
        interpolator.interpolate(level, pool, &inputs, &mut out);
        out
    }

    fn bit(&self, plane: &[u64], (x, y): Pixel) -> bool {
        let (word, bit) = self.samples.grid.bit(x, y);
        plane[word] >> bit & 1 == 1
    }

    fn joined(&self, (x, y): Pixel) -> Vec<Pixel> {
        let mut all = Vec::new();
        if self.bit(&self.right, (x, y)) {
            all.push((x + 1, y));
        }
        if self.bit(&self.down, (x, y)) {
            all.push((x, y + 1));
        }
        if x > 0 && self.bit(&self.right, (x - 1, y)) {
            all.push((x - 1, y));
        }
        if y > 0 && self.bit(&self.down, (x, y - 1)) {
            all.push((x, y - 1));
        }
        all
    }

    /// Everything that can be reached from these pixels in so many steps, where `allowed`.
    fn reach(&self, from: &[Pixel], steps: usize, allowed: impl Fn(Pixel) -> bool) -> Vec<Pixel> {
        let mut reached = from.to_vec();
        for _ in 0..steps {
            let ring: Vec<Pixel> = reached.iter().flat_map(|&p| self.joined(p)).collect();
            let before = reached.len();
            for p in ring {
                if allowed(p) && !reached.contains(&p) {
                    reached.push(p);
                }
            }
            if reached.len() == before {
                break;
            }
        }
        reached
    }

    /// The pixel and those of the eight around it that it reaches.
    fn beside(&self, (x, y): Pixel) -> Vec<Pixel> {
        let grid = self.samples.grid;
        let is_beside = |(u, v): Pixel| u.abs_diff(x) <= 1 && v.abs_diff(y) <= 1;
        if self.bit(&self.complex, (x, y)) {
            let rows = (0..grid.height).flat_map(|y| (0..grid.width).map(move |x| (x, y)));
            return rows.filter(|&p| is_beside(p)).collect();
        }
        self.reach(&[(x, y)], 2, is_beside)
    }

    /// Whether each pixel of a block has three samples beside it.
    fn is_dense(&self, (x, y): Pixel) -> bool {
        let grid = self.samples.grid;
        let rows = (y..(y + 4).min(grid.height))
            .flat_map(|y| (x..(x + 4).min(grid.width)).map(move |x| (x, y)));
        x < grid.width
            && rows.into_iter().all(|p| {
                let beside = self.beside(p);
                let has = beside
                    .iter()
                    .filter(|&&(x, y)| self.samples.has_sample(x, y));
                has.count() >= 3
            })
    }

    /// The samples that serve a pixel and the area that they were found in, by the descriptions of [`super::super::blocks`]
    /// and [`super::super::lattice`].
    fn serving(&self, (x, y): Pixel) -> (Vec<Pixel>, usize) {
        let grid = self.samples.grid;
        let block = [x & !3, y & !3];
        let four = [0, 4, 8, 12].map(|dx| self.is_dense(((x & !15) + dx, block[1])));
        if four[x % 16 / 4] && four.iter().filter(|&&dense| dense).count() >= 2 {
            let beside = self.beside((x, y));
            let has = beside
                .iter()
                .filter(|&&(x, y)| self.samples.has_sample(x, y));
            return (has.copied().collect(), beside.len());
        }
        let apart = |p: Pixel| {
            let [x, y] = [(p.0, block[0]), (p.1, block[1])]
                .map(|(p, b)| b.saturating_sub(p).max(p.saturating_sub(b + 3)));
            x.max(y)
        };
        let within = |margin: usize| {
            let rows = (0..grid.height).flat_map(|y| (0..grid.width).map(move |x| (x, y)));
            rows.filter(|&p| apart(p) <= margin).collect::<Vec<_>>()
        };
        let window = within(2);
        let edged = window
            .iter()
            .any(|&p| self.bit(&self.simple, p) || self.bit(&self.complex, p));
        let complex = self.bit(&self.complex, (x, y));
        // Where no edge shows, what lies beyond the image's border counts as looked at.
        let (mut reached, everything) = if complex || !edged {
            (window, true)
        } else {
            (self.reach(&[(x, y)], 64, |p| apart(p) <= 2), false)
        };
        let sampled = |all: &[Pixel]| {
            let has = all.iter().filter(|&&(x, y)| self.samples.has_sample(x, y));
            has.copied().collect::<Vec<_>>()
        };
        let close: Vec<Pixel> = reached.iter().copied().filter(|&p| apart(p) <= 1).collect();
        let grows = !complex && (everything || reached.iter().any(|&p| apart(p) == 2));
        if grows && sampled(&reached).len() < 5 {
            let mut area = if everything { 64 - reached.len() } else { 0 };
            for _ in 0..12 {
                let before = reached.len();
                reached = self.reach(&reached, 1, |_| true);
                if sampled(&reached).len() >= 6 || reached.len() == before {
                    break;
                }
            }
            area += reached.len();
            (sampled(&reached), area)
        } else if sampled(&close).len() >= 8 {
            (sampled(&close), if everything { 36 } else { close.len() })
        } else {
            (
                sampled(&reached),
                if everything { 64 } else { reached.len() },
            )
        }
    }

    /// A pixel's colour by its definition, in double precision; nothing if it reaches no sample.
    fn by_definition(&self, (x, y): Pixel) -> Option<[f64; 3]> {
        let s = &self.samples;
        let (near, area) = self.serving((x, y));
        let softening = (0.45 * area as f32 / near.len() as f32).max(0.25);
        let wanted = self.centre.each_ref().map(|c| c[s.grid.at(x, y)]);
        let places: Vec<[f64; 2]> = near
            .iter()
            .map(|&(u, v)| {
                let at = s.grid.at(u, v);
                let dx = u as f32 + s.x[at] - (x as f32 + wanted[0]);
                let dy = v as f32 + s.y[at] - (y as f32 + wanted[1]);
                [f64::from(dx), f64::from(dy)]
            })
            .collect();
        // (s / (s + d²))⁵ by way of a float's bits, as the fast path has it.
        let weight = |[dx, dy]: [f64; 2], count: f32| {
            let log = |v: f32| i64::from(v.to_bits());
            let q = (dx * dx + dy * dy) as f32 + softening;
            f64::from(f32::from_bits(
                (log(count) - 5 * (log(q) - log(softening))) as u32,
            ))
        };
        let weights: Vec<f64> = near
            .iter()
            .zip(&places)
            .map(|(&(u, v), &place)| weight(place, s.count[s.grid.at(u, v)]))
            .collect();
        let total: f64 = weights.iter().sum();
        (!near.is_empty()).then(|| {
            let mean = |f: &dyn Fn(usize) -> f64| {
                (0..near.len()).map(|i| weights[i] * f(i)).sum::<f64>() / total
            };
            let (mx, my) = (mean(&|i| places[i][0]), mean(&|i| places[i][1]));
            let far = mean(&|i| places[i][0].powi(2) + places[i][1].powi(2));
            let ridge = 0.001 * (1.0 + far);
            let xx = mean(&|i| places[i][0].powi(2)) - mx * mx + ridge;
            let yy = mean(&|i| places[i][1].powi(2)) - my * my + ridge;
            let xy = mean(&|i| places[i][0] * places[i][1]) - mx * my;
            [0, 1, 2].map(|k| {
                let colour = |i: usize| f64::from(s.rgb[k][s.grid.at(near[i].0, near[i].1)]);
                let mc = mean(&colour);
                let cx = mean(&|i| places[i][0] * colour(i)) - mx * mc;
                let cy = mean(&|i| places[i][1] * colour(i)) - my * mc;
                let det = xx * yy - xy * xy;
                let value = mc - mx * (yy * cx - xy * cy) / det - my * (xx * cy - xy * cx) / det;
                let low = (0..near.len()).map(colour).fold(f64::INFINITY, f64::min);
                let high = (0..near.len()).map(colour).fold(0.0, f64::max);
                value.clamp(low, high)
            })
        })
    }
}

/// Sizes and shares of samples, walls and complex pixels.
const SCENES: [((usize, usize), [f32; 3]); 10] = [
    ((150, 21), [0.8, 0.1, 0.02]),
    ((70, 13), [0.02, 0.0, 0.0]),
    ((64, 8), [0.3, 0.0, 0.0]),
    ((130, 11), [1.0, 0.02, 0.0]),
    ((67, 30), [0.2, 0.1, 0.01]),
    ((90, 33), [0.1, 0.3, 0.05]),
    ((129, 22), [0.05, 0.5, 0.0]),
    ((1, 9), [0.5, 0.1, 0.0]),
    ((9, 1), [0.2, 0.0, 0.0]),
    ((3, 2), [0.0, 0.2, 0.1]),
];

#[test]
fn every_pixel_has_the_colour_of_the_fit_s_definition() {
    for (seed, ((width, height), shares)) in SCENES.into_iter().enumerate() {
        let grid = Grid::new(width, height);
        let scene = Scene::random(grid, seed as u64, shares);
        let out = scene.run(Level::new(), None, Method::LinearFit);
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let exact = scene.by_definition((x, y));
            assert_eq!(
                scene.bit(&out.bare, (x, y)),
                exact.is_none(),
                "{seed} {x} {y}"
            );
            for (plane, exact) in out.rgb.iter().zip(exact.unwrap_or_default()) {
                let got = f64::from(plane[grid.at(x, y)]);
                let bare = scene.bit(&out.bare, (x, y));
                assert!(
                    bare || (got - exact).abs() < 5e-3,
                    "{seed} {x} {y}: {got} for {exact}"
                );
            }
        }
    }
}

#[test]
fn levels_and_threads_change_nothing() {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(3)
        .build()
        .unwrap();
    for (seed, ((width, height), shares)) in SCENES.into_iter().enumerate() {
        let scene = Scene::random(Grid::new(width, height), seed as u64, shares);
        for method in [Method::LinearFit, Method::FixedWeights] {
            let out = scene.run(Level::new(), None, method);
            for other in [
                scene.run(Level::baseline(), None, method),
                scene.run(Level::new(), Some(&pool), method),
            ] {
                assert_eq!(out.rgb, other.rgb, "{seed}");
                assert_eq!(
                    (&out.weight, &out.bare),
                    (&other.weight, &other.bare),
                    "{seed}"
                );
            }
        }
    }
}

/// Samples have the colour of the region that walls close off around them; no pixel may show another's.
#[test]
fn colours_never_pass_a_wall() {
    let grid = Grid::new(96, 64);
    for (seed, walls) in [(1, 0.4), (2, 0.5), (3, 0.6)] {
        let mut scene = Scene::random(grid, seed, [0.15, walls, 0.0]);
        let mut region = vec![0.0; grid.elements()];
        let mut regions = 0;
        for start in (0..64).flat_map(|y| (0..96).map(move |x| (x, y))) {
            if region[grid.at(start.0, start.1)] == 0.0 {
                regions += 1;
                for (x, y) in scene.reach(&[start], usize::MAX, |_| true) {
                    region[grid.at(x, y)] = regions as f32;
                }
            }
        }
        assert!(regions > 10);
        for plane in &mut scene.samples.rgb {
            plane.copy_from_slice(&region);
        }
        for method in [Method::LinearFit, Method::FixedWeights] {
            let out = scene.run(Level::new(), None, method);
            let mut founded = 0;
            for (x, y) in (0..64).flat_map(|y| (0..96).map(move |x| (x, y))) {
                if !scene.bit(&out.bare, (x, y)) {
                    let (got, wanted) = (out.rgb[1][grid.at(x, y)], region[grid.at(x, y)]);
                    assert!(
                        (got / wanted - 1.0).abs() < 1e-5,
                        "{x} {y}: {got} for {wanted}"
                    );
                    founded += 1;
                }
            }
            assert!(founded > 3000);
        }
    }
}

#[test]
fn a_plane_of_colour_is_found_again_from_few_samples() {
    let grid = Grid::new(150, 60);
    for share in [0.03, 0.3, 1.0] {
        let mut scene = Scene::random(grid, 3, [share, 0.0, 0.0]);
        let exact = |x: f32, y: f32| 0.1 + 0.002 * x + 0.003 * y;
        for (x, y) in (0..60).flat_map(|y| (0..150).map(move |x| (x, y))) {
            let (at, s) = (grid.at(x, y), &mut scene.samples);
            let value = exact(x as f32 + s.x[at], y as f32 + s.y[at]);
            s.rgb.iter_mut().for_each(|plane| plane[at] = value);
        }
        let out = scene.run(Level::new(), None, Method::LinearFit);
        for (x, y) in (12..48).flat_map(|y| (12..138).map(move |x| (x, y))) {
            let (got, wanted) = (
                out.rgb[2][grid.at(x, y)],
                exact(x as f32 + 0.5, y as f32 + 0.5),
            );
            assert!(
                (got - wanted).abs() < 0.02,
                "{share} {x} {y}: {got} for {wanted}"
            );
        }
    }
}
