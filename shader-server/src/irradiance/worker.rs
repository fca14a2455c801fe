//! Records computed in the background.

use std::sync::{PoisonError, atomic::Ordering};

use super::{IrradianceCache, Slot, lattice::Place};
use crate::stage::Stage;

/// Records that may wait to be computed; more are asked for again when they are missed again.
const MOST_WAITING: usize = 1 << 16;

impl IrradianceCache {
    /// Has the record of a place computed, once.
    pub(super) fn want(&self, place: Place, slot: &Slot) {
        if slot.is_wanted.swap(true, Ordering::Relaxed) {
            return;
        }
        let mut wanted = self.wanted.lock().unwrap_or_else(PoisonError::into_inner);
        if wanted.len() < MOST_WAITING {
            wanted.push_back(place);
        } else {
            slot.is_wanted.store(false, Ordering::Relaxed);
        }
    }

    /// Records that wait to be computed.
    #[must_use]
    pub fn waiting(&self) -> usize {
        let wanted = self.wanted.lock().unwrap_or_else(PoisonError::into_inner);
        wanted.len()
    }

    /// Computes the record that has waited longest. Says whether there was one.
    pub fn work(&self, stage: &Stage) -> bool {
        let mut wanted = self.wanted.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(place) = wanted.pop_front() else {
            return false;
        };
        drop(wanted);
        let slot = self.records.value(place, Slot::default);
        if let Some(site) = self.site(stage, place) {
            self.fresh(stage, place, &site.receiver, &slot);
        }
        true
    }
}
