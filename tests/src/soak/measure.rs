//! Memory of processes.

use std::fs;
use std::time::Duration;

/// Resident memory of a process, KiB; 0 if it is not there or the system does not say.
pub(super) fn resident_kib(process: u32) -> u64 {
    let status = fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    line.and_then(|text| text.trim().trim_end_matches(" kB").parse().ok())
        .unwrap_or(0)
}

/// The least squares' slope of what is later than `from`.
pub(super) fn slope_kib_a_minute(
    points: impl Iterator<Item = (Duration, u64)>,
    from: Duration,
) -> f64 {
    let points: Vec<(f64, f64)> = points
        .filter(|(at, _)| *at >= from)
        .map(|(at, kib)| (at.as_secs_f64() / 60.0, kib as f64))
        .collect();
    let count = points.len() as f64;
    let mean_x = points.iter().map(|p| p.0).sum::<f64>() / count;
    let mean_y = points.iter().map(|p| p.1).sum::<f64>() / count;
    let (mut over, mut under) = (0.0, 0.0);
    for (x, y) in points {
        over += (x - mean_x) * (y - mean_y);
        under += (x - mean_x) * (x - mean_x);
    }
    if under > 0.0 { over / under } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_by_the_minute_and_leave_out_the_start() {
        let minute = Duration::from_secs(60);
        let points =
            (0..10).map(|i| (minute * i, if i < 2 { 9000 } else { 50 + 7 * u64::from(i) }));
        let slope = slope_kib_a_minute(points, minute * 2);
        assert!((slope - 7.0).abs() < 1e-9, "{slope}");
        assert_eq!(slope_kib_a_minute(std::iter::empty(), minute), 0.0);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn this_process_is_resident() {
        assert!(resident_kib(std::process::id()) > 100);
        assert_eq!(resident_kib(u32::MAX), 0);
    }
}
