//! A red thing before a blue wall, both flat: whatever the samples, the two colours meet in pixels on the edge alone.

use fearless_simd::Level;
use glam::Vec3;
use rays::Ray;
use renderer::camera::View;
use renderer::config::Choices;
use renderer::epi::Epi;
use renderer::epi::code::EdgeCode;
use renderer::epi::reach::ReachMap;
use renderer::epi::reach_tables::{PP, PS, SP, SS};
use renderer::frame::Display;

use crate::drive::{Theatre, view};

const SIZE_PX: [u32; 2] = [144, 108];
const FRAMES: usize = 24;
/// Colours differ from red and blue by rounding at most.
const ROUNDING: f32 = 1e-4;

const HEAD: &str = r#"
[shading]
ambient = [1, 1, 1]
background = [0, 0, 1]
[material.red]
diffuse = [1, 0, 0]
[material.blue]
diffuse = [0, 0, 1]
[[object]]
name = "wall"
generate = { kind = "plane", size = [60, 60] }
rotate = [90, 0, 0]
translate = [0, 0, -2]
material = "blue"
"#;

const SHEET: &str = r#"
[[object]]
name = "sheet"
generate = { kind = "plane", size = [1.7, 1.1] }
rotate = [90, 0, 17]
material = "red"
"#;

const RING: &str = r#"
[[object]]
name = "ring"
generate = { kind = "torus", major = 0.8, minor = 0.3 }
rotate = [70, 0, 17]
material = "red"
"#;

const BARS: &str = r#"
[[object]]
name = "bars"
generate = { kind = "bars", size = [2, 1.4], bars = [5, 4], width = 0.11, thickness = 0.05 }
rotate = [90, 0, 9]
material = "red"
"#;

