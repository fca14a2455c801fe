use super::*;
use crate::messages::{FaultCode, LightShadows, ObjectMove, ShadowMethod, Texel};

fn camera() -> Camera {
    Camera {
        eye: [0.0, 1.0, 4.0],
        target: [0.0, 1.0, 0.0],
        up: [0.0, 1.0, 0.0],
        fov_y: 45.0,
        width: 512,
        height: 384,
    }
}

fn sample() -> Sample {
    Sample {
        id: 1,
        position: [1.0, 2.0, 3.0],
        object: 0,
        radiance: [0.5; 3],
        flags: 0,
    }
}

#[test]
fn bad_cameras_name_what_is_wrong() {
    validate_camera(&camera()).unwrap();
    let cases: [(&str, Camera); 9] = [
        (
            "camera.eye",
            Camera {
                eye: [f32::NAN, 0.0, 0.0],
                ..camera()
            },
        ),
        (
            "camera.target",
            Camera {
                target: camera().eye,
                ..camera()
            },
        ),
        (
            "camera.target",
            Camera {
                target: [f32::INFINITY, 0.0, 0.0],
                ..camera()
            },
        ),
        (
            "camera.up",
            Camera {
                up: [0.0; 3],
                ..camera()
            },
        ),
        (
            "camera.up",
            Camera {
                up: [0.0, 0.0, -2.0],
                ..camera()
            },
        ),
        (
            "camera.fov_y",
            Camera {
                fov_y: 180.0,
                ..camera()
            },
        ),
        (
            "camera.fov_y",
            Camera {
                fov_y: f32::NAN,
                ..camera()
            },
        ),
        (
            "camera.width",
            Camera {
                width: 0,
                ..camera()
            },
        ),
        (
            "camera.height",
            Camera {
                height: 16_385,
                ..camera()
            },
        ),
    ];
    for (place, bad) in cases {
        assert_eq!(validate_camera(&bad).unwrap_err().place, place, "{bad:?}");
    }
}

#[test]
fn bad_samples_name_what_is_wrong() {
    let miss = Sample {
        position: [0.0, 0.6, 0.8],
        object: NO_OBJECT,
        flags: flags::MISS | flags::PROVISIONAL,
        ..sample()
    };
    validate_samples(&[sample(), miss]).unwrap();
    let cases: [(&str, Sample); 10] = [
        (
            "radiance",
            Sample {
                radiance: [0.0, f32::NAN, 0.0],
                ..sample()
            },
        ),
        (
            "radiance",
            Sample {
                radiance: [0.0, -1e-9, 0.0],
                ..sample()
            },
        ),
        (
            "radiance",
            Sample {
                radiance: [0.0, 1e30, 0.0],
                ..sample()
            },
        ),
        (
            "position",
            Sample {
                position: [f32::NEG_INFINITY, 0.0, 0.0],
                ..sample()
            },
        ),
        (
            "position",
            Sample {
                position: [0.0, 0.6, 0.9],
                ..miss
            },
        ),
        (
            "position",
            Sample {
                position: [0.0, f32::NAN, 1.0],
                ..miss
            },
        ),
        (
            "flags",
            Sample {
                flags: 16,
                ..sample()
            },
        ),
        (
            "flags",
            Sample {
                object: NO_OBJECT,
                ..sample()
            },
        ),
        ("flags", Sample { object: 3, ..miss }),
        (
            "flags",
            Sample {
                flags: flags::MISS | flags::LIGHT,
                ..miss
            },
        ),
    ];
    for (field, bad) in cases {
        let error = validate_samples(&[sample(), bad]).unwrap_err();
        assert_eq!(
            error.place,
            format!("Samples.samples[1].{field}"),
            "{bad:?}"
        );
    }
    assert_eq!(validate_samples(&[]).unwrap_err().fault(), FaultCode::Limit);
}

#[test]
fn offsets_are_half_open() {
    let request = |x: f32| ToServer::Request {
        view: 1,
        samples: vec![SampleRequest {
            id: 0,
            x: 0,
            y: 0,
            offset: [0.0, x],
        }],
    };
    validate_to_server(&request(0.999_999_9)).unwrap();
    for bad in [1.0, -1e-9, f32::NAN] {
        let error = validate_to_server(&request(bad)).unwrap_err();
        assert_eq!(error.place, "Request.samples[0].offset[1]");
        assert_eq!(error.fault(), FaultCode::Value);
    }
}

