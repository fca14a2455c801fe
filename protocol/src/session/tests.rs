use super::*;
use crate::handshake::hello;
use crate::limits::MAX_UNASKED;
use crate::messages::{
    Camera, Capabilities, LightShadows, Sample, SampleRequest, ShadowMethod, Texel, TexturedSample,
    Triple, VERSION,
};
use crate::scene::{Light, Material, Mesh, Model, Object, Scene, Shading};
use crate::transfer::EncodedScene;

fn scene() -> Scene {
    Scene {
        shading: Shading {
            model: Model::Direct,
            ambient: [0.0; 3],
            background: [0.0; 3],
        },
        lights: vec![Light::Point {
            position: [0.0; 3],
            intensity: [1.0; 3],
        }],
        materials: vec![],
        textures: vec![],
        meshes: vec![],
        objects: vec![],
    }
}

fn camera() -> Camera {
    Camera {
        eye: [0.0; 3],
        target: [0.0, 0.0, -1.0],
        up: [0.0, 1.0, 0.0],
        fov_y: 45.0,
        width: 4,
        height: 4,
    }
}

fn capabilities() -> Capabilities {
    Capabilities {
        credits: 3,
        max_batch: 2,
        triples: true,
        edits: true,
        threads: 1,
    }
}

fn request(id: u64) -> SampleRequest {
    SampleRequest {
        id,
        x: 3,
        y: 0,
        offset: [0.5; 2],
    }
}

fn hit_on_light(id: u64) -> Sample {
    Sample {
        id,
        position: [0.0; 3],
        object: 0,
        radiance: [1.0; 3],
        flags: 8,
    }
}

/// Both ends, past the handshake and the scene, and view 1.
fn ready() -> (DisplaySession, ServerSession) {
    ready_in(&scene(), VERSION)
}

/// The same with this scene, and a server that chose this version.
fn ready_in(scene: &Scene, version: u16) -> (DisplaySession, ServerSession) {
    let encoded = EncodedScene::new(scene).unwrap();
    let mut display = DisplaySession::new(SceneSize::from(scene));
    let mut server = ServerSession::new(capabilities(), vec![], 1000);
    assert!(matches!(
        server.receive(hello("t", 1)).unwrap(),
        ServerEvent::Hello {
            version: VERSION,
            ..
        }
    ));
    let welcome = ToDisplay::Welcome {
        version,
        name: "s".into(),
        shader: "direct".into(),
        capabilities: capabilities(),
        holds: vec![],
    };
    assert_eq!(display.receive(&welcome).unwrap(), DisplayEvent::Welcome);
    assert!(!display.announce(encoded.digest()));
    assert_eq!(display.free_credits(), 0);
    assert!(matches!(
        server.receive(encoded.begin()).unwrap(),
        ServerEvent::More
    ));
    for chunk in encoded.chunks() {
        let ServerEvent::Scene(digest, assembler) = server.receive(chunk).unwrap() else {
            panic!("the scene fits one chunk")
        };
        assert_eq!(digest, encoded.digest());
        server.scene_built(&assembler.finish().unwrap());
    }
    let event = display
        .receive(&ToDisplay::SceneReady {
            digest: encoded.digest(),
        })
        .unwrap();
    assert_eq!(event, DisplayEvent::Ready);
    server
        .receive(ToServer::View {
            view: 1,
            camera: camera(),
        })
        .unwrap();
    (display, server)
}

fn code<T: std::fmt::Debug>(result: Result<T, Violation>) -> FaultCode {
    result.unwrap_err().code
}

fn samples(view: u32, ids: &[u64]) -> ToDisplay {
    let samples = ids.iter().map(|&id| hit_on_light(id)).collect();
    ToDisplay::Samples {
        view,
        epoch: 0,
        samples,
    }
}

