//! The 6x6 sub-pixels around a complex pixel, as bit planes in one word each: sub-pixel (column, row) is bit
//! `8 · row + column`. Region 0 of a sub-pixel is the outer one, with its top-left corner; region 1 the inner one.

use crate::edges::crossings::Crossings;

/// Sub-pixels a side.
const SIDE: usize = 6;
/// All sub-pixels.
const ALL: u64 = 0x0000_3F3F_3F3F_3F3F;
/// Bit of a sub-pixel.
pub(super) const fn sub_bit(column: usize, row: usize) -> u64 {
    1 << (8 * row + column)
}

/// The sub-pixels at one corner (clockwise from the top left) of pixels, of which `pixels` has bit `3 · row + column`.
pub(super) fn at_corner(pixels: u32, corner: usize) -> u64 {
    let row = |row: u32| {
        let bits = u64::from(pixels >> (3 * row) & 7);
        (bits & 1 | (bits & 2) << 1 | (bits & 4) << 2) << (16 * row)
    };
    // To the sub-pixel at the right or below, if the corner lies there.
    (row(0) | row(1) | row(2)) << [0, 1, 9, 8][corner]
}

/// Positions of the bits that are set.
pub(super) fn bits(mut mask: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (mask != 0).then(|| mask.trailing_zeros() as usize);
        mask &= mask.wrapping_sub(1);
        bit
    })
}

/// One of the complex pixel's own sub-pixels and the steps that lead away from it within its 5x5 neighbourhood.
pub(super) struct Window {
    /// Column and row.
    pub(super) centre: (usize, usize),
    /// From where a step right, left, down, up may be taken.
    from: [u64; 4],
}

/// The four sub-pixels of the pixel in the middle.
pub(super) const WINDOWS: [Window; 4] = [window(2, 2), window(3, 2), window(2, 3), window(3, 3)];

const fn window(column: usize, row: usize) -> Window {
    let mut from = [0; 4];
    let mut y = row - 2;
    while y <= row + 2 {
        let mut x = column - 2;
        while x <= column + 2 {
            let allowed = [
                x >= column && x < column + 2,
                x <= column && x > column - 2,
                y >= row && y < row + 2,
                y <= row && y > row - 2,
            ];
            let mut k = 0;
            while k < 4 {
                if allowed[k] {
                    from[k] |= sub_bit(x, y);
                }
                k += 1;
            }
            x += 1;
        }
        y += 1;
    }
    Window {
        centre: (column, row),
        from,
    }
}

/// Edges of the 6x6 sub-pixels.
pub(super) struct Subpixels {
    /// Crossings on the seven horizontal lines, 4 bits a sub-pixel from left to right.
    horizontal: [u32; SIDE + 1],
    /// Crossings on the seven vertical lines, 4 bits a sub-pixel from top to bottom.
    vertical: [u32; SIDE + 1],
    /// Sub-pixels inside the image that are not complex.
    pub(super) open: u64,
    /// Sub-pixels that one edge parts.
    simple: u64,
    /// Corners 1, 2 and 3 (clockwise from the top left) that lie in the inner region.
    corner: [u64; 3],
    /// Regions joined with those of the sub-pixel to the right: `[here][there]`.
    right: [[u64; 2]; 2],
    /// The same with the sub-pixel below.
    down: [[u64; 2]; 2],
}

