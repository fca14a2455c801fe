//! The messages, in both directions. `PROTOCOL.md` gives their bytes.

use serde::{Deserialize, Serialize};

use crate::scene::{Affine, Light};

/// Protocol version that this crate speaks; the handshake settles on one that both sides know.
pub const VERSION: u16 = 3;

/// First version with [`ToDisplay::Textured`].
pub const TEXTURED_VERSION: u16 = 2;

/// First version with [`ToServer::Shadows`] and [`ToDisplay::Shadows`].
pub const SHADOWS_VERSION: u16 = 3;

/// BLAKE3 digest of a scene's encoded bytes.
pub type Digest = [u8; 32];

/// Index that stands for "no object" in [`Sample::object`].
pub const NO_OBJECT: u32 = u32::MAX;

/// A pinhole camera and the image it fills.
///
/// Image coordinates are pixels, x to the right, y down, (0, 0) the outer corner of the first pixel. The ray through
/// image point (x, y) has direction `f + r·((2x/w − 1)·tan(fov_y/2)·w/h) + u·((1 − 2y/h)·tan(fov_y/2))`, where `f` is
/// the unit vector from `eye` to `target`, `r` = normalise(f × up) and `u` = r × f.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// World position of the pinhole, metres.
    pub eye: [f32; 3],
    /// World point in the middle of the image, metres; not equal to `eye`.
    pub target: [f32; 3],
    /// World direction that is up in the image; not parallel to the line of sight.
    pub up: [f32; 3],
    /// Vertical field of view, degrees, in (0, 180).
    pub fov_y: f32,
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
}

/// One sample that the display wants: a ray through `(x + offset[0], y + offset[1])`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SampleRequest {
    /// Unique in the session. A server's random numbers are a function of this and of [`ToServer::Hello`]'s seed
    /// alone, so that who answers, and when, changes nothing.
    pub id: u64,
    /// Pixel column.
    pub x: u16,
    /// Pixel row.
    pub y: u16,
    /// Place in the pixel, each in [0, 1).
    pub offset: [f32; 2],
}

/// Bits of [`Sample::flags`].
pub mod flags {
    /// The ray hit nothing: `position` holds its unit direction, `object` is [`super::NO_OBJECT`].
    pub const MISS: u32 = 1;
    /// The radiance depends on where it was seen from.
    pub const VIEW_DEPENDENT: u32 = 2;
    /// A better value will be had if the sample is asked for again.
    pub const PROVISIONAL: u32 = 4;
    /// The ray hit a light; `object` is the light's index.
    pub const LIGHT: u32 = 8;
    /// All bits with a meaning; a sample with others is refused.
    pub const ALL: u32 = 15;
}

/// One shaded sample.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// The id of its request.
    pub id: u64,
    /// World position of the first hit, metres; for a miss the unit direction of the ray.
    pub position: [f32; 3],
    /// Index of the object hit, or of the light with [`flags::LIGHT`], or [`NO_OBJECT`].
    pub object: u32,
    /// Radiance towards the eye, linear sRGB primaries, W/(m² sr); finite and not negative.
    pub radiance: [f32; 3],
    /// Bits of [`flags`].
    pub flags: u32,
}

/// What the diffuse map of a sample's surface did to it, so that a display can apply the map where it looks instead of blurring it
/// between samples: the sample's radiance is `reflectance · reflected` and what else the surface sends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Texel {
    /// Index of the face hit in its object's mesh.
    pub face: u32,
    /// Diffuse reflectance, map and material together, linear; in [0, 1].
    pub reflectance: [f32; 3],
    /// Radiance that a diffuse reflectance of 1 would reflect there, W/(m² sr); finite and not negative.
    pub reflected: [f32; 3],
}

/// A sample of a surface whose material has a diffuse map.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TexturedSample {
    /// The sample: a hit on an object.
    pub sample: Sample,
    /// What the map did to it.
    pub texel: Texel,
}

/// A light that a blocker hides from a receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Triple {
    /// Index of the light.
    pub light: u32,
    /// Index of the object that blocks.
    pub blocker: u32,
    /// Index of the object in shadow; may be the blocker.
    pub receiver: u32,
}

/// A new place for an object.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ObjectMove {
    /// Index of the object.
    pub object: u32,
    /// Its new transform, object to world.
    pub transform: Affine,
}

/// A light as it is from now on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LightMove {
    /// Index of the light.
    pub light: u32,
    /// The light, of the same kind as before.
    pub value: Light,
}

/// What a server offers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Capabilities {
    /// Sample requests that the server will hold at once: the display's credit. A request uses one, its sample or its
    /// cancelling gives it back.
    pub credits: u32,
    /// Most requests in one [`ToServer::Request`].
    pub max_batch: u32,
    /// Whether it reports [`ToDisplay::Triples`].
    pub triples: bool,
    /// Whether it takes [`ToServer::Edit`].
    pub edits: bool,
    /// Worker threads, for the display's information.
    pub threads: u32,
}

/// Error that [`ShadowMethod::Auto`] may make where nobody says otherwise, as in [`ToServer::Shadows`]: pictures do not show it.
pub const SHADOW_ERROR: f32 = 0.01;

/// A way to find out how much of a light can be seen from where.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum ShadowMethod {
    /// The cheapest that keeps the error wanted. Something to be wished for, never an answer.
    #[default]
    Auto,
    /// Shadow rays, stratified and adaptive.
    Rays,
    /// Hierarchical penumbra casting.
    Penumbra,
    /// Soft shadow maps.
    SoftMap,
}