#[test]
fn credits_are_counted_on_both_sides() {
    let (mut display, mut server) = ready();
    let ask = |ids: &[u64]| ToServer::Request {
        view: 1,
        samples: ids.iter().map(|&id| request(id)).collect(),
    };
    assert_eq!(display.free_credits(), 3);
    display.requested(1, &[request(1), request(2)]);
    assert!(matches!(
        server.receive(ask(&[1, 2])).unwrap(),
        ServerEvent::Request { .. }
    ));
    assert_eq!(display.free_credits(), 1);
    assert_eq!(code(server.receive(ask(&[3, 4]))), FaultCode::Limit);
    assert!(server.release(1) && !server.release(1));
    display.receive(&samples(1, &[1])).unwrap();
    assert_eq!((display.free_credits(), server.held()), (2, 1));
    assert_eq!(code(server.receive(ask(&[2]))), FaultCode::Value);
}

#[test]
fn batches_have_their_own_limit() {
    let (_, mut server) = ready();
    let samples = vec![request(1), request(2), request(3)];
    assert_eq!(
        code(server.receive(ToServer::Request { view: 1, samples })),
        FaultCode::Limit
    );
}

#[test]
fn a_bad_batch_leaves_all_its_requests_outstanding() {
    let (mut display, _) = ready();
    display.requested(1, &[request(1), request(2)]);
    assert_eq!(
        code(display.receive(&samples(1, &[1, 7]))),
        FaultCode::OutOfOrder
    );
    assert_eq!(
        code(display.receive(&samples(1, &[1, 1]))),
        FaultCode::OutOfOrder
    );
    assert_eq!(code(display.receive(&samples(2, &[1]))), FaultCode::Value);
    assert_eq!(display.outstanding(), 2);
    let ids: Vec<_> = display
        .take_outstanding()
        .iter()
        .map(|held| held.request.id)
        .collect();
    assert_eq!(ids, [1, 2]);
}

#[test]
fn cancelling_gives_credit_back_once() {
    let (mut display, mut server) = ready();
    let status = |cancelled_before| ToDisplay::Status {
        queued: 0,
        traced: 0,
        rays: 0,
        cancelled_before,
    };
    display.requested(1, &[request(1)]);
    server
        .receive(ToServer::Request {
            view: 1,
            samples: vec![request(1)],
        })
        .unwrap();
    assert_eq!(code(display.receive(&status(2))), FaultCode::Value);
    display.cancelling(2);
    server
        .receive(ToServer::Cancel { views_before: 2 })
        .unwrap();
    assert!(!server.release(1));
    assert_eq!(
        display.receive(&status(2)).unwrap(),
        DisplayEvent::Status { released: vec![1] }
    );
    assert_eq!(
        code(display.receive(&samples(1, &[1]))),
        FaultCode::OutOfOrder
    );
    assert_eq!(code(display.receive(&status(1))), FaultCode::Value);
    let late = ToServer::Request {
        view: 1,
        samples: vec![request(2)],
    };
    assert_eq!(code(server.receive(late)), FaultCode::OutOfOrder);
}

#[test]
fn epochs_follow_each_other_and_never_run_ahead() {
    let (mut display, mut server) = ready();
    let edit = |epoch| ToServer::Edit {
        epoch,
        objects: vec![],
        lights: vec![],
    };
    assert_eq!(code(server.receive(edit(2))), FaultCode::OutOfOrder);
    server.receive(edit(1)).unwrap();
    let triples = ToDisplay::Triples {
        epoch: 1,
        triples: vec![],
    };
    assert_eq!(code(display.receive(&triples)), FaultCode::Value);
    display.edited(1);
    display.receive(&triples).unwrap();
}

