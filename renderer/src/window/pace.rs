//! The rate of frames, for people and for what is asked for.

use std::time::Instant;

/// Share that a new measurement has in a figure shown to people.
const SMOOTHING: f64 = 0.1;

/// How fast frames come, smoothed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pace {
    last: Option<Instant>,
    /// From one frame to the next, seconds.
    pub(super) interval_s: f64,
    /// What a frame takes, ms.
    pub(super) cost_ms: f64,
}

impl Pace {
    /// A frame begins; returns the time since the one before, seconds.
    pub(super) fn begin(&mut self, now: Instant) -> f64 {
        let since = self.last.map_or(1.0, |l| (now - l).as_secs_f64());
        self.last = Some(now);
        // After a pause the pace is a new one.
        let share = if since > 0.25 || self.interval_s > 0.25 {
            1.0
        } else {
            SMOOTHING
        };
        self.interval_s += (since - self.interval_s) * share;
        since
    }

    /// The frame took so long.
    pub(super) fn end(&mut self, ms: f64) {
        let share = if self.cost_ms == 0.0 { 1.0 } else { SMOOTHING };
        self.cost_ms += (ms - self.cost_ms) * share;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pace_follows_a_steady_run_and_starts_anew_after_a_pause() {
        let mut pace = Pace::default();
        let start = Instant::now();
        let ms = std::time::Duration::from_millis;
        for frame in 0..100 {
            pace.begin(start + ms(20 * frame));
        }
        assert!((pace.interval_s - 0.02).abs() < 1e-3);
        pace.begin(start + ms(10_000));
        pace.begin(start + ms(10_010));
        assert!((pace.interval_s - 0.01).abs() < 1e-3);
    }
}