/// How the visibility of a light is found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LightShadows {
    /// Index of the light.
    pub light: u32,
    /// The method; not [`ShadowMethod::Auto`].
    pub method: ShadowMethod,
    /// Why, in one line for people.
    pub why: String,
}

/// Display to server. The order of variants is part of the wire format: append only.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum ToServer {
    /// First message on a connection.
    Hello {
        /// Oldest version the display speaks.
        min_version: u16,
        /// Newest version the display speaks.
        max_version: u16,
        /// Name and version of the program, for people.
        name: String,
        /// Seeds the server's random numbers, with each request's id.
        seed: u64,
    },
    /// Announces the scene; its bytes follow in [`ToServer::SceneChunk`]s unless [`ToDisplay::Welcome`] listed the digest.
    SceneBegin {
        /// BLAKE3 of the whole encoded [`crate::scene::Scene`].
        digest: Digest,
        /// Length of the encoded scene, bytes.
        bytes: u64,
    },
    /// The next bytes of the scene, in order, at most [`crate::scene::MAX_CHUNK`].
    SceneChunk {
        /// The bytes.
        data: Vec<u8>,
    },
    /// A camera, named by a number that only grows.
    View {
        /// The view's number.
        view: u32,
        /// The camera.
        camera: Camera,
    },
    /// Samples wanted of a view already sent, most wanted first.
    Request {
        /// The view's number.
        view: u32,
        /// The samples.
        samples: Vec<SampleRequest>,
    },
    /// Objects and lights that moved. Samples traced from now on carry the new epoch.
    Edit {
        /// The scene's state after this edit; grows by one.
        epoch: u32,
        /// Objects that moved.
        objects: Vec<ObjectMove>,
        /// Lights that changed.
        lights: Vec<LightMove>,
    },
    /// Drop every request of views before this one. Answered by a [`ToDisplay::Status`] with the same
    /// `cancelled_before`, after which no sample of an older view comes.
    Cancel {
        /// First view that is kept.
        views_before: u32,
    },
    /// Answered by [`ToDisplay::Pong`].
    Ping {
        /// Returned as it is.
        token: u64,
    },
    /// Last message; the server closes.
    Goodbye,
    /// Last message: the server broke a rule, and which.
    Fault {
        /// The kind of fault.
        code: FaultCode,
        /// One line for people.
        text: String,
    },
    /// How samples are wanted to be made, from version 3 on: at most once, after [`ToDisplay::Welcome`] and before
    /// [`Self::SceneBegin`]. A wish: a server without a method uses another.
    Shadows {
        /// Whether samples are to be the same on every machine and in every run: no sample is [`flags::PROVISIONAL`], and
        /// no method is chosen by what it costs here and now.
        steady: bool,
        /// Error that [`ShadowMethod::Auto`] may make: root mean square over a light's penumbrae, as a share of the light in
        /// full view. In [0, 1].
        error: f32,
        /// By index of the light; those past the end are [`ShadowMethod::Auto`].
        methods: Vec<ShadowMethod>,
    },
}

/// Why a peer is being closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum FaultCode {
    /// No common protocol version.
    Version,
    /// Bytes that are no message.
    Malformed,
    /// A message that has no place here, such as a request before a scene.
    OutOfOrder,
    /// A length, count or number of outstanding requests above what was agreed.
    Limit,
    /// A value that is not allowed, such as a NaN or an index past its table.
    Value,
    /// Something that this server does not do.
    Unsupported,
    /// The sender failed by itself.
    Internal,
}

/// Server to display. The order of variants is part of the wire format: append only.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum ToDisplay {
    /// Answer to [`ToServer::Hello`].
    Welcome {
        /// The version spoken from here on.
        version: u16,
        /// Name and version of the program, for people.
        name: String,
        /// What it shades with, for people, such as `direct`.
        shader: String,
        /// What it offers.
        capabilities: Capabilities,
        /// Digests of scenes that it already holds.
        holds: Vec<Digest>,
    },
    /// The scene with this digest is built; requests may come.
    SceneReady {
        /// The scene's digest.
        digest: Digest,
    },
    /// Shaded samples.
    Samples {
        /// The view that they were asked for.
        view: u32,
        /// State of the scene that they were shaded in.
        epoch: u32,
        /// The samples, each id one that is outstanding.
        samples: Vec<Sample>,
    },
    /// Shadows met, each once an epoch.
    Triples {
        /// State of the scene that they were met in.
        epoch: u32,
        /// The triples.
        triples: Vec<Triple>,
    },
    /// How the server is doing: after each [`ToServer::Cancel`], and from time to time.
    Status {
        /// Requests that it holds.
        queued: u32,
        /// Samples traced since the session began.
        traced: u64,
        /// Rays traced since the session began.
        rays: u64,
        /// No sample of a view before this one will come.
        cancelled_before: u32,
    },
    /// Answer to [`ToServer::Ping`].
    Pong {
        /// The ping's.
        token: u64,
    },
    /// The sender closes the connection, and why.
    Fault {
        /// The kind of fault.
        code: FaultCode,
        /// One line for people.
        text: String,
    },
    /// Shaded samples of surfaces with a diffuse map, from version 2 on. A request is answered here or in
    /// [`ToDisplay::Samples`], as the server likes.
    Textured {
        /// The view that they were asked for.
        view: u32,
        /// State of the scene that they were shaded in.
        epoch: u32,
        /// The samples, each id one that is outstanding.
        samples: Vec<TexturedSample>,
    },
    /// How the visibility of lights is found, from version 3 on: lights whose method is chosen or has changed, each once.
    Shadows {
        /// The lights.
        lights: Vec<LightShadows>,
    },
}
