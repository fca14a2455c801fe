//! Samples a second with one, two and four shader servers of fixed speed against as many times that of one, and the
//! processor time that a sample costs the display. The servers sleep instead of tracing, so that two cores suffice.

mod sleeper;
mod threads;

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use clap::Parser;
use protocol::messages::{Camera, SampleRequest};
use protocol::scene::{Material, Mesh, Model, Object, Scene, Shading};
use renderer::link::{Link, LinkConfig, ServerSource};

pub use sleeper::Sleeper;

/// Side of the picture that is asked for, pixels.
const SIDE: u32 = 512;
/// How often the display looks, as one that draws would.
const FRAME: Duration = Duration::from_millis(16);
/// How much is kept asked for, seconds of what all servers do.
const AHEAD_S: f64 = 0.3;
/// Time before counting starts.
const WARM_UP: Duration = Duration::from_secs(1);

/// Measures how samples a second grow with the number of shader servers.
#[derive(Debug, Parser)]
#[command(name = "scaling")]
struct Args {
    /// Numbers of servers
    #[arg(long, num_args = 1.., default_values_t = [1, 2, 4], value_name = "N")]
    servers: Vec<usize>,
    /// Samples a second of each server
    #[arg(long, default_value_t = 2000.0, value_name = "RATE")]
    speed: f64,
    /// The last server has this share of the speed of the others
    #[arg(long, default_value_t = 1.0, value_name = "SHARE")]
    last: f64,
    /// Seconds of each measurement
    #[arg(long, default_value_t = 5.0, value_name = "S")]
    seconds: f64,
    /// Measurements of each number, of which the median is told
    #[arg(long, default_value_t = 3, value_name = "N")]
    runs: usize,
}

/// What came in a measurement.
#[derive(Clone, Copy, Debug)]
pub struct Measured {
    /// Samples a second.
    pub rate: f64,
    /// The same as a share of what the servers can do together.
    pub share: f64,
    /// Processor time of the display's two threads for each sample, microseconds; where the system tells it.
    pub cost_us: Option<f64>,
    /// Samples that two servers answered, as a share of all.
    pub twice: f64,
}

/// Reads the command line and prints a line for each number of servers, and what a sample costs where servers answer at once.
///
/// # Errors
/// If there are no servers to be had, or a measurement brings nothing.
pub fn run() -> Result<()> {
    let args = Args::parse();
    let time = Duration::from_secs_f64(args.seconds.clamp(0.1, 3600.0));
    for &count in &args.servers {
        let mut speeds = vec![args.speed; count];
        if let Some(last) = speeds.last_mut() {
            *last *= args.last;
        }
        let of = median(args.runs, || measure(&speeds, time))?;
        println!(
            "{count} servers: {:.0} samples/s, {:.3} of ideal, {:.4} asked twice{}",
            of.rate,
            of.share,
            of.twice,
            cost(of)
        );
    }
    let at_once = median(args.runs, || measure(&[f64::INFINITY], time))?;
    println!(
        "answered at once: {:.0} samples/s{}",
        at_once.rate,
        cost(at_once)
    );
    Ok(())
}

fn cost(of: Measured) -> String {
    of.cost_us.map_or_else(String::new, |us| {
        format!(", {us:.2} us of the display's processor time a sample")
    })
}

fn median(runs: usize, mut measured: impl FnMut() -> Result<Measured>) -> Result<Measured> {
    let mut all = (0..runs.max(1))
        .map(|_| measured())
        .collect::<Result<Vec<_>>>()?;
    all.sort_by(|a, b| a.rate.total_cmp(&b.rate));
    Ok(all[all.len() / 2])
}

