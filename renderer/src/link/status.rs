//! What is told about the servers.

use std::sync::Arc;
use std::time::{Duration, Instant};

use protocol::messages::LightShadows;

/// How a server is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ServerPhase {
    /// Being started, connected to, or sent the scene.
    Connecting,
    /// Takes requests.
    Ready,
    /// Failed so many times in a row; will be tried again after a pause.
    Down {
        /// Failures since it last worked for a while.
        failures: u32,
    },
}

/// One server.
#[derive(Clone, Debug)]
pub struct ServerStatus {
    /// Where it is: an address or a program.
    pub place: Arc<str>,
    /// How it is doing.
    pub phase: ServerPhase,
    /// Its name and shader, once it said them.
    pub name: Arc<str>,
    /// Requests that it will hold at once; 0 unless ready.
    pub credits: usize,
    /// Requests that it holds.
    pub outstanding: usize,
    /// Its worker threads.
    pub threads: u32,
    /// Samples that came from it.
    pub samples: u64,
    /// How it finds the visibility of lights, by index, as far as it said.
    pub shadows: Vec<LightShadows>,
    /// Why it was lost last.
    pub last_fault: Option<Arc<str>>,
}

impl ServerStatus {
    /// Nothing is known yet of what is at this place.
    pub(super) fn new(place: &str) -> Self {
        Self {
            place: place.into(),
            phase: ServerPhase::Connecting,
            name: "".into(),
            credits: 0,
            outstanding: 0,
            threads: 0,
            samples: 0,
            shadows: Vec::new(),
            last_fault: None,
        }
    }
}

/// All servers together, and what went through the link so far.
#[derive(Clone, Debug, Default)]
pub struct LinkStatus {
    /// Servers that the link knows of.
    pub servers: usize,
    /// Servers that take requests.
    pub connected: usize,
    /// Requests that the connected ones will hold at once.
    pub credits: usize,
    /// Requests that wait for a server.
    pub queued: usize,
    /// Requests that servers hold, each counted once however many hold it.
    pub outstanding: usize,
    /// Samples a second, over the last half second or so.
    pub samples_per_second: f64,
    /// Samples received, the first of each request.
    pub samples: u64,
    /// Samples that another server had answered before.
    pub late: u64,
    /// Samples and triples of an older epoch, not passed on.
    pub stale: u64,
    /// Requests given up because the queue was full or their view forgotten, and triples for which there was no room.
    pub dropped: u64,
    /// Connections lost or refused.
    pub faults: u64,
    /// Why the last one was.
    pub last_fault: Option<Arc<str>>,
}

const WINDOW: Duration = Duration::from_millis(500);

/// Samples a second over the last whole window.
#[derive(Debug)]
pub(super) struct Rate {
    start: Instant,
    count: u64,
    rate: f64,
}

impl Rate {
    pub(super) fn new(now: Instant) -> Self {
        Self {
            start: now,
            count: 0,
            rate: 0.0,
        }
    }

    pub(super) fn add(&mut self, samples: usize, now: Instant) {
        self.roll(now);
        self.count += samples as u64;
    }

    pub(super) fn at(&mut self, now: Instant) -> f64 {
        self.roll(now);
        self.rate
    }

    fn roll(&mut self, now: Instant) {
        let elapsed = now.saturating_duration_since(self.start);
        if elapsed >= WINDOW {
            self.rate = self.count as f64 / elapsed.as_secs_f64();
            self.start = now;
            self.count = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_of_the_last_window() {
        let start = Instant::now();
        let mut rate = Rate::new(start);
        rate.add(100, start);
        assert_eq!(rate.at(start + Duration::from_millis(499)), 0.0);
        assert_eq!(rate.at(start + Duration::from_millis(500)), 200.0);
        assert_eq!(rate.at(start + Duration::from_millis(2000)), 0.0);
    }
}
