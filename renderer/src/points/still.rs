//! What a camera that does not move has gathered: means of the raw samples of every pixel and of each of its regions.
//!
//! Averaging raw samples converges to the true pixel; averaging reconstructed frames would keep the filter's bias.

use crate::epi::grid::Grid;

/// A sample's region in a simple pixel: 0 outer (with the top-left corner), 1 inner.
pub type Region = usize;

/// Colour of a raw sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Colours {
    /// Linear radiance as it came.
    pub rgb: [f32; 3],
    /// The same under its map's mean (see [`crate::maps`]); as it came where there is no map.
    pub flat: [f32; 3],
}

impl From<[f32; 3]> for Colours {
    fn from(rgb: [f32; 3]) -> Self {
        Self { rgb, flat: rgb }
    }
}

/// Mean of a set of raw samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mean {
    /// How many.
    pub count: f32,
    /// Their mean linear radiance.
    pub rgb: [f32; 3],
    /// The mean of their colours under the mean of their maps.
    pub flat: [f32; 3],
    /// Their mean place in the pixel, [0, 1).
    pub place: [f32; 2],
    /// Sum of squared deviations of display-encoded luminance from its mean.
    spread: f32,
    luma: f32,
}

impl Mean {
    /// Takes one more sample in.
    pub fn add(&mut self, colours: impl Into<Colours>, place: [f32; 2]) {
        let Colours { rgb, flat } = colours.into();
        self.count += 1.0;
        let share = 1.0 / self.count;
        for (mean, value) in self.rgb.iter_mut().zip(rgb) {
            *mean += (value - *mean) * share;
        }
        for (mean, value) in self.flat.iter_mut().zip(flat) {
            *mean += (value - *mean) * share;
        }
        for (mean, value) in self.place.iter_mut().zip(place) {
            *mean += (value - *mean) * share;
        }
        let luma = encoded_luma(rgb);
        let before = luma - self.luma;
        self.luma += before * share;
        self.spread += before * (luma - self.luma);
    }

    /// Estimated standard error of the mean, in display-encoded luminance; infinite below two samples.
    pub fn standard_error(&self) -> f32 {
        if self.count < 2.0 {
            return f32::INFINITY;
        }
        (self.spread.max(0.0) / (self.count * (self.count - 1.0))).sqrt()
    }
}

/// Standard error of a settled mean, display-encoded luminance: half of one step of 255.
const SETTLED_ERROR: f32 = 0.5 / 255.0;

/// Samples that a mean has at least before it can be settled: fewer may agree by chance.
const SETTLED_FROM: f32 = 4.0;

/// Samples at which a mean is settled whatever its error.
const SETTLED_AT: f32 = 256.0;

impl Mean {
    /// Whether more samples would not change what a display shows of it.
    pub fn is_settled(&self) -> bool {
        self.count >= SETTLED_AT
            || (self.count >= SETTLED_FROM && self.standard_error() <= SETTLED_ERROR)
    }
}

/// Luminance as a display shows it, about: square root of the clamped linear luminance (Rec. 709 weights).
pub fn encoded_luma(rgb: [f32; 3]) -> f32 {
    (0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2])
        .clamp(0.0, 1.0)
        .sqrt()
}

/// Means of both regions of a simple pixel, for the edge code that split it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Split {
    /// Edge code that the regions belong to.
    pub code: u16,
    /// Outer and inner region.
    pub regions: [Mean; 2],
}

const NO_SPLIT: u32 = u32::MAX;

/// Samples gathered while the view and the scene stay the same.
#[derive(Clone, Debug)]
pub struct Still {
    grid: Grid,
    whole: Vec<Mean>,
    split_of: Vec<u32>,
    splits: Vec<Split>,
    touched: Vec<u32>,
    changed: Vec<u32>,
    marked: Vec<u64>,
    /// Pixels of which there is nothing but a provisional sample.
    provisional: Vec<u64>,
    samples: u64,
}

impl Still {
    /// Nothing gathered.
    pub fn new(grid: Grid) -> Self {
        let pixels = grid.width * grid.height;
        Self {
            grid,
            whole: vec![Mean::default(); pixels],
            split_of: vec![NO_SPLIT; pixels],
            splits: Vec::new(),
            touched: Vec::new(),
            changed: Vec::new(),
            marked: vec![0; grid.plane_words()],
            provisional: vec![0; grid.plane_words()],
            samples: 0,
        }
    }

    /// Forgets everything, since the view or the scene changed; costs in proportion to what was gathered.
    pub fn clear(&mut self) {
        self.forget_changed();
        for pixel in self.touched.drain(..) {
            self.whole[pixel as usize] = Mean::default();
            self.split_of[pixel as usize] = NO_SPLIT;
        }
        self.splits.clear();
        self.provisional.fill(0);
        self.samples = 0;
    }

    /// Samples taken in since the last [`Still::clear`].
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Takes a provisional sample in, if there is nothing better: it stands for its pixel alone and until the first that is
    /// for good.
    pub fn add_provisional(
        &mut self,
        (x, y): (usize, usize),
        place: [f32; 2],
        colours: impl Into<Colours>,
    ) {
        let (word, bit) = self.grid.bit(x, y);
        let is_first = self.whole(x, y).count == 0.0;
        if !is_first && self.provisional[word] >> bit & 1 == 0 {
            return;
        }
        self.add((x, y), place, colours, None);
        self.provisional[word] |= 1 << bit;
    }

