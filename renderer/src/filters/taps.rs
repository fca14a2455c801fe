//! The 5x5 neighbourhood of a pixel, and reachability in it, 64 pixels at a time.

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

#[cfg(test)]
mod tests {
    use super::*;

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