#[test]
fn edits_and_handshakes_are_checked() {
    let singular = ToServer::Edit {
        epoch: 1,
        objects: vec![ObjectMove {
            object: 0,
            transform: [[1.0, 1.0, 1.0, 0.0]; 3],
        }],
        lights: vec![],
    };
    let error = validate_to_server(&singular).unwrap_err();
    assert_eq!(
        error.to_string(),
        "Edit.objects[0].transform: cannot be inverted"
    );

    let hello = |min_version, max_version, name: String| ToServer::Hello {
        min_version,
        max_version,
        name,
        seed: 0,
    };
    validate_to_server(&hello(1, 1, String::new())).unwrap();
    assert!(validate_to_server(&hello(2, 1, String::new())).is_err());
    assert!(validate_to_server(&hello(0, 1, String::new())).is_err());
    let long = validate_to_server(&hello(1, 1, "x".repeat(1025))).unwrap_err();
    assert_eq!(long.fault(), FaultCode::Limit);

    let welcome = |credits, max_batch| ToDisplay::Welcome {
        version: 1,
        name: String::new(),
        shader: String::new(),
        capabilities: Capabilities {
            credits,
            max_batch,
            triples: true,
            edits: true,
            threads: 1,
        },
        holds: vec![],
    };
    validate_to_display(&welcome(1, 1)).unwrap();
    assert!(validate_to_display(&welcome(0, 1)).is_err());
    assert!(validate_to_display(&welcome(1, MAX_BATCH + 1)).is_err());
    assert!(validate_to_server(&ToServer::SceneChunk { data: vec![] }).is_err());
}

#[test]
fn bad_texels_name_what_is_wrong() {
    let texel = Texel {
        face: 0,
        reflectance: [0.5; 3],
        reflected: [1.0; 3],
    };
    let with = |sample, texel| ToDisplay::Textured {
        view: 1,
        epoch: 0,
        samples: vec![TexturedSample { sample, texel }],
    };
    validate_to_display(&with(sample(), texel)).unwrap();
    let bright = Texel {
        reflectance: [0.5, 1.5, 0.5],
        ..texel
    };
    let broken = Texel {
        reflected: [f32::NAN; 3],
        ..texel
    };
    let light = Sample {
        flags: flags::LIGHT,
        ..sample()
    };
    for (message, place) in [
        (with(sample(), bright), "texel.reflectance"),
        (with(sample(), broken), "texel.reflected"),
        (with(light, texel), "sample.flags"),
    ] {
        let error = validate_to_display(&message).unwrap_err();
        assert_eq!(error.place, format!("Textured.samples[0].{place}"));
    }
    let none = ToDisplay::Textured {
        view: 1,
        epoch: 0,
        samples: vec![],
    };
    assert_eq!(
        validate_to_display(&none).unwrap_err().fault(),
        FaultCode::Limit
    );
}

#[test]
fn shadows_are_checked() {
    let wish = |error, count| ToServer::Shadows {
        steady: true,
        error,
        methods: vec![ShadowMethod::SoftMap; count],
    };
    validate_to_server(&wish(0.0, 0)).unwrap();
    validate_to_server(&wish(1.0, MAX_LIGHTS)).unwrap();
    for bad in [
        wish(f32::NAN, 0),
        wish(-0.1, 0),
        wish(1.1, 0),
        wish(0.5, MAX_LIGHTS + 1),
    ] {
        validate_to_server(&bad).unwrap_err();
    }
    let told = |method, why: usize, count| ToDisplay::Shadows {
        lights: vec![
            LightShadows {
                light: 0,
                method,
                why: "x".repeat(why),
            };
            count
        ],
    };
    validate_to_display(&told(ShadowMethod::Rays, MAX_NAME, MAX_SHADOWS)).unwrap();
    for bad in [
        told(ShadowMethod::Rays, 0, 0),
        told(ShadowMethod::Rays, 0, MAX_SHADOWS + 1),
        told(ShadowMethod::Rays, MAX_NAME + 1, 1),
        told(ShadowMethod::Auto, 0, 1),
    ] {
        validate_to_display(&bad).unwrap_err();
    }
}
