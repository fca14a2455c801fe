//! What a person can be shown of a frame: the picture, or one stage of its making.

mod edges;

use clap::ValueEnum;

use crate::edges::list::EdgeList;
use crate::edges::visible::VisibleEdges;
use crate::epi::Epi;
use crate::epi::code::EdgeCode;
use crate::epi::grid::Grid;
use crate::frame::Display;
use crate::points::PixelSamples;
use crate::tone::ToneMap;

/// What to show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Show {
    /// The finished frame.
    #[default]
    Picture,
    /// The frame, dimmed, under its edges: those of meshes yellow in simple pixels and magenta in complex ones; hard shadow
    /// edges green, penumbral blue, umbral red; where objects pass through one another, cyan.
    Edges,
    /// Empty pixels blue, simple ones green, complex ones red; bright where there is a sample.
    Classes,
    /// Samples in their pixels; black where there is none.
    Points,
    /// What wants samples most: black, red, yellow, white.
    Priorities,
    /// How many samples each pixel's colour is the mean of: black for none, each doubling a step brighter.
    Counts,
}

impl Show {
    /// All, in the order of the keys 1 to 6.
    pub const ALL: [Self; 6] = [
        Self::Picture,
        Self::Edges,
        Self::Classes,
        Self::Points,
        Self::Priorities,
        Self::Counts,
    ];

    /// For people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Picture => "picture",
            Self::Edges => "edges",
            Self::Classes => "pixel classes",
            Self::Points => "points alone",
            Self::Priorities => "priorities",
            Self::Counts => "samples a pixel",
        }
    }
}

/// What a frame's stages left; arrays by the grid.
#[derive(Clone, Copy, Debug)]
pub struct Stages<'a> {
    /// The layout.
    pub grid: Grid,
    /// Linear radiance.
    pub image: &'a [Vec<f32>; 3],
    /// Pixel classes.
    pub epi: &'a Epi,
    /// Edges.
    pub edges: &'a EdgeList,
    /// Which parts of them can be seen, where rays decided about it; else none.
    pub seen: &'a VisibleEdges,
    /// Samples.
    pub pixels: &'a PixelSamples,
    /// What the last plan was made from.
    pub priorities: &'a [f32],
}

impl<'a> Stages<'a> {
    /// Those of the frame that a display drew last.
    pub fn of(display: &'a Display) -> Self {
        Self {
            grid: display.grid(),
            image: display.image(),
            epi: display.epi(),
            edges: display.edge_stage().list(),
            seen: display.edge_stage().visible(),
            pixels: display.pixels(),
            priorities: display.priorities(),
        }
    }
}

const EMPTY: u32 = 0x1c_3c78;
const SIMPLE: u32 = 0x30_c050;
const COMPLEX: u32 = 0xe0_3828;

/// Samples a pixel that count as many: their mean is shown white.
const MANY: f32 = 256.0;

/// Draws it as 0x00RRGGBB, row by row without padding.
pub fn show(what: Show, stages: &Stages<'_>, tone: &ToneMap, out: &mut Vec<u32>) {
    match what {
        Show::Picture => tone.map(stages.grid, stages.image, out),
        Show::Edges => edges::draw(stages, tone, out),
        Show::Classes => each(stages.grid, out, |x, y, at| {
            let colour = match EdgeCode(stages.epi.code[at]) {
                EdgeCode::EMPTY => EMPTY,
                EdgeCode::COMPLEX => COMPLEX,
                _ => SIMPLE,
            };
            if stages.pixels.has_sample(x, y) {
                colour
            } else {
                half(colour)
            }
        }),
        Show::Points => each(stages.grid, out, |x, y, at| {
            if stages.pixels.has_sample(x, y) {
                encode(tone, &stages.pixels.rgb, at)
            } else {
                0
            }
        }),
        Show::Priorities => priorities(stages, out),
        Show::Counts => each(stages.grid, out, |x, y, at| {
            if stages.pixels.has_sample(x, y) {
                let count = stages.pixels.count[at].max(1.0);
                heat((count.log2() + 1.0) / (MANY.log2() + 1.0))
            } else {
                0
            }
        }),
    }
}

