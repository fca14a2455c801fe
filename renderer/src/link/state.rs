//! What the display's thread and the connections share, without sockets.

use std::collections::{HashSet, VecDeque};
use std::sync::Arc;
use std::time::Instant;

use protocol::messages::{Camera, SampleRequest, Triple};
use protocol::scene::Scene;
use protocol::session::Outstanding;

use super::edits::Edits;
use super::face::ReceivedSample;
use super::status::{LinkStatus, Rate, ServerPhase, ServerStatus};

/// Views that are kept for requests still to be sent; servers remember four times as many.
pub(super) const VIEWS_KEPT: usize = 64;
/// Most triples of an epoch.
const MAX_TRIPLES: usize = 1 << 20;
/// No server's share is cut below so many requests.
const LEAST_SHARE: usize = 64;

/// Requests, answers, views and edits.
#[derive(Debug)]
pub(super) struct State {
    pub(super) edits: Edits,
    pub(super) views: VecDeque<(u32, Camera)>,
    pub(super) cancel_before: u32,
    pub(super) servers: Vec<ServerStatus>,
    /// Most requests and undrained samples together.
    capacity: usize,
    newest_view: u32,
    queue: VecDeque<Outstanding>,
    in_flight: usize,
    inbox: Vec<ReceivedSample>,
    triples: Vec<Triple>,
    seen: HashSet<Triple>,
    rate: Rate,
    samples: u64,
    stale: u64,
    dropped: u64,
    faults: u64,
    last_fault: Option<Arc<str>>,
}

impl State {
    pub(super) fn new(scene: &Scene, servers: usize, capacity: usize) -> Self {
        let server = ServerStatus {
            phase: ServerPhase::Connecting,
            name: "".into(),
            credits: 0,
            outstanding: 0,
            threads: 0,
            shadows: Vec::new(),
            last_fault: None,
        };
        Self {
            edits: Edits::new(scene),
            views: VecDeque::with_capacity(VIEWS_KEPT),
            cancel_before: 0,
            servers: vec![server; servers],
            capacity,
            newest_view: 0,
            queue: VecDeque::new(),
            in_flight: 0,
            inbox: Vec::new(),
            triples: Vec::new(),
            seen: HashSet::new(),
            rate: Rate::new(Instant::now()),
            samples: 0,
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
        self.servers.iter().any(left)
    }

    /// A new view; the oldest is forgotten, and its requests with it, when there are too many.
    pub(super) fn set_view(&mut self, camera: Camera) -> u32 {
        self.newest_view += 1;
        if self.views.len() == VIEWS_KEPT {
            self.views.pop_front();
            let oldest = self.views.front().map_or(0, |(view, _)| *view);
            self.drop_queued_before(oldest, true);
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

    /// Moves the next requests, all of one view, to a server that has so much credit free. Returns their view.
    ///
    /// With several servers none takes more than half of its share of the work at once, its share being measured by
    /// credit; so the queue runs out for all of them at about the same time, however fast each is.
    pub(super) fn take(
        &mut self,
        server: usize,
        most: usize,
        batch: &mut Vec<SampleRequest>,
    ) -> Option<u32> {
        batch.clear();
        let view = self.queue.front()?.view;
        let most = most.min(self.share(server));
        while batch.len() < most
            && let Some(queued) = self.queue.front()
            && queued.view == view
        {
            batch.push(queued.request);
            self.queue.pop_front();
        }
        self.in_flight += batch.len();
        self.servers[server].outstanding += batch.len();
        if batch.is_empty() { None } else { Some(view) }
    }

    fn share(&self, server: usize) -> usize {
        let credits: usize = self.servers.iter().map(|s| s.credits).sum();
        let own = &self.servers[server];
        if own.credits == credits {
            return usize::MAX;
        }
        let share = (self.pending() as u128 * own.credits as u128 / credits.max(1) as u128) / 2;
        (share as usize)
            .max(LEAST_SHARE)
            .saturating_sub(own.outstanding)
    }

    /// Takes in samples; true if the inbox was empty before.
    pub(super) fn deliver(
        &mut self,
        server: usize,
        samples: impl ExactSizeIterator<Item = ReceivedSample>,
        current: bool,
    ) -> bool {
        let count = samples.len();
        self.release(server, count);
        self.samples += count as u64;
        self.rate.add(count, Instant::now());
        if !current {
            self.stale += count as u64;
            return false;
        }
        let first = self.inbox.is_empty();
        self.inbox.extend(samples);
        first
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

    /// So many requests are no longer held by this server.
    pub(super) fn release(&mut self, server: usize, count: usize) {
        self.in_flight -= count;
        self.servers[server].outstanding -= count;
    }

    /// Puts what a lost server held back before everything else.
    pub(super) fn hand_back(&mut self, server: usize, held: &[Outstanding]) {
        self.release(server, held.len());
        for &one in held.iter().rev() {
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
        let status = &mut self.servers[server];
        status.phase = ServerPhase::Down { failures };
        status.credits = 0;
        status.last_fault = Some(Arc::clone(&why));
        self.faults += 1;
        self.last_fault = Some(why);
    }

    /// Moves everything received to the ends of these.
    pub(super) fn drain(&mut self, samples: &mut Vec<ReceivedSample>, triples: &mut Vec<Triple>) {
        samples.append(&mut self.inbox);
        triples.append(&mut self.triples);
    }

    pub(super) fn status(&mut self) -> LinkStatus {
        LinkStatus {
            servers: self.servers.len(),
            connected: self
                .servers
                .iter()
                .filter(|s| s.phase == ServerPhase::Ready)
                .count(),
            credits: self.servers.iter().map(|s| s.credits).sum(),
            queued: self.queue.len(),
            outstanding: self.in_flight,
            samples_per_second: self.rate.at(Instant::now()),
            samples: self.samples,
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
