//! The status line in words.

use crate::config::{Method, ShadowEdges};
use crate::link::LinkStatus;
use crate::stats::FrameStats;

/// What the status line is made from.
pub(super) struct Figures<'a> {
    /// From one frame to the next, seconds.
    pub(super) interval_s: f64,
    /// What a frame takes, ms.
    pub(super) cost_ms: f64,
    /// Pixels of the picture.
    pub(super) pixels: usize,
    /// Of the last frame.
    pub(super) stats: &'a FrameStats,
    /// The servers.
    pub(super) servers: &'a LinkStatus,
    /// How pixels are reconstructed; nothing if every pixel is traced.
    pub(super) method: Option<Method>,
    /// Which edges of shadows there are.
    pub(super) shadow_edges: ShadowEdges,
    /// No samples are taken in.
    pub(super) frozen: bool,
    /// No samples are asked for.
    pub(super) paused: bool,
    /// Nothing is left to ask for.
    pub(super) settled: bool,
}

impl Figures<'_> {
    /// The status line's items, most telling first.
    pub(super) fn tell(&self) -> Vec<String> {
        let share = |n: usize| n as f64 * 100.0 / self.pixels.max(1) as f64;
        let frames = if self.settled {
            format!("{:.1} ms a frame", self.cost_ms)
        } else {
            let rate = 1.0 / self.interval_s.max(1e-3);
            format!("{rate:.0} frames/s, {:.1} ms", self.cost_ms)
        };
        let mut items = vec![
            frames,
            format!("{} samples/s", short(self.servers.samples_per_second)),
            format!(
                "{:.0}% of pixels sampled",
                share(self.stats.samples_visible)
            ),
            tell_servers(self.servers),
        ];
        match self.method {
            None => items.push("every pixel ray-traced".into()),
            Some(method) => {
                items.push(tell_method(method).into());
                let kinds = self.stats.pixels;
                if method != Method::PointsOnly {
                    let drawn = self.stats.shadow_edges;
                    items.push(tell_shadows(self.shadow_edges, drawn));
                }
                items.push(format!(
                    "{} edges, pixels {:.1}% simple {:.1}% complex",
                    self.stats.silhouette_edges + self.stats.shadow_edges,
                    share(kinds.simple),
                    share(kinds.complex)
                ));
            }
        }
        let states = [
            (self.frozen, "points frozen"),
            (self.paused, "paused"),
            (self.settled, "settled"),
        ];
        items.extend(states.iter().filter(|s| s.0).map(|s| s.1.to_owned()));
        items
    }
}

fn tell_method(method: Method) -> &'static str {
    match method {
        Method::EdgeAndPoint => "edge-and-point",
        Method::NoComplex => "no-complex",
        Method::PointsOnly => "points-only",
        Method::Full => "full",
        Method::Reference => "reference",
    }
}

fn tell_shadows(which: ShadowEdges, drawn: usize) -> String {
    match which {
        ShadowEdges::Off => "no shadow edges".into(),
        ShadowEdges::All => format!("all shadow edges ({drawn})"),
        ShadowEdges::Chosen => format!("chosen shadow edges ({drawn})"),
    }
}

fn tell_servers(status: &LinkStatus) -> String {
    match (status.connected, &status.last_fault) {
        (0, None) => "connecting to the shader server".into(),
        (0, Some(why)) => format!("no shader server: reconnecting ({why})"),
        (1, _) if status.servers == 1 => "1 shader server".into(),
        (n, _) => format!("{n} of {} shader servers", status.servers),
    }
}

/// A count with three digits or so.
fn short(n: f64) -> String {
    if n < 1e4 {
        format!("{n:.0}")
    } else if n < 1e6 {
        format!("{:.0}k", n / 1e3)
    } else {
        format!("{:.2}M", n / 1e6)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn servers_are_told_in_words() {
        let mut status = LinkStatus {
            servers: 1,
            ..LinkStatus::default()
        };
        assert_eq!(tell_servers(&status), "connecting to the shader server");
        status.last_fault = Some("it closed the connection".into());
        assert_eq!(
            tell_servers(&status),
            "no shader server: reconnecting (it closed the connection)"
        );
        status.connected = 1;
        assert_eq!(tell_servers(&status), "1 shader server");
        status.servers = 3;
        assert_eq!(tell_servers(&status), "1 of 3 shader servers");
        assert_eq!(
            [short(950.0), short(41_234.0), short(2e6)],
            ["950", "41k", "2.00M"]
        );
    }

    #[test]
    fn states_are_told_after_the_figures() {
        let mut figures = Figures {
            interval_s: 0.02,
            cost_ms: 8.25,
            pixels: 1000,
            stats: &FrameStats {
                samples_visible: 250,
                shadow_edges: 7,
                ..FrameStats::default()
            },
            servers: &LinkStatus::default(),
            method: Some(Method::NoComplex),
            shadow_edges: ShadowEdges::All,
            frozen: true,
            paused: true,
            settled: false,
        };
        let line = figures.tell().join(", ");
        for part in [
            "50 frames/s, 8.2 ms",
            "25% of pixels",
            "no-complex",
            "all shadow edges (7)",
            "points frozen, paused",
        ] {
            assert!(line.contains(part), "{part}: {line}");
        }
        (figures.method, figures.settled) = (None, true);
        let line = figures.tell().join(", ");
        assert!(line.contains("every pixel ray-traced") && line.ends_with("settled"));
        assert!(!line.contains("frames/s") && !line.contains("edges"));
    }
}
