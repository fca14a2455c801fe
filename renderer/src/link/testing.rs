//! Shader servers that run in the test's own process and do as they are told.

use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

use protocol::ToServer;
use protocol::framing::server_side;
use protocol::messages::{Camera, Capabilities, Sample, SampleRequest, ToDisplay, Triple};
use protocol::scene::{Light, Material, Mesh, Model, Object, Scene, Shading};
use protocol::session::{ServerEvent, ServerSession};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::oneshot;

use super::face::{Link, LinkConfig, ServerSource};

pub(super) fn scene(objects: usize) -> Scene {
    let object = |i| Object {
        name: format!("object {i}"),
        mesh: 0,
        material: 0,
        transform: [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
        ],
        crease_angle: 85.0,
    };
    let material = Material {
        name: "grey".into(),
        diffuse: [0.5; 3],
        diffuse_map: None,
        specular: [0.0; 3],
        roughness: 1.0,
    };
    Scene {
        shading: Shading {
            model: Model::Direct,
            ambient: [0.0; 3],
            background: [0.0; 3],
        },
        lights: vec![Light::Point {
            position: [0.0; 3],
            intensity: [1.0; 3],
        }],
        materials: vec![material],
        textures: vec![],
        meshes: vec![Mesh::default()],
        objects: (0..objects).map(object).collect(),
    }
}

pub(super) fn camera() -> Camera {
    Camera {
        eye: [0.0, 0.0, 3.0],
        target: [0.0; 3],
        up: [0.0, 1.0, 0.0],
        fov_y: 45.0,
        width: 64,
        height: 64,
    }
}

pub(super) fn requests(ids: std::ops::Range<u64>) -> Vec<SampleRequest> {
    ids.map(|id| SampleRequest {
        id,
        x: (id % 64) as u16,
        y: 5,
        offset: [0.5; 2],
    })
    .collect()
}

/// How a server behaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Fate {
    /// By the rules.
    Honest,
    /// Every radiance is not a number.
    Nan,
    /// Answers nothing after `SceneReady`, pings neither.
    Mute,
    /// Holds requests until they are cancelled.
    Hold,
    /// Closes the connection after so many samples.
    CloseAfter(usize),
    /// Answers a request twice.
    Twice,
    /// Keeps its answers back until something moves.
    Late,
    /// Takes so many milliseconds for each sample, one after another.
    Slow(u64),
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Behaviour {
    pub(super) fate: Fate,
    pub(super) credits: u32,
    pub(super) max_batch: u32,
    pub(super) edits: bool,
}

pub(super) const HONEST: Behaviour = Behaviour {
    fate: Fate::Honest,
    credits: 300,
    max_batch: 70,
    edits: true,
};

/// How a server is to end.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stop {
    /// At once.
    Now,
    /// When every display has closed its connection.
    WhenLeft,
}

/// A server on a loopback port of its own; ends when dropped.
pub(super) struct FakeServer {
    pub(super) address: String,
    log: Arc<Mutex<Vec<ToServer>>>,
    stop: Option<oneshot::Sender<Stop>>,
    thread: Option<JoinHandle<()>>,
}

impl FakeServer {
    pub(super) fn start(behaviour: Behaviour) -> Self {
        Self::start_at("127.0.0.1:0", behaviour)
    }

    /// The same at an address.
    pub(super) fn start_at(place: &str, behaviour: Behaviour) -> Self {
        let place = place.to_owned();
        let log = Arc::new(Mutex::new(Vec::new()));
        let (stop, stopped) = oneshot::channel();
        let (say, hear) = std::sync::mpsc::channel();
        let for_thread = Arc::clone(&log);
        let thread = std::thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_current_thread()
                .enable_all()
                .build()
                .unwrap();
            runtime.block_on(async move {
                let listener = TcpListener::bind(place).await.unwrap();
                say.send(listener.local_addr().unwrap().to_string())
                    .unwrap();
                let mut open = tokio::task::JoinSet::new();
                let accept = async {
                    loop {
                        let (stream, _) = listener.accept().await.unwrap();
                        open.spawn(serve(stream, behaviour, Arc::clone(&for_thread)));
                    }
                };
                let stop = tokio::select! {
                    stop = stopped => stop,
                    () = accept => unreachable!("a server accepts for good"),
                };
                if stop == Ok(Stop::WhenLeft) {
                    open.join_all().await;
                }
            });
        });
        Self {
            address: hear.recv().unwrap(),
            log,
            stop: Some(stop),
            thread: Some(thread),
        }
    }

    pub(super) fn source(&self) -> ServerSource {
        ServerSource::Connect(self.address.clone())
    }

    /// Everything received so far.
    pub(super) fn log(&self) -> Vec<ToServer> {
        self.log.lock().unwrap().clone()
    }

    /// Everything received until the displays closed their connections, which they must.
    pub(super) fn log_of_all(mut self) -> Vec<ToServer> {
        self.end(Stop::WhenLeft);
        self.log()
    }

    fn end(&mut self, stop: Stop) {
        self.stop.take().map(|tell| tell.send(stop));
        self.thread.take().map(JoinHandle::join);
    }

    /// Requests received so far.
    pub(super) fn asked(&self) -> usize {
        let count = |message: &ToServer| match message {
            ToServer::Request { samples, .. } => samples.len(),
            _ => 0,
        };
        self.log().iter().map(count).sum()
    }
}