#[test]
fn textured_samples_answer_requests_from_version_2_on_and_name_faces_that_are_there() {
    let mut scene = scene();
    scene.meshes = vec![Mesh {
        positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        faces: vec![[0, 1, 2]],
        ..Mesh::default()
    }];
    scene.materials = vec![Material {
        name: "m".into(),
        diffuse: [0.5; 3],
        diffuse_map: None,
        specular: [0.0; 3],
        roughness: 1.0,
    }];
    scene.objects = vec![Object {
        name: "o".into(),
        mesh: 0,
        material: 0,
        transform: [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
        ],
        crease_angle: 85.0,
    }];
    let with = |face| ToDisplay::Textured {
        view: 1,
        epoch: 0,
        samples: vec![TexturedSample {
            sample: Sample {
                object: 0,
                flags: 0,
                ..hit_on_light(1)
            },
            texel: Texel {
                face,
                reflectance: [0.5; 3],
                reflected: [2.0; 3],
            },
        }],
    };
    let (mut display, _) = ready_in(&scene, VERSION);
    display.requested(1, &[request(1)]);
    assert_eq!(code(display.receive(&with(1))), FaultCode::Value);
    assert_eq!(display.outstanding(), 1);
    assert_eq!(display.receive(&with(0)).unwrap(), DisplayEvent::Samples);
    assert_eq!(display.outstanding(), 0);
    assert_eq!(code(display.receive(&with(0))), FaultCode::OutOfOrder);
    let (mut display, _) = ready_in(&scene, 1);
    display.requested(1, &[request(1)]);
    assert_eq!(code(display.receive(&with(0))), FaultCode::OutOfOrder);
}

#[test]
fn indices_are_checked_against_the_scene() {
    let (mut display, mut server) = ready();
    display.requested(1, &[request(1)]);
    let with = |object, flags| ToDisplay::Samples {
        view: 1,
        epoch: 0,
        samples: vec![Sample {
            object,
            flags,
            ..hit_on_light(1)
        }],
    };
    assert_eq!(code(display.receive(&with(1, 8))), FaultCode::Value);
    assert_eq!(code(display.receive(&with(0, 0))), FaultCode::Value);
    let triple = Triple {
        light: 0,
        blocker: 0,
        receiver: 0,
    };
    let triples = ToDisplay::Triples {
        epoch: 0,
        triples: vec![triple],
    };
    assert_eq!(code(display.receive(&triples)), FaultCode::Value);
    let value = Light::Linear {
        from: [0.0; 3],
        to: [1.0; 3],
        intensity: [1.0; 3],
    };
    let lights = vec![crate::messages::LightMove { light: 0, value }];
    assert_eq!(
        code(server.receive(ToServer::Edit {
            epoch: 1,
            objects: vec![],
            lights
        })),
        FaultCode::Value
    );
    let outside = SampleRequest { x: 4, ..request(9) };
    assert_eq!(
        code(server.receive(ToServer::Request {
            view: 1,
            samples: vec![outside]
        })),
        FaultCode::Value
    );
}

#[test]
fn messages_have_their_place() {
    let (mut display, mut server) = ready();
    assert_eq!(
        code(server.receive(hello("again", 0))),
        FaultCode::OutOfOrder
    );
    assert_eq!(
        code(server.receive(ToServer::SceneChunk { data: vec![1] })),
        FaultCode::OutOfOrder
    );
    assert_eq!(
        code(server.receive(ToServer::View {
            view: 1,
            camera: camera()
        })),
        FaultCode::OutOfOrder
    );
    let unknown = ToServer::Request {
        view: 5,
        samples: vec![request(1)],
    };
    assert_eq!(code(server.receive(unknown)), FaultCode::OutOfOrder);
    assert_eq!(
        code(display.receive(&ToDisplay::Pong { token: 1 })),
        FaultCode::Value
    );
    display.pinged(1);
    assert!(display.awaits_pong());
    display.receive(&ToDisplay::Pong { token: 1 }).unwrap();
    assert!(!display.awaits_pong());
    let mut fresh = ServerSession::new(capabilities(), vec![], 1000);
    assert_eq!(
        code(fresh.receive(ToServer::Ping { token: 1 })),
        FaultCode::OutOfOrder
    );
    let mut fresh = DisplaySession::new(SceneSize {
        lights: 0,
        objects: 0,
        faces: 0,
    });
    assert_eq!(
        code(fresh.receive(&ToDisplay::Pong { token: 1 })),
        FaultCode::OutOfOrder
    );
}

