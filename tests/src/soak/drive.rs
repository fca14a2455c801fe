//! The session itself.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Context;
use protocol::messages::{Camera, LightMove, ObjectMove};
use protocol::scene::Light;
use renderer::camera::View;
use renderer::config::Choices;
use renderer::frame::{Display, Edit, Received, Wanted};
use renderer::link::{Link, LinkConfig, LinkStatus, ReceivedSample, ServerSource};
use renderer::show::{Show, Stages, show};
use renderer::tone::ToneMap;
use scenes::LoadedScene;

use super::Args;
use super::measure::resident_kib;
use super::servers::Server;

const SIZE_PX: u32 = 256;
/// 2 % of the pixels.
const SAMPLES: usize = 1311;
/// Between a kill and the restart.
const PAUSE: Duration = Duration::from_millis(500);
/// For the last answers to come.
const REST: Duration = Duration::from_secs(20);

/// What all runs have in common.
pub(super) struct Drive {
    scene: LoadedScene,
    program: PathBuf,
    length: Duration,
    frame: Duration,
}

/// Memory in use at some time of a run, KiB.
pub(super) struct Memory {
    pub(super) at: Duration,
    pub(super) display: u64,
    pub(super) servers: [u64; 2],
}

/// What a run was like.
pub(super) struct Driven {
    pub(super) kills: Vec<Duration>,
    /// When each frame began, and how long it took, milliseconds.
    pub(super) frames: Vec<(Duration, f64)>,
    pub(super) memory: Vec<Memory>,
    pub(super) edits: usize,
    pub(super) asked: u64,
    pub(super) status: LinkStatus,
    pub(super) slowest_return: Duration,
    pub(super) longest_gap: Duration,
}

impl Driven {
    /// Requests of which nobody knows what became.
    pub(super) fn lost(&self) -> i64 {
        self.asked as i64 - (self.status.samples + self.status.dropped) as i64
    }
}

impl Drive {
    pub(super) fn new(args: &Args) -> anyhow::Result<Self> {
        let beside = || {
            let own = std::env::current_exe()?;
            Ok::<_, std::io::Error>(own.with_file_name("shader-server"))
        };
        let program = match &args.shader_server {
            Some(program) => program.clone(),
            None => beside().context("where is the shader server? name it with --shader-server")?,
        };
        Ok(Self {
            scene: scenes::open(&args.scene)?,
            program,
            length: Duration::from_secs_f64(args.minutes * 60.0),
            frame: Duration::from_secs_f64(1.0 / args.pace),
        })
    }

    /// Draws for the time given, with a server killed so often if at all.
    pub(super) fn run(&self, kill_every: Option<Duration>) -> anyhow::Result<Driven> {
        let servers = [Server::start(&self.program)?, Server::start(&self.program)?];
        let sources = servers
            .iter()
            .map(|s| ServerSource::Connect(s.address.clone()));
        let config = LinkConfig::new(sources.collect(), 1);
        let link = Link::start(config, Arc::new(self.scene.scene.clone()))?;
        let mut session = Session::new(self, link, servers, kill_every);
        session.first_samples()?;
        let start = Instant::now();
        let mut next = start;
        while start.elapsed() < self.length {
            session.attend(start.elapsed())?;
            session.frame(start.elapsed())?;
            next += self.frame;
            std::thread::sleep(next.saturating_duration_since(Instant::now()));
        }
        session.rest();
        Ok(session.driven)
    }
}

/// A run that is going on.
struct Session<'a> {
    drive: &'a Drive,
    link: Link,
    servers: [Server; 2],
    display: Display,
    tone: ToneMap,
    view: View,
    number: u32,
    wanted: Wanted,
    samples: Vec<ReceivedSample>,
    received: Vec<Received>,
    shown: Vec<u32>,
    kill_every: Option<Duration>,
    /// The server that is down or not back yet: its number, and since when it runs again.
    away: Option<(usize, Option<Duration>)>,
    samples_at_kill: u64,
    last_sample: Duration,
    driven: Driven,
}

impl<'a> Session<'a> {
    fn new(
        drive: &'a Drive,
        link: Link,
        servers: [Server; 2],
        kill_every: Option<Duration>,
    ) -> Self {
        let scene = &drive.scene.scene;
        let camera = &drive.scene.camera;
        let view = View::new(&Camera {
            eye: camera.eye,
            target: camera.target,
            up: camera.up,
            fov_y: camera.fov_y,
            width: SIZE_PX,
            height: SIZE_PX,
        });
        Self {
            display: Display::new(scene, Choices::default(), SIZE_PX, SIZE_PX, 1),
            drive,
            link,
            servers,
            tone: ToneMap::new(),
            view,
            number: 0,
            wanted: Wanted::default(),
            samples: Vec::new(),
            received: Vec::new(),
            shown: Vec::new(),
            kill_every,
            away: None,
            samples_at_kill: 0,
            last_sample: Duration::ZERO,
            driven: Driven {
                kills: Vec::new(),
                frames: Vec::new(),
                memory: Vec::new(),
                edits: 0,
                asked: 0,
                status: LinkStatus::default(),
                slowest_return: Duration::ZERO,
                longest_gap: Duration::ZERO,
            },
        }
    }

