//! The examples in `PROTOCOL.md` are what the code sends. `UPDATE_EXAMPLES=1` writes them anew.
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use protocol::codec::encode;
use protocol::framing::{HEADER, Message, frame};
use protocol::messages::*;
use protocol::scene::*;
use protocol::transfer::EncodedScene;
use protocol::validate::validate_scene;
use protocol::{ToDisplay, ToServer};
use serde::Serialize;

const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/PROTOCOL.md");

/// A value taken apart by hand: each line's bytes and what they are.
struct Example {
    name: &'static str,
    lines: Vec<(Vec<u8>, &'static str)>,
}

fn bytes<T: Serialize>(value: T, label: &'static str) -> (Vec<u8>, &'static str) {
    (encode(&value).unwrap(), label)
}

fn text(value: &str) -> [(Vec<u8>, &'static str); 2] {
    [
        bytes(value.len() as u64, "length"),
        (value.as_bytes().to_vec(), "text"),
    ]
}

/// Checks that the parts are the message, and puts the frame's header before them.
fn example<M: Message>(
    name: &'static str,
    message: &M,
    parts: Vec<(Vec<u8>, &'static str)>,
) -> Example {
    message.validate().unwrap();
    let whole = frame(message).unwrap();
    let mut lines = vec![(whole[..HEADER].to_vec(), "frame: payload length")];
    lines.extend(parts);
    let joined: Vec<u8> = lines.iter().flat_map(|(bytes, _)| bytes.clone()).collect();
    assert_eq!(joined, whole, "the parts of {name} are not its bytes");
    Example { name, lines }
}

/// The scene of the examples: a triangle under a point light.
fn scene() -> Scene {
    Scene {
        shading: Shading {
            model: Model::Direct,
            ambient: [0.0; 3],
            background: [0.25; 3],
        },
        lights: vec![Light::Point {
            position: [0.0, 2.0, 0.0],
            intensity: [8.0; 3],
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
            positions: vec![[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 0.0, -1.0]],
            faces: vec![[0, 1, 2]],
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

fn scene_example() -> Example {
    let scene = scene();
    validate_scene(&scene).unwrap();
    let mut lines = vec![
        bytes(0u32, "shading.model: Direct"),
        bytes([0.0f32; 3], "shading.ambient"),
        bytes([0.25f32; 3], "shading.background"),
        bytes(1u64, "lights: count"),
        bytes(0u32, "lights[0]: Point"),
        bytes([0.0f32, 2.0, 0.0], "position"),
        bytes([8.0f32; 3], "intensity"),
        bytes(1u64, "materials: count"),
    ];
    lines.extend(text("grey"));
    lines.extend([
        bytes([0.5f32; 3], "diffuse"),
        bytes(None::<u32>, "diffuse_map: none"),
        bytes([0.0f32; 3], "specular"),
        bytes(1.0f32, "roughness"),
        bytes(0u64, "textures: count"),
        bytes(1u64, "meshes: count"),
        bytes(3u64, "positions: count"),
        bytes([-1.0f32, 0.0, 1.0], "positions[0]"),
        bytes([1.0f32, 0.0, 1.0], "positions[1]"),
        bytes([0.0f32, 0.0, -1.0], "positions[2]"),
        bytes(1u64, "faces: count"),
        bytes([0u32, 1, 2], "faces[0]"),
        bytes(0u64, "normals: count"),
        bytes(0u64, "face_normals: count"),
        bytes(0u64, "uvs: count"),
        bytes(0u64, "face_uvs: count"),
        bytes(0u64, "face_materials: count"),
        bytes(1u64, "objects: count"),
    ]);
    lines.extend(text("floor"));
    lines.extend([
        bytes(0u32, "mesh"),
        bytes(0u32, "material"),
        bytes(scene.objects[0].transform, "transform, row by row"),
        bytes(85.0f32, "crease_angle"),
    ]);
    let joined: Vec<u8> = lines.iter().flat_map(|(bytes, _)| bytes.clone()).collect();
    assert_eq!(joined, encode(&scene).unwrap());
    Example {
        name: "scene",
        lines,
    }
}

fn to_server_examples() -> Vec<Example> {
    let encoded = EncodedScene::new(&scene()).unwrap();
    let camera = Camera {
        eye: [0.0, 1.0, 4.0],
        target: [0.0; 3],
        up: [0.0, 1.0, 0.0],
        fov_y: 45.0,
        width: 64,
        height: 48,
    };
    let hello = ToServer::Hello {
        min_version: 1,
        max_version: 1,
        name: "example".into(),
        seed: 7,
    };
    let mut hello_parts = vec![
        bytes(0u32, "Hello"),
        bytes(1u16, "min_version"),
        bytes(1u16, "max_version"),
    ];
    hello_parts.extend(text("example"));
    hello_parts.push(bytes(7u64, "seed"));
    let request = SampleRequest {
        id: 258,
        x: 32,
        y: 24,
        offset: [0.5, 0.25],
    };
    let chunk = ToServer::SceneChunk {
        data: encoded.bytes()[..5].to_vec(),
    };
    let transform: Affine = [
        [1.0, 0.0, 0.0, 0.5],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
    ];
    let moved = ObjectMove {
        object: 0,
        transform,
    };
    let light = Light::Point {
        position: [1.0, 2.0, 0.0],
        intensity: [8.0; 3],
    };
    let edit = ToServer::Edit {
        epoch: 1,
        objects: vec![moved],
        lights: vec![LightMove {
            light: 0,
            value: light,
        }],
    };
    let fault = ToServer::Fault {
        code: FaultCode::Value,
        text: "NaN".into(),
    };
    let mut fault_parts = vec![bytes(9u32, "Fault"), bytes(4u32, "code: Value")];
    fault_parts.extend(text("NaN"));
    vec![
        example("hello", &hello, hello_parts),
        example(
            "scene-begin",
            &encoded.begin(),
            vec![
                bytes(1u32, "SceneBegin"),
                bytes(encoded.digest(), "digest"),
                bytes(encoded.bytes().len() as u64, "bytes"),
            ],
        ),
        example(
            "scene-chunk",
            &chunk,
            vec![
                bytes(2u32, "SceneChunk"),
                bytes(5u64, "data: count"),
                (encoded.bytes()[..5].to_vec(), "data"),
            ],
        ),
        example(
            "view",
            &ToServer::View { view: 1, camera },
            vec![
                bytes(3u32, "View"),
                bytes(1u32, "view"),
                bytes(camera.eye, "camera.eye"),
                bytes(camera.target, "camera.target"),
                bytes(camera.up, "camera.up"),
                bytes(camera.fov_y, "camera.fov_y"),
                bytes(camera.width, "camera.width"),
                bytes(camera.height, "camera.height"),
            ],
        ),
        example(
            "request",
            &ToServer::Request {
                view: 1,
                samples: vec![request],
            },
            vec![
                bytes(4u32, "Request"),
                bytes(1u32, "view"),
                bytes(1u64, "samples: count"),
                bytes(258u64, "samples[0].id"),
                bytes(32u16, "x"),
                bytes(24u16, "y"),
                bytes([0.5f32, 0.25], "offset"),
            ],
        ),
        example(
            "edit",
            &edit,
            vec![
                bytes(5u32, "Edit"),
                bytes(1u32, "epoch"),
                bytes(1u64, "objects: count"),
                bytes(0u32, "objects[0].object"),
                bytes(transform, "transform, row by row"),
                bytes(1u64, "lights: count"),
                bytes(0u32, "lights[0].light"),
                bytes(0u32, "value: Point"),
                bytes([1.0f32, 2.0, 0.0], "position"),
                bytes([8.0f32; 3], "intensity"),
            ],
        ),
        example(
            "cancel",
            &ToServer::Cancel { views_before: 2 },
            vec![bytes(6u32, "Cancel"), bytes(2u32, "views_before")],
        ),
        example(
            "ping",
            &ToServer::Ping { token: 9 },
            vec![bytes(7u32, "Ping"), bytes(9u64, "token")],
        ),
        example("goodbye", &ToServer::Goodbye, vec![bytes(8u32, "Goodbye")]),
        example(
            "shadows-to-server",
            &ToServer::Shadows {
                steady: true,
                error: 0.0625,
                methods: vec![ShadowMethod::Auto, ShadowMethod::Penumbra],
            },
            vec![
                bytes(10u32, "Shadows"),
                bytes(1u8, "steady"),
                bytes(0.0625f32, "error"),
                bytes(2u64, "methods: count"),
                bytes(0u32, "methods[0]: Auto"),
                bytes(2u32, "methods[1]: Penumbra"),
            ],
        ),
        example("fault-to-server", &fault, fault_parts),
    ]
}

fn to_display_examples() -> Vec<Example> {
    let digest = EncodedScene::new(&scene()).unwrap().digest();
    let capabilities = Capabilities {
        credits: 4096,
        max_batch: 512,
        triples: true,
        edits: true,
        threads: 2,
    };
    let welcome = ToDisplay::Welcome {
        version: 1,
        name: "example".into(),
        shader: "direct".into(),
        capabilities: capabilities.clone(),
        holds: vec![digest],
    };
    let mut welcome_parts = vec![bytes(0u32, "Welcome"), bytes(1u16, "version")];
    welcome_parts.extend(text("example"));
    welcome_parts.extend(text("direct"));
    welcome_parts.extend([
        bytes(4096u32, "capabilities.credits"),
        bytes(512u32, "capabilities.max_batch"),
        bytes(true, "capabilities.triples"),
        bytes(true, "capabilities.edits"),
        bytes(2u32, "capabilities.threads"),
        bytes(1u64, "holds: count"),
        bytes(digest, "holds[0]"),
    ]);
    let sample = Sample {
        id: 258,
        position: [0.125, 0.0, 0.5],
        object: 0,
        radiance: [0.25, 0.25, 0.25],
        flags: 0,
    };
    let texel = Texel {
        face: 0,
        reflectance: [0.5, 0.25, 0.125],
        reflected: [0.5, 1.0, 2.0],
    };
    let triple = Triple {
        light: 0,
        blocker: 0,
        receiver: 0,
    };
    let fault = ToDisplay::Fault {
        code: FaultCode::Limit,
        text: "too many".into(),
    };
    let mut fault_parts = vec![bytes(6u32, "Fault"), bytes(3u32, "code: Limit")];
    fault_parts.extend(text("too many"));
    let status = ToDisplay::Status {
        queued: 3,
        traced: 100,
        rays: 250,
        cancelled_before: 2,
    };
    let shadows = ToDisplay::Shadows {
        lights: vec![LightShadows {
            light: 0,
            method: ShadowMethod::Rays,
            why: "a point".into(),
        }],
    };
    let mut shadows_parts = vec![
        bytes(8u32, "Shadows"),
        bytes(1u64, "lights: count"),
        bytes(0u32, "lights[0].light"),
        bytes(1u32, "method: Rays"),
    ];
    shadows_parts.extend(text("a point"));
    vec![
        example("welcome", &welcome, welcome_parts),
        example(
            "scene-ready",
            &ToDisplay::SceneReady { digest },
            vec![bytes(1u32, "SceneReady"), bytes(digest, "digest")],
        ),
        example(
            "samples",
            &ToDisplay::Samples {
                view: 1,
                epoch: 0,
                samples: vec![sample],
            },
            vec![
                bytes(2u32, "Samples"),
                bytes(1u32, "view"),
                bytes(0u32, "epoch"),
                bytes(1u64, "samples: count"),
                bytes(258u64, "samples[0].id"),
                bytes(sample.position, "position"),
                bytes(0u32, "object"),
                bytes(sample.radiance, "radiance"),
                bytes(0u32, "flags"),
            ],
        ),
        example(
            "triples",
            &ToDisplay::Triples {
                epoch: 0,
                triples: vec![triple],
            },
            vec![
                bytes(3u32, "Triples"),
                bytes(0u32, "epoch"),
                bytes(1u64, "triples: count"),
                bytes([0u32; 3], "triples[0]: light, blocker, receiver"),
            ],
        ),
        example(
            "status",
            &status,
            vec![
                bytes(4u32, "Status"),
                bytes(3u32, "queued"),
                bytes(100u64, "traced"),
                bytes(250u64, "rays"),
                bytes(2u32, "cancelled_before"),
            ],
        ),
        example(
            "pong",
            &ToDisplay::Pong { token: 9 },
            vec![bytes(5u32, "Pong"), bytes(9u64, "token")],
        ),
        example("fault-to-display", &fault, fault_parts),
        example(
            "textured",
            &ToDisplay::Textured {
                view: 1,
                epoch: 0,
                samples: vec![TexturedSample { sample, texel }],
            },
            vec![
                bytes(7u32, "Textured"),
                bytes(1u32, "view"),
                bytes(0u32, "epoch"),
                bytes(1u64, "samples: count"),
                bytes(258u64, "samples[0].id"),
                bytes(sample.position, "position"),
                bytes(0u32, "object"),
                bytes(sample.radiance, "radiance"),
                bytes(0u32, "flags"),
                bytes(0u32, "face"),
                bytes(texel.reflectance, "reflectance"),
                bytes(texel.reflected, "reflected"),
            ],
        ),
        example("shadows-to-display", &shadows, shadows_parts),
    ]
}

/// 16 bytes a line, the label on the first.
fn render(example: &Example) -> String {
    let mut out = String::new();
    for (bytes, label) in &example.lines {
        for (i, row) in bytes.chunks(16).enumerate() {
            let hex = row
                .iter()
                .map(|b| format!("{b:02x}"))
                .collect::<Vec<_>>()
                .join(" ");
            let line = if i == 0 {
                format!("{hex:<47}  {label}")
            } else {
                hex
            };
            out.push_str(line.trim_end());
            out.push('\n');
        }
    }
    out
}

#[test]
fn the_document_shows_what_is_sent() {
    let mut document = std::fs::read_to_string(PATH).unwrap();
    let update = std::env::var_os("UPDATE_EXAMPLES").is_some();
    let mut examples = to_server_examples();
    examples.extend(to_display_examples());
    examples.push(scene_example());
    for example in &examples {
        let opening = format!("<!-- example: {} -->\n```text\n", example.name);
        let start = document.find(&opening).expect(example.name) + opening.len();
        let end = start
            + document[start..]
                .find("```")
                .expect("the example has an end");
        let expected = render(example);
        if update {
            document.replace_range(start..end, &expected);
        } else {
            assert_eq!(&document[start..end], expected, "example {}", example.name);
        }
    }
    let shown = document.matches("<!-- example: ").count();
    assert_eq!(
        shown,
        examples.len(),
        "the document has examples that the code does not know"
    );
    if update {
        std::fs::write(PATH, document).unwrap();
    }
}
