//! From boundary crossings to edge codes (paper section 4.5, "Edge reconstruction").

use fearless_simd::{Level, dispatch, prelude::*};
use fearless_simd_macros::simd;

use super::Counts;
use super::code::EdgeCode;
use super::image::Epi;
use crate::edges::crossings::Crossings;

/// Classifies every pixel: sets `epi`'s codes, its planes of simple and complex pixels and its counts, and resizes it if
/// need be. The primary regions are those of the last frame until [`Epi::set_primary`] is called.
/// The result does not depend on `level`.
pub fn classify(level: Level, crossings: &Crossings, epi: &mut Epi) {
    epi.resize(crossings.width, crossings.height);
    dispatch!(level, simd => classify_rows(simd, crossings, epi));
}

/// Joins the masks on the top, right, bottom and left boundary (bits along +x or +y) to one that runs clockwise from the
/// top-left corner.
#[inline(always)]
pub fn clockwise([top, right, bottom, left]: [u8; 4]) -> u32 {
    // Bottom and left run against +x and +y: reversing them as one 16-bit number swaps them too.
    let reversed = u16::from_le_bytes([left, bottom]).reverse_bits();
    u32::from(top) | u32::from(right) << 8 | u32::from(reversed) << 16
}

/// The four boundary rows of up to 64 pixels.
struct Row<'a> {
    top: &'a [u8],
    right: &'a [u8],
    bottom: &'a [u8],
    left: &'a [u8],
}

#[simd]
fn classify_rows<S: Simd>(simd: S, crossings: &Crossings, epi: &mut Epi) {
    let width = crossings.width;
    let mut counts = Counts::default();
    for y in 0..crossings.height {
        let top = &crossings.horizontal[y * width..][..width];
        let bottom = &crossings.horizontal[(y + 1) * width..][..width];
        let vertical = &crossings.vertical[y * (width + 1)..][..width + 1];
        for word in 0..width.div_ceil(64) {
            let range = 64 * word..width.min(64 * word + 64);
            let row = Row {
                top: &top[range.clone()],
                right: &vertical[1..][range.clone()],
                bottom: &bottom[range.clone()],
                left: &vertical[range],
            };
            let (simple, complex) = classify_word(simd, &row, epi, (word, y));
            counts.simple += simple.count_ones() as usize;
            counts.complex += complex.count_ones() as usize;
        }
    }
    counts.empty = width * crossings.height - counts.simple - counts.complex;
    epi.counts = counts;
}

#[inline(always)]
fn classify_word<S: Simd>(
    simd: S,
    row: &Row,
    epi: &mut Epi,
    (word, y): (usize, usize),
) -> (u64, u64) {
    let i = y * epi.grid.words + word;
    let first = epi.grid.at(64 * word, y);
    if epi.simple[i] | epi.complex[i] != 0 {
        epi.code[first..first + 64].fill(EdgeCode::EMPTY.0);
        for centre in &mut epi.centre_px {
            centre[first..first + 64].fill(0.5);
        }
    }
    let mut planes = Planes::default();
    let mut crossed = crossed(simd, row);
    while crossed != 0 {
        let x = crossed.trailing_zeros() as usize;
        let mask = clockwise([row.top[x], row.right[x], row.bottom[x], row.left[x]]);
        let code = EdgeCode::from_boundary(mask);
        epi.code[first + x] = code.0;
        planes.add(x, code, epi.tables().inner_larger(code));
        crossed &= crossed - 1;
    }
    epi.simple[i] = planes.simple;
    epi.complex[i] = planes.complex;
    epi.inner_larger[i] = planes.inner_larger;
    for (plane, bits) in epi.inner_corner.iter_mut().zip(planes.inner_corner) {
        plane[i] = bits;
    }
    (planes.simple, planes.complex)
}

/// Bit mask of the pixels that have a crossing on their boundary.
#[inline(always)]
fn crossed<S: Simd>(simd: S, row: &Row) -> u64 {
    let lanes = S::u8s::LEN;
    let width = row.top.len();
    let mut mask = 0;
    let whole = width - width % lanes;
    for x in (0..whole).step_by(lanes) {
        let load = |bytes: &[u8]| S::u8s::from_slice(simd, &bytes[x..x + lanes]);
        let any = load(row.top) | load(row.right) | load(row.bottom) | load(row.left);
        mask |= (!any.simd_eq(S::u8s::splat(simd, 0))).to_bitmask() << x;
    }
    for x in whole..width {
        let any = row.top[x] | row.right[x] | row.bottom[x] | row.left[x];
        mask |= u64::from(any != 0) << x;
    }
    mask
}

#[derive(Default)]
struct Planes {
    simple: u64,
    complex: u64,
    inner_larger: u64,
    inner_corner: [u64; 3],
}

impl Planes {
    #[inline(always)]
    fn add(&mut self, x: usize, code: EdgeCode, inner_larger: bool) {
        let bit = 1 << x;
        if code == EdgeCode::COMPLEX {
            self.complex |= bit;
            return;
        }
        let (a, b) = code.ends();
        self.simple |= bit;
        self.inner_larger |= u64::from(inner_larger) << x;
        // The arc from a to b holds corner k if a lies before it and b after it.
        for (k, plane) in (1..).zip(&mut self.inner_corner) {
            *plane |= u64::from(a / 8 < k && k <= b / 8) << x;
        }
    }
}

#[cfg(test)]
mod tests;