impl Drop for FakeServer {
    fn drop(&mut self) {
        self.end(Stop::Now);
    }
}

/// A link to these servers.
pub(super) fn link_to(servers: &[&FakeServer]) -> Link {
    link_with(servers, LinkConfig::new(vec![], 7))
}

/// A link to these servers with other settings.
pub(super) fn link_with(servers: &[&FakeServer], mut config: LinkConfig) -> Link {
    config.servers = servers.iter().map(|server| server.source()).collect();
    Link::start(config, Arc::new(scene(2))).unwrap()
}

/// What every server makes of a request.
pub(super) fn answer(seed: u64, id: u64) -> Sample {
    let bits = (id ^ seed.rotate_left(32)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let radiance = [bits >> 40, bits >> 50, bits & 0xff].map(|b| b as f32);
    Sample {
        id,
        position: [id as f32, 0.0, 0.0],
        object: 0,
        radiance,
        flags: 0,
    }
}

/// The triple that every server meets when it answers a request.
fn triple_of(id: u64) -> Triple {
    Triple {
        light: 0,
        blocker: 0,
        receiver: (id % 2) as u32,
    }
}

fn offer(behaviour: &Behaviour) -> Capabilities {
    Capabilities {
        credits: behaviour.credits,
        max_batch: behaviour.max_batch,
        triples: true,
        edits: behaviour.edits,
        threads: 1,
    }
}

pub(super) async fn serve(stream: TcpStream, behaviour: Behaviour, log: Arc<Mutex<Vec<ToServer>>>) {
    stream.set_nodelay(true).unwrap();
    let (mut receiver, mut sender) = server_side(stream);
    let offer = offer(&behaviour);
    let mut session = ServerSession::new(offer.clone(), vec![], 1 << 30);
    let (mut seed, mut sent, mut epoch, mut ready) = (0, 0, 0, false);
    let mut late = Vec::new();
    while let Ok(Some(message)) = receiver.receive().await {
        log.lock().unwrap().push(message.clone());
        if ready && behaviour.fate == Fate::Mute {
            continue;
        }
        let mut replies = Vec::new();
        match session.receive(message) {
            Err(violation) => {
                let _ = sender.send(&violation.to_display()).await;
                return;
            }
            Ok(ServerEvent::Hello {
                version,
                seed: given,
                ..
            }) => {
                seed = given;
                let (name, shader) = ("fake".into(), "test".into());
                let capabilities = offer.clone();
                replies.push(ToDisplay::Welcome {
                    version,
                    name,
                    shader,
                    capabilities,
                    holds: vec![],
                });
            }
            Ok(ServerEvent::Scene(digest, assembler)) => {
                session.scene_built(&assembler.finish().unwrap());
                replies.push(ToDisplay::SceneReady { digest });
                ready = true;
            }
            Ok(ServerEvent::Request { view, samples, .. }) if behaviour.fate != Fate::Hold => {
                let triples = samples
                    .iter()
                    .map(|request| triple_of(request.id))
                    .collect();
                replies.push(ToDisplay::Triples { epoch, triples });
                let mut samples: Vec<_> = samples
                    .iter()
                    .rev()
                    .map(|request| answer(seed, request.id))
                    .collect();
                samples.retain(|sample| session.release(sample.id));
                match behaviour.fate {
                    Fate::Nan => samples[0].radiance[1] = f32::NAN,
                    Fate::Twice => samples.push(samples[0]),
                    Fate::CloseAfter(most) => samples.truncate(most - sent),
                    _ => {}
                }
                sent += samples.len();
                replies.push(ToDisplay::Samples {
                    view,
                    epoch,
                    samples,
                });
                if behaviour.fate == Fate::Late && epoch == 0 {
                    late.append(&mut replies);
                }
            }
            Ok(ServerEvent::Edit { epoch: now, .. }) => {
                epoch = now;
                replies.append(&mut late);
            }
            Ok(ServerEvent::Cancel { views_before }) => replies.push(ToDisplay::Status {
                queued: 0,
                traced: 0,
                rays: 0,
                cancelled_before: views_before,
            }),
            Ok(ServerEvent::Ping { token }) => replies.push(ToDisplay::Pong { token }),
            Ok(ServerEvent::Goodbye(_)) => return,
            Ok(_) => {}
        }
        for reply in &replies {
            if let (Fate::Slow(ms), ToDisplay::Samples { samples, .. }) = (behaviour.fate, reply) {
                let all = std::time::Duration::from_millis(ms * samples.len() as u64);
                tokio::time::sleep(all).await;
            }
            if sender.send(reply).await.is_err() {
                return;
            }
        }
        if behaviour.fate == Fate::CloseAfter(sent) {
            return;
        }
    }
}
