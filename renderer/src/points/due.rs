//! Points that an edit may have made invalid, until new samples take their places.

/// Samples that may come to a due point's pixel without meeting its surface; then it goes.
const TRIES: u8 = 3;

/// Says of each slot of the point cache whether its point is due for renewal.
#[derive(Clone, Debug, Default)]
pub struct Due {
    tries: Vec<u8>,
    count: usize,
}

impl Due {
    /// None of so many slots is due.
    pub fn new(capacity: usize) -> Self {
        Self {
            tries: vec![0; capacity],
            count: 0,
        }
    }

    /// Points that are due.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Whether a point is due.
    #[inline]
    pub fn is_due(&self, slot: u32) -> bool {
        self.tries.get(slot as usize).is_some_and(|&t| t > 0)
    }

    /// The point in this slot is due.
    pub fn set(&mut self, slot: u32) {
        let tries = &mut self.tries[slot as usize];
        self.count += usize::from(*tries == 0);
        *tries = TRIES;
    }

    /// The slot holds another point, or none.
    pub fn clear(&mut self, slot: u32) {
        let tries = &mut self.tries[slot as usize];
        self.count -= usize::from(*tries != 0);
        *tries = 0;
    }

    /// A sample came to the pixel of a point, but not to its surface. True if the point was due and has been given all its
    /// tries: it is due no more, and should go.
    pub fn missed(&mut self, slot: u32) -> bool {
        match self.tries[slot as usize] {
            0 => false,
            1 => {
                self.clear(slot);
                true
            }
            n => {
                self.tries[slot as usize] = n - 1;
                false
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_that_is_never_met_goes_and_counts_are_right() {
        let mut due = Due::new(4);
        due.set(1);
        due.set(1);
        due.set(3);
        assert_eq!(
            (due.count(), due.is_due(1), due.is_due(0)),
            (2, true, false)
        );
        assert!(!due.missed(0) && !due.missed(1) && !due.missed(1));
        assert!(due.missed(1) && !due.is_due(1) && !due.missed(1));
        due.clear(3);
        due.clear(3);
        assert_eq!((due.count(), due.is_due(9)), (0, false));
    }
}