/// Keeps servers of these speeds, samples a second each, busy for a while.
///
/// # Errors
/// If a server cannot be started or answers nothing.
pub fn measure(speeds: &[f64], time: Duration) -> Result<Measured> {
    let servers = speeds
        .iter()
        .map(|&speed| Sleeper::start(speed))
        .collect::<std::io::Result<Vec<_>>>()
        .context("cannot start a server")?;
    let sources = servers.iter().map(|s| s.address().to_string());
    let config = LinkConfig::new(sources.map(ServerSource::Connect).collect(), 1);
    let mut link = Link::start(config, Arc::new(scene()))?;
    let ideal: f64 = speeds.iter().sum();
    let ahead = if ideal.is_finite() {
        (ideal * AHEAD_S) as usize
    } else {
        1 << 16
    };
    let view = link.set_view(camera())?;
    let (mut samples, mut triples) = (Vec::new(), Vec::new());
    let mut asking = Asking::default();
    let start = Instant::now();
    let mut counted: Option<(Instant, u64, u64, Option<Duration>)> = None;
    loop {
        samples.clear();
        link.drain(&mut samples, &mut triples);
        let status = link.status();
        let now = Instant::now();
        if counted.is_none() && now - start >= WARM_UP && status.connected == speeds.len() {
            counted = Some((now, status.samples, status.late, threads::own_and("link")));
        }
        if let Some((from, before, late, cpu)) = counted
            && now - from >= time
        {
            let count = status.samples - before;
            ensure!(count > 0, "no samples came");
            let rate = count as f64 / (now - from).as_secs_f64();
            let spent = cpu.zip(threads::own_and("link")).map(|(a, b)| b - a);
            return Ok(Measured {
                rate,
                share: rate / ideal,
                cost_us: spent.map(|spent| spent.as_secs_f64() * 1e6 / count as f64),
                twice: (status.late - late) as f64 / count as f64,
            });
        }
        ensure!(
            now - start < time + Duration::from_secs(60),
            "the servers do not answer"
        );
        let pending = status.queued + status.outstanding;
        link.request(view, asking.next(ahead.saturating_sub(pending)))?;
        if ideal.is_finite() {
            std::thread::sleep(FRAME);
        } else {
            std::thread::yield_now();
        }
    }
}

/// Requests with ids that grow.
#[derive(Default)]
struct Asking {
    id: u64,
    batch: Vec<SampleRequest>,
}

impl Asking {
    fn next(&mut self, count: usize) -> &[SampleRequest] {
        self.batch.clear();
        for _ in 0..count {
            let place = self.id % u64::from(SIDE * SIDE);
            self.batch.push(SampleRequest {
                id: self.id,
                x: (place % u64::from(SIDE)) as u16,
                y: (place / u64::from(SIDE)) as u16,
                offset: [0.5; 2],
            });
            self.id += 1;
        }
        &self.batch
    }
}

fn camera() -> Camera {
    Camera {
        eye: [0.0, 0.0, 3.0],
        target: [0.0; 3],
        up: [0.0, 1.0, 0.0],
        fov_y: 45.0,
        width: SIDE,
        height: SIDE,
    }
}

fn scene() -> Scene {
    let material = Material {
        name: "grey".into(),
        diffuse: [0.5; 3],
        diffuse_map: None,
        specular: [0.0; 3],
        roughness: 1.0,
    };
    let object = Object {
        name: "nothing".into(),
        mesh: 0,
        material: 0,
        transform: [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
        ],
        crease_angle: 85.0,
    };
    Scene {
        shading: Shading {
            model: Model::Direct,
            ambient: [0.0; 3],
            background: [0.0; 3],
        },
        lights: vec![],
        materials: vec![material],
        textures: vec![],
        meshes: vec![Mesh::default()],
        objects: vec![object],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_servers_do_nearly_twice_as_much_as_one() {
        let time = Duration::from_secs(1);
        let two = measure(&[500.0, 500.0], time).unwrap();
        // A loaded machine wakes sleepers late; what it costs is measured by the program, not here.
        assert!(two.share > 0.6 && two.share < 1.2, "{two:?}");
    }
}
