//! How many samples to ask for in a frame.

use crate::link::LinkStatus;

/// Share of the pixels asked for before anything is known of the servers.
const FIRST_SHARE: usize = 50;
/// Fewest samples that are kept asked for.
const LEAST: f64 = 256.0;
/// Frames' worth of samples at the servers' own rate that are kept asked for, so that they have work while a frame is
/// drawn and the next request is under way.
const FRAMES_AHEAD: f64 = 1.5;
/// Time that requests and answers travel, seconds.
const TRAVEL_S: f64 = 0.01;

/// Keeps the servers busy and no more: what waits too long is asked of a view that has gone.
#[derive(Clone, Copy, Debug)]
pub(super) struct Budget {
    most: Option<usize>,
    target: f64,
}

impl Budget {
    /// `most` bounds what a single frame asks for.
    pub(super) fn new(most: Option<usize>, pixels: usize) -> Self {
        Self {
            most,
            target: ((pixels / FIRST_SHARE) as f64).max(LEAST),
        }
    }

    /// The bound that it was given.
    pub(super) fn most(&self) -> Option<usize> {
        self.most
    }

    /// How many samples the frame just drawn may ask for, `frame_s` after the one before.
    pub(super) fn next(&mut self, status: &LinkStatus, frame_s: f64, pixels: usize) -> usize {
        let pending = (status.queued + status.outstanding) as f64;
        let frame_s = frame_s.clamp(0.001, 0.5);
        // Idle servers could do more than their rate says; a rate that is known bounds what they can be given.
        if status.connected > 0 && pending < self.target * 0.25 {
            self.target *= 1.25;
        }
        let rate = status.samples_per_second;
        if rate > 0.0 {
            let enough = rate * (frame_s * FRAMES_AHEAD + TRAVEL_S);
            self.target = self.target.clamp(enough, 2.0 * enough);
        }
        let credits = status.credits.max(LEAST as usize);
        let most = pixels.min(credits) as f64;
        self.target = self.target.clamp(LEAST, most.max(LEAST));
        let ask = (self.target - pending).max(0.0) as usize;
        ask.min(self.most.unwrap_or(usize::MAX)).min(pixels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Servers that do `speed` samples a second for frames of 16 ms; gives how long they were busy, and the most that
    /// waited, after the start.
    fn run(speed: f64, credits: usize, most: Option<usize>) -> (f64, usize) {
        let pixels = 512 * 512;
        let mut budget = Budget::new(most, pixels);
        let (mut pending, mut busy, mut longest) = (0usize, 0.0, 0);
        let mut status = LinkStatus {
            connected: 1,
            credits,
            ..LinkStatus::default()
        };
        let mut window = 0.0;
        for frame in 0..600 {
            status.queued = pending;
            let ask = budget.next(&status, 0.016, pixels);
            assert!(ask <= most.unwrap_or(pixels));
            pending += ask;
            let done = (pending as f64).min(speed * 0.016);
            pending -= done as usize;
            window += done;
            if frame % 30 == 29 {
                status.samples_per_second = window / 0.48;
                window = 0.0;
            }
            if frame >= 300 {
                busy += done / (speed * 0.016) / 300.0;
                longest = longest.max(pending);
            }
        }
        (busy, longest)
    }

    #[test]
    fn servers_of_any_speed_are_kept_busy_without_a_long_queue() {
        for speed in [20_000.0, 200_000.0, 4_000_000.0] {
            let (busy, longest) = run(speed, 1 << 20, None);
            assert!(busy > 0.9, "{speed}: busy {busy}");
            assert!(
                (longest as f64) < speed * 0.1 + 500.0,
                "{speed}: {longest} wait"
            );
        }
    }

    #[test]
    fn credits_and_the_person_bound_what_is_asked() {
        let (_, longest) = run(100_000.0, 1000, None);
        assert!(longest <= 1000);
        let (busy, _) = run(1_000_000.0, 1 << 20, Some(100));
        assert!(busy < 0.01);
        let mut budget = Budget::new(None, 10);
        let asked = budget.next(&LinkStatus::default(), f64::NAN, 10);
        assert!(asked <= 10);
    }
}
