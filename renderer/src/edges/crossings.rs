//! Where edges cross the boundaries of pixels.

/// Crossings of edges with pixel boundaries, an 8-bit mask a boundary: bit i is the i-th eighth of a pixel, counted
/// along +x or +y (paper section 4.5). Half boundaries run through the middle of a pixel and feed the complex filter only.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Crossings {
    /// Image width, pixels.
    pub width: usize,
    /// Image height, pixels.
    pub height: usize,
    /// Upper boundaries: `(height + 1)` rows of `width`; row y is the line at image y, between x and x + 1.
    pub horizontal: Vec<u8>,
    /// Left boundaries: `height` rows of `width + 1`; element x is the line at image x, between y and y + 1.
    pub vertical: Vec<u8>,
    /// Horizontal lines at y + 1/2: `height` rows of `width`.
    pub half_horizontal: Vec<u8>,
    /// Vertical lines at x + 1/2: `height` rows of `width`.
    pub half_vertical: Vec<u8>,
}

impl Crossings {
    /// No crossings, for an image of this size.
    pub fn new(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            horizontal: vec![0; width * (height + 1)],
            vertical: vec![0; (width + 1) * height],
            half_horizontal: vec![0; width * height],
            half_vertical: vec![0; width * height],
        }
    }

    /// Forgets every crossing.
    pub fn clear(&mut self) {
        self.horizontal.fill(0);
        self.vertical.fill(0);
        self.half_horizontal.fill(0);
        self.half_vertical.fill(0);
    }

    /// Masks on the top, right, bottom and left boundary of a pixel, bits along +x or +y.
    #[inline]
    pub fn around(&self, x: usize, y: usize) -> [u8; 4] {
        [
            self.horizontal[y * self.width + x],
            self.vertical[y * (self.width + 1) + x + 1],
            self.horizontal[(y + 1) * self.width + x],
            self.vertical[y * (self.width + 1) + x],
        ]
    }
}