/// Ways of the camera; the edge moves in the picture in all but the first.
fn paths() -> [(&'static str, Vec<View>); 5] {
    let at = |eye: [f32; 3], target: [f32; 3]| view(SIZE_PX, eye, target, 40.0);
    let frames = |f: &dyn Fn(f32) -> View| (0..FRAMES).map(|i| f(i as f32)).collect();
    [
        ("still", frames(&|_| at([0.1, 0.2, 4.0], [0.0; 3]))),
        (
            "creeping",
            frames(&|i| at([0.1 + 1e-3 * i, 0.2, 4.0], [3e-4 * i, 0.0, 0.0])),
        ),
        (
            "sideways",
            frames(&|i| at([-1.0 + 0.05 * i, 0.2, 4.0], [-1.0 + 0.05 * i, 0.0, 0.0])),
        ),
        (
            "around",
            frames(&|i| {
                let (sin, cos) = (0.04 * i - 0.8).sin_cos();
                at([4.0 * sin, 0.4, 4.0 * cos], [0.0; 3])
            }),
        ),
        (
            "nearer and back, in steps",
            frames(&|i| {
                at(
                    [
                        0.0,
                        0.1,
                        if (i as u32 / 6).is_multiple_of(2) {
                            4.0
                        } else {
                            2.6
                        },
                    ],
                    [0.0; 3],
                )
            }),
        ),
    ]
}

/// A pixel of a frame and its colour.
type Place = (usize, usize, usize, [f32; 3]);

/// What becomes of pixels that no edge crosses, and of samples.
#[derive(Debug, Default)]
struct Tally {
    empty: usize,
    /// Have an edge.
    crossed: usize,
    /// Reach samples of one colour alone, and mix both.
    mixed: Vec<Place>,
    /// Mix both, through a gap in the edges.
    leaked: Vec<Place>,
    /// Mix both, because the point of a sample that they reach is hidden by now.
    spoilt: usize,
    /// Show the wrong one of the two colours.
    wrong: usize,
    /// Pixels with an edge that mix both where rays find one alone.
    far: Vec<Place>,
    samples: usize,
    hidden: usize,
}

impl Tally {
    fn look(&mut self, theatre: &Theatre, frame: usize, view: &View, display: &Display) {
        let (grid, epi, pixels) = (display.grid(), display.epi(), display.pixels());
        let red = |x: f32, y: f32| {
            let ray = Ray {
                origin: view.eye,
                direction: view.direction(x, y),
            };
            theatre
                .stage
                .world()
                .closest(&ray, f32::INFINITY)
                .is_some_and(|hit| hit.instance == 1)
        };
        let mut regions = Regions::new(epi);
        let is_pure = |c: [f32; 3]| {
            [Vec3::X, Vec3::Z].map(|p| (p - Vec3::from(c)).abs().max_element() <= ROUNDING)
        };
        let places = || (0..grid.height).flat_map(|y| (0..grid.width).map(move |x| (x, y)));
        for (x, y) in places().filter(|&(x, y)| epi.code_at(x, y) != EdgeCode::COMPLEX) {
            let ((word, bit), at) = (grid.bit(x, y), grid.at(x, y));
            if epi.has_sample[word] >> bit & 1 == 0 {
                continue;
            }
            let colour = [0, 1, 2].map(|k| pixels.rgb[k][at]);
            let [shows_red, shows_blue] = is_pure(colour);
            self.samples += 1;
            let really_red = red(x as f32 + pixels.x[at], y as f32 + pixels.y[at]);
            let is_hidden = (shows_red || shows_blue) && shows_red != really_red;
            self.hidden += usize::from(is_hidden);
            // The mean of a pixel that an undrawn edge crosses holds both.
            regions.add((x, y), [!shows_blue, !shows_red], is_hidden);
        }
        for (x, y) in places() {
            let at = grid.at(x, y);
            let colour = [0, 1, 2].map(|k| display.image()[k][at]);
            let [shows_red, shows_blue] = is_pure(colour);
            let pure = shows_red || shows_blue;
            if epi.code_at(x, y) != EdgeCode::EMPTY {
                self.crossed += 1;
                if !pure && !both_sides(&red, x as f32, y as f32) {
                    self.far.push((frame, x, y, colour));
                }
                continue;
            }
            self.empty += 1;
            let region = regions.of((x, y));
            if pure {
                self.wrong += usize::from(shows_red != red(x as f32 + 0.5, y as f32 + 0.5));
            }
            if pure {
                continue;
            }
            match region {
                [0, 0, _] => {}
                [_, 0, _] | [0, _, _] => self.mixed.push((frame, x, y, colour)),
                [_, _, 0] => self.leaked.push((frame, x, y, colour)),
                _ => self.spoilt += 1,
            }
        }
    }

    fn line(&self) -> String {
        let percent = |part: usize, of: usize| 100.0 * part as f64 / of.max(1) as f64;
        format!(
            "{} mixed, {} leaked, {} far; {:.3} % of samples hidden; of empty pixels {:.3} % spoilt, {:.3} % wrong; first {:?} {:?} {:?}",
            self.mixed.len(),
            self.leaked.len(),
            self.far.len(),
            percent(self.hidden, self.samples),
            percent(self.spoilt, self.empty),
            percent(self.wrong, self.empty),
            self.mixed.first(),
            self.leaked.first(),
            self.far.first(),
        )
    }
}

/// What is connected in an edge-and-point image without crossing an edge: two regions a pixel, primary and secondary.
struct Regions {
    width: usize,
    parent: Vec<usize>,
    /// Of each root: red samples, blue samples, and how many of all are hidden.
    samples: Vec<[usize; 3]>,
}

impl Regions {
    fn new(epi: &Epi) -> Self {
        let (width, height) = (epi.grid.width, epi.grid.height);
        let mut reach = ReachMap::new(width, height);
        reach.compute(Level::new(), epi);
        let count = 2 * width * height;
        let mut regions = Self {
            width,
            parent: (0..count).collect(),
            samples: vec![[0; 3]; count],
        };
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            for (dx, dy) in [(1, 0), (0, 1)] {
                let step = reach.step((x, y), (dx, dy));
                for (relation, from, to) in [(PP, 0, 0), (PS, 0, 1), (SP, 1, 0), (SS, 1, 1)] {
                    if step >> relation & 1 == 1 {
                        let there = regions.node((x + dx as usize, y + dy as usize)) + to;
                        let (a, b) = (
                            regions.root(regions.node((x, y)) + from),
                            regions.root(there),
                        );
                        regions.parent[a] = b;
                    }
                }
            }
        }
        regions
    }

    fn node(&self, (x, y): (usize, usize)) -> usize {
        2 * (y * self.width + x)
    }

    fn root(&mut self, mut node: usize) -> usize {
        while self.parent[node] != node {
            self.parent[node] = self.parent[self.parent[node]];
            node = self.parent[node];
        }
        node
    }

    fn add(&mut self, pixel: (usize, usize), colours: [bool; 2], hidden: bool) {
        let root = self.root(self.node(pixel));
        for (count, has) in self.samples[root].iter_mut().zip(colours) {
            *count += usize::from(has);
        }
        self.samples[root][2] += usize::from(hidden);
    }

    fn of(&mut self, pixel: (usize, usize)) -> [usize; 3] {
        let root = self.root(self.node(pixel));
        self.samples[root]
    }
}

