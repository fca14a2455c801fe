//! Strategies for every message, and a scene that has something in every table.
#![allow(dead_code, reason = "each test binary uses its part")]

use proptest::collection::vec;
use proptest::option;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use protocol::messages::*;
use protocol::scene::*;

pub(crate) const IDENTITY: Affine = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
];

/// Fixed seed, no files.
pub(crate) fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: RngSeed::Fixed(0x5eed),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// A valid scene with one of everything.
pub(crate) fn scene() -> Scene {
    Scene {
        shading: Shading {
            model: Model::Glossy,
            ambient: [0.1; 3],
            background: [0.0, 0.0, 0.2],
        },
        lights: vec![
            Light::Point {
                position: [0.0, 3.0, 0.0],
                intensity: [10.0; 3],
            },
            Light::Linear {
                from: [0.0; 3],
                to: [1.0; 3],
                intensity: [1.0; 3],
            },
            Light::Area {
                vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
                radiance: [5.0; 3],
            },
        ],
        materials: vec![Material {
            name: "wall".into(),
            diffuse: [0.7; 3],
            diffuse_map: Some(0),
            specular: [0.04; 3],
            roughness: 0.3,
        }],
        textures: vec![Texture {
            width: 2,
            height: 1,
            rgb: vec![[1, 2, 3], [4, 5, 6]],
        }],
        meshes: vec![Mesh {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            faces: vec![[0, 1, 2]],
            normals: vec![[0.0, 0.0, 1.0]],
            face_normals: vec![[0, 0, 0]],
            uvs: vec![[0.0, 0.5]],
            face_uvs: vec![[0, 0, 0]],
            face_materials: vec![0],
        }],
        objects: vec![Object {
            name: "thing".into(),
            mesh: 0,
            material: 0,
            transform: IDENTITY,
            crease_angle: 85.0,
        }],
    }
}

type F3 = [f32; 3];

fn f3() -> impl Strategy<Value = F3> {
    any::<F3>()
}

fn light() -> impl Strategy<Value = Light> {
    prop_oneof![
        (f3(), f3()).prop_map(|(position, intensity)| Light::Point {
            position,
            intensity
        }),
        (f3(), f3(), f3()).prop_map(|(from, to, intensity)| Light::Linear {
            from,
            to,
            intensity
        }),
        (vec(f3(), 0..6), f3()).prop_map(|(vertices, radiance)| Light::Area { vertices, radiance }),
    ]
}

fn camera() -> impl Strategy<Value = Camera> {
    (f3(), f3(), f3(), any::<f32>(), any::<(u32, u32)>()).prop_map(
        |(eye, target, up, fov_y, (width, height))| Camera {
            eye,
            target,
            up,
            fov_y,
            width,
            height,
        },
    )
}

fn request() -> impl Strategy<Value = SampleRequest> {
    any::<(u64, u16, u16, [f32; 2])>().prop_map(|(id, x, y, offset)| SampleRequest {
        id,
        x,
        y,
        offset,
    })
}

fn sample() -> impl Strategy<Value = Sample> {
    any::<(u64, F3, u32, F3, u32)>().prop_map(|(id, position, object, radiance, flags)| Sample {
        id,
        position,
        object,
        radiance,
        flags,
    })
}

fn fault_code() -> impl Strategy<Value = FaultCode> {
    prop_oneof![
        Just(FaultCode::Version),
        Just(FaultCode::Malformed),
        Just(FaultCode::OutOfOrder),
        Just(FaultCode::Limit),
        Just(FaultCode::Value),
        Just(FaultCode::Unsupported),
        Just(FaultCode::Internal),
    ]
}

/// Any message to a server, its values good or not.
pub(crate) fn to_server() -> impl Strategy<Value = ToServer> {
    let object_move =
        any::<(u32, Affine)>().prop_map(|(object, transform)| ObjectMove { object, transform });
    let light_move = (any::<u32>(), light()).prop_map(|(light, value)| LightMove { light, value });
    prop_oneof![
        (any::<(u16, u16, u64)>(), ".{0,9}").prop_map(
            |((min_version, max_version, seed), name)| ToServer::Hello {
                min_version,
                max_version,
                name,
                seed
            }
        ),
        any::<(Digest, u64)>().prop_map(|(digest, bytes)| ToServer::SceneBegin { digest, bytes }),
        vec(any::<u8>(), 0..50).prop_map(|data| ToServer::SceneChunk { data }),
        (any::<u32>(), camera()).prop_map(|(view, camera)| ToServer::View { view, camera }),
        (any::<u32>(), vec(request(), 0..5))
            .prop_map(|(view, samples)| ToServer::Request { view, samples }),
        (any::<u32>(), vec(object_move, 0..4), vec(light_move, 0..4)).prop_map(
            |(epoch, objects, lights)| ToServer::Edit {
                epoch,
                objects,
                lights
            }
        ),
        any::<u32>().prop_map(|views_before| ToServer::Cancel { views_before }),
        any::<u64>().prop_map(|token| ToServer::Ping { token }),
        Just(ToServer::Goodbye),
        (fault_code(), ".{0,9}").prop_map(|(code, text)| ToServer::Fault { code, text }),
    ]
}

