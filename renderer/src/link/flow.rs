//! What a server has shown to manage, and how much it is therefore given at once.
//!
//! A server should hold what keeps it busy until more arrives, and no more: what it holds is late if it turns out to be
//! slow, and lost time if it goes away. That is its speed times a short horizon, or times twice what it takes for the
//! smallest batch where that is longer (a shader that traces whole batches at once). Speed is measured as in TCP's BBR:
//! what was answered between sending a batch and its last answer, by the time that took; the best of the last few, since
//! a server with little to do shows less than it can.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// A server is given as much as it does in this time, seconds.
const HORIZON_S: f64 = 0.1;
/// Least that it is given at once: what it does in this time, seconds, and at most [`PROBE`] requests.
const LEAST_S: f64 = 0.01;
/// Requests for each of its threads that a server is given before anything is known of it.
const PROBE: usize = 64;
/// Threads that count for that: a server may claim any number.
const MOST_PROBED_THREADS: u32 = 64;
/// Measurements of which the best counts.
const KEPT: usize = 8;
/// Silence after which a server is taken as stalled, at least; and in units of its quickest batch.
const LEAST_STALL: Duration = Duration::from_millis(250);
const STALL_BATCHES: f64 = 4.0;
/// The same before a batch was measured.
const UNKNOWN_STALL: Duration = Duration::from_millis(500);
/// Shortest time that can be told from none, seconds.
const TICK_S: f64 = 1e-4;

#[derive(Clone, Copy, Debug)]
struct Batch {
    /// Requests sent until its end.
    last: u64,
    /// Requests answered when it was sent.
    answered: u64,
    sent: Instant,
}

/// The account of one connection.
#[derive(Debug)]
pub(super) struct Flow {
    sent: u64,
    answered: u64,
    /// Batches not yet answered in full, taking answers to come in the order of requests.
    batches: VecDeque<Batch>,
    speeds: VecDeque<f64>,
    /// Time of the quickest batch, seconds; none was measured if infinite.
    quickest_s: f64,
    heard: Instant,
    probe: usize,
}

impl Flow {
    /// Of a server with so many threads, of which nothing is known.
    pub(super) fn new(threads: u32, now: Instant) -> Self {
        Self {
            sent: 0,
            answered: 0,
            batches: VecDeque::new(),
            speeds: VecDeque::with_capacity(KEPT),
            quickest_s: f64::INFINITY,
            heard: now,
            probe: PROBE * threads.clamp(1, MOST_PROBED_THREADS) as usize,
        }
    }

    /// So many requests are being sent.
    pub(super) fn sent(&mut self, count: usize, now: Instant) {
        self.sent += count as u64;
        self.batches.push_back(Batch {
            last: self.sent,
            answered: self.answered,
            sent: now,
        });
    }

    /// So many answers came.
    pub(super) fn answered(&mut self, count: usize, now: Instant) {
        self.answered += count as u64;
        self.heard = now;
        while let Some(batch) = self.batches.front()
            && batch.last <= self.answered
        {
            let took = now.saturating_duration_since(batch.sent).as_secs_f64();
            let took = took.max(TICK_S);
            if self.speeds.len() == KEPT {
                self.speeds.pop_front();
            }
            self.speeds
                .push_back((self.answered - batch.answered) as f64 / took);
            self.quickest_s = self.quickest_s.min(took);
            self.batches.pop_front();
        }
    }

    /// Requests were cancelled; so many are left. Batches cut short measure nothing.
    pub(super) fn cancelled(&mut self, left: usize) {
        self.batches.clear();
        self.sent = self.answered + left as u64;
    }

    /// Requests a second; none was measured yet if not given.
    pub(super) fn speed(&self) -> Option<f64> {
        self.speeds.iter().copied().reduce(f64::max)
    }

    /// Most requests that it should hold.
    pub(super) fn window(&self) -> usize {
        match self.speed() {
            Some(speed) => {
                let horizon = HORIZON_S + 2.0 * self.quickest_s;
                ((speed * horizon).round() as usize).max(self.least())
            }
            None => self.probe,
        }
    }

    /// Requests below which it is not worth cutting its share.
    pub(super) fn least(&self) -> usize {
        self.speed()
            .map_or(PROBE, |speed| ((speed * LEAST_S) as usize).clamp(1, PROBE))
    }

    /// Seconds until it has answered so many, as far as is known.
    pub(super) fn time_for(&self, requests: usize) -> f64 {
        match self.speed() {
            Some(speed) => (requests as f64 / speed).max(self.quickest_s),
            None => f64::INFINITY,
        }
    }

    /// Whether it has been silent for too long with requests to answer.
    pub(super) fn is_stalled(&self, holds: usize, now: Instant) -> bool {
        if holds == 0 {
            return false;
        }
        let first = self.batches.front().map_or(self.heard, |batch| batch.sent);
        let silent = now.saturating_duration_since(first.max(self.heard));
        if self.quickest_s.is_infinite() {
            return silent >= UNKNOWN_STALL;
        }
        silent >= LEAST_STALL && silent.as_secs_f64() >= STALL_BATCHES * self.quickest_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(start: Instant, ms: u64) -> Instant {
        start + Duration::from_millis(ms)
    }

    #[test]
    fn windows_hold_what_a_server_does_in_a_tenth_of_a_second() {
        let start = Instant::now();
        let mut flow = Flow::new(2, start);
        assert_eq!((flow.window(), flow.speed()), (128, None));
        // One request a millisecond.
        for k in 0..20 {
            flow.sent(10, ms(start, 10 * k));
            flow.answered(10, ms(start, 10 * k + 10));
        }
        let speed = flow.speed().unwrap();
        assert!((speed - 1000.0).abs() < 1.0, "{speed}");
        assert_eq!(flow.window(), 120, "and twice its quickest batch");
        assert_eq!(flow.least(), 10);
        assert!((flow.time_for(500) - 0.5).abs() < 1e-3);
    }

    #[test]
    fn a_shader_of_whole_batches_is_given_more_and_more() {
        // Every batch takes half a second, however large.
        let start = Instant::now();
        let mut flow = Flow::new(1, start);
        for round in 0..4 {
            let before = flow.window();
            flow.sent(before, ms(start, 500 * round));
            flow.answered(before, ms(start, 500 * round + 500));
            assert!(flow.window() >= 2 * before);
        }
    }

    #[test]
    fn a_slow_server_holds_little() {
        let start = Instant::now();
        let mut flow = Flow::new(1, start);
        flow.sent(1, start);
        flow.answered(1, ms(start, 100));
        assert!(flow.window() <= 3, "{}", flow.window());
        assert_eq!(flow.least(), 1);
    }

    #[test]
    fn silence_with_work_to_do_is_a_stall() {
        let start = Instant::now();
        let mut flow = Flow::new(1, start);
        assert!(!flow.is_stalled(0, ms(start, 100_000)));
        flow.sent(10, start);
        assert!(!flow.is_stalled(10, ms(start, 499)));
        assert!(flow.is_stalled(10, ms(start, 500)));
        flow.answered(10, ms(start, 600));
        flow.sent(10, ms(start, 5000));
        assert!(
            !flow.is_stalled(10, ms(start, 5300)),
            "its batches take 600 ms"
        );
        assert!(flow.is_stalled(10, ms(start, 7401)));
        flow.cancelled(3);
        flow.sent(5, ms(start, 8000));
        flow.answered(8, ms(start, 8100));
        assert!(flow.batches.is_empty());
    }
}
