//! Processor time of single threads.

use std::fs;
use std::time::Duration;

/// Ticks a second in which the system tells it: `USER_HZ`, the same on every Linux that is in use.
const TICKS: f64 = 100.0;

/// Processor time so far of the calling thread and of all of this process with a name; nothing where the system does not
/// tell it.
pub(super) fn own_and(name: &str) -> Option<Duration> {
    let mut seconds = ticks("/proc/thread-self/stat")? / TICKS;
    for task in fs::read_dir("/proc/self/task").ok()? {
        let path = task.ok()?.path();
        let is_it = |text: String| text.trim_end() == name;
        // A thread may end while it is looked at.
        if fs::read_to_string(path.join("comm")).is_ok_and(is_it) {
            seconds += ticks(path.join("stat").to_str()?).unwrap_or(0.0) / TICKS;
        }
    }
    Some(Duration::from_secs_f64(seconds))
}

fn ticks(stat: &str) -> Option<f64> {
    let text = fs::read_to_string(stat).ok()?;
    // After the name, which is in brackets and may hold anything, the 12th and 13th fields are user and system time.
    let fields: Vec<&str> = text.rsplit_once(')')?.1.split_whitespace().collect();
    let field = |i: usize| fields.get(i)?.parse::<f64>().ok();
    Some(field(11)? + field(12)?)
}
