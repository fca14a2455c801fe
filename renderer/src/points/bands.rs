//! Projected points sorted by bands of rows, so that those of a band are put into its pixels while these are in the nearer
//! memory: points come in the order of their slots, which is that of no place in the image.

use std::ops::Range;

use crate::epi::grid::Grid;

/// Bytes of a band's keys: half of a small second-level cache.
const BAND_BYTES: usize = 256 << 10;

/// Points that lie together in memory.
const CHUNK: usize = 256;

/// No chunk.
const NONE: u32 = u32::MAX;

/// A point that has come to lie in the image.
#[derive(Clone, Copy, Debug, Default)]
struct Landed {
    key: u64,
    /// Its pixel in the band, by row without margin.
    cell: u32,
}

/// The chunk that a band fills.
#[derive(Clone, Copy, Debug)]
struct Head {
    chunk: u32,
    /// How many points are in it.
    filled: u32,
}

/// Points by bands, in chunks that are linked together. Keeps its memory, which is fixed by the number of points and the size
/// of the image.
#[derive(Clone, Debug, Default)]
pub(super) struct Bands {
    stride: usize,
    height: usize,
    /// Binary logarithm of a band's rows.
    shift: u32,
    points: Vec<Landed>,
    /// The chunk of the same band that was filled before.
    before: Vec<u32>,
    heads: Vec<Head>,
    /// Chunks in use.
    used: usize,
}

impl Bands {
    /// Forgets all points and makes room for so many in an image of this layout.
    pub(super) fn start(&mut self, grid: Grid, points: usize) {
        (self.stride, self.height) = (grid.stride, grid.height);
        let rows = (BAND_BYTES / (size_of::<u64>() * grid.stride)).max(1);
        self.shift = rows.ilog2();
        let bands = grid.height.div_ceil(1 << self.shift);
        // A band's last chunk may be next to empty.
        let chunks = points / CHUNK + bands + 1;
        if self.before.len() < chunks {
            self.before.resize(chunks, NONE);
            self.points.resize(chunks * CHUNK, Landed::default());
        }
        let empty = Head {
            chunk: NONE,
            filled: CHUNK as u32,
        };
        self.heads.clear();
        self.heads.resize(bands, empty);
        self.used = 0;
    }

    /// How many bands there are.
    pub(super) fn len(&self) -> usize {
        self.heads.len()
    }

    /// Rows of a band.
    pub(super) fn rows_of(&self, band: usize) -> Range<usize> {
        let first = band << self.shift;
        first..((band + 1) << self.shift).min(self.height)
    }

    /// Adds a point in this pixel.
    #[inline]
    pub(super) fn push(&mut self, [x, y]: [u32; 2], key: u64) {
        let head = &mut self.heads[(y >> self.shift) as usize];
        if head.filled == CHUNK as u32 {
            self.before[self.used] = head.chunk;
            *head = Head {
                chunk: self.used as u32,
                filled: 0,
            };
            self.used += 1;
        }
        let row = y & ((1 << self.shift) - 1);
        self.points[head.chunk as usize * CHUNK + head.filled as usize] = Landed {
            key,
            cell: row * self.stride as u32 + x,
        };
        head.filled += 1;
    }

    /// Calls `visit` for all points of a band, in no particular order: pixel in the band, and key.
    #[inline]
    pub(super) fn for_each(&self, band: usize, mut visit: impl FnMut(usize, u64)) {
        let Head { mut chunk, filled } = self.heads[band];
        let mut filled = filled as usize;
        while chunk != NONE {
            let first = chunk as usize * CHUNK;
            for point in &self.points[first..first + filled] {
                visit(point.cell as usize, point.key);
            }
            chunk = self.before[chunk as usize];
            filled = CHUNK;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::place::hash_unit;

    #[test]
    fn every_point_comes_back_once_in_its_band() {
        let mut bands = Bands::default();
        for (width, height, count) in [(2000, 100, 5000), (70, 50, 3000), (1, 1, 700), (64, 9, 0)] {
            let grid = Grid::new(width, height);
            bands.start(grid, count);
            let mut wanted = Vec::new();
            for key in 0..count as u64 {
                let place = |salt: u64, size: usize| (hash_unit(salt, key) * size as f32) as u32;
                let [x, y] = [place(1, width), place(2, height)];
                bands.push([x, y], key);
                wanted.push((key, x as usize, y as usize));
            }
            let mut found = Vec::new();
            let mut rows = 0..0;
            for band in 0..bands.len() {
                assert_eq!(bands.rows_of(band).start, rows.end);
                rows = bands.rows_of(band);
                bands.for_each(band, |cell, key| {
                    let y = rows.start + cell / grid.stride;
                    assert!(rows.contains(&y));
                    found.push((key, cell % grid.stride, y));
                });
            }
            assert_eq!(rows.end, height);
            found.sort_unstable();
            assert_eq!(found, wanted);
        }
    }
}
