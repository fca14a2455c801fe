//! What a trace holds, and its bytes.

use bytes::Bytes;
use serde::{Deserialize, Serialize};

use crate::codec::{DecodeError, EncodeError, decode, encode, encode_into};
use crate::messages::{Camera, Digest, LightMove, ObjectMove, Triple};

/// Version of the trace format that is written, and the only one that is read.
pub const FORMAT: u16 = 1;

/// First bytes of every trace.
pub(super) const MAGIC: [u8; 8] = *b"EP-TRACE";
/// Bytes before the header proper: magic, format, protocol version, length and checksum.
pub(super) const PREAMBLE: usize = 20;
/// Bytes of an entry before its payload: length, checksum, time, kind and connection.
pub(super) const ENTRY_HEADER: usize = 24;
/// Those that the checksum does not cover.
pub(super) const UNCHECKED: usize = 8;

/// What stands at the head of a trace.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// Seed of everything random.
    pub seed: u64,
    /// BLAKE3 of the encoded scene, whose bytes are the first entries.
    pub digest: Digest,
    /// Length of the encoded scene, bytes.
    pub scene_bytes: u64,
    /// Name and version of the program that recorded, for people.
    pub program: String,
    /// What it was told to do, as JSON, for people.
    pub options: String,
}

/// Something that happened.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// When, microseconds after the recording began; never less than that of the entry before.
    pub time_us: u64,
    /// What.
    pub event: Event,
}

/// What happened. Connections are numbered from 1 on in the order in which they were made; none has the number of another.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// The next bytes of the encoded scene; these entries come first.
    Scene(Bytes),
    /// The display is connected to a server.
    Opened {
        /// The connection.
        connection: u32,
        /// Which server it is, as the display counts them.
        server: u32,
    },
    /// The display sends a frame.
    Sent {
        /// To whom.
        connection: u32,
        /// The frame's payload: an encoded [`crate::ToServer`].
        frame: Bytes,
    },
    /// The display sends a `SceneChunk` with bytes of the trace's own scene, which are not written twice.
    SceneSent {
        /// To whom.
        connection: u32,
        /// The first of them.
        at: u64,
        /// How many.
        bytes: u32,
    },
    /// The display receives a frame.
    Received {
        /// From whom.
        connection: u32,
        /// The frame's payload: an encoded [`crate::ToDisplay`], or what the server took for one.
        frame: Bytes,
    },
    /// The connection is no more.
    Closed {
        /// The connection.
        connection: u32,
        /// Why.
        why: String,
    },
    /// The display does something that its pictures depend on.
    Step(Step),
    /// The recording ended as it should.
    End {
        /// Pictures drawn.
        frames: u32,
    },
}

/// What a display does with its scene and its samples, from which its pictures follow to the bit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Step {
    /// It is made, or made anew for pictures of another kind.
    Shaped {
        /// Its choices, as JSON.
        choices: String,
        /// Width of its pictures, pixels.
        width: u32,
        /// Their height, pixels.
        height: u32,
        /// Whether the points that it has stay.
        keep_points: bool,
    },
    /// It is told where the next picture will be seen from, before any samples come in.
    Begun {
        /// The view's number.
        view: u32,
        /// The camera.
        camera: Camera,
    },
    /// Things move. What was received before this is of no use from here on.
    Edited {
        /// The display's epoch from here on.
        epoch: u32,
        /// Objects that moved.
        objects: Vec<ObjectMove>,
        /// Lights that changed.
        lights: Vec<LightMove>,
    },
    /// It learns which lights, blockers and receivers samples met.
    Learned {
        /// Those that are new to it.
        triples: Vec<Triple>,
    },
    /// It takes in shadow edges that were computed in the background.
    Shadowed(Shadowed),
    /// It takes in samples that were received.
    Took {
        /// The view of the next picture.
        view: u32,
        /// The samples, in their order.
        samples: Vec<Run>,
    },
    /// It draws a picture.
    Drawn {
        /// The view's number.
        view: u32,
        /// The camera.
        camera: Camera,
    },
    /// The picture that it drew last.
    Pictured {
        /// BLAKE3 of the picture's linear radiance: all red, all green, all blue, each row by row, little-endian `f32`.
        digest: Digest,
    },
    /// It chooses what to ask for.
    Planned {
        /// Most samples to ask for.
        budget: u32,
        /// Whether there is no picture yet.
        first: bool,
        /// Where the camera is expected to be next.
        next: Option<Camera>,
    },
    /// A frame passes without a picture of the display's: something else is shown.
    Passed,
}

/// Samples with consecutive ids, all received on one connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Run {
    /// The first id.
    pub first: u64,
    /// How many.
    pub count: u32,
    /// The connection.
    pub connection: u32,
}

