//! Where in its pixel a sample goes.

/// A number that looks random, uniform over all 64 bits: splitmix64's finaliser over seed and key.
#[inline]
pub fn hash(seed: u64, key: u64) -> u64 {
    let mut z = seed.wrapping_add(key.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}

/// The same, in [0, 1).
#[inline]
pub fn hash_unit(seed: u64, key: u64) -> f32 {
    (hash(seed, key) >> 40) as f32 / (1u64 << 24) as f32
}

/// What is known of a pixel when a place in it is chosen.
#[derive(Clone, Copy, Debug)]
pub struct PixelState {
    /// Column.
    pub x: usize,
    /// Row.
    pub y: usize,
    /// Samples that the pixel has had since the view last changed.
    pub count: u32,
    /// Where the region lies that has the greatest need of a sample, for a simple pixel.
    pub region_centre: Option<[f32; 2]>,
}

/// Side of the square around the middle in which the first sample of a pixel falls, pixels.
const FIRST_JITTER: f32 = 0.4;

/// Side of the square around a region's middle, pixels: small, so that the sample is surely in the region.
const REGION_JITTER: f32 = 0.15;

/// Samples after which places no longer favour a region but cover the pixel evenly.
const REGION_SAMPLES: u32 = 2;

/// Place of the next sample, each coordinate in [0, 1).
///
/// The first goes near the middle, where interpolation wants its value; later ones follow the R2 sequence (Roberts 2018:
/// steps of 1/g and 1/g², g³ = g + 1), shifted by a random amount a pixel, so that their mean becomes the pixel's.
pub fn place(seed: u64, pixel: PixelState) -> [f32; 2] {
    let key = (pixel.y as u64) << 20 | pixel.x as u64;
    let jitter =
        |salt: u64| hash_unit(seed ^ salt, key << 8 | u64::from(pixel.count.min(255))) - 0.5;
    let near = |middle: [f32; 2], side: f32| {
        [middle[0] + jitter(1) * side, middle[1] + jitter(2) * side]
            .map(|v| v.clamp(0.0, 1.0 - f32::EPSILON))
    };
    match pixel.region_centre {
        Some(centre) if pixel.count < REGION_SAMPLES => return near(centre, REGION_JITTER),
        None if pixel.count == 0 => return near([0.5, 0.5], FIRST_JITTER),
        _ => {}
    }
    const G: f64 = 1.324_717_957_244_746;
    let step = |power: i32, salt: u64| {
        let start = f64::from(hash_unit(seed ^ salt, key));
        let v = (start + f64::from(pixel.count) * G.powi(-power)).fract() as f32;
        v.min(1.0 - f32::EPSILON)
    };
    [step(1, 3), step(2, 4)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn later_places_cover_the_pixel_evenly() {
        for y in 0..20 {
            let mut mean = [0.0f32; 2];
            let mut cells = [0; 16];
            for count in 2..66 {
                let p = place(
                    7,
                    PixelState {
                        x: 3,
                        y,
                        count,
                        region_centre: None,
                    },
                );
                assert!(p.iter().all(|v| (0.0..1.0).contains(v)));
                mean = [mean[0] + p[0] / 64.0, mean[1] + p[1] / 64.0];
                cells[(p[1] * 4.0) as usize * 4 + (p[0] * 4.0) as usize] += 1;
            }
            assert!(mean.iter().all(|m| (m - 0.5).abs() < 0.03), "{mean:?}");
            assert!(cells.iter().all(|&c| (2..=6).contains(&c)), "{cells:?}");
        }
    }

    #[test]
    fn first_places_are_near_the_middle_of_what_they_stand_for() {
        for x in 0..50 {
            let p = place(
                1,
                PixelState {
                    x,
                    y: 2,
                    count: 0,
                    region_centre: None,
                },
            );
            assert!(p.iter().all(|v| (v - 0.5).abs() <= FIRST_JITTER / 2.0));
            let r = place(
                1,
                PixelState {
                    x,
                    y: 2,
                    count: 1,
                    region_centre: Some([0.95, 0.1]),
                },
            );
            assert!((r[0] - 0.95).abs() <= 0.08 && (r[1] - 0.1).abs() <= 0.08 && r[0] < 1.0);
        }
    }
}
