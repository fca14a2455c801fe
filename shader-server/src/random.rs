//! Random numbers that depend on what is computed, never on who computes it or when.

use glam::Vec2;

/// A stream of numbers that is a function of its key alone (SplitMix64).
///
/// Every light of every sample has its own stream, keyed by the session's seed, the request's id and the light's
/// index: neither the number of threads nor the number of servers changes a sample.
#[derive(Clone, Debug)]
pub struct Stream {
    state: u64,
}

const STEP: u64 = 0x9E37_79B9_7F4A_7C15;

fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

impl Stream {
    /// The stream of one request.
    #[must_use]
    pub fn new(seed: u64, request: u64) -> Self {
        Self {
            state: mix(mix(seed.wrapping_add(STEP)) ^ request.wrapping_mul(STEP)),
        }
    }

    /// A stream of its own for part `index` of the same request.
    #[must_use]
    pub fn part(&self, index: u64) -> Self {
        Self {
            state: mix(self.state ^ mix(index.wrapping_add(STEP))),
        }
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(STEP);
        mix(self.state)
    }

    /// Two independent numbers in [0, 1).
    pub fn square(&mut self) -> Vec2 {
        let bits = self.bits();
        let unit = |b: u64| (b & 0xFF_FFFF) as f32 / 16_777_216.;
        Vec2::new(unit(bits >> 40), unit(bits >> 8))
    }

    /// A number in [0, 1).
    pub fn unit(&mut self) -> f32 {
        self.square().x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_differ_by_key_and_fill_the_square() {
        let mut seen = std::collections::HashSet::new();
        for seed in 0..20 {
            for request in 0..20 {
                for part in 0..3 {
                    seen.insert(Stream::new(seed, request).part(part).bits());
                }
            }
        }
        assert_eq!(seen.len(), 1200);

        let mut stream = Stream::new(1, 2);
        let mut counts = [[0u32; 4]; 4];
        for _ in 0..16_000 {
            let p = stream.square() * 4.;
            counts[p.x as usize][p.y as usize] += 1;
        }
        assert!(
            counts.iter().flatten().all(|c| (850..1150).contains(c)),
            "{counts:?}"
        );
    }
}