    /// Takes a sample in. `side` is its region and the pixel's edge code where the pixel is simple and the region certain.
    pub fn add(
        &mut self,
        (x, y): (usize, usize),
        place: [f32; 2],
        colours: impl Into<Colours>,
        side: Option<(u16, Region)>,
    ) {
        let colours = colours.into();
        let pixel = y * self.grid.width + x;
        self.samples += 1;
        let (word, bit) = self.grid.bit(x, y);
        if self.whole[pixel].count == 0.0 {
            self.touched.push(pixel as u32);
        } else if self.provisional[word] >> bit & 1 == 1 {
            self.whole[pixel] = Mean::default();
            self.provisional[word] &= !(1 << bit);
        }
        self.whole[pixel].add(colours, place);
        if let Some((code, region)) = side {
            let slot = &mut self.split_of[pixel];
            if *slot == NO_SPLIT {
                *slot = self.splits.len() as u32;
                self.splits.push(Split {
                    code,
                    ..Split::default()
                });
            }
            let split = &mut self.splits[*slot as usize];
            if split.code != code {
                *split = Split {
                    code,
                    ..Split::default()
                };
            }
            split.regions[region].add(colours, place);
        }
        if self.marked[word] >> bit & 1 == 0 {
            self.marked[word] |= 1 << bit;
            self.changed.push(pixel as u32);
        }
    }

    /// Mean of all samples of a pixel.
    pub fn whole(&self, x: usize, y: usize) -> &Mean {
        &self.whole[y * self.grid.width + x]
    }

    /// Means of the regions of a simple pixel with this edge code, if any of its samples is known to lie in one.
    pub fn split(&self, x: usize, y: usize, code: u16) -> Option<&Split> {
        let slot = self.split_of[y * self.grid.width + x];
        self.splits.get(slot as usize).filter(|s| s.code == code)
    }

    /// Pixels (row · width + column) that have samples, each once.
    pub fn touched(&self) -> &[u32] {
        &self.touched
    }

    /// Pixels (row · width + column) that took samples in since [`Still::forget_changed`], each once.
    pub fn changed(&self) -> &[u32] {
        &self.changed
    }

    /// Puts every pixel that has samples on the list of changed ones.
    pub fn change_all(&mut self) {
        self.forget_changed();
        for &pixel in &self.touched {
            let (x, y) = (
                pixel as usize % self.grid.width,
                pixel as usize / self.grid.width,
            );
            let (word, bit) = self.grid.bit(x, y);
            self.marked[word] |= 1 << bit;
            self.changed.push(pixel);
        }
    }

    /// Starts a new list of changed pixels.
    pub fn forget_changed(&mut self) {
        for &pixel in &self.changed {
            let (word, bit) = self.grid.bit(
                pixel as usize % self.grid.width,
                pixel as usize / self.grid.width,
            );
            self.marked[word] &= !(1 << bit);
        }
        self.changed.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_those_of_the_samples() {
        let mut still = Still::new(Grid::new(70, 3));
        let values = [0.25f32, 0.5, 1.0, 0.0];
        for (i, v) in values.into_iter().enumerate() {
            let region = i % 2;
            still.add(
                (69, 2),
                [0.25 * i as f32, 0.5],
                [v, v, v],
                Some((77, region)),
            );
        }
        let mean = still.whole(69, 2);
        assert!(mean.count == 4.0 && mean.rgb.iter().all(|c| (c - 0.4375).abs() < 1e-6));
        assert_eq!(mean.place, [0.375, 0.5]);
        let luma = values.map(f32::sqrt);
        let m = luma.iter().sum::<f32>() / 4.0;
        let variance = luma.iter().map(|l| (l - m).powi(2)).sum::<f32>() / 3.0;
        assert!((mean.standard_error() - (variance / 4.0).sqrt()).abs() < 1e-6);
        let split = still.split(69, 2, 77).unwrap();
        assert_eq!(split.regions[0].rgb, [0.625; 3]);
        assert_eq!(split.regions[1].rgb, [0.25; 3]);
        assert!(still.split(69, 2, 78).is_none() && still.split(0, 0, 77).is_none());
    }

    #[test]
    fn means_settle_when_samples_agree_or_are_many() {
        let (mut even, mut uneven) = (Mean::default(), Mean::default());
        for i in 0..256 {
            even.add([0.5; 3], [0.5; 2]);
            uneven.add([(i % 2) as f32; 3], [0.5; 2]);
            assert_eq!(even.is_settled(), i >= 3);
            assert_eq!(uneven.is_settled(), i >= 255);
        }
    }

    #[test]
    fn provisional_samples_give_way() {
        let mut still = Still::new(Grid::new(4, 4));
        for value in [9.0, 8.0] {
            still.add_provisional((1, 1), [0.5; 2], [value; 3]);
            assert_eq!(
                (still.whole(1, 1).count, still.whole(1, 1).rgb),
                (1.0, [value; 3])
            );
        }
        for value in [0.25, 0.75] {
            still.add((1, 1), [0.5; 2], [value; 3], None);
            still.add_provisional((1, 1), [0.5; 2], [7.0; 3]);
        }
        assert_eq!(
            (still.whole(1, 1).count, still.whole(1, 1).rgb),
            (2.0, [0.5; 3])
        );
        assert_eq!(still.touched(), [5]);
    }

    #[test]
    fn another_edge_forgets_the_regions_but_not_the_pixel() {
        let mut still = Still::new(Grid::new(4, 4));
        still.add((1, 1), [0.5; 2], [1.0; 3], Some((5, 0)));
        still.add((1, 1), [0.5; 2], [0.0; 3], Some((9, 1)));
        assert_eq!(still.whole(1, 1).count, 2.0);
        let split = still.split(1, 1, 9).unwrap();
        assert_eq!((split.regions[0].count, split.regions[1].count), (0.0, 1.0));
        assert_eq!(still.changed(), [5]);
        still.forget_changed();
        assert!(still.changed().is_empty());
        still.clear();
        assert_eq!((still.samples(), still.whole(1, 1).count), (0, 0.0));
    }
}
