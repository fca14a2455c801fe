//! Edge codes (paper section 4.2) and the tables that they index, all computed from geometry.
//!
//! The boundary of a pixel is cut into 32 segments, numbered clockwise from the top-left corner: 0..8 along the top
//! (+x), 8..16 down the right (+y), 16..24 along the bottom (-x), 24..32 up the left (-y). A simple pixel's edge runs
//! from the middle of segment `a` to the middle of segment `b`, `a < b`, on different sides:
//!
//! ```text
//! code  bits 9..5  a      bits 4..0  b
//! EMPTY   = 0 (a = b = 0)     COMPLEX = 1 (a = 0, b = 1: the same side, which no edge may have)
//! ```
//!
//! The edge parts the pixel into the *inner* region, on the arc clockwise from `a` to `b`, and the *outer* one, which
//! always holds the top-left corner.

use super::geometry::Boundary;

/// Number of 10-bit codes.
pub const CODES: usize = 1024;

/// Segments of a pixel's boundary; units of 1/32 of a pixel make the centres of the smallest cells integer.
const PIXEL: Boundary = Boundary::new(8, 2);

/// Steps to the eight neighbours, in the order that the tables number them: sides clockwise from the right, then corners.
pub const NEIGHBOURS: [(i32, i32); 8] = [
    (1, 0),
    (0, 1),
    (-1, 0),
    (0, -1),
    (1, 1),
    (-1, 1),
    (-1, -1),
    (1, -1),
];

/// A 10-bit edge code. Layout in the module's text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct EdgeCode(pub u16);

impl EdgeCode {
    /// No edge crosses the pixel's boundary.
    pub const EMPTY: Self = Self(0);
    /// The pixel's edges cannot be stood for by one.
    pub const COMPLEX: Self = Self(1);

    /// The code of a clockwise boundary mask (bit i = segment i), by the rules of paper section 4.5: no crossing is
    /// empty, two on different sides simple, all else complex.
    #[inline]
    pub fn from_boundary(mask: u32) -> Self {
        if mask == 0 {
            return Self::EMPTY;
        }
        let (a, b) = (mask.trailing_zeros(), 31 - mask.leading_zeros());
        if mask.count_ones() == 2 && a / 8 != b / 8 {
            Self((a << 5 | b) as u16)
        } else {
            Self::COMPLEX
        }
    }

    /// Segments of the edge's ends, `a < b`; meaningless unless the code is simple.
    #[inline]
    pub fn ends(self) -> (u32, u32) {
        (u32::from(self.0 >> 5) & 31, u32::from(self.0) & 31)
    }

    /// Does the code stand for one edge?
    #[inline]
    pub fn is_simple(self) -> bool {
        let (a, b) = self.ends();
        self.0 < CODES as u16 && a < b && a / 8 != b / 8
    }

    /// Every simple code.
    pub fn all_simple() -> impl Iterator<Item = Self> {
        (0..CODES as u16).map(Self).filter(|code| code.is_simple())
    }
}

/// What 4 bits of a code say (paper section 5.2): empty, complex, or which two sides the edge joins and which of the two
/// regions is primary. `0` is empty, `1` complex, `2 + 2 · pair + primary_inner` simple, pairs in [`SIDE_PAIRS`]' order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Class(pub u8);

/// Sides (0 top, 1 right, 2 bottom, 3 left) that an edge can join, in the order of the side of `a`.
pub const SIDE_PAIRS: [(u8, u8); 6] = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];

impl Class {
    /// Number of classes in use.
    pub const COUNT: usize = 14;
    /// No edge.
    pub const EMPTY: Self = Self(0);
    /// More than one edge can say.
    pub const COMPLEX: Self = Self(1);

