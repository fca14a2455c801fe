//! What the display's thread and the connections share, without sockets.

use std::collections::{HashSet, VecDeque};
use std::sync::Arc;
use std::time::Instant;

use protocol::messages::{Camera, SampleRequest, Triple};
use protocol::scene::Scene;
use protocol::session::Outstanding;

use super::again::{Again, Copy};
use super::edits::Edits;
use super::face::ReceivedSample;
use super::slots::Slots;
use super::status::{LinkStatus, Rate, ServerPhase, ServerStatus};

/// Views that are kept for requests still to be sent; servers remember four times as many.
pub(super) const VIEWS_KEPT: usize = 64;
/// Most triples of an epoch.
const MAX_TRIPLES: usize = 1 << 20;

/// Requests, answers, views and edits.
#[derive(Debug)]
pub(super) struct State {
    pub(super) edits: Edits,
    pub(super) views: VecDeque<(u32, Camera)>,
    pub(super) cancel_before: u32,
    pub(super) slots: Slots,
    /// Servers may come by themselves.
    pub(super) open: bool,
    /// Most requests and undrained samples together.
    capacity: usize,
    newest_view: u32,
    queue: VecDeque<Outstanding>,
    /// Requests that servers hold, each once.
    in_flight: usize,
    /// Those that more than one server has to do with.
    again: Again,
    inbox: Vec<ReceivedSample>,
    triples: Vec<Triple>,
    seen: HashSet<Triple>,
    rate: Rate,
    samples: u64,
    late: u64,
    stale: u64,
    dropped: u64,
    faults: u64,
    last_fault: Option<Arc<str>>,
}

impl State {
    pub(super) fn new(scene: &Scene, capacity: usize) -> Self {
        Self {
            edits: Edits::new(scene),
            views: VecDeque::with_capacity(VIEWS_KEPT),
            cancel_before: 0,
            slots: Slots::default(),
            open: false,
            capacity,
            newest_view: 0,
            queue: VecDeque::new(),
            in_flight: 0,
            again: Again::default(),
            inbox: Vec::new(),
            triples: Vec::new(),
            seen: HashSet::new(),
            rate: Rate::new(Instant::now()),
            samples: 0,
            late: 0,
            stale: 0,
            dropped: 0,
            faults: 0,
            last_fault: None,
        }
    }

    pub(super) fn capacity(&self) -> usize {
        self.capacity
    }

    /// Requests that have no answer yet.
    pub(super) fn pending(&self) -> usize {
        self.queue.len() + self.in_flight
    }

    /// Whether any server may still answer: ready, being connected to, or failed fewer than `attempts` times in a row.
    pub(super) fn any_left(&self, attempts: u32) -> bool {
        let left = |server: &ServerStatus| match server.phase {
            ServerPhase::Down { failures } => failures < attempts,
            ServerPhase::Ready | ServerPhase::Connecting => true,
        };
        self.open || self.slots.iter().any(|slot| left(&slot.status))
    }

    /// A new view; the oldest is forgotten, and its requests with it, when there are too many.
    pub(super) fn set_view(&mut self, camera: Camera) -> u32 {
        self.newest_view += 1;
        if self.views.len() == VIEWS_KEPT {
            self.views.pop_front();
            let oldest = self.views.front().map_or(0, |(view, _)| *view);
            self.drop_queued_before(oldest, true);
            self.again.cancel(oldest);
        }
        self.views.push_back((self.newest_view, camera));
        self.newest_view
    }

    /// Puts requests before all others. Returns how many of them, from the front, there was room for.
    pub(super) fn request(&mut self, view: u32, requests: &[SampleRequest]) -> usize {
        if view < self.cancel_before || !self.knows(view) {
            return 0;
        }
        let room = self
            .capacity
            .saturating_sub(self.in_flight + self.inbox.len());
        let taken = requests.len().min(room);
        let excess = (self.queue.len() + taken).saturating_sub(room);
        self.queue.truncate(self.queue.len() - excess);
        self.dropped += excess as u64;
        for &request in requests[..taken].iter().rev() {
            self.queue.push_front(Outstanding { view, request });
        }
        taken
    }

    fn knows(&self, view: u32) -> bool {
        self.views
            .binary_search_by_key(&view, |(number, _)| *number)
            .is_ok()
    }

    fn drop_queued_before(&mut self, view: u32, count: bool) {
        let before = self.queue.len();
        self.queue.retain(|queued| queued.view >= view);
        if count {
            self.dropped += (before - self.queue.len()) as u64;
        }
    }

    /// Forgets all views before this one and what is asked of them.
    pub(super) fn cancel(&mut self, views_before: u32) {
        self.cancel_before = self.cancel_before.max(views_before);
        let before = self.cancel_before;
        self.drop_queued_before(before, false);
        self.again.cancel(before);
        while self.views.front().is_some_and(|(view, _)| *view < before) {
            self.views.pop_front();
        }
    }

    /// A new epoch began: what came of older ones is of no use any more.
    pub(super) fn forget_answers(&mut self) {
        self.stale += (self.inbox.len() + self.triples.len()) as u64;
        self.inbox.clear();
        self.triples.clear();
        self.seen.clear();
    }

