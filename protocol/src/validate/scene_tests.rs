use super::*;
use crate::scene::{Model, Shading};

const IDENTITY: Affine = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
];

fn scene() -> Scene {
    let material = Material {
        name: "wall".into(),
        diffuse: [0.7; 3],
        diffuse_map: Some(0),
        specular: [0.04; 3],
        roughness: 0.3,
    };
    let mesh = Mesh {
        positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        faces: vec![[0, 1, 2]],
        normals: vec![[0.0, 0.0, 1.0]],
        face_normals: vec![[0, 0, 0]],
        uvs: vec![[0.0, 0.0]],
        face_uvs: vec![[0, 0, 0]],
        face_materials: vec![0],
    };
    let object = |name: &str| Object {
        name: name.into(),
        mesh: 0,
        material: 0,
        transform: IDENTITY,
        crease_angle: 85.0,
    };
    Scene {
        shading: Shading {
            model: Model::Direct,
            ambient: [0.0; 3],
            background: [0.1; 3],
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
        materials: vec![material],
        textures: vec![Texture {
            width: 1,
            height: 2,
            rgb: vec![[1, 2, 3]; 2],
        }],
        meshes: vec![mesh],
        objects: vec![object("a"), object("b")],
    }
}

fn place(change: impl FnOnce(&mut Scene)) -> String {
    let mut broken = scene();
    change(&mut broken);
    validate_scene(&broken).unwrap_err().place
}

#[test]
fn a_good_scene_passes() {
    validate_scene(&scene()).unwrap();
}

#[test]
fn every_index_is_checked() {
    assert_eq!(place(|s| s.meshes[0].faces[0][2] = 3), "meshes[0].faces[0]");
    assert_eq!(
        place(|s| s.meshes[0].face_normals[0][0] = 1),
        "meshes[0].face_normals[0]"
    );
    assert_eq!(
        place(|s| s.meshes[0].face_uvs[0][1] = u32::MAX),
        "meshes[0].face_uvs[0]"
    );
    assert_eq!(
        place(|s| s.meshes[0].face_materials[0] = 1),
        "meshes[0].face_materials[0]"
    );
    assert_eq!(
        place(|s| s.meshes[0].face_materials.push(0)),
        "meshes[0].face_materials"
    );
    assert_eq!(
        place(|s| s.meshes[0].face_uvs.push([0; 3])),
        "meshes[0].face_uvs"
    );
    assert_eq!(
        place(|s| s.materials[0].diffuse_map = Some(1)),
        "materials[0].diffuse_map"
    );
    assert_eq!(place(|s| s.objects[1].mesh = 1), "objects[1].mesh");
    assert_eq!(place(|s| s.objects[1].material = 1), "objects[1].material");
}

#[test]
fn every_number_is_checked() {
    assert_eq!(
        place(|s| s.shading.ambient[1] = f32::NAN),
        "shading.ambient"
    );
    assert_eq!(
        place(|s| s.shading.background[1] = -1.0),
        "shading.background"
    );
    assert_eq!(
        place(|s| s.meshes[0].positions[1][0] = f32::NAN),
        "meshes[0].positions[1]"
    );
    assert_eq!(
        place(|s| s.meshes[0].normals[0] = [0.0; 3]),
        "meshes[0].normals[0]"
    );
    assert_eq!(
        place(|s| s.meshes[0].uvs[0][1] = f32::INFINITY),
        "meshes[0].uvs[0]"
    );
    assert_eq!(
        place(|s| s.materials[0].diffuse[0] = 1.1),
        "materials[0].diffuse"
    );
    assert_eq!(
        place(|s| s.materials[0].roughness = 0.0),
        "materials[0].roughness"
    );
    assert_eq!(place(|s| s.textures[0].height = 3), "textures[0]");
    assert_eq!(place(|s| s.textures[0].width = 0), "textures[0]");
    assert_eq!(
        place(|s| s.objects[0].crease_angle = -1.0),
        "objects[0].crease_angle"
    );
    assert_eq!(
        place(|s| s.objects[0].transform[1][3] = f32::NAN),
        "objects[0].transform"
    );
    assert_eq!(
        place(|s| s.objects[0].transform[1] = [0.0; 4]),
        "objects[0].transform"
    );
    assert_eq!(place(|s| s.objects[0].name = "b".into()), "objects[1].name");
}

#[test]
fn lights_are_checked() {
    let light = |value: Light| place(|s| s.lights[1] = value);
    let p = [1.0, 2.0, 3.0];
    assert_eq!(
        light(Light::Point {
            position: p,
            intensity: [-1.0; 3]
        }),
        "lights[1].intensity"
    );
    assert_eq!(
        light(Light::Linear {
            from: p,
            to: p,
            intensity: [1.0; 3]
        }),
        "lights[1].to"
    );
    assert_eq!(
        light(Light::Area {
            vertices: vec![p, p, p],
            radiance: [1.0; 3]
        }),
        "lights[1].vertices"
    );
    assert_eq!(
        light(Light::Area {
            vertices: vec![p, [f32::NAN; 3], p],
            radiance: [1.0; 3]
        }),
        "lights[1].vertices[1]"
    );
}

#[test]
fn transforms_pass_at_any_sane_scale() {
    for scale in [1e-6f32, 1.0, 1e6] {
        let mut transform = IDENTITY;
        for (i, row) in transform.iter_mut().enumerate() {
            row[i] = -scale;
        }
        validate_transform(&transform).unwrap();
    }
    let mut flat = IDENTITY;
    flat[2][2] = 0.0;
    assert!(validate_transform(&flat).is_err());
    let mut skewed = IDENTITY;
    skewed[0][1] = 1e8;
    assert!(validate_transform(&skewed).is_err());
}
