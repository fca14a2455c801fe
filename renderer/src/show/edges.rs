//! Edges in colours that say what they are.

use super::{Stages, encode, half};
use crate::edges::raster::{Crossing, crossings_within};
use crate::edges::tree::EdgeKind;
use crate::epi::code::EdgeCode;
use crate::shadows::wedge::EventKind;
use crate::tone::ToneMap;

/// Edges of meshes in simple pixels.
pub(super) const SIMPLE: u32 = 0xff_d800;
/// Edges of meshes in complex pixels.
pub(super) const COMPLEX: u32 = 0xff_40ff;
/// Shadows that are hard, or stand for soft ones.
pub(super) const HARD: u32 = 0x40_ff60;
/// As in Figure 9.
pub(super) const PENUMBRAL: u32 = 0x30_80ff;
/// As in Figure 9.
pub(super) const UMBRAL: u32 = 0xff_3020;
/// Where objects pass through one another.
pub(super) const MEETING: u32 = 0x20_e8e8;

/// What is known of a pixel before it has a colour.
const MESH_BIT: u32 = 1;
const HARD_BIT: u32 = 2;
const PENUMBRAL_BIT: u32 = 4;
const UMBRAL_BIT: u32 = 8;
const MEETING_BIT: u32 = 16;

fn bit_of(kind: EdgeKind) -> u32 {
    match kind {
        EdgeKind::Silhouette | EdgeKind::Crease | EdgeKind::Border | EdgeKind::NonManifold => {
            MESH_BIT
        }
        EdgeKind::Meeting => MEETING_BIT,
        EdgeKind::Shadow(EventKind::Hard) => HARD_BIT,
        EdgeKind::Shadow(EventKind::Penumbral) => PENUMBRAL_BIT,
        EdgeKind::Shadow(EventKind::Umbral) => UMBRAL_BIT,
    }
}

/// The frame, dimmed, under its edges. Pixels with edges of several kinds show them by turns, so that a line on which two
/// kinds coincide is dotted in both colours.
pub(super) fn draw(stages: &Stages<'_>, tone: &ToneMap, out: &mut Vec<u32>) {
    let grid = stages.grid;
    out.clear();
    out.resize(grid.width * grid.height, 0);
    mark(stages, out);
    for y in 0..grid.height {
        for x in 0..grid.width {
            let at = grid.at(x, y);
            let pixel = &mut out[y * grid.width + x];
            *pixel = match (EdgeCode(stages.epi.code[at]), *pixel) {
                (EdgeCode::EMPTY, _) => half(encode(tone, stages.image, at)),
                (code, kinds) => colour(turn(kinds, x + y), code == EdgeCode::COMPLEX),
            };
        }
    }
}

/// Notes the kinds of the edges that can be seen in the pixels whose boundaries they cross.
fn mark(stages: &Stages<'_>, out: &mut [u32]) {
    let (width, height) = (stages.grid.width as i64, stages.grid.height as i64);
    let seen = stages.seen;
    for ((&edge, segment), range) in seen.edge.iter().zip(&seen.segment).zip(&seen.range) {
        let Some(&kind) = stages.edges.kind.get(edge as usize) else {
            continue;
        };
        let bit = bit_of(kind);
        let part = segment.part(*range);
        crossings_within(segment.ends, part, [width, height], false, |crossing| {
            let Crossing {
                horizontal,
                line,
                eighth,
            } = crossing;
            let (after, along) = (line >> 1, eighth >> 3);
            for across in [after - 1, after] {
                let (x, y) = if horizontal {
                    (along, across)
                } else {
                    (across, along)
                };
                if (0..width).contains(&x) && (0..height).contains(&y) {
                    out[(y * width + x) as usize] |= bit;
                }
            }
        });
    }
}

/// One of the bits, another one from pixel to pixel; that of meshes if there is none, since then nobody knows the kinds.
fn turn(kinds: u32, pixel: usize) -> u32 {
    let mut left = kinds;
    for _ in 0..pixel % kinds.count_ones().max(1) as usize {
        left &= left - 1;
    }
    if left == 0 {
        MESH_BIT
    } else {
        left & left.wrapping_neg()
    }
}

fn colour(kind: u32, is_complex: bool) -> u32 {
    match kind {
        HARD_BIT => HARD,
        PENUMBRAL_BIT => PENUMBRAL,
        UMBRAL_BIT => UMBRAL,
        MEETING_BIT => MEETING,
        _ if is_complex => COMPLEX,
        _ => SIMPLE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_take_turns() {
        let both = PENUMBRAL_BIT | UMBRAL_BIT;
        assert_eq!(
            [0, 1, 2, 3].map(|k| turn(both, k)),
            [PENUMBRAL_BIT, UMBRAL_BIT, PENUMBRAL_BIT, UMBRAL_BIT]
        );
        assert_eq!([0, 1, 5].map(|k| turn(UMBRAL_BIT, k)), [UMBRAL_BIT; 3]);
        assert_eq!([0, 7].map(|k| turn(0, k)), [MESH_BIT; 2]);
        let three = MESH_BIT | both;
        assert_eq!(
            [0, 1, 2].map(|k| turn(three, k)),
            [MESH_BIT, PENUMBRAL_BIT, UMBRAL_BIT]
        );
    }
}
