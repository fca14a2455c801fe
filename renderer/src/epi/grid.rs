//! How per-pixel data lies in memory.

/// Layout of arrays with one element a pixel, and of bit planes with one bit a pixel.
///
/// Rows are padded to whole 64-bit words, so that bit `x % 64` of word `x / 64` of a row is pixel x. Element arrays have
/// a margin before the first and after the last row, so that loads up to two pixels away in any direction stay inside;
/// what is loaded there is masked off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Image width, pixels.
    pub width: usize,
    /// Image height, pixels.
    pub height: usize,
    /// Words a row in a bit plane.
    pub words: usize,
    /// Elements a row: `64 · words`.
    pub stride: usize,
    /// Index of pixel (0, 0) in an element array.
    pub origin: usize,
}

impl Grid {
    /// The layout for an image of this size.
    pub fn new(width: usize, height: usize) -> Self {
        let words = width.div_ceil(64).max(1);
        let stride = words * 64;
        Self {
            width,
            height,
            words,
            stride,
            origin: 2 * stride + 64,
        }
    }

    /// Elements in an element array.
    pub fn elements(&self) -> usize {
        self.origin + self.height * self.stride + 2 * self.stride + 64
    }

    /// Words in a bit plane: `height` rows of `words`, no margin.
    pub fn plane_words(&self) -> usize {
        self.height * self.words
    }

    /// Index of a pixel in an element array.
    #[inline]
    pub fn at(&self, x: usize, y: usize) -> usize {
        self.origin + y * self.stride + x
    }

    /// Word and bit of a pixel in a bit plane.
    #[inline]
    pub fn bit(&self, x: usize, y: usize) -> (usize, u32) {
        (y * self.words + x / 64, (x % 64) as u32)
    }

    /// Visits every pixel whose bit is set in a plane, by rows.
    #[inline]
    pub fn for_each_set(&self, plane: &[u64], mut visit: impl FnMut(usize, usize)) {
        for y in 0..self.height {
            for word in 0..self.words {
                let mut left = plane[y * self.words + word];
                while left != 0 {
                    visit(word * 64 + left.trailing_zeros() as usize, y);
                    left &= left - 1;
                }
            }
        }
    }

    /// Bits of word `word` of any row that are pixels of the image.
    #[inline]
    pub fn valid(&self, word: usize) -> u64 {
        let left = self.width.saturating_sub(word * 64);
        if left >= 64 { !0 } else { (1u64 << left) - 1 }
    }
}