/// Priorities have no scale of their own and range over many orders: shown by the logarithm below the largest.
fn priorities(stages: &Stages<'_>, out: &mut Vec<u32>) {
    const DECADES: f32 = 4.0;
    let grid = stages.grid;
    let rows = (0..grid.height).map(|y| &stages.priorities[grid.at(0, y)..grid.at(grid.width, y)]);
    let most = rows.flatten().fold(0.0f32, |most, &p| most.max(p));
    each(grid, out, |_, _, at| {
        let p = stages.priorities[at];
        if p > 0.0 && most > 0.0 {
            heat(1.0 + (p / most).log10() / DECADES)
        } else {
            0
        }
    });
}

fn each(grid: Grid, out: &mut Vec<u32>, mut colour: impl FnMut(usize, usize, usize) -> u32) {
    out.clear();
    for y in 0..grid.height {
        let row = (0..grid.width).map(|x| colour(x, y, grid.at(x, y)));
        out.extend(row);
    }
}

fn encode(tone: &ToneMap, rgb: &[Vec<f32>; 3], at: usize) -> u32 {
    let [r, g, b] = rgb
        .each_ref()
        .map(|plane| u32::from(tone.encode(plane[at])));
    r << 16 | g << 8 | b
}

/// Every channel halved.
pub(crate) fn half(colour: u32) -> u32 {
    colour >> 1 & 0x7f_7f7f
}