    /// Class of a pixel with this code, of which the inner region is primary or not.
    pub fn new(code: EdgeCode, primary_inner: bool) -> Self {
        if !code.is_simple() {
            return if code == EdgeCode::EMPTY {
                Self::EMPTY
            } else {
                Self::COMPLEX
            };
        }
        let (a, b) = code.ends();
        let sides = ((a / 8) as u8, (b / 8) as u8);
        let pair = SIDE_PAIRS.iter().position(|&p| p == sides).unwrap_or(0);
        Self(2 + 2 * pair as u8 + u8::from(primary_inner))
    }

    /// Sides that the edge joins and whether the inner region is primary; `None` unless simple.
    pub fn edge(self) -> Option<((u8, u8), bool)> {
        let index = usize::from(self.0).checked_sub(2)?;
        SIDE_PAIRS
            .get(index / 2)
            .map(|&pair| (pair, index % 2 == 1))
    }
}

/// How finely a sample's place in its pixel is known (paper section 4.3 has 4 bits). Finer cells leave fewer samples
/// ambiguous: of all cells of all simple codes 31, 19 and 14 %.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Places {
    /// 4x4 cells.
    Bits4,
    /// 8x8 cells.
    Bits6,
    /// 16x16 cells.
    #[default]
    Bits8,
}

impl Places {
    /// Cells along x or y.
    pub const fn per_axis(self) -> usize {
        match self {
            Self::Bits4 => 4,
            Self::Bits6 => 8,
            Self::Bits8 => 16,
        }
    }

    /// Cell of an offset from the pixel's top-left corner, each coordinate in 0..1 of a pixel: `row · per_axis + column`.
    #[inline]
    pub fn cell(self, offset_x_px: f32, offset_y_px: f32) -> u8 {
        let n = self.per_axis();
        let axis = |v: f32| ((v * n as f32) as usize).min(n - 1);
        (axis(offset_y_px) * n + axis(offset_x_px)) as u8
    }
}

/// Where a sub-pixel cell lies with respect to an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// In the region with the top-left corner.
    Outer,
    /// In the region on the arc from a to b.
    Inner,
    /// Some edge that the code stands for cuts the cell.
    Ambiguous,
}

/// Sides of a code's cells: bit `cell` of 256, inner for where the cell's centre lies, ambiguous by the paper's rule.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Cells {
    inner: [u64; 4],
    ambiguous: [u64; 4],
}

/// Ends a list of neighbours.
pub const NO_NEIGHBOUR: u8 = 8;

/// Everything that is looked up by a simple edge code.
#[derive(Clone, Debug)]
pub struct CodeTables {
    places: Places,
    inner_area: Vec<f32>,
    centroid_px: Vec<[[f32; 2]; 2]>,
    cells: Vec<Cells>,
    secondary: Vec<[[u8; 8]; 2]>,
    inner_larger: [u64; CODES / 64],
}

impl CodeTables {
    /// Computes all tables, for samples whose places are known this finely. Takes milliseconds: once, at start-up.
    pub fn new(places: Places) -> Self {
        let mut tables = Self {
            places,
            inner_area: vec![0.0; CODES],
            centroid_px: vec![[[0.5; 2]; 2]; CODES],
            cells: vec![Cells::default(); CODES],
            secondary: vec![[[NO_NEIGHBOUR; 8]; 2]; CODES],
            inner_larger: [0; CODES / 64],
        };
        for code in EdgeCode::all_simple() {
            let (i, (a, b)) = (usize::from(code.0), code.ends());
            let (a, b) = (a as i32, b as i32);
            let area = PIXEL.inner_area(a, b);
            let centroids = PIXEL.centroids(a, b);
            tables.inner_area[i] = area as f32;
            tables.centroid_px[i] = centroids.map(|c| c.map(|v| v as f32));
            tables.cells[i] = cells(a, b, places.per_axis() as i32);
            tables.secondary[i] =
                [false, true].map(|inner| donors(a, b, inner, centroids[usize::from(inner)]));
            tables.inner_larger[i / 64] |= u64::from(area > 0.5) << (i % 64);
        }
        tables
    }

