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

const SIZE_PX: [u32; 2] = [192, 144];
const FRAMES: usize = 40;
/// Colours differ from red and blue by rounding at most.
const ROUNDING: f32 = 1e-4;

pub(crate) const HEAD: &str = r#"
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

pub(crate) const SHEET: &str = r#"
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
                    [0.0, 0.1, if i as u32 / 6 % 2 == 0 { 4.0 } else { 2.6 }],
                    [0.0; 3],
                )
            }),
        ),
    ]
}

/// A pixel of a frame and its colour.
type Place = (usize, usize, usize, [f32; 3]);

#[derive(Debug, Default)]
struct Tally {
    /// Pixels that no edge crosses, mix colours, and reach samples of one colour alone.
    mixed: Vec<Place>,
    /// Pixels with an edge that mix colours where rays find one colour alone.
    far: Vec<Place>,
    /// Samples that lie on the wrong side of an edge although what they show is seen.
    astray: Vec<Place>,
    /// Samples of points that something hides.
    hidden: usize,
    samples: usize,
    /// Pixels that no edge crosses, and those of them that reach no sample.
    empty: usize,
    cut_off: usize,
    /// Those of them that mix colours because a hidden point can be reached.
    spoilt: usize,
    /// Those of them that show the wrong one of the two colours.
    wrong: usize,
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
            let shows_red = is_pure(colour)[0];
            assert!(
                shows_red || is_pure(colour)[1],
                "{frame} {x} {y}: {colour:?}"
            );
            self.samples += 1;
            let is_hidden = shows_red != red(x as f32 + pixels.x[at], y as f32 + pixels.y[at]);
            self.hidden += usize::from(is_hidden);
            regions.add((x, y), shows_red, is_hidden);
        }
        for (x, y) in places() {
            let at = grid.at(x, y);
            let colour = [0, 1, 2].map(|k| display.image()[k][at]);
            let [shows_red, shows_blue] = is_pure(colour);
            let pure = shows_red || shows_blue;
            if epi.code_at(x, y) != EdgeCode::EMPTY {
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
            match region {
                [0, 0, _] => self.cut_off += 1,
                [_, 0, _] | [0, _, _] if !pure => self.mixed.push((frame, x, y, colour)),
                [0, _, _] | [_, 0, _] => {}
                [_, _, 0] => self.astray.push((frame, x, y, colour)),
                _ => self.spoilt += usize::from(!pure),
            }
        }
    }

    fn line(&self) -> String {
        let percent = |part: usize, of: usize| 100.0 * part as f64 / of.max(1) as f64;
        format!(
            "{} mixed, {} astray, {} far; hidden {:.3} % of samples; cut off {}, spoilt {:.3} %, wrong {:.3} % of empty pixels; first {:?} {:?} {:?}",
            self.mixed.len(),
            self.astray.len(),
            self.far.len(),
            percent(self.hidden, self.samples),
            self.cut_off,
            percent(self.spoilt, self.empty),
            percent(self.wrong, self.empty),
            self.mixed.first(),
            self.astray.first(),
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

    fn add(&mut self, pixel: (usize, usize), red: bool, hidden: bool) {
        let root = self.root(self.node(pixel));
        self.samples[root][usize::from(!red)] += 1;
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

#[test]
fn two_colours_meet_in_pixels_on_the_edge_alone() {
    let mut broken = Vec::new();
    for (shape, text) in [("sheet", SHEET), ("ring", RING), ("bars", BARS)] {
        let theatre = Theatre::new(&format!("{HEAD}{text}"));
        for (path, views) in paths() {
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
                let line = format!("{shape} {path} {share}: {}", tally.line());
                println!("{line}");
                if !(tally.mixed.is_empty() && tally.far.is_empty() && tally.astray.is_empty()) {
                    broken.push(line);
                }
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}
