//! The servers of the moment: they come and go, each in a slot that is used again.

use std::sync::Arc;
use std::time::Instant;

use tokio::sync::Notify;

use super::again::ConnectionId;
use super::flow::Flow;
use super::status::{ServerPhase, ServerStatus};

/// Most servers at once.
const MAX_SERVERS: usize = 1024;

/// One server, and the connection to it if there is one.
#[derive(Debug)]
pub(super) struct Slot {
    pub(super) status: ServerStatus,
    pub(super) flow: Flow,
    pub(super) connection: ConnectionId,
    /// Told when there may be something to send.
    pub(super) wake: Arc<Notify>,
}

impl Slot {
    fn is_ready(&self) -> bool {
        self.status.phase == ServerPhase::Ready
    }

    fn is_stalled(&self, now: Instant) -> bool {
        self.flow.is_stalled(self.status.outstanding, now)
    }
}

/// All slots by number.
#[derive(Debug, Default)]
pub(super) struct Slots {
    all: Vec<Option<Slot>>,
    connections: ConnectionId,
}

impl Slots {
    /// A slot for a server at this place; none if there are too many.
    pub(super) fn open(&mut self, place: &str) -> Option<usize> {
        let free = self.all.iter().position(Option::is_none);
        let number = free.unwrap_or(self.all.len());
        if number >= MAX_SERVERS {
            return None;
        }
        let slot = Slot {
            status: ServerStatus::new(place),
            flow: Flow::new(1, Instant::now()),
            connection: 0,
            wake: Arc::default(),
        };
        if free.is_some() {
            self.all[number] = Some(slot);
        } else {
            self.all.push(Some(slot));
        }
        Some(number)
    }

    /// Gives a slot up. Nothing may be outstanding in it.
    pub(super) fn close(&mut self, number: usize) {
        if let Some(slot) = self.all.get_mut(number) {
            *slot = None;
        }
    }

    /// Begins a connection: nothing is known of it.
    pub(super) fn connect(&mut self, number: usize) {
        self.connections += 1;
        let connection = self.connections;
        if let Some(slot) = self.get_mut(number) {
            slot.connection = connection;
            slot.flow = Flow::new(1, Instant::now());
        }
    }

    pub(super) fn get(&self, number: usize) -> Option<&Slot> {
        self.all.get(number)?.as_ref()
    }

    pub(super) fn get_mut(&mut self, number: usize) -> Option<&mut Slot> {
        self.all.get_mut(number)?.as_mut()
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &Slot> {
        self.all.iter().flatten()
    }

    /// There may be something to send to any server.
    pub(super) fn wake_all(&self) {
        self.iter().for_each(|slot| slot.wake.notify_one());
    }

    /// How many more of so many requests without an answer a server should hold now.
    ///
    /// With several servers none holds more than its window, nor more than half of its share of all, its share being
    /// measured by speed; so the requests run out for all of them at about the same time, however fast each is.
    pub(super) fn allowance(&self, number: usize, pending: usize, now: Instant) -> usize {
        let Some(own) = self.get(number) else {
            return 0;
        };
        let others = || self.iter().filter(|slot| slot.is_ready());
        if others().count() <= 1 {
            return usize::MAX;
        }
        if own.is_stalled(now) {
            return 0;
        }
        let at_work = || others().filter(|slot| !slot.is_stalled(now));
        let (known, count) = at_work()
            .filter_map(|slot| slot.flow.speed())
            .fold((0.0, 0.0), |(sum, count), speed| (sum + speed, count + 1.0));
        // Who has shown nothing yet is taken to be like the others.
        let guess = if count > 0.0 { known / count } else { 1.0 };
        let weight = |slot: &Slot| slot.flow.speed().unwrap_or(guess);
        let all: f64 = at_work().map(weight).sum();
        let share = pending as f64 * weight(own) / all.max(f64::MIN_POSITIVE) / 2.0;
        (share as usize)
            .max(own.flow.least())
            .min(own.flow.window())
            .saturating_sub(own.status.outstanding)
    }

    /// How many of a server's requests others should be asked too, since they would be done with them much sooner: all if
    /// it is silent, and if it is only slow, when there is nothing else to do, as many as lets all end at the same time.
    pub(super) fn overdue(&self, number: usize, idle: bool, now: Instant) -> usize {
        /// Seconds that are not worth any trouble.
        const WORTH_S: f64 = 0.05;
        let Some(own) = self.get(number) else {
            return 0;
        };
        let holds = own.status.outstanding;
        let helpers = self.all.iter().enumerate().filter_map(|(i, slot)| {
            let slot = slot.as_ref()?;
            let room = slot.flow.window().saturating_sub(slot.status.outstanding);
            let helps = i != number && slot.is_ready() && !slot.is_stalled(now) && room > 0;
            helps.then_some((slot, room))
        });
        let (mut soonest, mut speed, mut room) = (f64::INFINITY, 0.0, 0);
        for (slot, free) in helpers {
            soonest = soonest.min(slot.flow.time_for(slot.status.outstanding + 1));
            speed += slot.flow.speed().unwrap_or(0.0);
            room += free;
        }
        if holds == 0 || room == 0 {
            return 0;
        }
        if own.is_stalled(now) {
            return holds;
        }
        let (Some(own_speed), true) = (own.flow.speed(), idle) else {
            return 0;
        };
        if own.flow.time_for(holds) <= 2.0 * soonest + WORTH_S {
            return 0;
        }
        let even = (holds as f64 * speed / (speed + own_speed)) as usize;
        even.min(room)
    }
}
