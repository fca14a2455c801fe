//! The depth that culls edges in the paper's way (section 4.5): from reprojected points, made conservative.

/// Depth along the line of sight by pixel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DepthBuffer {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Metres, row by row from the top; `f32::INFINITY` where no point is known.
    pub depth: Vec<f32>,
}

/// What is added to the greatest depth, as shares of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthOffset {
    /// Where every pixel around has a point.
    pub dense: f32,
    /// More, times the share of pixels around that have none.
    pub sparse: f32,
}

impl Default for DepthOffset {
    fn default() -> Self {
        Self {
            dense: 0.005,
            sparse: 0.03,
        }
    }
}

/// Pixels before and after the one in question that its 4x4 neighbourhood has in each direction.
const BEFORE: usize = 2;
const AFTER: usize = 1;

/// A depth behind which an edge is taken to be hidden, by pixel.
#[derive(Clone, Debug, Default)]
pub struct FilteredDepth {
    width: usize,
    height: usize,
    depth: Vec<f32>,
    rows: Vec<(f32, u8)>,
}

impl FilteredDepth {
    /// Takes the greatest known depth in 4x4 pixels and adds an offset that grows with the number of unknown ones.
    /// Allocates only when the size grows.
    pub fn filter(&mut self, buffer: &DepthBuffer, offset: DepthOffset) {
        let (width, height) = (buffer.width, buffer.height);
        (self.width, self.height) = (width, height);
        self.depth.clear();
        self.depth.resize(width * height, f32::INFINITY);
        self.rows.clear();
        self.rows.resize(width * height, (f32::NEG_INFINITY, 0));
        for y in 0..height {
            let source = &buffer.depth[y * width..(y + 1) * width];
            for (x, row) in self.rows[y * width..(y + 1) * width].iter_mut().enumerate() {
                for depth in &source[x.saturating_sub(BEFORE)..(x + AFTER + 1).min(width)] {
                    if depth.is_finite() {
                        *row = (row.0.max(*depth), row.1 + 1);
                    }
                }
            }
        }
        for y in 0..height {
            let (first, last) = (y.saturating_sub(BEFORE), (y + AFTER).min(height - 1));
            for x in 0..width {
                let (mut most, mut known) = (f32::NEG_INFINITY, 0);
                for row in first..=last {
                    let (m, k) = self.rows[row * width + x];
                    most = most.max(m);
                    known += k;
                }
                if known > 0 {
                    let missing = 1.0 - f32::from(known) / 16.0;
                    self.depth[y * width + x] =
                        most * (1.0 + offset.dense + offset.sparse * missing);
                }
            }
        }
    }

    /// Whether something at this depth (m) can be seen in the pixel, as far as is known. True outside of the picture.
    #[inline]
    pub fn sees(&self, x: i64, y: i64, depth: f32) -> bool {
        if x < 0 || y < 0 || x >= self.width as i64 || y >= self.height as i64 {
            return true;
        }
        depth <= self.depth[y as usize * self.width + x as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_filter_is_conservative() {
        let (width, height) = (9, 7);
        let mut depth = vec![f32::INFINITY; width * height];
        for i in (0..depth.len()).step_by(3) {
            depth[i] = 1.0 + (i * 37 % 11) as f32;
        }
        let buffer = DepthBuffer {
            width,
            height,
            depth,
        };
        let mut filtered = FilteredDepth::default();
        let offset = DepthOffset {
            dense: 0.01,
            sparse: 0.5,
        };
        filtered.filter(&buffer, offset);
        for y in 0..height as i64 {
            for x in 0..width as i64 {
                let (mut most, mut known) = (0.0_f32, 0.0);
                for (dx, dy) in (-2..=1).flat_map(|dy| (-2..=1).map(move |dx| (dx, dy))) {
                    if (0..width as i64).contains(&(x + dx))
                        && (0..height as i64).contains(&(y + dy))
                    {
                        let d = buffer.depth[(y + dy) as usize * width + (x + dx) as usize];
                        if d.is_finite() {
                            most = most.max(d);
                            known += 1.0;
                        }
                    }
                }
                let limit = most * (1.0 + 0.01 + 0.5 * (1.0 - known / 16.0));
                assert!(filtered.sees(x, y, limit * 0.9999), "{x}, {y}");
                assert!(
                    known > 0.0 && !filtered.sees(x, y, limit * 1.0001),
                    "{x}, {y}"
                );
            }
        }
    }
}