impl Subpixels {
    /// Reconstructs the edges of the sub-pixels around a pixel.
    pub(super) fn load(crossings: &Crossings, (x, y): (usize, usize)) -> Self {
        let (horizontal, vertical) = lines(crossings, (x, y));
        let (top, many_top) = occupied_rows(&horizontal);
        let (left, many_left) = occupied_columns(&vertical);
        let (bottom, right) = (top >> 8, left >> 1);
        let many = many_top | many_top >> 8 | many_left | many_left >> 1;

        let any = top | bottom | left | right;
        let odd = top ^ bottom ^ left ^ right;
        let simple = any & !odd & !(top & bottom & left & right) & !many & ALL;
        let open = (simple | !any) & inside(crossings, (x, y));
        let corner = [top & simple, (top ^ right) & simple, left & simple];
        let [tr, br, bl] = corner;
        let (bl_next, tr_below) = (bl >> 1, tr >> 8);
        let joined = |first: u64, last: u64, last_there: u64, both: u64| {
            // Of the corners that meet, the first one there is a top-left one: always outer.
            let outer = [!first | !(last | last_there), !last & last_there];
            let inner = [first | last & !last_there, last & last_there];
            [outer, inner].map(|row| row.map(|plane| plane & both))
        };
        Self {
            horizontal,
            vertical,
            open,
            simple,
            corner,
            right: joined(tr, br, bl_next, open & open >> 1),
            down: joined(bl, br, tr_below, open & open >> 8),
        }
    }

    /// Is the sub-pixel neither complex nor outside the image?
    pub(super) fn is_open(&self, (column, row): (usize, usize)) -> bool {
        self.open & sub_bit(column, row) != 0
    }

    /// Of open sub-pixels, the outer and the inner regions that hold this corner.
    pub(super) fn corner_regions(&self, subpixels: u64, corner: usize) -> [u64; 2] {
        let inner = corner
            .checked_sub(1)
            .map_or(0, |corner| self.corner[corner]);
        [!inner, inner].map(|region| region & subpixels & self.open)
    }

    /// Code `16 a + b` of a simple sub-pixel's edge, its segments numbered clockwise from the top-left corner, four a side.
    pub(super) fn code(&self, (column, row): (usize, usize)) -> Option<usize> {
        if self.simple & sub_bit(column, row) == 0 {
            return None;
        }
        let boundary = self.boundary((column, row));
        Some((16 * boundary.trailing_zeros() + 15 - boundary.leading_zeros()) as usize)
    }

    /// Clockwise boundary mask of a sub-pixel, 4 bits a side from the top-left corner.
    fn boundary(&self, (column, row): (usize, usize)) -> u16 {
        let nibble = |lines: &[u32; SIDE + 1], line: usize, along: usize| {
            (lines[line] >> (4 * along) & 15) as u16
        };
        let reversed = |nibble: u16| nibble.reverse_bits() >> 12;
        nibble(&self.horizontal, row, column)
            | nibble(&self.vertical, column + 1, row) << 4
            | reversed(nibble(&self.horizontal, row + 1, column)) << 8
            | reversed(nibble(&self.vertical, column, row)) << 12
    }

    /// Outer and inner regions that a region in the middle of a window reaches, itself included, always stepping away.
    pub(super) fn reach(&self, window: &Window, region: usize) -> [u64; 2] {
        let mut front = [0; 2];
        front[region] = sub_bit(window.centre.0, window.centre.1) & self.open;
        let [right, left, down, up] = window.from;
        // The longest way has four steps; a round takes one along each axis.
        for _ in 0..4 {
            let before = front;
            step(&mut front, &self.right, right, left, 1);
            step(&mut front, &self.down, down, up, 8);
            if front == before {
                break;
            }
        }
        front
    }
}

/// One step along an axis both ways.
fn step(front: &mut [u64; 2], joined: &[[u64; 2]; 2], ahead: u64, back: u64, by: u32) {
    let here = front.map(|plane| plane & ahead);
    // A step back is stored at the sub-pixel that it leads to.
    let there = front.map(|plane| (plane & back) >> by);
    for region in 0..2 {
        front[region] |= (here[0] & joined[0][region] | here[1] & joined[1][region]) << by
            | there[0] & joined[region][0]
            | there[1] & joined[region][1];
    }
}

/// Three or four neighbouring masks of a row from column `x - 1` on; 0 outside the image.
#[inline]
fn masks<const N: usize>(plane: &[u8], columns: usize, row: usize, x: usize) -> [u8; N] {
    let first = row.wrapping_mul(columns).wrapping_add(x).wrapping_sub(1);
    let inside = x >= 1 && x - 1 + N <= columns;
    if let (true, Some(masks)) = (inside, plane.get(first..first.wrapping_add(N))) {
        return std::array::from_fn(|k| masks[k]);
    }
    let column = |k: usize| (x + k).checked_sub(1).filter(|&column| column < columns);
    let at = |k: usize| plane.get(row.checked_mul(columns)? + column(k)?);
    std::array::from_fn(|k| at(k).copied().unwrap_or(0))
}