#[test]
fn scenes_above_the_limit_are_refused_and_held_ones_are_not_sent() {
    let mut server = ServerSession::new(capabilities(), vec![[7; 32]], 1000);
    server.receive(hello("t", 1)).unwrap();
    let begin = |digest, bytes| ToServer::SceneBegin {
        digest: [digest; 32],
        bytes,
    };
    assert_eq!(code(server.receive(begin(1, 1001))), FaultCode::Limit);
    assert!(matches!(
        server.receive(begin(7, 9)).unwrap(),
        ServerEvent::Held(_)
    ));
}

#[test]
fn long_fault_texts_are_cut_at_a_character() {
    let ToDisplay::Fault { text, .. } =
        Violation::new(FaultCode::Value, "é".repeat(4000)).to_display()
    else {
        panic!("a violation becomes a fault")
    };
    assert_eq!(text.len(), MAX_TEXT);
}

#[test]
fn wishes_for_shadows_come_once_before_the_scene() {
    let wish = || ToServer::Shadows {
        steady: true,
        error: 0.01,
        methods: vec![ShadowMethod::Penumbra],
    };
    let mut server = ServerSession::new(capabilities(), vec![], 1000);
    assert_eq!(
        server.receive(wish()).unwrap_err().code,
        FaultCode::OutOfOrder
    );
    server.receive(hello("t", 1)).unwrap();
    let event = server.receive(wish()).unwrap();
    assert!(
        matches!(event, ServerEvent::Shadows { steady: true, error: 0.01, ref methods } if *methods == [ShadowMethod::Penumbra])
    );
    assert_eq!(
        server.receive(wish()).unwrap_err().code,
        FaultCode::OutOfOrder
    );
    let (_, mut ready) = ready();
    assert!(ready.receive(wish()).is_err());
    let old = ToServer::Hello {
        min_version: 1,
        max_version: 2,
        name: "t".into(),
        seed: 1,
    };
    let mut server = ServerSession::new(capabilities(), vec![], 1000);
    server.receive(old).unwrap();
    assert!(server.receive(wish()).is_err(), "version 2 has none");
}

#[test]
fn methods_are_told_of_lights_that_there_are() {
    let told = |light| ToDisplay::Shadows {
        lights: vec![LightShadows {
            light,
            method: ShadowMethod::Rays,
            why: String::new(),
        }],
    };
    let (mut display, _) = ready();
    assert_eq!(display.receive(&told(0)).unwrap(), DisplayEvent::Shadows);
    assert_eq!(
        display.receive(&told(1)).unwrap_err().code,
        FaultCode::Value
    );
    let (mut display, _) = ready_in(&scene(), 2);
    assert!(display.receive(&told(0)).is_err(), "version 2 has none");
}

#[test]
fn servers_that_talk_without_end_are_found() {
    let (mut display, _) = ready();
    let status = ToDisplay::Status {
        queued: 0,
        traced: 0,
        rays: 0,
        cancelled_before: 0,
    };
    let talk = |display: &mut DisplaySession, count| {
        (0..count).try_for_each(|_| display.receive(&status).map(|_| ()))
    };
    talk(&mut display, MAX_UNASKED).unwrap();
    display.requested(1, &[request(1)]);
    display.receive(&samples(1, &[1])).unwrap();
    talk(&mut display, 1).unwrap();
    display.pinged(5);
    display.receive(&ToDisplay::Pong { token: 5 }).unwrap();
    talk(&mut display, MAX_UNASKED).unwrap();
    assert_eq!(code(talk(&mut display, 1)), FaultCode::Limit);
}
