//! Bit masks of receivers, given out when one is needed and taken back when all is dark.

use crate::mesh::NONE;

/// Masks of a fixed number of words.
#[derive(Debug)]
pub(crate) struct Masks {
    words: usize,
    pool: Vec<u32>,
    free: Vec<u32>,
    /// Place of each receiver's mask, or [`NONE`].
    slots: Vec<u32>,
    used: usize,
    peak: usize,
}

impl Masks {
    pub(crate) fn new(receivers: usize, words: usize) -> Self {
        Self {
            words,
            pool: Vec::new(),
            free: Vec::new(),
            slots: vec![NONE; receivers],
            used: 0,
            peak: 0,
        }
    }

    /// The mask of a receiver, which is empty if there was none.
    pub(crate) fn of(&mut self, receiver: u32) -> &mut [u32] {
        if self.slots[receiver as usize] == NONE {
            let slot = self.free.pop().unwrap_or_else(|| {
                self.pool.resize(self.pool.len() + self.words, 0);
                (self.pool.len() / self.words - 1) as u32
            });
            self.slots[receiver as usize] = slot;
            self.used += 1;
            self.peak = self.peak.max(self.used);
            let first = slot as usize * self.words;
            self.pool[first..first + self.words].fill(0);
        }
        let first = self.slots[receiver as usize] as usize * self.words;
        &mut self.pool[first..first + self.words]
    }

    /// The mask of a receiver, if it has one.
    pub(crate) fn existing(&self, receiver: u32) -> Option<&[u32]> {
        let slot = self.slots[receiver as usize];
        let first = (slot != NONE).then_some(slot as usize * self.words)?;
        Some(&self.pool[first..first + self.words])
    }

    pub(crate) fn release(&mut self, receiver: u32) {
        let slot = std::mem::replace(&mut self.slots[receiver as usize], NONE);
        if slot != NONE {
            self.free.push(slot);
            self.used -= 1;
        }
    }

    /// Size of the masks that were in use at once, bytes.
    pub(crate) fn peak_bytes(&self) -> usize {
        self.peak * self.words * 4
    }
}
