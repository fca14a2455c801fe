//! What the figures were measured on: processor, its clock, memory, compiler settings and commit.

use std::fs;
use std::hint::black_box;
use std::path::Path;
use std::process::Command;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// Latency of a 64-bit integer multiplication on x86-64 cores since 2008 (Intel Nehalem, AMD Zen), cycles.
const MULTIPLY_LATENCY_CYCLES: f64 = 3.0;

/// The machine and the build.
#[derive(Debug, Clone)]
pub struct Machine {
    /// The processor's name.
    pub cpu: String,
    /// Logical processors that this process may use.
    pub cores: usize,
    /// Installed memory, GiB, where the system tells.
    pub memory_gib: Option<f64>,
    /// System and architecture.
    pub system: String,
    /// Core clock, GHz, and how it was found; none where it cannot be told.
    pub clock: Option<Clock>,
    /// Commit of the checkout, with "+ changes" when files differ from it.
    pub commit: String,
    /// Seconds since 1970.
    pub unix_time: u64,
}

/// A core's clock.
#[derive(Debug, Clone)]
pub struct Clock {
    /// Cycles a nanosecond.
    pub ghz: f64,
    /// How it was derived, one sentence.
    pub derivation: String,
}

impl Machine {
    /// Looks at the machine; `checkout` is a folder inside the repository.
    pub fn look(checkout: &Path) -> Self {
        let cpu_info = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        Self {
            cpu: field(&cpu_info, "model name")
                .unwrap_or("unknown")
                .to_owned(),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            memory_gib: memory_gib(),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            clock: clock(&cpu_info),
            commit: commit(checkout),
            unix_time: SystemTime::now()
                .duration_since(UNIX_EPOCH)
                .map_or(0, |d| d.as_secs()),
        }
    }
}

/// Value of the first line `key : value`.
fn field<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    text.lines()
        .filter_map(|line| line.split_once(':'))
        .find(|(name, _)| name.trim() == key)
        .map(|(_, value)| value.trim())
}

fn memory_gib() -> Option<f64> {
    let info = fs::read_to_string("/proc/meminfo").ok()?;
    let kib: f64 = field(&info, "MemTotal")?
        .strip_suffix("kB")?
        .trim()
        .parse()
        .ok()?;
    Some(kib / (1024.0 * 1024.0))
}

fn clock(cpu_info: &str) -> Option<Clock> {
    let told = field(cpu_info, "cpu MHz").and_then(|mhz| mhz.parse::<f64>().ok());
    let told_text = told.map_or_else(String::new, |mhz| {
        format!("; the system's figure is {:.2} GHz", mhz / 1000.0)
    });
    if cfg!(target_arch = "x86_64") {
        return Some(Clock {
            ghz: measured_ghz(),
            derivation: format!(
                "core clock, from the fastest of 15 timed chains of dependent 64-bit multiplications, 3 cycles each{told_text}"
            ),
        });
    }
    told.map(|mhz| Clock {
        ghz: mhz / 1000.0,
        derivation: "the system's figure".to_owned(),
    })
}

/// Each square waits for the one before, so a chain takes its length times the latency, whatever else the core can do.
fn measured_ghz() -> f64 {
    const CHAIN: u32 = 2_000_000;
    let fastest_ns = (0..15)
        .map(|_| {
            let start = Instant::now();
            let mut value = black_box(0x9E37_79B9_7F4A_7C15_u64);
            for _ in 0..CHAIN {
                value = value.wrapping_mul(value);
            }
            black_box(value);
            start.elapsed().as_nanos() as f64
        })
        .fold(f64::INFINITY, f64::min);
    f64::from(CHAIN) * MULTIPLY_LATENCY_CYCLES / fastest_ns
}

fn commit(checkout: &Path) -> String {
    let git = |args: &[&str]| {
        let output = Command::new("git")
            .arg("-C")
            .arg(checkout)
            .args(args)
            .output()
            .ok()?;
        output
            .status
            .success()
            .then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let Some(hash) = git(&["rev-parse", "--short=12", "HEAD"]) else {
        return "unknown".to_owned();
    };
    match git(&["status", "--porcelain", "--untracked-files=no"]) {
        Some(changes) if changes.is_empty() => hash,
        _ => format!("{hash} + changes"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_found_by_their_exact_name() {
        let text = "processor\t: 0\nmodel name\t: Fast One\ncpu MHz\t\t: 2600.1\n";
        assert_eq!(field(text, "model name"), Some("Fast One"));
        assert_eq!(field(text, "model"), None);
    }

    #[test]
    fn the_measured_clock_is_one_a_processor_may_have() {
        let ghz = measured_ghz();
        assert!((0.1..10.0).contains(&ghz), "{ghz}");
    }
}
