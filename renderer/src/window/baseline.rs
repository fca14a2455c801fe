//! Every pixel ray-traced and nothing reconstructed: what the display is better than. Pixels are renewed in a scattered
//! order as fast as the servers go, so that a moving picture falls apart as in frameless rendering.

use std::collections::VecDeque;

use protocol::messages::SampleRequest;

use crate::epi::grid::Grid;
use crate::frame::Received;

/// The picture and what is still on its way into it.
#[derive(Clone, Debug)]
pub(super) struct Baseline {
    grid: Grid,
    rgb: [Vec<f32>; 3],
    step: usize,
    position: usize,
    left: usize,
    traced: usize,
    asked: VecDeque<(u64, u32)>,
}

impl Baseline {
    /// A black picture.
    pub(super) fn new(grid: Grid) -> Self {
        let pixels = grid.width * grid.height;
        Self {
            grid,
            rgb: std::array::from_fn(|_| vec![0.0; grid.elements()]),
            step: scattering_step(pixels),
            position: 0,
            left: pixels,
            traced: 0,
            asked: VecDeque::new(),
        }
    }

    /// The camera moved: every pixel is due again.
    pub(super) fn renew(&mut self) {
        self.left = self.grid.width * self.grid.height;
        self.traced = 0;
    }

    /// Asks for the middles of the next pixels, at most `budget`.
    pub(super) fn plan(
        &mut self,
        budget: usize,
        mut next_id: impl FnMut() -> u64,
        wanted: &mut Vec<SampleRequest>,
    ) {
        let pixels = self.grid.width * self.grid.height;
        let count = budget.min(self.left);
        for _ in 0..count {
            self.position = (self.position + self.step) % pixels;
            let id = next_id();
            wanted.push(SampleRequest {
                id,
                x: (self.position % self.grid.width) as u16,
                y: (self.position / self.grid.width) as u16,
                offset: [0.5, 0.5],
            });
            self.asked.push_back((id, self.position as u32));
        }
        self.left -= count;
        let excess = self.asked.len().saturating_sub(4 * pixels);
        self.asked.drain(..excess);
    }

    /// Puts samples that were asked for here into their pixels.
    pub(super) fn take(&mut self, received: &[Received]) {
        for r in received {
            let Ok(i) = self.asked.binary_search_by_key(&r.sample.id, |a| a.0) else {
                continue;
            };
            let pixel = self.asked[i].1 as usize;
            let at = self
                .grid
                .at(pixel % self.grid.width, pixel / self.grid.width);
            for (plane, value) in self.rgb.iter_mut().zip(r.sample.radiance) {
                plane[at] = value;
            }
            self.traced += 1;
        }
    }

    /// Linear radiance, planes by the grid.
    pub(super) fn image(&self) -> &[Vec<f32>; 3] {
        &self.rgb
    }

    /// Samples taken since the camera stands, at most one a pixel.
    pub(super) fn traced(&self) -> usize {
        self.traced.min(self.grid.width * self.grid.height)
    }

    /// Whether every pixel of a camera that stands has been asked for.
    pub(super) fn is_done(&self) -> bool {
        self.left == 0
    }
}

/// A step that visits all of `n` pixels and scatters them: near the golden section of n, and with no factor in common.
fn scattering_step(n: usize) -> usize {
    let gcd = |mut a: usize, mut b: usize| {
        while b != 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let start = (n as f64 * 0.618_033_988_75) as usize;
    (start.max(1)..).find(|&s| gcd(s, n) == 1).unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use protocol::messages::Sample;

    use super::*;

    #[test]
    fn every_pixel_is_asked_for_once_and_gets_its_own_sample() {
        for (width, height) in [(1, 1), (2, 1), (13, 8), (64, 48)] {
            let grid = Grid::new(width, height);
            let mut baseline = Baseline::new(grid);
            let (mut id, mut wanted) = (10, Vec::new());
            while !baseline.is_done() {
                let mut next = || {
                    id += 3;
                    id
                };
                baseline.plan(100, &mut next, &mut wanted);
            }
            assert_eq!(wanted.len(), width * height);
            let received = wanted.iter().rev().map(|w| Received {
                view: 1,
                epoch: 0,
                sample: Sample {
                    id: w.id,
                    position: [0.0; 3],
                    object: 0,
                    radiance: [w.x.into(), w.y.into(), 1.0],
                    flags: 0,
                },
                texel: None,
            });
            baseline.take(&received.collect::<Vec<_>>());
            assert_eq!(baseline.traced(), width * height);
            for y in 0..height {
                for x in 0..width {
                    let at = grid.at(x, y);
                    let rgb = baseline.image().each_ref().map(|plane| plane[at]);
                    assert_eq!(rgb, [x as f32, y as f32, 1.0]);
                }
            }
            baseline.renew();
            assert!(!baseline.is_done());
        }
    }
}
