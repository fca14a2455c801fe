//! Requests that are given to a second server because the first is slow: the first answer counts.
//!
//! A sample is a function of its request alone, so it makes no difference whose comes first.

use std::collections::{HashMap, VecDeque};

use protocol::messages::SampleRequest;
use protocol::session::Outstanding;
use smallvec::SmallVec;

/// One connection, counted over all servers: a session may not be sent an id twice.
pub(super) type ConnectionId = u64;

#[derive(Debug)]
struct Entry {
    answered: bool,
    /// It waits for another server.
    waits: bool,
    /// Connections that hold it now.
    holders: usize,
    /// Connections that were ever sent it.
    asked: SmallVec<[ConnectionId; 4]>,
}

impl Entry {
    fn is_over(&self) -> bool {
        self.holders == 0 && !self.waits
    }
}

/// What an answer or a loss means for a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Copy {
    /// No other server has anything to do with it: the caller counts it.
    Only,
    /// It is as before: another server holds it still, or answered it.
    Spare,
}

/// The requests that more than one server was or will be asked.
#[derive(Debug, Default)]
pub(super) struct Again {
    entries: HashMap<u64, Entry>,
    waiting: VecDeque<Outstanding>,
}

impl Again {
    pub(super) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    pub(super) fn contains(&self, id: u64) -> bool {
        self.entries.contains_key(&id)
    }

    /// What this connection holds, and nobody else, is wanted of others too.
    pub(super) fn add(&mut self, from: ConnectionId, held: Outstanding) {
        let entry = Entry {
            answered: false,
            waits: true,
            holders: 1,
            asked: SmallVec::from_slice(&[from]),
        };
        if self.entries.insert(held.request.id, entry).is_none() {
            self.waiting.push_back(held);
        }
    }

    /// Moves requests of one view that this connection was never sent to it. Returns their view.
    pub(super) fn take(
        &mut self,
        to: ConnectionId,
        most: usize,
        batch: &mut Vec<SampleRequest>,
    ) -> Option<u32> {
        let mut view = None;
        let entries = &mut self.entries;
        self.waiting.retain(|held| {
            let Some(entry) = entries.get_mut(&held.request.id) else {
                return false;
            };
            let other_view = view.is_some_and(|view| view != held.view);
            if other_view || batch.len() >= most || entry.asked.contains(&to) {
                return true;
            }
            view = Some(held.view);
            batch.push(held.request);
            entry.waits = false;
            entry.holders += 1;
            entry.asked.push(to);
            false
        });
        view
    }

    /// A holder answered. [`Copy::Only`] if it is the first to do so: the answer counts.
    pub(super) fn answered(&mut self, id: u64) -> Copy {
        let Some(entry) = self.entries.get_mut(&id) else {
            return Copy::Only;
        };
        entry.holders = entry.holders.saturating_sub(1);
        let first = !std::mem::replace(&mut entry.answered, true);
        if first && std::mem::replace(&mut entry.waits, false) {
            self.waiting.retain(|held| held.request.id != id);
        }
        self.forget_if_over(id);
        if first { Copy::Only } else { Copy::Spare }
    }

    /// A holder lost it, or dropped it as asked. [`Copy::Only`] if it was the last and nobody answered.
    pub(super) fn released(&mut self, id: u64) -> Copy {
        let Some(entry) = self.entries.get_mut(&id) else {
            return Copy::Only;
        };
        entry.holders = entry.holders.saturating_sub(1);
        let (last, answered) = (entry.holders == 0, entry.answered);
        if last && !answered {
            // Whoever lost it hands it on: it need not wait here too.
            self.waiting.retain(|held| held.request.id != id);
            self.entries.remove(&id);
            return Copy::Only;
        }
        self.forget_if_over(id);
        Copy::Spare
    }

    /// Nothing of views before this one need be asked again.
    pub(super) fn cancel(&mut self, before: u32) {
        let entries = &mut self.entries;
        self.waiting.retain(|held| {
            let kept = held.view >= before;
            if !kept && let Some(entry) = entries.get_mut(&held.request.id) {
                entry.waits = false;
            }
            kept
        });
    }

    fn forget_if_over(&mut self, id: u64) {
        if self.entries.get(&id).is_some_and(Entry::is_over) {
            self.entries.remove(&id);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held(id: u64, view: u32) -> Outstanding {
        let request = SampleRequest {
            id,
            x: 0,
            y: 0,
            offset: [0.5; 2],
        };
        Outstanding { view, request }
    }

    fn take(again: &mut Again, to: ConnectionId, most: usize) -> Vec<u64> {
        let mut batch = Vec::new();
        again.take(to, most, &mut batch);
        batch.iter().map(|request| request.id).collect()
    }

    #[test]
    fn the_first_answer_counts_and_no_session_is_sent_an_id_twice() {
        let mut again = Again::default();
        for id in 0..4 {
            again.add(1, held(id, 1));
        }
        assert_eq!(take(&mut again, 1, 9), [] as [u64; 0], "it has them");
        assert_eq!(take(&mut again, 2, 2), [0, 1]);
        assert_eq!(again.answered(0), Copy::Only);
        assert_eq!(again.answered(0), Copy::Spare);
        assert_eq!(again.answered(3), Copy::Only);
        assert_eq!(
            take(&mut again, 2, 9),
            [2],
            "what is answered waits no longer"
        );
        assert_eq!(again.answered(1), Copy::Only);
        assert_eq!(again.released(1), Copy::Spare);
        assert_eq!(again.released(2), Copy::Spare);
        assert_eq!(again.released(2), Copy::Only, "nobody is left who has it");
        assert!(again.is_empty() && again.waiting.is_empty());
        assert_eq!(
            (again.answered(9), again.released(9)),
            (Copy::Only, Copy::Only)
        );
    }

    #[test]
    fn what_its_holder_loses_waits_no_longer() {
        let mut again = Again::default();
        again.add(1, held(0, 1));
        assert_eq!(again.released(0), Copy::Only);
        assert_eq!(take(&mut again, 2, 9), [] as [u64; 0]);
        assert!(again.is_empty());
    }

    #[test]
    fn views_do_not_mix_and_cancelled_ones_are_not_asked_again() {
        let mut again = Again::default();
        for id in 0..4 {
            again.add(1, held(id, 1 + (id % 2) as u32));
        }
        assert_eq!(take(&mut again, 2, 9), [0, 2]);
        again.cancel(3);
        assert_eq!(take(&mut again, 2, 9), [] as [u64; 0]);
        for id in [1, 3] {
            assert_eq!(again.released(id), Copy::Only);
        }
        for id in [0, 2] {
            assert_eq!(again.released(id), Copy::Spare);
            assert_eq!(again.answered(id), Copy::Only);
        }
        assert!(again.is_empty());
    }
}