/// Seven horizontal and seven vertical lines of three 8-bit masks each.
fn lines(crossings: &Crossings, (x, y): (usize, usize)) -> ([u32; SIDE + 1], [u32; SIDE + 1]) {
    let width = crossings.width;
    let joined = |[a, b, c]: [u8; 3]| u32::from_le_bytes([a, b, c, 0]);
    let mut lines = ([0; SIDE + 1], [0; SIDE + 1]);
    for along in 0..4 {
        let row = (y + along).wrapping_sub(1);
        lines.0[2 * along] = joined(masks(&crossings.horizontal, width, row, x));
        if along == 3 {
            break;
        }
        lines.0[2 * along + 1] = joined(masks(&crossings.half_horizontal, width, row, x));
        let full: [u8; 4] = masks(&crossings.vertical, width + 1, row, x);
        let half: [u8; 3] = masks(&crossings.half_vertical, width, row, x);
        for (line, mask) in full.into_iter().enumerate() {
            lines.1[2 * line] |= u32::from(mask) << (8 * along);
        }
        for (line, mask) in half.into_iter().enumerate() {
            lines.1[2 * line + 1] |= u32::from(mask) << (8 * along);
        }
    }
    lines
}

/// Sub-pixels of the 6x6 whose pixels lie inside the image.
fn inside(crossings: &Crossings, (x, y): (usize, usize)) -> u64 {
    let mut inside = ALL;
    for (outside, lost) in [
        (x == 0, 0x0303_0303_0303),
        (x + 1 >= crossings.width, 0x3030_3030_3030),
        (y == 0, 0x0000_0000_FFFF),
        (y + 1 >= crossings.height, 0xFFFF_0000_0000),
    ] {
        if outside {
            inside &= !lost;
        }
    }
    inside
}

/// Of each nibble: is any bit set, are several?
fn nibbles(line: u32) -> (u32, u32) {
    let pairs_any = line | line >> 1;
    let pairs_both = line & line >> 1;
    let (low, high) = (pairs_any & 0x11_1111, pairs_any >> 2 & 0x11_1111);
    let several = (pairs_both | pairs_both >> 2) & 0x11_1111 | low & high;
    (low | high, several)
}

/// Bits 0, 4, 8, ... 20 moved together to bits 0..6.
fn gather(spread: u32) -> u64 {
    let pairs = (spread | spread >> 3) & 0x03_0303;
    u64::from((pairs | pairs >> 6 | pairs >> 12) & 0x3F)
}

/// Planes of horizontal lines: line l, sub-pixel i at bit `8 l + i`.
fn occupied_rows(lines: &[u32; SIDE + 1]) -> (u64, u64) {
    lines
        .iter()
        .enumerate()
        .fold((0, 0), |(any, several), (line, &mask)| {
            let (a, s) = nibbles(mask);
            (
                any | gather(a) << (8 * line),
                several | gather(s) << (8 * line),
            )
        })
}

/// Bits 0, 4, 8, ... 20 moved apart to bits 0, 8, 16, ... 40.
fn spread(bits: u32) -> u64 {
    let halves = u64::from(bits & 0x111) | u64::from(bits & 0x11_1000) << 12;
    halves & 0x0100_0001 | (halves & 0x1000_0010) << 4 | (halves & 0x1_0000_0100) << 8
}

/// Planes of vertical lines: line l, sub-pixel j at bit `8 j + l`.
fn occupied_columns(lines: &[u32; SIDE + 1]) -> (u64, u64) {
    lines
        .iter()
        .enumerate()
        .fold((0, 0), |(any, several), (line, &mask)| {
            let (a, s) = nibbles(mask);
            (any | spread(a) << line, several | spread(s) << line)
        })
}
