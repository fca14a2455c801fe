//! The edge rasteriser (paper section 4.5): where segments cross the lines between pixels.
//!
//! Everything is decided in integers, as if all segments were moved by (δ, δ²) for a δ too small to see. A point on a
//! grid line then lies to the right of it or below it, and no segment passes through a corner of a pixel: segments that
//! share an end neither leave a gap nor count twice, and one that passes through a pixel crosses its boundary exactly
//! twice.

use super::clip::{ImageSegment, Projector, SUBPIXELS};
use super::crossings::Crossings;
use super::list::EdgeList;
use crate::camera::View;

/// Pieces that a pixel boundary is divided into.
const EIGHTHS: i64 = 8;

/// Where a segment crosses a line of the grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crossing {
    /// The line is horizontal, y = `line`; else vertical, x = `line`.
    pub horizontal: bool,
    /// Twice the coordinate of the line, px: odd for lines through the middle of pixels.
    pub line: i64,
    /// Where on the line, eighths of a pixel, rounded down.
    pub eighth: i64,
}

/// Calls back with all crossings of a segment (ends in units of 1/[`SUBPIXELS`] px) with lines between pixels and, with
/// `half`, through their middle, that have coordinates from 0 to `width` and `height`, px, first those with horizontal
/// lines.
#[inline]
pub fn crossings_of(ends: [[i64; 2]; 2], size: [i64; 2], half: bool, each: impl FnMut(Crossing)) {
    crossings_within(ends, ends, size, half, each);
}

/// Like [`crossings_of`], of the part of the segment between two points on it.
#[inline]
pub fn crossings_within(
    ends: [[i64; 2]; 2],
    part: [[i64; 2]; 2],
    [width, height]: [i64; 2],
    half: bool,
    mut each: impl FnMut(Crossing),
) {
    let [[x0, y0], [x1, y1]] = ends;
    let [[px0, py0], [px1, py1]] = part;
    let rows = Lines {
        from: py0.min(py1),
        to: py0.max(py1),
        size: height,
        half,
    };
    rows.cross([y0, x0], [y1, x1], false, |line, eighth| {
        if eighth >= 0 && eighth < width * EIGHTHS {
            each(Crossing {
                horizontal: true,
                line,
                eighth,
            });
        }
    });
    let columns = Lines {
        from: px0.min(px1),
        to: px0.max(px1),
        size: width,
        half,
    };
    columns.cross([x0, y0], [x1, y1], true, |line, eighth| {
        if eighth >= 0 && eighth < height * EIGHTHS {
            each(Crossing {
                horizontal: false,
                line,
                eighth,
            });
        }
    });
}

/// Parallel lines of the grid.
struct Lines {
    /// Those past this coordinate...
    from: i64,
    /// ...up to this one, inclusive.
    to: i64,
    /// Greatest coordinate, px.
    size: i64,
    /// Those through the middle of pixels too.
    half: bool,
}

impl Lines {
    /// Crossings with the lines `u = line`. Points are (u, v); `low_ties` says that where `v` grows with `u`, the
    /// segment passes an exact multiple of an eighth just below it.
    #[inline]
    fn cross(
        &self,
        mut from: [i64; 2],
        mut to: [i64; 2],
        low_ties: bool,
        mut each: impl FnMut(i64, i64),
    ) {
        // Lines are numbered by twice their coordinate. Those in (from, to] are crossed: an end on a line lies beyond it.
        let unit = SUBPIXELS / 2;
        let shift = unit.trailing_zeros();
        let step = if self.half { 1 } else { 2 };
        let mut first = ((self.from >> shift) + 1).max(0);
        let last = (self.to >> shift).min(2 * self.size);
        first += first & (step - 1);
        if first > last {
            return;
        }
        if from[0] > to[0] {
            std::mem::swap(&mut from, &mut to);
        }
        let (du, dv) = (to[0] - from[0], to[1] - from[1]);
        // v = from.v + dv (line - from.u) / du, in eighths: floor(numerator / denominator).
        let denominator = du * (SUBPIXELS / EIGHTHS);
        let mut numerator = from[1] * du + (first * unit - from[0]) * dv;
        if low_ties && dv > 0 {
            numerator -= 1;
        }
        let mut eighth = floor_of_ratio(numerator, denominator);
        each(first, eighth);
        if first + step > last {
            return;
        }
        let advance = step * unit * dv;
        let whole = floor_of_ratio(advance, denominator);
        let part = advance - whole * denominator;
        let mut remainder = numerator - eighth * denominator;
        let mut line = first + step;
        while line <= last {
            eighth += whole;
            remainder += part;
            if remainder >= denominator {
                remainder -= denominator;
                eighth += 1;
            }
            each(line, eighth);
            line += step;
        }
    }
}

/// The integer at or below a ratio that is less than 2¹⁸ in size, of a denominator between 0 and 2³⁴; several times as fast
/// as dividing integers. A ratio that is no integer is further from one than rounding can move it.
#[inline]
fn floor_of_ratio(numerator: i64, denominator: i64) -> i64 {
    let ratio = numerator as f64 / denominator as f64;
    let towards_zero = ratio as i64;
    towards_zero - i64::from((towards_zero as f64) > ratio)
}

impl Crossings {
    /// Records a crossing; its coordinates must lie within the picture.
    #[inline]
    pub fn record(&mut self, crossing: Crossing) {
        let bit = 1_u8 << (crossing.eighth & 7);
        let cell = (crossing.eighth >> 3) as usize;
        let line = (crossing.line >> 1) as usize;
        let middle = crossing.line & 1 == 1;
        let mask = match (crossing.horizontal, middle) {
            (true, false) => &mut self.horizontal[line * self.width + cell],
            (true, true) => &mut self.half_horizontal[line * self.width + cell],
            (false, false) => &mut self.vertical[cell * (self.width + 1) + line],
            (false, true) => &mut self.half_vertical[cell * self.width + line],
        };
        *mask |= bit;
    }

    /// Records all crossings of a segment, those with lines through the middle of pixels too if `half` is set.
    pub fn draw(&mut self, segment: &ImageSegment, half: bool) {
        let size = [self.width as i64, self.height as i64];
        crossings_of(segment.ends, size, half, |crossing| self.record(crossing));
    }

    /// Like [`draw`](Self::draw), of a part of the segment, 0..1 in image space: exactly those of the whole one's
    /// crossings that lie within it.
    pub fn draw_part(&mut self, segment: &ImageSegment, range: [f64; 2], half: bool) {
        if range == [0.0, 1.0] {
            return self.draw(segment, half);
        }
        let size = [self.width as i64, self.height as i64];
        crossings_within(segment.ends, segment.part(range), size, half, |crossing| {
            self.record(crossing);
        });
    }
}

/// Draws every edge of a list, whether or not it can be seen. The crossings must be of the view's size.
pub fn draw_all(view: &View, edges: &EdgeList, half: bool, out: &mut Crossings) {
    let projector = Projector::new(view);
    for (from, to) in edges.from.iter().zip(&edges.to) {
        if let Some(segment) = projector.project(*from, *to) {
            out.draw(&segment, half);
        }
    }
}
