//! Shader servers that keep to the rules until they are asked for samples, and then do what a test says.

use std::net::TcpListener;
use std::thread::JoinHandle;

use protocol::framing::Message;
use protocol::messages::{
    Capabilities, FaultCode, NO_OBJECT, Sample, SampleRequest, VERSION, flags,
};
use protocol::{ToDisplay, ToServer};

use super::wire::Wire;

/// A server that serves one connection, then listens no more. What its script makes is given by [`Fake::end`].
pub(super) struct Fake<T> {
    pub(super) address: String,
    thread: JoinHandle<T>,
}

impl<T: Send + 'static> Fake<T> {
    pub(super) fn start(script: impl FnOnce(Wire) -> T + Send + 'static) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let thread = std::thread::spawn(move || {
            let (stream, _) = listener.accept().unwrap();
            drop(listener);
            script(Wire::new(stream))
        });
        Self { address, thread }
    }

    #[track_caller]
    pub(super) fn end(self) -> T {
        self.thread.join().unwrap()
    }
}

/// What was asked.
pub(super) struct Asked {
    pub(super) view: u32,
    pub(super) samples: Vec<SampleRequest>,
}

pub(super) fn welcome(credits: u32) -> ToDisplay {
    ToDisplay::Welcome {
        version: VERSION,
        name: "fake".into(),
        shader: "none".into(),
        capabilities: Capabilities {
            credits,
            max_batch: credits.min(32_768),
            triples: true,
            edits: true,
            threads: 1,
        },
        holds: vec![],
    }
}

/// Answers a display up to the scene; false if it left before.
pub(super) fn greet(wire: &mut Wire, credits: u32) -> bool {
    let (mut digest, mut expected, mut got) = ([0; 32], u64::MAX, 0);
    while got < expected {
        match wire.receive() {
            Some(ToServer::Hello { .. }) => wire.send(&welcome(credits)),
            Some(ToServer::SceneBegin { digest: d, bytes }) => (digest, expected) = (d, bytes),
            Some(ToServer::SceneChunk { data }) => got += data.len() as u64,
            Some(_) => {}
            None => return false,
        }
    }
    wire.send(&ToDisplay::SceneReady { digest });
    true
}

/// The next request; heartbeats are answered meanwhile. Nothing if the display leaves.
pub(super) fn asked(wire: &mut Wire) -> Option<Asked> {
    loop {
        match wire.receive()? {
            ToServer::Request { view, samples } => return Some(Asked { view, samples }),
            ToServer::Ping { token } => wire.send(&ToDisplay::Pong { token }),
            ToServer::Cancel { views_before } => wire.send(&ToDisplay::Status {
                queued: 0,
                traced: 0,
                rays: 0,
                cancelled_before: views_before,
            }),
            _ => {}
        }
    }
}

/// The fault that the display ends with, if it says one.
pub(super) fn fault(wire: &mut Wire) -> Option<FaultCode> {
    let mut found = None;
    while let Some(message) = wire.receive::<ToServer>() {
        if let ToServer::Fault { code, .. } = message {
            found = Some(code);
        }
    }
    found
}

/// A good sample that nobody could take for a real one: if it were used, pictures would show it.
pub(super) fn glaring(id: u64) -> Sample {
    Sample {
        id,
        position: [0.0, 0.6, -0.8],
        object: NO_OBJECT,
        radiance: [1000.0, 0.0, 1000.0],
        flags: flags::MISS,
    }
}

/// Good samples in answer to everything that was asked.
pub(super) fn answer(asked: &Asked) -> ToDisplay {
    ToDisplay::Samples {
        view: asked.view,
        epoch: 0,
        samples: asked.samples.iter().map(|r| glaring(r.id)).collect(),
    }
}

/// The same with the first of them changed.
pub(super) fn answer_with(asked: &Asked, change: impl FnOnce(&mut Sample)) -> ToDisplay {
    let mut message = answer(asked);
    if let ToDisplay::Samples { samples, .. } = &mut message {
        change(&mut samples[0]);
    }
    message
}

/// A message's frame.
pub(super) fn bytes<M: Message>(message: &M) -> Vec<u8> {
    protocol::framing::frame(message).unwrap()
}