/// Any message to a display, its values good or not.
pub(crate) fn to_display() -> impl Strategy<Value = ToDisplay> {
    let capabilities = any::<(u32, u32, bool, bool, u32)>().prop_map(
        |(credits, max_batch, triples, edits, threads)| Capabilities {
            credits,
            max_batch,
            triples,
            edits,
            threads,
        },
    );
    let triple = any::<[u32; 3]>().prop_map(|[light, blocker, receiver]| Triple {
        light,
        blocker,
        receiver,
    });
    prop_oneof![
        (
            any::<u16>(),
            ".{0,9}",
            ".{0,9}",
            capabilities,
            vec(any::<Digest>(), 0..3)
        )
            .prop_map(
                |(version, name, shader, capabilities, holds)| ToDisplay::Welcome {
                    version,
                    name,
                    shader,
                    capabilities,
                    holds
                }
            ),
        any::<Digest>().prop_map(|digest| ToDisplay::SceneReady { digest }),
        (any::<(u32, u32)>(), vec(sample(), 0..5)).prop_map(|((view, epoch), samples)| {
            ToDisplay::Samples {
                view,
                epoch,
                samples,
            }
        }),
        (
            any::<(u32, u32)>(),
            vec(
                (sample(), any::<u32>(), f3(), f3()).prop_map(
                    |(sample, face, reflectance, reflected)| TexturedSample {
                        sample,
                        texel: Texel {
                            face,
                            reflectance,
                            reflected
                        }
                    }
                ),
                0..5
            )
        )
            .prop_map(|((view, epoch), samples)| ToDisplay::Textured {
                view,
                epoch,
                samples
            }),
        (any::<u32>(), vec(triple, 0..5))
            .prop_map(|(epoch, triples)| ToDisplay::Triples { epoch, triples }),
        any::<(u32, u64, u64, u32)>().prop_map(|(queued, traced, rays, cancelled_before)| {
            ToDisplay::Status {
                queued,
                traced,
                rays,
                cancelled_before,
            }
        }),
        any::<u64>().prop_map(|token| ToDisplay::Pong { token }),
        (fault_code(), ".{0,9}").prop_map(|(code, text)| ToDisplay::Fault { code, text }),
    ]
}

fn mesh() -> impl Strategy<Value = Mesh> {
    (
        vec(f3(), 0..4),
        vec(any::<[u32; 3]>(), 0..4),
        vec(f3(), 0..4),
        vec(any::<[u32; 3]>(), 0..4),
        vec(any::<[f32; 2]>(), 0..4),
        vec(any::<[u32; 3]>(), 0..4),
        vec(any::<u32>(), 0..4),
    )
        .prop_map(
            |(positions, faces, normals, face_normals, uvs, face_uvs, face_materials)| Mesh {
                positions,
                faces,
                normals,
                face_normals,
                uvs,
                face_uvs,
                face_materials,
            },
        )
}

/// Any scene, its values good or not.
pub(crate) fn any_scene() -> impl Strategy<Value = Scene> {
    let model = prop_oneof![
        Just(Model::Direct),
        Just(Model::Glossy),
        Just(Model::Global)
    ];
    let shading = (model, f3(), f3()).prop_map(|(model, ambient, background)| Shading {
        model,
        ambient,
        background,
    });
    let material = (".{0,9}", f3(), option::of(any::<u32>()), f3(), any::<f32>()).prop_map(
        |(name, diffuse, diffuse_map, specular, roughness)| Material {
            name,
            diffuse,
            diffuse_map,
            specular,
            roughness,
        },
    );
    let texture = (any::<(u32, u32)>(), vec(any::<[u8; 3]>(), 0..9))
        .prop_map(|((width, height), rgb)| Texture { width, height, rgb });
    let object = (".{0,9}", any::<(u32, u32, Affine, f32)>()).prop_map(
        |(name, (mesh, material, transform, crease_angle))| Object {
            name,
            mesh,
            material,
            transform,
            crease_angle,
        },
    );
    (
        shading,
        vec(light(), 0..4),
        vec(material, 0..3),
        vec(texture, 0..3),
        vec(mesh(), 0..3),
        vec(object, 0..3),
    )
        .prop_map(
            |(shading, lights, materials, textures, meshes, objects)| Scene {
                shading,
                lights,
                materials,
                textures,
                meshes,
                objects,
            },
        )
}