/// Black, red, yellow, white over [0, 1].
fn heat(value: f32) -> u32 {
    let channel = |from: f32| ((value * 3.0 - from).clamp(0.0, 1.0) * 255.0).round() as u32;
    channel(0.0) << 16 | channel(1.0) << 8 | channel(2.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edges::clip::{ImageSegment, SUBPIXELS};
    use crate::edges::crossings::Crossings;
    use crate::edges::tree::EdgeKind;
    use crate::epi::classify::classify;
    use crate::epi::code::Places;
    use fearless_simd::Level;

    struct Frame {
        epi: Epi,
        pixels: PixelSamples,
        image: [Vec<f32>; 3],
        priorities: Vec<f32>,
        edges: EdgeList,
        seen: VisibleEdges,
    }

    /// A level edge of a kind through the middle of row 1, seen from x = `from` to x = `to`, px.
    fn level_edge(frame: &mut Frame, kind: EdgeKind, [from, to]: [f64; 2]) {
        let y = 3 * SUBPIXELS / 2;
        let segment = ImageSegment {
            ends: [[0, y], [70 * SUBPIXELS, y]],
            inverse_depth: [1.0; 2],
            along: [0.0, 1.0],
        };
        let index = frame.edges.kind.len() as u32;
        frame.edges.kind.push(kind);
        frame.seen.push(index, segment, [from / 70.0, to / 70.0]);
    }

    /// 70 x 3 white pixels: (1, 1) is simple, (4, 1) complex with a red sample, (65, 2) has one of sixteen.
    fn frame() -> Frame {
        let (width, height) = (70, 3);
        let mut crossings = Crossings::new(width, height);
        crossings.horizontal[width + 1] = 1 << 3;
        crossings.horizontal[2 * width + 1] = 1 << 3;
        crossings.vertical[width + 1 + 4] = 0b101;
        let mut epi = Epi::new(width, height, Places::Bits8);
        classify(Level::new(), &crossings, &mut epi);
        let grid = epi.grid;
        let mut pixels = PixelSamples::new(grid);
        let mut add = |x: usize, y: usize, rgb: [f32; 3], count: f32| {
            let (word, bit) = grid.bit(x, y);
            pixels.has[word] |= 1 << bit;
            pixels.count[grid.at(x, y)] = count;
            for (plane, value) in pixels.rgb.iter_mut().zip(rgb) {
                plane[grid.at(x, y)] = value;
            }
        };
        add(4, 1, [1.0, 0.0, 0.0], 1.0);
        add(65, 2, [0.0, 0.0, 1.0], 16.0);
        let mut priorities = vec![0.0; grid.elements()];
        priorities[grid.at(65, 2)] = 3.0;
        priorities[grid.at(1, 0)] = 3e-9;
        // Margins must not set the scale.
        priorities[0] = f32::INFINITY;
        Frame {
            epi,
            pixels,
            image: std::array::from_fn(|_| vec![1.0; grid.elements()]),
            priorities,
            edges: EdgeList::default(),
            seen: VisibleEdges::default(),
        }
    }

    fn shown(what: Show) -> impl Fn(usize, usize) -> u32 {
        shown_of(&frame(), what)
    }

    fn shown_of(f: &Frame, what: Show) -> impl Fn(usize, usize) -> u32 + use<> {
        let mut out = vec![7; 3];
        let stages = Stages {
            grid: f.epi.grid,
            image: &f.image,
            epi: &f.epi,
            edges: &f.edges,
            seen: &f.seen,
            pixels: &f.pixels,
            priorities: &f.priorities,
        };
        show(what, &stages, &ToneMap::new(), &mut out);
        assert_eq!(out.len(), 70 * 3);
        move |x, y| out[y * 70 + x]
    }

    #[test]
    fn every_stage_shows_what_it_is_about() {
        assert_eq!(shown(Show::Picture)(69, 2), 0xff_ffff);
        let lines = shown(Show::Edges);
        assert_eq!(
            [lines(1, 1), lines(4, 1), lines(9, 1)],
            [edges::SIMPLE, edges::COMPLEX, 0x7f_7f7f]
        );
        let classes = shown(Show::Classes);
        assert_eq!([classes(1, 1), classes(4, 1)], [half(SIMPLE), COMPLEX]);
        assert_eq!([classes(65, 2), classes(64, 2)], [EMPTY, half(EMPTY)]);
        let points = shown(Show::Points);
        assert_eq!(
            [points(4, 1), points(65, 2), points(5, 1)],
            [0xff_0000, 0x00_00ff, 0]
        );
        let wanted = shown(Show::Priorities);
        assert_eq!(
            [wanted(65, 2), wanted(1, 0), wanted(0, 0)],
            [0xff_ffff, 0, 0]
        );
        let counts = shown(Show::Counts);
        assert!(counts(65, 2) > counts(4, 1) && counts(4, 1) > 0 && counts(0, 0) == 0);
    }

    #[test]
    fn edges_have_the_colours_of_their_kinds_where_they_are_seen() {
        use crate::shadows::wedge::EventKind::{Hard, Penumbral, Umbral};
        let kinds = [
            (EdgeKind::Silhouette, edges::SIMPLE),
            (EdgeKind::Shadow(Hard), edges::HARD),
            (EdgeKind::Shadow(Penumbral), edges::PENUMBRAL),
            (EdgeKind::Shadow(Umbral), edges::UMBRAL),
            (EdgeKind::Meeting, edges::MEETING),
        ];
        for (kind, colour) in kinds {
            let mut f = frame();
            level_edge(&mut f, kind, [0.5, 3.5]);
            let lines = shown_of(&f, Show::Edges);
            assert_eq!(lines(1, 1), colour, "{kind:?}");
            // Seen, but without a code; and with one, but hidden.
            assert_eq!([lines(2, 1), lines(4, 1)], [0x7f_7f7f, edges::COMPLEX]);
        }
        let mut f = frame();
        level_edge(&mut f, EdgeKind::Shadow(Penumbral), [0.5, 6.0]);
        level_edge(&mut f, EdgeKind::Shadow(Umbral), [0.5, 6.0]);
        let lines = shown_of(&f, Show::Edges);
        assert_eq!(
            [lines(1, 1), lines(4, 1)],
            [edges::PENUMBRAL, edges::UMBRAL]
        );
    }

    #[test]
    fn heat_rises_through_red_and_yellow_to_white() {
        let all = [-1.0, 0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0, 2.0, f32::NAN].map(heat);
        assert_eq!(all, [0, 0, 0xff_0000, 0xff_ff00, 0xff_ffff, 0xff_ffff, 0]);
    }
}
