//! Values from bytes: an input read as decisions.

/// The rest of an input. Past its end all is zero.
pub(super) struct Source<'a> {
    bytes: &'a [u8],
}

/// Numbers that break things, and some that do not.
const NUMBERS: [f32; 24] = [
    0.0,
    -0.0,
    0.25,
    0.5,
    0.999_999_94,
    1.0,
    1.01,
    2.0,
    45.0,
    -1.0,
    -1e-30,
    1e-30,
    f32::MIN_POSITIVE,
    1e-6,
    179.9,
    180.0,
    1e9,
    1.1e9,
    1e30,
    f32::MAX,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::NAN,
    -1e30,
];

impl<'a> Source<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    pub(super) fn rest(&mut self) -> &'a [u8] {
        std::mem::take(&mut self.bytes)
    }

    pub(super) fn byte(&mut self) -> u8 {
        match self.bytes.split_first() {
            Some((first, rest)) => {
                self.bytes = rest;
                *first
            }
            None => 0,
        }
    }

    /// So many of the next bytes, or fewer at the end.
    pub(super) fn take(&mut self, count: usize) -> &'a [u8] {
        let (taken, rest) = self.bytes.split_at(count.min(self.bytes.len()));
        self.bytes = rest;
        taken
    }

    pub(super) fn chance(&mut self, of: u8) -> bool {
        self.byte() % of == of - 1
    }

    pub(super) fn below(&mut self, count: usize) -> usize {
        self.byte() as usize % count.max(1)
    }

    pub(super) fn u64(&mut self) -> u64 {
        let mut all = [0; 8];
        let taken = self.take(8);
        all[..taken.len()].copy_from_slice(taken);
        u64::from_le_bytes(all)
    }

    pub(super) fn number(&mut self) -> f32 {
        match self.byte() as usize {
            byte if byte < 8 * NUMBERS.len() => NUMBERS[byte % NUMBERS.len()],
            _ => f32::from_bits(self.u64() as u32),
        }
    }

    pub(super) fn numbers<const N: usize>(&mut self) -> [f32; N] {
        std::array::from_fn(|_| self.number())
    }

    /// Mostly a number close above `near`, now and then any.
    pub(super) fn close_to(&mut self, near: u32) -> u32 {
        match self.byte() {
            byte @ 0..=127 => near.wrapping_add(u32::from(byte % 2)),
            byte @ 128..=239 => near.wrapping_add(u32::from(byte % 8)).wrapping_sub(4),
            _ => self.u64() as u32,
        }
    }
}
