//! Values that a scene may not hold: each is told with `Value`, by a server that goes on.

use crate::encode;
use crate::messages::FaultCode::{Limit, Malformed, Value};
use crate::scene::{Light, Scene, Texture};

use super::Bench;
use super::check::{Check, Needs};
use super::peer::Peer;
use super::scene::send_raw;

type Change = fn(&mut Scene);

/// What is wrong, and how it gets there.
const CHANGES: [(&str, Change); 26] = [
    ("face-past-positions", |s| s.meshes[0].faces[0][2] = 4),
    ("mesh-past-table", |s| s.objects[0].mesh = 1),
    ("material-past-table", |s| s.objects[0].material = 2),
    ("map-past-table", |s| s.materials[0].diffuse_map = Some(0)),
    ("face-material-past-table", |s| {
        s.meshes[0].face_materials = vec![0, 2];
    }),
    ("normal-past-table", |s| {
        s.meshes[0].normals = vec![[0.0, 1.0, 0.0]];
        s.meshes[0].face_normals = vec![[0; 3], [0, 0, 1]];
    }),
    ("uv-past-table", |s| {
        s.meshes[0].uvs = vec![[0.0; 2]];
        s.meshes[0].face_uvs = vec![[0; 3], [0, 0, 1]];
    }),
    ("position-nan", |s| s.meshes[0].positions[1][1] = f32::NAN),
    ("position-infinite", |s| {
        s.meshes[0].positions[1][1] = f32::INFINITY;
    }),
    ("position-1e30", |s| s.meshes[0].positions[1][1] = 1e30),
    ("normal-long", |s| {
        s.meshes[0].normals = vec![[0.0, 2.0, 0.0]];
    }),
    ("uv-nan", |s| s.meshes[0].uvs = vec![[f32::NAN, 0.0]]),
    ("ambient-negative", |s| s.shading.ambient[0] = -0.1),
    ("background-nan", |s| s.shading.background[2] = f32::NAN),
    ("diffuse-above-1", |s| s.materials[0].diffuse[1] = 1.5),
    ("specular-nan", |s| s.materials[0].specular[1] = f32::NAN),
    ("roughness-0", |s| s.materials[0].roughness = 0.0),
    ("object-names-alike", |s| {
        s.objects[1].name = s.objects[0].name.clone();
    }),
    ("transform-singular", |s| {
        s.objects[1].transform[0] = s.objects[1].transform[2];
    }),
    ("transform-nan", |s| s.objects[1].transform[0][3] = f32::NAN),
    ("crease-angle-181", |s| s.objects[1].crease_angle = 181.0),
    ("intensity-negative", |s| {
        s.lights[0] = Light::Point {
            position: [0.0; 3],
            intensity: [-1.0, 0.0, 0.0],
        };
    }),
    ("light-nan", |s| {
        s.lights[0] = Light::Point {
            position: [f32::NAN, 0.0, 0.0],
            intensity: [1.0; 3],
        };
    }),
    ("linear-light-without-length", |s| {
        s.lights[0] = Light::Linear {
            from: [1.0; 3],
            to: [1.0; 3],
            intensity: [1.0; 3],
        };
    }),
    ("area-light-dented", |s| {
        s.lights[0] = Light::Area {
            vertices: vec![
                [0.0, 3.0, 0.0],
                [1.0, 3.0, 0.0],
                [0.2, 3.0, 0.2],
                [0.0, 3.0, 1.0],
            ],
            radiance: [1.0; 3],
        };
    }),
    ("area-light-bent", |s| {
        s.lights[0] = Light::Area {
            vertices: vec![
                [0.0, 3.0, 0.0],
                [1.0, 3.0, 0.0],
                [1.0, 3.5, 1.0],
                [0.0, 3.0, 1.0],
            ],
            radiance: [1.0; 3],
        };
    }),
];

/// Tables of the wrong length, which may be called a wrong count as well as a wrong value.
const LENGTHS: [(&str, Change); 5] = [
    ("texture-short", |s| {
        s.textures.push(Texture {
            width: 2,
            height: 2,
            rgb: vec![[0; 3]; 3],
        });
    }),
    ("texture-without-size", |s| {
        s.textures.push(Texture {
            width: 0,
            height: 0,
            rgb: Vec::new(),
        });
    }),
    ("face-normals-short", |s| {
        s.meshes[0].normals = vec![[0.0, 1.0, 0.0]];
        s.meshes[0].face_normals = vec![[0; 3]];
    }),
    ("face-materials-long", |s| {
        s.meshes[0].face_materials = vec![0; 3];
    }),
    ("area-light-two-vertices", |s| {
        s.lights[0] = Light::Area {
            vertices: vec![[0.0, 3.0, 0.0], [1.0, 3.0, 0.0]],
            radiance: [1.0; 3],
        };
    }),
];

pub(super) fn checks() -> Vec<Check> {
    let values = CHANGES.iter().map(|change| (change, &[Value][..]));
    let lengths = LENGTHS
        .iter()
        .map(|change| (change, &[Value, Limit, Malformed][..]));
    values
        .chain(lengths)
        .map(|(&(name, change), codes)| {
            let run = move |bench: &Bench| {
                let mut scene = bench.worlds.lit.scene.clone();
                change(&mut scene);
                let mut peer = Peer::greeted(bench)?;
                send_raw(&mut peer, &encode(&scene).unwrap_or_default());
                peer.expect_fault(codes)
            };
            Check::new(&format!("scene.{name}"), "5, Scene", run).needing(Needs::Welcome)
        })
        .collect()
}
