//! Every bound of the protocol in one place. Both sides keep to them; a peer that does not gets a `Fault`.

/// Longest frame payload in either direction, bytes.
pub const MAX_FRAME: usize = 2 << 20;
/// Longest encoded scene that an assembler takes unless told otherwise, bytes.
pub const MAX_SCENE: u64 = 2 << 30;
/// Most requests in one `Request` and samples in one `Samples`.
pub const MAX_BATCH: u32 = 32_768;
/// Most triples in one `Triples`.
pub const MAX_TRIPLES: usize = 65_536;
/// Most objects, and most lights, in one `Edit`.
pub const MAX_MOVES: usize = 16_384;
/// Most lights in one `Shadows` from a server.
pub const MAX_SHADOWS: usize = 1024;
/// Largest credit that a server may offer.
pub const MAX_CREDITS: u32 = 1 << 20;
/// Longest program, shader, material or object name, bytes of UTF-8.
pub const MAX_NAME: usize = 1024;
/// Longest text of a `Fault`, bytes of UTF-8.
pub const MAX_TEXT: usize = 4096;
/// Most digests in a `Welcome`.
pub const MAX_HOLDS: usize = 1024;
/// Views that a server remembers: a request may name one of the last so many that were sent.
pub const MAX_VIEWS: usize = 256;

/// Largest image side and texture side, pixels.
pub const MAX_SIDE: u32 = 16_384;
/// Largest magnitude of a coordinate, in any space, metres.
pub const MAX_COORDINATE: f32 = 1e9;
/// Largest radiance in one channel, W/(m² sr); the sun's disc has about 2e7. Larger ones are clamped by who shades.
pub const MAX_RADIANCE: f32 = 1e9;
/// Largest intensity of a light in one channel, W/sr or W/(m sr).
pub const MAX_INTENSITY: f32 = 1e10;
/// Field of view, degrees: least and most. Inside (0, 180) by a margin that keeps its tangent and the focal length
/// well within single precision.
pub const FOV_Y: [f32; 2] = [1e-3, 179.9];
/// Least distance from a camera's eye to its target, metres.
pub const MIN_SIGHT: f32 = 1e-6;
/// Least sine of the angle between a camera's line of sight and its up direction.
pub const MIN_UP_SINE: f32 = 1e-4;
/// How far the length of a unit direction may be from 1.
pub const UNIT_TOLERANCE: f32 = 1e-2;
/// Area lights: how far a vertex may lie off the plane, and how much it may be dented, as a share of the polygon's
/// largest distance from its first vertex.
pub const POLYGON_TOLERANCE: f64 = 1e-4;
/// Least ratio of a transform's determinant to the product of its column lengths: below it, it is taken as singular.
pub const MIN_DETERMINANT: f64 = 1e-6;
/// Length of each column of a transform: least and most scale.
pub const SCALE: [f64; 2] = [1e-9, 1e9];

/// Most lights in a scene.
pub const MAX_LIGHTS: usize = 1 << 16;
/// Most vertices of an area light.
pub const MAX_LIGHT_VERTICES: usize = 256;
/// Most materials in a scene.
pub const MAX_MATERIALS: usize = 1 << 16;
/// Most textures in a scene.
pub const MAX_TEXTURES: usize = 4096;
/// Most meshes in a scene, and most objects.
pub const MAX_OBJECTS: usize = 1 << 20;

/// Most messages that answer nothing (`Status`, `Triples` and `Shadows`) that a server may send on top of one a sample,
/// until it answers a `Ping`; a message counts once, and once more for each 256 triples or lights in it.
pub const MAX_UNASKED: usize = 8192;

/// Heartbeat: a `Ping` that is not answered for this long means that the peer is gone, seconds.
pub const PING_TIMEOUT_S: u64 = 10;
/// Both sides have so long to prove that they know the secret, and a display to send its first message, seconds.
pub const AUTH_TIMEOUT_S: u64 = 5;
/// Connections that may wait to say who they are; a further one displaces the oldest.
pub const MAX_GUESTS: usize = 64;
/// Longest frame payload taken from a peer that has not said who it is, bytes: a `Hello` or a `Welcome` fits.
pub const MAX_GREETING: usize = 64 << 10;
/// Length of a secret: least and most, bytes.
pub const SECRET_BYTES: [usize; 2] = [16, 4096];

/// Longest payload of an entry in a trace, bytes.
pub const MAX_TRACE_ENTRY: usize = 64 << 20;
/// Longest header of a trace, bytes.
pub const MAX_TRACE_HEADER: usize = 1 << 20;

// The largest messages fit a frame.
const _: () = assert!(16 + 40 * MAX_BATCH as usize <= MAX_FRAME);
const _: () = assert!(16 + 12 * MAX_TRIPLES <= MAX_FRAME);
const _: () = assert!(24 + 52 * MAX_MOVES <= MAX_FRAME);
const _: () = assert!(12 + (16 + MAX_NAME) * MAX_SHADOWS <= MAX_FRAME);
const _: () = assert!(16 + 4 * MAX_LIGHTS <= MAX_FRAME);
const _: () = assert!(64 + 2 * MAX_NAME + 32 * MAX_HOLDS <= MAX_GREETING);
const _: () = assert!(12 + crate::scene::MAX_CHUNK <= MAX_FRAME);

/// Brings radiance into what the protocol allows: not-a-number and negative channels become 0, larger ones than
/// [`MAX_RADIANCE`] become that. A shader calls it last, since one bad channel would cost it its connection.
#[must_use]
pub fn clamp_radiance(radiance: [f32; 3]) -> [f32; 3] {
    radiance.map(|c| if c > 0.0 { c.min(MAX_RADIANCE) } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clamped_radiance_is_allowed() {
        let clamped = clamp_radiance([f32::NAN, f32::INFINITY, -1.0]);
        assert_eq!(clamped, [0.0, MAX_RADIANCE, 0.0]);
        assert_eq!(
            clamp_radiance([0.5, -0.0, f32::NEG_INFINITY]),
            [0.5, 0.0, 0.0]
        );
    }
}
