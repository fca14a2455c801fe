//! Reachability by the paper's tables (section 5.2): the specification that the bit-sliced path must equal.
//!
//! A relation of two pixels' regions is a 4-bit mask: bit 0 primary to primary, bit 1 primary to secondary, bit 2
//! secondary to primary, bit 3 secondary to secondary.

use std::sync::LazyLock;

use super::code::Class;
use super::image::Epi;

/// Primary to primary.
pub const PP: usize = 0;
/// Primary of the first pixel to secondary of the second.
pub const PS: usize = 1;
/// Secondary of the first pixel to primary of the second.
pub const SP: usize = 2;
/// Secondary to secondary.
pub const SS: usize = 3;

/// The half of the 5x5 neighbourhood that is computed and stored; the other half follows by symmetry.
pub const OFFSETS: [(i32, i32); 12] = [
    (1, 0),
    (2, 0),
    (-2, 1),
    (-1, 1),
    (0, 1),
    (1, 1),
    (2, 1),
    (-2, 2),
    (-1, 2),
    (0, 2),
    (1, 2),
    (2, 2),
];

/// The paper's look-up tables.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReachTables {
    /// Relation of a pixel and its right neighbour, by `16 · class + class of the neighbour`.
    pub right: [u8; 256],
    /// Relation of a pixel and the one below it.
    pub down: [u8; 256],
    /// Relation of a and d through b, by `16 · (a to b) + (b to d)`.
    pub chain: [u8; 256],
}

/// The tables, computed once.
pub static TABLES: LazyLock<ReachTables> = LazyLock::new(ReachTables::new);

impl ReachTables {
    /// Computes the tables: two regions are joined if they meet somewhere along the shared side.
    pub fn new() -> Self {
        let table = |entry: fn(usize, usize) -> u8| std::array::from_fn(|i| entry(i / 16, i % 16));
        Self {
            // Going along the shared side, the second pixel meets it on its opposite side, running the other way.
            right: table(|a, b| neighbour_entry(a, b, |t| 1.0 + t, |t| 4.0 - t)),
            down: table(|a, b| neighbour_entry(a, b, |t| 3.0 - t, |t| t)),
            chain: table(chain_entry),
        }
    }
}

impl Default for ReachTables {
    fn default() -> Self {
        Self::new()
    }
}

/// Does this place on the boundary (sides clockwise from the top left) lie in the secondary region? `None` where nothing
/// is reachable. The edge is taken to cross its sides in their middle: where exactly is the same for both neighbours.
fn is_secondary(class: usize, along: f64) -> Option<bool> {
    let class = Class(class as u8);
    if class == Class::EMPTY {
        return Some(false);
    }
    let ((from, to), primary_inner) = class.edge()?;
    let inner = f64::from(from) + 0.5 < along && along < f64::from(to) + 0.5;
    Some(inner != primary_inner)
}

fn neighbour_entry(a: usize, b: usize, on_a: fn(f64) -> f64, on_b: fn(f64) -> f64) -> u8 {
    let mut relation = 0;
    for t in [0.25, 0.75] {
        if let (Some(s), Some(t)) = (is_secondary(a, on_a(t)), is_secondary(b, on_b(t))) {
            relation |= 1 << (2 * usize::from(s) + usize::from(t));
        }
    }
    relation
}

fn chain_entry(ab: usize, bd: usize) -> u8 {
    let mut relation = 0;
    for (from, through, to) in (0..8).map(|i| (i >> 2, i >> 1 & 1, i & 1)) {
        let joined = ab >> (2 * from + through) & bd >> (2 * through + to) & 1;
        relation |= (joined << (2 * from + to)) as u8;
    }
    relation
}

/// The relation seen from the other pixel.
pub fn mirrored(relation: u8) -> u8 {
    relation & 0b1001 | (relation & 0b0010) << 1 | (relation & 0b0100) >> 1
}

/// Relation of a pixel and its neighbour one step along x or y; 0 if either is outside the image.
pub fn neighbour_relation(epi: &Epi, (x, y): (i32, i32), (dx, dy): (i32, i32)) -> u8 {
    let inside = |x: i32, y: i32| {
        (0..epi.grid.width as i32).contains(&x) && (0..epi.grid.height as i32).contains(&y)
    };
    if !inside(x, y) || !inside(x + dx, y + dy) {
        return 0;
    }
    let class = |x: i32, y: i32| usize::from(epi.class_at(x as usize, y as usize).0);
    let (here, there) = (class(x, y), class(x + dx, y + dy));
    match (dx, dy) {
        (1, 0) => TABLES.right[16 * here + there],
        (0, 1) => TABLES.down[16 * here + there],
        (-1, 0) => mirrored(TABLES.right[16 * there + here]),
        _ => mirrored(TABLES.down[16 * there + here]),
    }
}

/// Relation of a pixel and the one at an offset of at most two pixels either way, propagated away from the first.
pub fn relation(epi: &Epi, (x, y): (i32, i32), (dx, dy): (i32, i32)) -> u8 {
    let mut joined = 0;
    for step in [(dx.signum(), 0), (0, dy.signum())] {
        if step == (0, 0) {
            continue;
        }
        let before = (dx - step.0, dy - step.1);
        let last = neighbour_relation(epi, (x + before.0, y + before.1), step);
        joined |= if before == (0, 0) {
            last
        } else {
            TABLES.chain[usize::from(16 * relation(epi, (x, y), before) + last)]
        };
    }
    joined
}

/// Primary-to-primary reachability of every pixel, row by row without padding: bit i is `OFFSETS[i]`, bit `12 + i` its
/// opposite, which is taken from the pixel there (reachability is symmetric).
pub fn reach_by_tables(epi: &Epi) -> Vec<u32> {
    let (width, height) = (epi.grid.width as i32, epi.grid.height as i32);
    let mut reach = vec![0u32; (width * height) as usize];
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        for (i, &(dx, dy)) in OFFSETS.iter().enumerate() {
            if relation(epi, (x, y), (dx, dy)) & 1 << PP != 0 {
                reach[(y * width + x) as usize] |= 1 << i;
                reach[((y + dy) * width + x + dx) as usize] |= 1 << (12 + i);
            }
        }
    }
    reach
}