    /// Until both servers are there.
    fn first_samples(&mut self) -> anyhow::Result<()> {
        self.number = self.link.set_view(self.view.camera())?;
        self.display.begin(&self.view, self.number);
        self.display.plan_first(SAMPLES, &mut self.wanted);
        self.ask()?;
        let start = Instant::now();
        while self.link.status().connected < self.servers.len() {
            anyhow::ensure!(start.elapsed() < REST, "the servers are not reached");
            std::thread::sleep(Duration::from_millis(5));
        }
        Ok(())
    }

    fn ask(&mut self) -> anyhow::Result<()> {
        let taken = self.link.request(self.number, &self.wanted.here)?;
        self.driven.asked += taken as u64;
        Ok(())
    }

    /// One frame, as the display's own loop draws it.
    fn frame(&mut self, now: Duration) -> anyhow::Result<()> {
        let begun = Instant::now();
        self.take_in(now);
        self.display.update_shadows(false);
        self.display.receive(&self.received, self.number);
        self.display.draw(&self.view, self.number);
        let (tone, shown) = (&self.tone, &mut self.shown);
        self.display
            .time_present(|display| show(Show::Picture, &Stages::of(display), tone, shown));
        self.display.plan(SAMPLES, None, &mut self.wanted);
        self.ask()?;
        let ms = begun.elapsed().as_secs_f64() * 1e3;
        self.driven.frames.push((now, ms));
        Ok(())
    }

    fn take_in(&mut self, now: Duration) {
        let mut triples = Vec::new();
        self.link.drain(&mut self.samples, &mut triples);
        self.display.learn(&triples);
        self.received.clear();
        self.received
            .extend(self.samples.drain(..).map(|r| Received {
                view: r.view,
                epoch: r.epoch,
                sample: r.sample,
                texel: r.texel,
            }));
        if !self.received.is_empty() {
            let gap = now.saturating_sub(self.last_sample);
            self.driven.longest_gap = self.driven.longest_gap.max(gap);
            self.last_sample = now;
        }
    }

    /// What happens between frames: edits each second, memory looked at, servers killed and restarted.
    fn attend(&mut self, now: Duration) -> anyhow::Result<()> {
        if now.as_secs() as usize > self.driven.edits {
            self.edit()?;
            self.driven.memory.push(Memory {
                at: now,
                display: resident_kib(std::process::id()),
                servers: self.servers.each_ref().map(|s| resident_kib(s.id())),
            });
        }
        let Some(every) = self.kill_every else {
            return Ok(());
        };
        match self.away {
            None if now > every * (self.driven.kills.len() as u32 + 1) => {
                let server = self.driven.kills.len() % 2;
                self.servers[server].kill()?;
                self.samples_at_kill = self.samples_from(server);
                self.driven.kills.push(now);
                self.away = Some((server, None));
            }
            Some((server, None)) if now > self.last_kill() + PAUSE => {
                self.servers[server].restart()?;
                self.away = Some((server, Some(now)));
            }
            Some((server, Some(since))) if self.is_back(server) => {
                self.driven.slowest_return = self.driven.slowest_return.max(now - since);
                self.away = None;
            }
            _ => {}
        }
        Ok(())
    }

    fn last_kill(&self) -> Duration {
        self.driven.kills.last().copied().unwrap_or_default()
    }

    /// Whether samples come from it again.
    fn is_back(&self, server: usize) -> bool {
        let samples = self.samples_from(server);
        // A server that comes back may be counted anew.
        samples > self.samples_at_kill || (0 < samples && samples < self.samples_at_kill)
    }

    fn samples_from(&self, server: usize) -> u64 {
        let servers = self.link.servers();
        let place = &self.servers[server].address;
        let found = servers.iter().find(|status| *status.place == **place);
        found.map_or(0, |status| status.samples)
    }

    /// Moves the first object to and fro, and makes the first light brighter and darker.
    fn edit(&mut self) -> anyhow::Result<()> {
        self.driven.edits += 1;
        let odd = self.driven.edits % 2 == 1;
        let scene = &self.drive.scene.scene;
        let mut edit = Edit::default();
        if let Some(object) = scene.objects.first() {
            let mut transform = object.transform;
            transform[0][3] += if odd { 0.3 } else { 0.0 };
            edit.objects.push(ObjectMove {
                object: 0,
                transform,
            });
        }
        if let Some(light) = scene.lights.first() {
            let mut value = light.clone();
            let power = match &mut value {
                Light::Point { intensity, .. } | Light::Linear { intensity, .. } => intensity,
                Light::Area { radiance, .. } => radiance,
            };
            *power = power.map(|c| if odd { c * 0.7 } else { c });
            edit.lights.push(LightMove { light: 0, value });
        }
        let epoch = self.link.edit(&edit.objects, &edit.lights)?;
        self.display.edit(epoch, &edit);
        Ok(())
    }

    /// Asks for nothing more until everything is answered; what is still open then is lost.
    fn rest(&mut self) {
        let mut triples = Vec::new();
        self.link.wait(REST, &mut self.samples, &mut triples);
        self.driven.status = self.link.status();
    }
}
