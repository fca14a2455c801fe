//! A side of a connection that says whatever a test wants, over a plain blocking socket.

use std::collections::BTreeMap;
use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;

use protocol::framing::{HEADER, Message, frame};
use protocol::handshake::hello;
use protocol::messages::{Camera, Digest, FaultCode, Sample, SampleRequest};
use protocol::scene::{Light, Material, Mesh, Model, Object, Scene, Shading};
use protocol::transfer::EncodedScene;
use protocol::{ToDisplay, ToServer, decode};

use crate::support::LIMIT;

/// A connection.
pub(super) struct Wire {
    pub(super) stream: TcpStream,
    /// Scenes that a server said it holds.
    holds: Vec<Digest>,
}

impl Wire {
    pub(super) fn new(stream: TcpStream) -> Self {
        stream.set_nodelay(true).unwrap();
        stream.set_read_timeout(Some(LIMIT)).unwrap();
        stream.set_write_timeout(Some(LIMIT)).unwrap();
        Self {
            stream,
            holds: Vec::new(),
        }
    }

    pub(super) fn connect(address: &str) -> Self {
        Self::new(TcpStream::connect(address).unwrap())
    }

    /// Sends bytes as they are. A peer that has closed is no error: what it heard is asked elsewhere.
    pub(super) fn send_bytes(&mut self, bytes: &[u8]) {
        if let Err(error) = self.stream.write_all(bytes) {
            assert!(closed(&error), "{error}");
        }
    }

    pub(super) fn send<M: Message>(&mut self, message: &M) {
        self.send_bytes(&frame(message).unwrap());
    }

    /// The next message; nothing at the connection's end, however it came.
    pub(super) fn receive<M: Message>(&mut self) -> Option<M> {
        let mut header = [0; HEADER];
        self.read(&mut header)?;
        let mut payload = vec![0; u32::from_le_bytes(header) as usize];
        self.read(&mut payload)?;
        Some(decode(&payload).unwrap())
    }

    fn read(&mut self, bytes: &mut [u8]) -> Option<()> {
        match self.stream.read_exact(bytes) {
            Ok(()) => Some(()),
            Err(error) if closed(&error) || error.kind() == ErrorKind::UnexpectedEof => None,
            Err(error) => panic!("{error}"),
        }
    }
}

fn closed(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::BrokenPipe | ErrorKind::ConnectionReset | ErrorKind::ConnectionAborted
    )
}

/// A display's side, of a scene with one of most things.
impl Wire {
    /// Up to the server's `Welcome`.
    pub(super) fn greeted(address: &str) -> Self {
        let mut wire = Self::connect(address);
        wire.send(&hello("hostile", 7));
        match wire.receive() {
            Some(ToDisplay::Welcome { holds, .. }) => wire.holds = holds,
            other => panic!("no Welcome but {other:?}"),
        }
        wire
    }

    /// Up to the server's `SceneReady`, and view 1.
    pub(super) fn opened(address: &str) -> Self {
        let mut wire = Self::greeted(address);
        let encoded = EncodedScene::new(&scene()).unwrap();
        wire.send(&encoded.begin());
        // A server that has the scene already takes none of its bytes.
        if !wire.holds.contains(&encoded.digest()) {
            encoded.chunks().for_each(|chunk| wire.send(&chunk));
        }
        loop {
            match wire.receive() {
                Some(ToDisplay::SceneReady { .. }) => break,
                Some(_) => {}
                None => panic!("the server closed before it had the scene"),
            }
        }
        wire.send(&view(1));
        wire
    }

    /// Asks for samples of a view and gives them by id.
    pub(super) fn ask(&mut self, view: u32, ids: std::ops::Range<u64>) -> BTreeMap<u64, Sample> {
        let count = (ids.end - ids.start) as usize;
        self.send(&ToServer::Request {
            view,
            samples: ids.map(request).collect(),
        });
        self.gather(count)
    }

    /// Receives so many samples.
    pub(super) fn gather(&mut self, count: usize) -> BTreeMap<u64, Sample> {
        let mut all = BTreeMap::new();
        while all.len() < count {
            match self.receive() {
                Some(ToDisplay::Samples { samples, .. }) => {
                    all.extend(samples.iter().map(|sample| (sample.id, *sample)));
                }
                Some(ToDisplay::Fault { code, text }) => panic!("{code:?}: {text}"),
                Some(_) => {}
                None => panic!("the server closed after {} samples", all.len()),
            }
        }
        all
    }

    /// The fault that the server ends with; nothing if it says none.
    pub(super) fn fault(&mut self) -> Option<FaultCode> {
        let mut found = None;
        while let Some(message) = self.receive::<ToDisplay>() {
            assert_eq!(found, None, "a fault is the last message");
            if let ToDisplay::Fault { code, .. } = message {
                found = Some(code);
            }
        }
        found
    }
}

pub(super) fn camera() -> Camera {
    Camera {
        eye: [0.0, 2.0, 6.0],
        target: [0.0, 0.0, 0.0],
        up: [0.0, 1.0, 0.0],
        fov_y: 45.0,
        width: 64,
        height: 64,
    }
}

pub(super) fn view(view: u32) -> ToServer {
    ToServer::View {
        view,
        camera: camera(),
    }
}

/// Spread over the image.
pub(super) fn request(id: u64) -> SampleRequest {
    SampleRequest {
        id,
        x: (id * 7 % 64) as u16,
        y: (id * 13 % 64) as u16,
        offset: [0.5, 0.25],
    }
}

pub(super) fn scene() -> Scene {
    Scene {
        shading: Shading {
            model: Model::Direct,
            ambient: [0.1; 3],
            background: [0.25, 0.5, 1.0],
        },
        lights: vec![Light::Point {
            position: [0.0, 5.0, 0.0],
            intensity: [40.0; 3],
        }],
        materials: vec![Material {
            name: "grey".into(),
            diffuse: [0.5; 3],
            diffuse_map: None,
            specular: [0.0; 3],
            roughness: 1.0,
        }],
        textures: vec![],
        meshes: vec![Mesh {
            positions: vec![
                [-2.0, 0.0, -2.0],
                [-2.0, 0.0, 2.0],
                [2.0, 0.0, 2.0],
                [2.0, 0.0, -2.0],
            ],
            faces: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        }],
        objects: vec![Object {
            name: "floor".into(),
            mesh: 0,
            material: 0,
            transform: [
                [1.0, 0.0, 0.0, 0.0],
                [0.0, 1.0, 0.0, 0.0],
                [0.0, 0.0, 1.0, 0.0],
            ],
            crease_angle: 85.0,
        }],
    }
}
