//! Inputs changed at random.

/// Numbers that counts and lengths are replaced by.
const COUNTS: [u64; 12] = [
    0,
    1,
    2,
    255,
    256,
    65_535,
    65_536,
    (2 << 20) - 4,
    2 << 20,
    u32::MAX as u64,
    1 << 60,
    u64::MAX,
];
/// Longest input made, unless a seed is longer.
const LONGEST: usize = 4096;

/// Makes input after input out of seeds and of what it made before.
pub(crate) struct Mutator<'a> {
    state: u64,
    seeds: &'a [Vec<u8>],
    input: Vec<u8>,
}

impl<'a> Mutator<'a> {
    pub(crate) fn new(seed: u64, seeds: &'a [Vec<u8>]) -> Self {
        Self {
            state: seed,
            seeds,
            input: Vec::new(),
        }
    }

    /// SplitMix64.
    fn random(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, count: usize) -> usize {
        (self.random() % count.max(1) as u64) as usize
    }

    pub(crate) fn next(&mut self) -> &[u8] {
        match self.below(8) {
            0 => {
                let length = self.below(300);
                self.input = (0..length).map(|_| self.random() as u8).collect();
            }
            1 => {} // What was made last is changed on.
            _ => {
                let place = self.below(self.seeds.len());
                self.input.clear();
                self.input.extend_from_slice(&self.seeds[place]);
            }
        }
        for _ in 0..=self.below(4) {
            self.change();
        }
        let longest = self.seeds.iter().map(Vec::len).max().unwrap_or(0);
        self.input.truncate(longest.max(LONGEST));
        &self.input
    }

    fn change(&mut self) {
        let length = self.input.len();
        let place = self.below(length + 1);
        match self.below(8) {
            0 | 1 if place < length => self.input[place] = self.random() as u8,
            2 if place < length => self.input[place] ^= 1 << self.below(8),
            3 => self.input.truncate(place),
            4 => {
                let count = COUNTS[self.below(COUNTS.len())].to_le_bytes();
                let width = [1, 2, 4, 8][self.below(4)].min(length - place);
                self.input[place..place + width].copy_from_slice(&count[..width]);
            }
            5 => {
                let end = place + self.below((length - place).min(64) + 1);
                let copy = self.input[place..end].to_vec();
                let at = self.below(length + 1);
                self.input.splice(at..at, copy);
            }
            6 => {
                let other = self.below(self.seeds.len());
                let from = self.below(self.seeds[other].len() + 1);
                self.input.truncate(place);
                self.input.extend_from_slice(&self.seeds[other][from..]);
            }
            _ => {
                let extra: Vec<u8> = (0..=self.below(8)).map(|_| self.random() as u8).collect();
                self.input.splice(place..place, extra);
            }
        }
    }
}
