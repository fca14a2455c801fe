//! Which of its 5x5 neighbours each pixel may read: reachability and samples put together, 64 pixels at a time.

/// Offsets of the 5x5 neighbourhood: the centre, the 8 around it, then the 16 of the outer ring.
pub const OFFSETS: [(i32, i32); 25] = [
    (0, 0),
    (1, 0),
    (-1, 0),
    (0, 1),
    (0, -1),
    (1, 1),
    (-1, 1),
    (1, -1),
    (-1, -1),
    (2, 0),
    (-2, 0),
    (0, 2),
    (0, -2),
    (2, 1),
    (-2, 1),
    (2, -1),
    (-2, -1),
    (1, 2),
    (-1, 2),
    (1, -2),
    (-1, -2),
    (2, 2),
    (-2, 2),
    (2, -2),
    (-2, -2),
];

/// Taps of the inner 3x3 in [`OFFSETS`].
pub const INNER: usize = 9;

/// Samples at which the inner 3x3 alone will do.
pub const ENOUGH: u32 = 4;

/// One bit a pixel: reachability over the 12 offsets of a half plane, whose opposites follow by symmetry.
pub trait Reach {
    /// Bits of 64 pixels from `word` on in row `y`: whether the primary region at `(dx, dy)` from each is reachable from
    /// its own; any offset of the 5x5 neighbourhood but (0, 0).
    fn reachable(&self, offset: (i32, i32), word: usize, y: usize) -> u64;
}

/// Word `word` of row `y` of a bit plane as seen `dx` pixels to the right and `dy` down; 0 outside.
#[inline]
pub fn shifted(plane: &[u64], words: usize, word: usize, y: usize, (dx, dy): (i32, i32)) -> u64 {
    let Some(y) = y.checked_add_signed(dy as isize) else {
        return 0;
    };
    let Some(row) = plane.get(y * words..(y + 1) * words) else {
        return 0;
    };
    let at = |w: usize| row.get(w).copied().unwrap_or(0);
    match dx {
        0 => at(word),
        1.. => at(word) >> dx | at(word + 1) << (64 - dx),
        _ => at(word) << -dx | word.checked_sub(1).map_or(0, at) >> (64 + dx),
    }
}

/// Counts to 4 in 64 lanes at once.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counter {
    ones: u64,
    twos: u64,
    four: u64,
}

impl Counter {
    /// Adds one where a bit is set.
    #[inline]
    pub fn add(&mut self, bits: u64) {
        let carry = self.ones & bits;
        self.ones ^= bits;
        self.four |= self.twos & carry;
        self.twos ^= carry;
    }

    /// Lanes that have reached [`ENOUGH`].
    #[inline]
    pub fn enough(&self) -> u64 {
        self.four
    }

    /// Lanes that have counted fewer than three.
    #[inline]
    pub fn few(&self) -> u64 {
        !(self.four | (self.twos & self.ones))
    }

    /// Lanes that have counted nothing.
    #[inline]
    pub fn none(&self) -> u64 {
        !(self.ones | self.twos | self.four)
    }
}

/// Taps of 64 pixels.
#[derive(Clone, Copy, Debug)]
pub struct Taps {
    /// A bit a pixel for each of [`OFFSETS`]: the neighbour there has a sample that this pixel may use.
    pub masks: [u64; 25],
    /// Pixels with fewer than three: a plane through them is not determined.
    pub few: u64,
    /// Pixels with none.
    pub none: u64,
}

/// Taps of the 64 pixels of a word. Complex pixels may use every neighbour's sample (paper section 5.4). Where
/// `stop_early` is set, pixels that find enough in the inner 3x3 do not read the outer ring.
pub fn taps<R: Reach>(
    reach: &R,
    has: &[u64],
    complex: &[u64],
    words: usize,
    (word, y): (usize, usize),
    stop_early: bool,
) -> Taps {
    let open = complex[y * words + word];
    let mut masks = [0; 25];
    let mut counter = Counter::default();
    let mut wanted = !0;
    for (k, (mask, &offset)) in masks.iter_mut().zip(&OFFSETS).enumerate() {
        if k == INNER && stop_early {
            wanted = !counter.enough();
        }
        let there = shifted(has, words, word, y, offset) & wanted;
        if there != 0 {
            let reachable = if k == 0 {
                !0
            } else {
                reach.reachable(offset, word, y)
            };
            *mask = there & (reachable | open);
            counter.add(*mask);
        }
    }
    Taps {
        masks,
        few: counter.few(),
        none: counter.none(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counting_stops_at_four() {
        let mut counter = Counter::default();
        for n in 0..10 {
            assert_eq!(counter.none() & 1, u64::from(n == 0));
            assert_eq!(counter.enough() & 1, u64::from(n >= 4));
            assert_eq!(counter.few() & 1, u64::from(n < 3));
            counter.add(1);
        }
    }

    #[test]
    fn shifting_agrees_with_looking_up_pixels() {
        let words = 2;
        let plane: Vec<u64> = (0..6u64)
            .map(|i| (i + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15))
            .collect();
        let bit = |x: i64, y: i64| {
            let inside = (0..128).contains(&x) && (0..3).contains(&y);
            inside && plane[y as usize * words + x as usize / 64] >> (x % 64) & 1 == 1
        };
        for offset in OFFSETS {
            for (y, word) in [(0, 0), (1, 1), (2, 0)] {
                let got = shifted(&plane, words, word, y, offset);
                for k in 0..64 {
                    let (x, yy) = (
                        (word * 64 + k) as i64 + i64::from(offset.0),
                        y as i64 + i64::from(offset.1),
                    );
                    assert_eq!(got >> k & 1 == 1, bit(x, yy), "{offset:?} {word} {y} {k}");
                }
            }
        }
    }
}