    /// Moves the next requests, all of one view, to a server that has so much credit free: as many as it should hold now,
    /// and first those that another was too slow for. Returns their view.
    pub(super) fn take(
        &mut self,
        server: usize,
        most: usize,
        batch: &mut Vec<SampleRequest>,
        now: Instant,
    ) -> Option<u32> {
        batch.clear();
        let most = most.min(self.slots.allowance(server, self.pending(), now));
        let slot = self.slots.get_mut(server)?;
        let again = if self.again.is_empty() {
            None
        } else {
            self.again.take(slot.connection, most, batch)
        };
        let view = match again {
            Some(view) => view,
            None => {
                let view = self.queue.front()?.view;
                while batch.len() < most
                    && let Some(queued) = self.queue.front()
                    && queued.view == view
                {
                    batch.push(queued.request);
                    self.queue.pop_front();
                }
                self.in_flight += batch.len();
                view
            }
        };
        if batch.is_empty() {
            return None;
        }
        slot.status.outstanding += batch.len();
        slot.flow.sent(batch.len(), now);
        Some(view)
    }

    /// How many of what a server holds others should be asked too.
    pub(super) fn overdue(&self, server: usize, now: Instant) -> usize {
        self.slots.overdue(server, self.queue.is_empty(), now)
    }

    /// Wants others to be asked for this too, of what a server holds.
    pub(super) fn ask_again(&mut self, server: usize, held: impl Iterator<Item = Outstanding>) {
        let Some(connection) = self.slots.get(server).map(|slot| slot.connection) else {
            return;
        };
        for one in held {
            if self.knows(one.view) {
                self.again.add(connection, one);
            }
        }
        self.slots.wake_all();
    }

    /// Whether others are asked for this already.
    pub(super) fn is_asked_again(&self, id: u64) -> bool {
        self.again.contains(id)
    }

    /// Takes in samples; true if the inbox was empty before.
    pub(super) fn deliver(
        &mut self,
        server: usize,
        samples: impl ExactSizeIterator<Item = ReceivedSample>,
        current: bool,
    ) -> bool {
        let now = Instant::now();
        let count = samples.len();
        if let Some(slot) = self.slots.get_mut(server) {
            slot.status.outstanding -= count;
            slot.status.samples += count as u64;
            slot.flow.answered(count, now);
        }
        let (before, first) = (self.inbox.len(), self.inbox.is_empty());
        if self.again.is_empty() {
            self.inbox.extend(samples);
        } else {
            let again = &mut self.again;
            let firsts = samples.filter(|r| again.answered(r.sample.id) == Copy::Only);
            self.inbox.extend(firsts);
        }
        let counted = self.inbox.len() - before;
        self.in_flight -= counted;
        self.samples += counted as u64;
        self.late += (count - counted) as u64;
        self.rate.add(counted, now);
        if !current {
            self.stale += counted as u64;
            self.inbox.truncate(before);
        }
        first && !self.inbox.is_empty()
    }

    /// Takes in triples, each once an epoch.
    pub(super) fn deliver_triples(&mut self, triples: &[Triple], current: bool) {
        if !current {
            self.stale += triples.len() as u64;
            return;
        }
        for &triple in triples {
            if self.seen.len() >= MAX_TRIPLES {
                self.dropped += 1;
            } else if self.seen.insert(triple) {
                self.triples.push(triple);
            }
        }
    }

    /// A server dropped these requests, as it was asked to.
    pub(super) fn release(&mut self, server: usize, ids: &[u64]) {
        for &id in ids {
            if self.again.released(id) == Copy::Only {
                self.in_flight -= 1;
            }
        }
        if let Some(slot) = self.slots.get_mut(server)
            && !ids.is_empty()
        {
            slot.status.outstanding -= ids.len();
            slot.flow.cancelled(slot.status.outstanding);
        }
    }

    /// Puts what a lost server held back before everything else.
    pub(super) fn hand_back(&mut self, server: usize, held: &[Outstanding]) {
        if let Some(slot) = self.slots.get_mut(server) {
            slot.status.outstanding -= held.len();
        }
        for &one in held.iter().rev() {
            if self.again.released(one.request.id) == Copy::Spare {
                continue;
            }
            self.in_flight -= 1;
            if self.knows(one.view) {
                self.queue.push_front(one);
            } else if one.view >= self.cancel_before {
                self.dropped += 1;
            }
        }
    }

    /// Notes why a server was lost.
    pub(super) fn lost(&mut self, server: usize, failures: u32, why: &str) {
        let why: Arc<str> = why.into();
        if let Some(slot) = self.slots.get_mut(server) {
            slot.status.phase = ServerPhase::Down { failures };
            slot.status.credits = 0;
            slot.status.last_fault = Some(Arc::clone(&why));
        }
        self.faults += 1;
        self.last_fault = Some(why);
    }

    /// Moves everything received to the ends of these.
    pub(super) fn drain(&mut self, samples: &mut Vec<ReceivedSample>, triples: &mut Vec<Triple>) {
        samples.append(&mut self.inbox);
        triples.append(&mut self.triples);
    }

    pub(super) fn status(&mut self) -> LinkStatus {
        let samples_per_second = self.rate.at(Instant::now());
        let servers = || self.slots.iter().map(|slot| &slot.status);
        let ready = |s: &&ServerStatus| s.phase == ServerPhase::Ready;
        LinkStatus {
            servers: servers().count(),
            connected: servers().filter(ready).count(),
            credits: servers().map(|s| s.credits).sum(),
            queued: self.queue.len(),
            outstanding: self.in_flight,
            samples_per_second,
            samples: self.samples,
            late: self.late,
            stale: self.stale,
            dropped: self.dropped,
            faults: self.faults,
            last_fault: self.last_fault.clone(),
        }
    }
}

#[cfg(test)]
#[path = "state_tests.rs"]
mod tests;