/// Whether rays find both colours in a pixel or within an eighth of a pixel of it.
fn both_sides(red: &impl Fn(f32, f32) -> bool, x: f32, y: f32) -> bool {
    let first = red(x, y);
    (-1..=9).any(|j| (-1..=9).any(|i| red(x + i as f32 / 8.0, y + j as f32 / 8.0) != first))
}

/// What may go wrong with a shape, most in any run.
struct Limits {
    /// Share of the empty pixels that mix colours through gaps in its edges.
    leaked: f64,
    /// Share of the pixels with an edge that mix colours beside its outline: on edges within it.
    far: f64,
    /// Shares of the empty pixels while the camera moves fast; none otherwise.
    spoilt: f64,
    wrong: f64,
}

#[track_caller]
fn check(shape: &str, text: &str, limits: &Limits) {
    let theatre = Theatre::new(&format!("{HEAD}{text}"));
    let mut broken = Vec::new();
    for (path, views) in paths() {
        let slow = ["still", "creeping"].contains(&path);
        for share in [0.005, 0.02, 0.05, 0.2] {
            let samples = (share * (SIZE_PX[0] * SIZE_PX[1]) as f32) as usize;
            let mut tally = Tally::default();
            theatre.play(
                Choices::default(),
                samples,
                &views,
                |frame, view, display| {
                    tally.look(&theatre, frame, view, display);
                },
            );
            let line = format!("{shape}, {path}, {} %: {}", 100.0 * share, tally.line());
            println!("{line}");
            let share_within =
                |part: usize, of: usize, limit: f64| part as f64 <= limit * of as f64;
            let within = |part: usize, limit: f64| {
                share_within(part, tally.empty, if slow { 0.0 } else { limit })
            };
            let kept = tally.mixed.is_empty()
                && share_within(tally.leaked.len(), tally.empty, limits.leaked)
                && share_within(tally.far.len(), tally.crossed, limits.far)
                && within(tally.spoilt, limits.spoilt)
                && (share < 0.01 || within(tally.wrong, limits.wrong));
            if !kept {
                broken.push(line);
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn the_colours_of_a_sheet_and_its_wall_meet_on_its_border_alone() {
    check(
        "sheet",
        SHEET,
        &Limits {
            leaked: 0.0,
            far: 0.0,
            spoilt: 0.03,
            wrong: 0.005,
        },
    );
}

#[test]
fn the_colours_of_a_ring_and_its_wall_meet_on_its_outline_alone() {
    check(
        "ring",
        RING,
        &Limits {
            leaked: 0.001,
            far: 0.0,
            spoilt: 0.06,
            wrong: 0.005,
        },
    );
}

#[test]
fn the_colours_of_bars_and_their_wall_meet_on_their_edges_alone() {
    check(
        "bars",
        BARS,
        &Limits {
            leaked: 0.0,
            far: 0.04,
            spoilt: 0.03,
            wrong: 0.005,
        },
    );
}
