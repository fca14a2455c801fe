//! A server in this process, a display that talks to it, and small scenes.
#![allow(dead_code, missing_docs, unreachable_pub, clippy::unwrap_used)]

use std::{collections::HashMap, net::SocketAddr, num::NonZeroUsize, sync::Arc};

use glam::Vec3;
pub use protocol::scene::Scene;
use protocol::{
    framing::{Receiver, Sender, display_side},
    handshake::hello,
    messages::*,
    scene::{Affine, Light, Material, Mesh, Model, Object, Shading},
    session::{DisplayEvent, DisplaySession, SceneSize},
    transfer::EncodedScene,
};
use rays::Ray;
use shader_server::{Entrance, ServerConfig, Shader, Stage, run, shadows::ShadowRays};
use tokio::{
    io::{ReadHalf, WriteHalf},
    net::{TcpListener, TcpStream},
    sync::oneshot,
};

pub const AT_ORIGIN: Affine = [[1., 0., 0., 0.], [0., 1., 0., 0.], [0., 0., 1., 0.]];

pub fn moved(x: f32, y: f32, z: f32) -> Affine {
    [[1., 0., 0., x], [0., 1., 0., y], [0., 0., 1., z]]
}

/// A square of half-size `half` in the plane y = 0, facing up.
pub fn square(half: f32) -> Mesh {
    Mesh {
        positions: vec![
            [-half, 0., -half],
            [-half, 0., half],
            [half, 0., half],
            [half, 0., -half],
        ],
        faces: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

pub fn object(name: &str, mesh: u32, transform: Affine) -> Object {
    Object {
        name: name.into(),
        mesh,
        material: 0,
        transform,
        crease_angle: 85.,
    }
}

pub fn scene(lights: Vec<Light>, meshes: Vec<Mesh>, objects: Vec<Object>) -> Scene {
    Scene {
        shading: Shading {
            model: Model::Direct,
            ambient: [0.; 3],
            background: [0.25, 0.5, 1.],
        },
        lights,
        materials: vec![Material {
            name: "grey".into(),
            diffuse: [0.5; 3],
            diffuse_map: None,
            specular: [0.; 3],
            roughness: 0.5,
        }],
        textures: vec![],
        meshes,
        objects,
    }
}

/// A floor, a lid one metre above its middle, and a point light three metres up.
pub fn floor_and_lid() -> Scene {
    scene(
        vec![Light::Point {
            position: [0., 3., 0.],
            intensity: [9.; 3],
        }],
        vec![square(4.), square(0.5)],
        vec![
            object("floor", 0, AT_ORIGIN),
            object("lid", 1, moved(0., 1., 0.)),
        ],
    )
}

/// Looks down on the floor from the side of the lid, 64x64 pixels.
pub fn camera() -> Camera {
    Camera {
        eye: [0., 2.5, 3.],
        target: [0., 0., 0.],
        up: [0., 1., 0.],
        fov_y: 60.,
        width: 64,
        height: 64,
    }
}

pub fn requests(ids: std::ops::Range<u64>) -> Vec<SampleRequest> {
    ids.map(|id| SampleRequest {
        id,
        x: (id % 64) as u16,
        y: (id / 64 % 64) as u16,
        offset: [0.5, 0.25],
    })
    .collect()
}

pub struct TestServer {
    pub address: SocketAddr,
    stop: Option<oneshot::Sender<()>>,
    running: tokio::task::JoinHandle<()>,
}

impl TestServer {
    pub async fn start(threads: usize, credits: u32) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let (stop, stopped) = oneshot::channel::<()>();
        let config = ServerConfig {
            threads: NonZeroUsize::new(threads),
            credits,
            ..ServerConfig::default()
        };
        let running = tokio::spawn(async move {
            run(config, Entrance::Listen(listener), async {
                stopped.await.unwrap_or(());
            })
            .await
            .unwrap();
        });
        Self {
            address,
            stop: Some(stop),
            running,
        }
    }

    pub async fn stop(mut self) {
        drop(self.stop.take());
        (&mut self.running).await.unwrap();
    }
}

pub struct Client {
    pub receiver: Receiver<ReadHalf<TcpStream>, ToDisplay>,
    pub sender: Sender<WriteHalf<TcpStream>, ToServer>,
    pub session: DisplaySession,
    pub scene_was_held: bool,
    scene: Arc<EncodedScene>,
}

impl Client {
    /// Connects and waits until the scene is built.
    pub async fn connect(server: &TestServer, scene: &Scene, seed: u64) -> Self {
        let mut client = Self::begin(server, scene, seed, &[]).await;
        while client.next().await.1 != DisplayEvent::Ready {}
        client
    }

    /// Connects, wishes for methods of finding visibility if any are given, and sends the scene.
    pub async fn begin(
        server: &TestServer,
        scene: &Scene,
        seed: u64,
        methods: &[ShadowMethod],
    ) -> Self {
        let stream = TcpStream::connect(server.address).await.unwrap();
        let (receiver, sender) = display_side(stream);
        let encoded = Arc::new(EncodedScene::new(scene).unwrap());
        let session = DisplaySession::new(SceneSize::from(scene));
        let mut client = Self {
            receiver,
            sender,
            session,
            scene_was_held: false,
            scene: encoded,
        };
        client.send(hello("test", seed)).await;
        assert_eq!(client.next().await.1, DisplayEvent::Welcome);
        if !methods.is_empty() {
            let wish = ToServer::Shadows {
                steady: false,
                error: 0.02,
                methods: methods.to_vec(),
            };
            client.send(wish).await;
        }
        let scene = Arc::clone(&client.scene);
        let holds = client.session.announce(scene.digest());
        client.scene_was_held = holds;
        client.send(scene.begin()).await;
        if !holds {
            for chunk in scene.chunks() {
                client.send(chunk).await;
            }
        }
        client
    }

    pub async fn send(&mut self, message: ToServer) {
        match &message {
            ToServer::Request { view, samples } => self.session.requested(*view, samples),
            ToServer::Edit { epoch, .. } => self.session.edited(*epoch),
            ToServer::Cancel { views_before } => self.session.cancelling(*views_before),
            ToServer::Ping { token } => self.session.pinged(*token),
            _ => {}
        }
        self.sender.send(&message).await.unwrap();
    }

    /// The next message, checked against every rule that a server must keep.
    pub async fn next(&mut self) -> (ToDisplay, DisplayEvent) {
        let message = self
            .receiver
            .receive()
            .await
            .unwrap()
            .expect("the server is there");
        let event = self.session.receive(&message).unwrap();
        (message, event)
    }

    /// Asks, and gathers all answers: samples by id with their epoch, and triples in order of arrival.
    pub async fn ask(
        &mut self,
        view: u32,
        samples: Vec<SampleRequest>,
    ) -> (HashMap<u64, (u32, Sample)>, Vec<(u32, Triple)>) {
        self.send(ToServer::Request { view, samples }).await;
        self.gather().await
    }

    pub async fn gather(&mut self) -> (HashMap<u64, (u32, Sample)>, Vec<(u32, Triple)>) {
        let (mut samples, mut triples) = (HashMap::new(), vec![]);
        // A pong after the last sample shows that its triples have come too.
        let mut pinged = false;
        loop {
            if self.session.outstanding() == 0 && !pinged {
                self.send(ToServer::Ping { token: 99 }).await;
                pinged = true;
            }
            match self.next().await.0 {
                ToDisplay::Samples {
                    epoch,
                    samples: batch,
                    ..
                } => {
                    samples.extend(batch.into_iter().map(|s| (s.id, (epoch, s))));
                }
                ToDisplay::Textured {
                    epoch,
                    samples: batch,
                    ..
                } => {
                    samples.extend(batch.into_iter().map(|t| (t.sample.id, (epoch, t.sample))));
                }
                ToDisplay::Triples {
                    epoch,
                    triples: batch,
                } => {
                    triples.extend(batch.into_iter().map(|t| (epoch, t)));
                }
                ToDisplay::Pong { .. } => return (samples, triples),
                ToDisplay::Fault { text, .. } => panic!("{text}"),
                _ => {}
            }
        }
    }
}

/// Irradiance after one to four reflections of albedo ρ in a furnace whose direct irradiance is 1.
pub fn reflected(albedo: f32) -> f32 {
    (1..=4).map(|n| albedo.powi(n)).sum()
}

/// A sphere of radius 1, smooth.
pub fn sphere(rings: u32, around: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for ring in 0..=rings {
        let (sin, cos) = (std::f32::consts::PI * ring as f32 / rings as f32).sin_cos();
        for step in 0..around {
            let (s, c) = (std::f32::consts::TAU * step as f32 / around as f32).sin_cos();
            mesh.positions.push([sin * c, cos, sin * s]);
            mesh.normals.push([sin * c, cos, sin * s]);
        }
    }
    for ring in 0..rings {
        for step in 0..around {
            let next = (step + 1) % around;
            let [a, b] = [ring * around + step, ring * around + next];
            mesh.faces
                .extend([[a, b, a + around], [b, b + around, a + around]]);
        }
    }
    mesh.face_normals = mesh.faces.clone();
    mesh
}

/// The sample of a ray from one point towards another.
pub fn shade(stage: &Stage, from: Vec3, to: Vec3) -> Sample {
    let ray = Ray {
        origin: from,
        direction: (to - from).normalize(),
    };
    Shader::new(stage, &ShadowRays::default(), 3)
        .shade(1, &ray)
        .sample
}

/// Six area lights that close a box of half-size 1 around the origin, with this radiance.
pub fn box_of_lights(radiance: f32) -> Vec<Light> {
    let mut lights = vec![];
    for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
        for side in [axis, -axis] {
            let (u, v) = side.any_orthonormal_pair();
            // Anticlockwise as seen from inside.
            let mut corners = [side + u + v, side - u + v, side - u - v, side + u - v];
            if (corners[1] - corners[0])
                .cross(corners[2] - corners[0])
                .dot(side)
                > 0.
            {
                corners.reverse();
            }
            let vertices = corners.map(|c| c.to_array()).to_vec();
            lights.push(Light::Area {
                vertices,
                radiance: [radiance; 3],
            });
        }
    }
    lights
}
