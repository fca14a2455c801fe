//! The last word of a still camera: raw samples' means take over from reconstruction as they become many.

use crate::epi::Epi;
use crate::epi::code::EdgeCode;
use crate::points::Still;

/// Samples of a pixel at which its plain mean is trusted as much as its regions weighted by the edge's area, which is
/// known to an eighth of a pixel only (error of the area 0.015 on average: the plain mean of 64 samples spread evenly
/// does as well).
const PLAIN_FROM: f32 = 64.0;

/// Blends, in every pixel that has samples of its own, the reconstructed colour with their mean: `n − 1` parts of the
/// mean in `n`, so that one sample alone changes nothing and many decide.
pub fn settle(still: &Still, epi: &Epi, image: &mut [Vec<f32>; 3]) {
    let grid = epi.grid;
    for &pixel in still.touched() {
        let (x, y) = (pixel as usize % grid.width, pixel as usize / grid.width);
        let whole = still.whole(x, y);
        let at = grid.at(x, y);
        let code = EdgeCode(epi.code[at]);
        let mut mean = whole.rgb;
        let mut trust = 1.0 - 1.0 / whole.count;
        if code.is_simple() {
            let Some(split) = still.split(x, y, code.0) else {
                continue;
            };
            let [outer, inner] = &split.regions;
            let fewer = outer.count.min(inner.count);
            let area = epi.tables().inner_area(code);
            let plain = if fewer > 0.0 {
                let ratio = whole.count / PLAIN_FROM;
                ratio * ratio / (1.0 + ratio * ratio)
            } else {
                0.0
            };
            for (k, value) in mean.iter_mut().enumerate() {
                let by_area = outer.rgb[k] * (1.0 - area) + inner.rgb[k] * area;
                *value = by_area + (*value - by_area) * plain;
            }
            trust = fewer / (fewer + 1.0);
        }
        if trust > 0.0 {
            for (plane, value) in image.iter_mut().zip(mean) {
                plane[at] += (value - plane[at]) * trust;
            }
        }
    }
}
