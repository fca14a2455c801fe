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

/// Stands for an unknown depth; depths are positive.
const UNKNOWN: f32 = 0.0;

/// A depth behind which an edge is taken to be hidden, by pixel.
#[derive(Clone, Debug, Default)]
pub struct FilteredDepth {
    width: usize,
    height: usize,
    depth: Vec<f32>,
    /// Greatest known depth in four columns, row by row, with a margin.
    most: Vec<f32>,
    /// How many of the four are known.
    known: Vec<f32>,
    padded: Vec<f32>,
}

impl FilteredDepth {
    /// Takes the greatest known depth in 4x4 pixels and adds an offset that grows with the number of unknown ones.
    /// Allocates only when the size grows.
    pub fn filter(&mut self, buffer: &DepthBuffer, offset: DepthOffset) {
        let (width, height) = (buffer.width, buffer.height);
        let margin = BEFORE + AFTER;
        (self.width, self.height) = (width, height);
        self.depth.clear();
        self.depth.resize(width * height, f32::INFINITY);
        self.padded.clear();
        self.padded.resize(width + margin, UNKNOWN);
        for table in [&mut self.most, &mut self.known] {
            table.clear();
            table.resize(width * (height + margin), 0.0);
        }
        for y in 0..height {
            let source = &buffer.depth[y * width..(y + 1) * width];
            for (to, from) in self.padded[BEFORE..].iter_mut().zip(source) {
                *to = if from.is_finite() { *from } else { UNKNOWN };
            }
            let row = (y + BEFORE) * width..(y + BEFORE + 1) * width;
            let (most, known) = (&mut self.most[row.clone()], &mut self.known[row]);
            for x in 0..width {
                let four: &[f32] = &self.padded[x..x + margin + 1];
                most[x] = four.iter().fold(UNKNOWN, |m, d| m.max(*d));
                known[x] = four.iter().map(|d| f32::from(u8::from(*d > UNKNOWN))).sum();
            }
        }
        for y in 0..height {
            let row = |k: usize| (y + k) * width..(y + k + 1) * width;
            let out = &mut self.depth[y * width..(y + 1) * width];
            let most: [&[f32]; 4] = std::array::from_fn(|k| &self.most[row(k)]);
            let known: [&[f32]; 4] = std::array::from_fn(|k| &self.known[row(k)]);
            for x in 0..width {
                let m = most[0][x].max(most[1][x]).max(most[2][x]).max(most[3][x]);
                let k = known[0][x] + known[1][x] + known[2][x] + known[3][x];
                let limit = m * (1.0 + offset.dense + offset.sparse * (1.0 - k / 16.0));
                out[x] = if k > 0.0 { limit } else { f32::INFINITY };
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
