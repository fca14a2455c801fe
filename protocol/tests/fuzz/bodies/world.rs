//! The scene that sessions are about, and values for messages.

use std::sync::OnceLock;

use protocol::messages::{Camera, Capabilities, Sample, SampleRequest, flags};
use protocol::scene::{Light, Material, Mesh, Model, Object, Scene, Shading};
use protocol::transfer::EncodedScene;

use super::source::Source;

pub(super) const IMAGE: u32 = 8;

pub(super) fn scene() -> Scene {
    Scene {
        shading: Shading {
            model: Model::Direct,
            ambient: [0.0; 3],
            background: [0.0; 3],
        },
        lights: vec![
            light(),
            Light::Linear {
                from: [0.0; 3],
                to: [1.0; 3],
                intensity: [1.0; 3],
            },
        ],
        materials: vec![Material {
            name: "m".into(),
            diffuse: [0.5; 3],
            diffuse_map: None,
            specular: [0.0; 3],
            roughness: 1.0,
        }],
        textures: vec![],
        meshes: vec![Mesh {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            faces: vec![[0, 1, 2]],
            ..Mesh::default()
        }],
        objects: vec![Object {
            name: "o".into(),
            mesh: 0,
            material: 0,
            transform: IDENTITY,
            crease_angle: 85.0,
        }],
    }
}

pub(super) const IDENTITY: [[f32; 4]; 3] = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
];

pub(super) fn light() -> Light {
    Light::Point {
        position: [0.0; 3],
        intensity: [1.0; 3],
    }
}

pub(super) fn encoded() -> &'static EncodedScene {
    static ENCODED: OnceLock<EncodedScene> = OnceLock::new();
    ENCODED.get_or_init(|| EncodedScene::new(&scene()).expect("the scene is good"))
}

pub(super) fn camera() -> Camera {
    Camera {
        eye: [0.0; 3],
        target: [0.0, 0.0, -1.0],
        up: [0.0, 1.0, 0.0],
        fov_y: 45.0,
        width: IMAGE,
        height: IMAGE,
    }
}

/// Few credits, so that they run out.
pub(super) fn offer(source: &mut Source) -> Capabilities {
    Capabilities {
        credits: 1 + source.below(12) as u32,
        max_batch: 1 + source.below(8) as u32,
        triples: true,
        edits: !source.chance(8),
        threads: 1,
    }
}

/// A good request, mostly.
pub(super) fn request(source: &mut Source, id: u64) -> SampleRequest {
    let wild = source.chance(32);
    SampleRequest {
        id,
        x: if wild { source.u64() as u16 } else { 3 },
        y: source.below(IMAGE as usize) as u16,
        offset: if wild { source.numbers() } else { [0.5; 2] },
    }
}

/// A good sample, mostly.
pub(super) fn sample(source: &mut Source, id: u64) -> Sample {
    let wild = source.chance(32);
    Sample {
        id,
        position: if wild { source.numbers() } else { [0.5; 3] },
        object: if wild { source.close_to(1) } else { 0 },
        radiance: if wild { source.numbers() } else { [1.0; 3] },
        flags: match source.byte() {
            0..=127 => 0,
            128..=249 => flags::LIGHT,
            _ => source.u64() as u32,
        },
    }
}