/// Which shadow edges are taken in.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Shadowed {
    /// All that are wanted: the display waits for them.
    All,
    /// What has been answered: jobs by their number in the order in which they were given out, from 1 on, and whether an
    /// answer is the job's last.
    Answers(Vec<(u64, bool)>),
}

/// Kinds of entries, by number.
mod kind {
    pub(super) const SCENE: u32 = 0;
    pub(super) const OPENED: u32 = 1;
    pub(super) const SENT: u32 = 2;
    pub(super) const SCENE_SENT: u32 = 3;
    pub(super) const RECEIVED: u32 = 4;
    pub(super) const CLOSED: u32 = 5;
    pub(super) const STEP: u32 = 6;
    pub(super) const END: u32 = 7;
}

/// Appends an entry: header and payload, but for length and checksum, which stay 0.
pub(super) fn put(entry: &Entry, bytes: &mut Vec<u8>) -> Result<(), EncodeError> {
    let (kind, connection) = match &entry.event {
        Event::Scene(_) => (kind::SCENE, 0),
        Event::Opened { connection, .. } => (kind::OPENED, *connection),
        Event::Sent { connection, .. } => (kind::SENT, *connection),
        Event::SceneSent { connection, .. } => (kind::SCENE_SENT, *connection),
        Event::Received { connection, .. } => (kind::RECEIVED, *connection),
        Event::Closed { connection, .. } => (kind::CLOSED, *connection),
        Event::Step(_) => (kind::STEP, 0),
        Event::End { .. } => (kind::END, 0),
    };
    bytes.extend([0; UNCHECKED]);
    bytes.extend(entry.time_us.to_le_bytes());
    bytes.extend(kind.to_le_bytes());
    bytes.extend(connection.to_le_bytes());
    match &entry.event {
        Event::Scene(data)
        | Event::Sent { frame: data, .. }
        | Event::Received { frame: data, .. } => bytes.extend_from_slice(data),
        Event::Opened { server, .. } => bytes.extend(server.to_le_bytes()),
        Event::SceneSent { at, bytes: n, .. } => {
            bytes.extend(at.to_le_bytes());
            bytes.extend(n.to_le_bytes());
        }
        Event::Closed { why, .. } => bytes.extend_from_slice(why.as_bytes()),
        Event::Step(step) => encode_into(step, bytes)?,
        Event::End { frames } => bytes.extend(frames.to_le_bytes()),
    }
    Ok(())
}

/// The entry of a header, from its time on, and a payload; nothing if it is none that this format has.
pub(super) fn take(checked: &[u8], payload: Bytes) -> Option<Entry> {
    let (time, rest) = checked.split_first_chunk()?;
    let (kind, rest) = rest.split_first_chunk()?;
    let (connection, _) = rest.split_first_chunk()?;
    let connection = u32::from_le_bytes(*connection);
    let number = || Some(u32::from_le_bytes(payload[..].try_into().ok()?));
    let event = match u32::from_le_bytes(*kind) {
        kind::SCENE if connection == 0 => Event::Scene(payload),
        kind::OPENED => Event::Opened {
            connection,
            server: number()?,
        },
        kind::SENT => Event::Sent {
            connection,
            frame: payload,
        },
        kind::SCENE_SENT => {
            let (at, bytes) = payload.split_first_chunk()?;
            Event::SceneSent {
                connection,
                at: u64::from_le_bytes(*at),
                bytes: u32::from_le_bytes(bytes.try_into().ok()?),
            }
        }
        kind::RECEIVED => Event::Received {
            connection,
            frame: payload,
        },
        kind::CLOSED => Event::Closed {
            connection,
            why: std::str::from_utf8(&payload).ok()?.to_owned(),
        },
        kind::STEP if connection == 0 => Event::Step(decode(&payload).ok()?),
        kind::END if connection == 0 => Event::End { frames: number()? },
        _ => return None,
    };
    Some(Entry {
        time_us: u64::from_le_bytes(*time),
        event,
    })
}

/// The header's bytes, preamble and all.
pub(super) fn put_header(header: &Header, protocol: u16) -> Result<Vec<u8>, EncodeError> {
    let body = encode(header)?;
    let mut bytes = Vec::with_capacity(PREAMBLE + body.len());
    bytes.extend(MAGIC);
    bytes.extend(FORMAT.to_le_bytes());
    bytes.extend(protocol.to_le_bytes());
    bytes.extend((body.len() as u32).to_le_bytes());
    bytes.extend(crc32fast::hash(&body).to_le_bytes());
    bytes.extend(body);
    Ok(bytes)
}

/// The header in its encoded form.
pub(super) fn take_header(body: &[u8]) -> Result<Header, DecodeError> {
    decode(body)
}
