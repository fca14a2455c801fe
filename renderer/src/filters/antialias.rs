//! Anti-aliasing of simple pixels (paper section 5.3): the colours of both regions, weighted by their area.
//!
//! Only the primary region has a colour of its own. The secondary region borrows that of a neighbour's primary region:
//! the edge's code ranks the neighbours that touch it, and the first of them that no edge separates from it lends.

use super::taps::shifted;
use crate::epi::Epi;
use crate::epi::code::{EdgeCode, NEIGHBOURS};
use crate::epi::reach::{ReachMap, Steps};
use crate::epi::reach_tables::{PP, PS, SP, SS};

/// What anti-aliasing reads.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    /// Edges and primary regions.
    pub epi: &'a Epi,
    /// Relations of neighbouring pixels' regions.
    pub reach: &'a ReachMap,
    /// Bit plane: the pixel's colour is not founded on samples and must not be lent.
    pub bare: &'a [u64],
    /// Colours of secondary regions that the caller knows better.
    pub direct: Option<Direct<'a>>,
}

/// Colours that secondary regions have of themselves, say from a sample of their own.
#[derive(Clone, Copy)]
pub struct Direct<'a> {
    /// Bit plane: the pixel has such a colour.
    pub known: &'a [u64],
    /// Element arrays: linear radiance, red, green, blue.
    pub rgb: [&'a [f32]; 3],
}

/// What became of the simple pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Blended with a colour of the caller's or a neighbour's.
    pub blended: usize,
    /// No neighbour could lend: kept as they are.
    pub kept: usize,
}

/// A pixel's new colour: `at` is its element.
#[derive(Clone, Copy, Debug)]
struct Patch {
    at: usize,
    rgb: [f32; 3],
}

/// Room to work in: new colours of two rows, since a row may change only when the row below needs it no more.
#[derive(Clone, Debug, Default)]
pub struct Antialias {
    upper: Vec<Patch>,
    row: Vec<Patch>,
}

impl Antialias {
    /// Anti-aliases simple pixels in place. `colours` are the primary regions' (element arrays, linear radiance).
    pub fn apply(&mut self, inputs: &Inputs, colours: &mut [Vec<f32>; 3]) -> Outcome {
        let grid = inputs.epi.grid;
        for row in [&mut self.upper, &mut self.row] {
            row.clear();
            row.reserve(grid.width);
        }
        let mut outcome = Outcome::default();
        for y in 0..grid.height {
            for word in 0..grid.words {
                let mut left = inputs.epi.simple[y * grid.words + word];
                if left == 0 {
                    continue;
                }
                let sides = lending_sides(inputs.reach, word, y);
                while left != 0 {
                    let x = 64 * word + left.trailing_zeros() as usize;
                    left &= left - 1;
                    match blend(inputs, &sides, colours, (x, y)) {
                        Some(rgb) => self.row.push(Patch {
                            at: grid.at(x, y),
                            rgb,
                        }),
                        None => outcome.kept += 1,
                    }
                }
            }
            outcome.blended += self.row.len();
            write(&mut self.upper, colours);
            std::mem::swap(&mut self.upper, &mut self.row);
        }
        write(&mut self.upper, colours);
        outcome
    }
}

fn write(patches: &mut Vec<Patch>, colours: &mut [Vec<f32>; 3]) {
    for patch in patches.drain(..) {
        for (plane, value) in colours.iter_mut().zip(patch.rgb) {
            plane[patch.at] = value;
        }
    }
}

/// Of 64 pixels: is the secondary region joined to the primary one of the neighbour at right, below, left, above?
#[inline]
fn lending_sides(reach: &ReachMap, word: usize, y: usize) -> [u64; 4] {
    let (words, Steps { right, down }) = (reach.grid.words, &reach.steps);
    let at = |plane: &[u64], offset| shifted(plane, words, word, y, offset);
    [
        at(&right[SP], (0, 0)),
        at(&down[SP], (0, 0)),
        // A step back is stored at the pixel that it leads to, seen from there.
        at(&right[PS], (-1, 0)),
        at(&down[PS], (0, -1)),
    ]
}

/// Area-weighted colour of a simple pixel; `None` if nothing is known of its secondary region.
#[inline]
fn blend(
    inputs: &Inputs,
    sides: &[u64; 4],
    colours: &[Vec<f32>; 3],
    (x, y): (usize, usize),
) -> Option<[f32; 3]> {
    let epi = inputs.epi;
    let (word, bit) = epi.grid.bit(x, y);
    let at = epi.grid.at(x, y);
    let code = EdgeCode(epi.code[at]);
    let secondary_inner = epi.primary_inner[word] >> bit & 1 == 0;
    let secondary: [f32; 3] = match inputs.direct {
        Some(direct) if direct.known[word] >> bit & 1 != 0 => direct.rgb.map(|plane| plane[at]),
        _ => {
            let donors = epi.tables().donors(code, secondary_inner);
            let lender = lender(inputs, sides, (x, y), donors)?;
            colours.each_ref().map(|plane| plane[lender])
        }
    };
    let inner = epi.tables().inner_area(code);
    let share = if secondary_inner { inner } else { 1.0 - inner };
    let mix = |k: usize| colours[k][at] + share * (secondary[k] - colours[k][at]);
    Some([mix(0), mix(1), mix(2)])
}

/// Element of the first neighbour in the list whose primary region reaches this pixel's secondary one.
#[inline]
fn lender(
    inputs: &Inputs,
    sides: &[u64; 4],
    (x, y): (usize, usize),
    donors: &[u8; 8],
) -> Option<usize> {
    let grid = inputs.epi.grid;
    let listed = donors
        .iter()
        .map(|&n| usize::from(n))
        .take_while(|&n| n < NEIGHBOURS.len());
    for neighbour in listed {
        let (dx, dy) = NEIGHBOURS[neighbour];
        let reached = match sides.get(neighbour) {
            Some(side) => side >> (x % 64) & 1 != 0,
            None => around_corner(inputs.reach, (x, y), (dx, dy)),
        };
        if reached {
            let (x, y) = (
                x.wrapping_add_signed(dx as isize),
                y.wrapping_add_signed(dy as isize),
            );
            let (word, bit) = grid.bit(x, y);
            if inputs.bare[word] >> bit & 1 == 0 {
                return Some(grid.at(x, y));
            }
        }
    }
    None
}

/// Does the secondary region reach the primary one of a diagonal neighbour by either of the two ways round?
fn around_corner(reach: &ReachMap, (x, y): (usize, usize), (dx, dy): (i32, i32)) -> bool {
    [((dx, 0), (0, dy)), ((0, dy), (dx, 0))]
        .into_iter()
        .any(|(first, second)| {
            let there = reach.step((x, y), first);
            if there & (1 << SP | 1 << SS) == 0 {
                return false;
            }
            let (x, y) = (
                x.wrapping_add_signed(first.0 as isize),
                y.wrapping_add_signed(first.1 as isize),
            );
            let on = reach.step((x, y), second);
            (there >> SP & on >> PP | there >> SS & on >> SP) & 1 != 0
        })
}

#[cfg(test)]
mod tests;