    /// How finely places are known.
    pub fn places(&self) -> Places {
        self.places
    }

    /// Area of the inner region, share of the pixel.
    #[inline]
    pub fn inner_area(&self, code: EdgeCode) -> f32 {
        self.inner_area[usize::from(code.0) % CODES]
    }

    /// Centroid of the outer (false) or inner (true) region, pixels from the pixel's top-left corner.
    #[inline]
    pub fn centroid_px(&self, code: EdgeCode, inner: bool) -> [f32; 2] {
        self.centroid_px[usize::from(code.0) % CODES][usize::from(inner)]
    }

    /// Is the inner region more than half of the pixel?
    #[inline]
    pub fn inner_larger(&self, code: EdgeCode) -> bool {
        let i = usize::from(code.0) % CODES;
        self.inner_larger[i / 64] >> (i % 64) & 1 != 0
    }

    /// Side of a cell (numbered as [`Places::cell`] does).
    #[inline]
    pub fn side(&self, code: EdgeCode, cell: u8) -> Side {
        let cells = &self.cells[usize::from(code.0) % CODES];
        let (word, bit) = (usize::from(cell) / 64, cell % 64);
        if cells.ambiguous[word] >> bit & 1 != 0 {
            Side::Ambiguous
        } else if cells.inner[word] >> bit & 1 != 0 {
            Side::Inner
        } else {
            Side::Outer
        }
    }

    /// Neighbours (indices of [`NEIGHBOURS`]) whose primary region may hold the colour of this pixel's inner or outer
    /// region, the likeliest first, ended by [`NO_NEIGHBOUR`] (paper section 5.3, anti-aliasing).
    #[inline]
    pub fn donors(&self, code: EdgeCode, inner: bool) -> &[u8; 8] {
        &self.secondary[usize::from(code.0) % CODES][usize::from(inner)]
    }
}

/// Sides of all cells of a code.
fn cells(a: i32, b: i32, per_axis: i32) -> Cells {
    let size = PIXEL.side() / per_axis;
    let mut cells = Cells::default();
    for cell in 0..per_axis * per_axis {
        let (x, y) = (cell % per_axis * size, cell / per_axis * size);
        let (word, bit) = (cell as usize / 64, cell % 64);
        let inner = PIXEL.is_inner(a, b, (x + size / 2, y + size / 2));
        let cut = PIXEL.cuts_cell(a, b, (x, y), (x + size, y + size));
        cells.inner[word] |= u64::from(inner) << bit;
        cells.ambiguous[word] |= u64::from(cut) << bit;
    }
    cells
}

/// Neighbours that touch a region, nearest to its centroid first.
fn donors(a: i32, b: i32, inner: bool, centroid_px: [f64; 2]) -> [u8; 8] {
    let touches = |neighbour: usize| {
        if neighbour < 4 {
            // Neighbours start at the right, sides at the top.
            let length = PIXEL.inner_length(a, b, (neighbour as i32 + 1) % 4);
            if inner {
                length > 0
            } else {
                length < PIXEL.side()
            }
        } else {
            // Corners clockwise from the top left are 0..4; neighbours 4..8 start at the bottom right.
            let corner = (neighbour as i32 - 2) % 4;
            (a < 8 * corner && 8 * corner <= b) == inner
        }
    };
    let distance = |neighbour: usize| {
        let (dx, dy) = NEIGHBOURS[neighbour];
        (f64::from(dx) + 0.5 - centroid_px[0]).powi(2)
            + (f64::from(dy) + 0.5 - centroid_px[1]).powi(2)
    };
    let mut order: Vec<usize> = (0..8).filter(|&n| touches(n)).collect();
    order.sort_by(|&m, &n| distance(m).total_cmp(&distance(n)));
    let mut list = [NO_NEIGHBOUR; 8];
    for (slot, &neighbour) in list.iter_mut().zip(&order) {
        *slot = neighbour as u8;
    }
    list
}

#[cfg(test)]
mod tests;
