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

/// Fewer than this share of what was to be kept asked for are left: the servers have run dry, or nearly.
const DRY: f64 = 0.1;
/// How much more is asked for with each frame that finds them dry, at most, and so many times as much as seems enough.
const GROWTH: f64 = 1.5;
const MOST_GROWTH: f64 = 4.0;

/// Keeps the servers busy and no more: what waits too long is asked of a view that has gone.
#[derive(Clone, Copy, Debug)]
pub(super) struct Budget {
    most: Option<usize>,
    /// Samples a second that the servers have shown to manage. While they have nothing to do this cannot fall.
    ability: f64,
    growth: f64,
    target: f64,
}

impl Budget {
    /// `most` bounds what a single frame asks for.
    pub(super) fn new(most: Option<usize>) -> Self {
        Self {
            most,
            ability: 0.0,
            growth: 1.0,
            target: 0.0,
        }
    }

    /// How many samples the frame just drawn may ask for, `frame_s` after the one before.
    pub(super) fn next(&mut self, status: &LinkStatus, frame_s: f64, pixels: usize) -> usize {
        let pending = (status.queued + status.outstanding) as f64;
        let frame_s = frame_s.clamp(0.001, 0.5);
        let dry = pending < self.target * DRY;
        let rate = status.samples_per_second;
        if rate > self.ability {
            self.ability = rate;
        } else if !dry {
            self.ability += (rate - self.ability) * 0.1;
        }
        self.growth = if dry && status.connected > 0 {
            (self.growth * GROWTH).min(MOST_GROWTH)
        } else {
            (self.growth / GROWTH).max(1.0)
        };
        let enough = self.ability * (frame_s * FRAMES_AHEAD + TRAVEL_S) * self.growth;
        let first = (pixels / FIRST_SHARE) as f64;
        let enough = if self.ability > 0.0 { enough } else { first };
        let credits = if status.credits > 0 {
            status.credits
        } else {
            usize::MAX
        };
        self.target = enough.max(LEAST).min(pixels.min(credits) as f64);
        let ask = (self.target - pending).max(0.0) as usize;
        ask.min(self.most.unwrap_or(usize::MAX))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Servers that do `speed` samples a second for frames of 16 ms; gives how long they were busy, and the most that
    /// waited, after the start.
    fn run(speed: f64, credits: usize, most: Option<usize>) -> (f64, usize) {
        let pixels = 512 * 512;
        let mut budget = Budget::new(most);
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
    fn slow_frames_and_lost_requests_do_not_starve_servers_for_good() {
        let mut budget = Budget::new(None);
        let mut status = LinkStatus {
            connected: 1,
            credits: 1 << 20,
            samples_per_second: 40_000.0,
            ..LinkStatus::default()
        };
        budget.next(&status, 0.02, 1 << 20);
        // Views that have gone take their requests with them: few answers, nothing pending.
        status.samples_per_second = 500.0;
        for _ in 0..100 {
            let asked = budget.next(&status, 0.1, 1 << 20);
            assert!(asked >= 4000, "{asked}");
        }
        // Servers that are busy all the time and do no more are slower than they were.
        status.queued = 20_000;
        for _ in 0..100 {
            budget.next(&status, 0.1, 1 << 20);
        }
        status.queued = 0;
        assert!(budget.next(&status, 0.1, 1 << 20) < 1000);
    }

    #[test]
    fn credits_and_the_person_bound_what_is_asked() {
        let (_, longest) = run(100_000.0, 1000, None);
        assert!(longest <= 1000);
        let (busy, _) = run(1_000_000.0, 1 << 20, Some(100));
        assert!(busy < 0.01);
        let mut budget = Budget::new(None);
        let asked = budget.next(&LinkStatus::default(), f64::NAN, 10);
        assert!(asked <= 10);
    }
}
