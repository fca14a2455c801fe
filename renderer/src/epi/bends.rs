//! Pixels in which an outline turns a corner.
//!
//! A code of two crossings stands for a straight edge between them (paper section 4.4). Where an outline has a corner
//! inside the pixel, part of one side lies on the other side of that straight edge, and a sample there would lend its
//! colour to the wrong neighbours. Such pixels are complex.

use super::code::Side;
use super::image::Epi;
use crate::edges::clip::SUBPIXELS;
use crate::edges::visible::VisibleEdges;

/// Makes complex every simple pixel that holds an end of an edge further from the straight edge of its code than the
/// code tells. Call after [`classify`](super::classify::classify), before [`Epi::set_primary`].
pub fn mark_bends(visible: &VisibleEdges, epi: &mut Epi) {
    for (segment, range) in visible.segment.iter().zip(&visible.range) {
        let ends = segment.ends.iter().zip(segment.along).zip(range);
        for (((place, along), seen), end) in ends.zip([0.0, 1.0]) {
            // Where an edge goes behind a nearer one it has no corner.
            if *seen == end && along == end {
                mark(*place, epi);
            }
        }
    }
}

fn mark(place: [i64; 2], epi: &mut Epi) {
    let [x, y] = place.map(|v| v.div_euclid(SUBPIXELS));
    let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else {
        return;
    };
    if x >= epi.grid.width || y >= epi.grid.height {
        return;
    }
    let code = epi.code_at(x, y);
    if !code.is_simple() {
        return;
    }
    let [dx, dy] = place.map(|v| v.rem_euclid(SUBPIXELS) as f32 / SUBPIXELS as f32);
    if epi.tables().side(code, epi.tables().places().cell(dx, dy)) != Side::Ambiguous {
        epi.make_complex(x, y);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edges::clip::ImageSegment;
    use crate::edges::crossings::Crossings;
    use crate::epi::classify::classify;
    use crate::epi::code::{EdgeCode, Places};
    use fearless_simd::Level;

    /// The image of an outline through these places, px.
    fn outline(places: &[[f64; 2]]) -> Epi {
        let snap = |p: [f64; 2]| p.map(|v| (v * SUBPIXELS as f64) as i64);
        let mut visible = VisibleEdges::default();
        for ends in places.windows(2) {
            let segment = ImageSegment {
                ends: [snap(ends[0]), snap(ends[1])],
                inverse_depth: [1.0; 2],
                along: [0.0, 1.0],
            };
            visible.push(0, segment, [0.0, 1.0]);
        }
        let mut crossings = Crossings::new(5, 4);
        visible.draw(false, &mut crossings);
        let mut epi = Epi::new(5, 4, Places::Bits8);
        classify(Level::new(), &crossings, &mut epi);
        mark_bends(&visible, &mut epi);
        epi
    }

    #[test]
    fn a_corner_makes_its_pixel_complex_and_no_other() {
        let epi = outline(&[[-2.0, 1.5], [2.8, 1.5], [2.8, 9.0]]);
        assert_eq!(epi.code_at(2, 1), EdgeCode::COMPLEX);
        assert_eq!((epi.counts.simple, epi.counts.complex), (4, 1));
        assert_eq!(epi.complex.iter().map(|w| w.count_ones()).sum::<u32>(), 1);
        assert_eq!(epi.simple.iter().map(|w| w.count_ones()).sum::<u32>(), 4);
    }

    #[test]
    fn an_outline_that_hardly_bends_stays_simple() {
        let epi = outline(&[[-2.0, 1.5], [2.5, 1.5], [7.0, 1.7]]);
        assert_eq!((epi.counts.simple, epi.counts.complex), (5, 0));
    }

    #[test]
    fn a_part_that_goes_behind_something_leaves_its_pixel_alone() {
        let mut epi = outline(&[[-2.0, 1.5], [7.0, 1.5]]);
        let mut hidden = VisibleEdges::default();
        let segment = ImageSegment {
            ends: [[2 * SUBPIXELS + 100, SUBPIXELS + 100], [9 * SUBPIXELS, 0]],
            inverse_depth: [1.0; 2],
            along: [0.0, 1.0],
        };
        hidden.push(0, segment, [0.5, 1.0]);
        mark_bends(&hidden, &mut epi);
        assert_eq!(epi.counts.complex, 0);
    }
}
