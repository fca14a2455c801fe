//! glTF: geometry in every form, nodes, materials, cameras, lights, and broken files.

mod common;

use common::gltf::{Maker, triangle};
use common::{Dir, line};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use protocol::scene::{Light, Model};

const CORNERS: [[f32; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
const SQUARE: [u32; 6] = [0, 1, 2, 0, 2, 3];

#[test]
fn indices_of_every_width_and_none_make_the_same_mesh() {
    let dir = Dir::new();
    let mut meshes = Vec::new();
    for width in [1, 2, 4, 0] {
        let mut maker = Maker::default();
        let (p, indices) = if width == 0 {
            let p = maker.floats(&SQUARE.map(|i| CORNERS[i as usize]));
            (p, String::new())
        } else {
            let p = maker.floats(&CORNERS);
            (
                p,
                format!(r#","indices":{}"#, maker.indices(&SQUARE, width)),
            )
        };
        let rest = format!(
            r#""nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":{p}}}{indices}}}]}}]"#
        );
        let text = dir.load("m.gltf", maker.text(&rest)).unwrap();
        assert_eq!(
            text.scene.meshes,
            dir.load("m.glb", maker.binary(&rest)).unwrap().scene.meshes
        );
        let (json, data) = maker.text_and_data("the%20data.bin", &rest);
        dir.write("the data.bin", data);
        assert_eq!(text, dir.load("m.gltf", json).unwrap());
        assert_eq!(
            (text.report.edges, text.report.boundary_edges),
            (5, 4),
            "welded"
        );
        assert_eq!(text.scene.objects[0].name, "m/node 0");
        meshes.push(text.scene.meshes);
    }
    assert!(meshes.windows(2).all(|w| w[0] == w[1]));
}

#[test]
fn sparse_accessors_replace_values_or_zeros() {
    let dir = Dir::new();
    for from_zero in [false, true] {
        let mut maker = Maker::default();
        let base = maker.floats(&[[9.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let indices = maker.view(&[0, 1, 2]);
        let values = maker.view(
            &[[0.0_f32, 0.0, 1.0], [2.0, 0.0, 0.0], [0.0, 3.0, 0.0]]
                .concat()
                .iter()
                .flat_map(|x| x.to_le_bytes())
                .collect::<Vec<_>>(),
        );
        let (view, count) = if from_zero {
            (String::new(), 3)
        } else {
            (r#""bufferView":0,"#.into(), 1)
        };
        assert_eq!(base, 0);
        let p = maker.accessor(format!(
            r#"{{{view}"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,1],"sparse":{{"count":{count},
            "indices":{{"bufferView":{indices},"componentType":5121}},"values":{{"bufferView":{values}}}}}}}"#
        ));
        let rest = format!(
            r#""nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":{p}}}}}]}}]"#
        );
        let mesh = dir
            .load("m.gltf", maker.text(&rest))
            .unwrap()
            .scene
            .meshes
            .swap_remove(0);
        let wanted = if from_zero {
            [[0.0, 0.0, 1.0], [2.0, 0.0, 0.0], [0.0, 3.0, 0.0]]
        } else {
            [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
        };
        assert_eq!(mesh.positions, wanted);
    }
}

#[test]
fn nodes_that_share_a_mesh_share_it_here() {
    let dir = Dir::new();
    let (maker, rest) = triangle();
    let nodes = r#""nodes":[
        {"name":"top","translation":[0,1,0],"rotation":[0,0.70710678,0,0.70710678],"children":[1,2]},
        {"name":"leaf","mesh":0,"translation":[1,0,0],"scale":[2,2,2]},
        {"name":"leaf","mesh":0},
        {"name":"flat","mesh":0,"scale":[1,0,1]},
        {"name":"elsewhere","mesh":0}],
        "scenes":[{"nodes":[4]},{"nodes":[0,3]}],"scene":1,"#;
    let meshes = &rest[rest.find(r#""meshes""#).unwrap()..];
    let loaded = dir
        .load("m.gltf", maker.text(&format!("{nodes}{meshes}")))
        .unwrap();
    let objects = &loaded.scene.objects;
    let names: Vec<&str> = objects.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(names, ["m/leaf", "m/leaf#2"]);
    assert_eq!(loaded.scene.meshes.len(), 1);
    assert_eq!(loaded.report.triangles, 2);
    // A quarter turn about y takes x to -z.
    let m = objects[0].transform;
    let at = |p: [f32; 3]| {
        [0, 1, 2].map(|r: usize| m[r][0] * p[0] + m[r][1] * p[1] + m[r][2] * p[2] + m[r][3])
    };
    for (got, wanted) in at([1.0, 1.0, 0.0]).into_iter().zip([0.0, 3.0, -3.0]) {
        assert!((got - wanted).abs() < 1e-5, "{got} {wanted}");
    }
    assert!(
        loaded
            .report
            .notes
            .iter()
            .any(|n| n.contains("\"flat\" is scaled to nothing"))
    );
    let toml = "[[object]]\nname = 'a'\nmesh = 'm.gltf'\ntranslate = [0, 5, 0]\n";
    let placed = dir.load("s.toml", toml).unwrap().scene;
    assert_eq!(placed.objects[1].name, "a/leaf#2");
    assert_eq!(placed.objects[1].transform[1][3], 6.0);
}

#[test]
fn materials_become_diffuse_and_specular() {
    let dir = Dir::new();
    let mut maker = Maker::default();
    let p = maker.floats(&CORNERS[..3]);
    let t = maker.floats(&[[0.0, 0.0], [1.0, 0.0], [0.0, 0.25]]);
    let mut png = Vec::new();
    image::RgbImage::from_pixel(2, 2, image::Rgb([0, 128, 255]))
        .write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png)
        .unwrap();
    let view = maker.view(&png);
    let primitive = |m: &str| format!(r#"{{"attributes":{{"POSITION":{p},"TEXCOORD_0":{t}}}{m}}}"#);
    let rest = format!(
        r#""extensionsUsed":["KHR_texture_transform"],"nodes":[{{"mesh":0}}],
        "images":[{{"bufferView":{view},"mimeType":"image/png"}}],"textures":[{{"source":0}}],
        "materials":[
            {{"name":"plastic","pbrMetallicRoughness":{{"baseColorFactor":[0.5,0.25,1,1],"metallicFactor":0,"roughnessFactor":0.5}}}},
            {{"name":"gold","pbrMetallicRoughness":{{"baseColorFactor":[1,0.75,0.25,1]}}}},
            {{"name":"picture","emissiveFactor":[1,0,0],"pbrMetallicRoughness":{{"metallicFactor":0,
                "baseColorTexture":{{"index":0,"extensions":{{"KHR_texture_transform":{{"offset":[0.5,0.25],"scale":[2,2]}}}}}}}}}},
            {{"name":"mixed","pbrMetallicRoughness":{{"metallicRoughnessTexture":{{"index":0}}}}}}],
        "meshes":[{{"primitives":[{},{},{},{},{}]}}]"#,
        primitive(r#","material":0"#),
        primitive(r#","material":1"#),
        primitive(r#","material":2"#),
        primitive(r#","material":3"#),
        primitive("")
    );
    let loaded = dir.load("m.glb", maker.binary(&rest)).unwrap();
    let scene = &loaded.scene;
    let material = |name: &str| scene.materials.iter().find(|m| m.name == name).unwrap();
    let plastic = material("plastic");
    assert_eq!(
        (plastic.diffuse, plastic.specular),
        ([0.5, 0.25, 1.0], [0.04; 3])
    );
    assert_eq!(plastic.roughness, 0.25, "alpha is roughness squared");
    let gold = material("gold");
    assert_eq!((gold.diffuse, gold.specular), ([0.0; 3], [1.0, 0.75, 0.25]));
    assert_eq!(scene.shading.model, Model::Glossy, "metal is black without");
    let mixed = material("mixed");
    // Blue is 1: all metal. Green is 128 of 255.
    assert_eq!(mixed.diffuse, [0.0; 3]);
    assert!((mixed.roughness - (128.0_f32 / 255.0).powi(2)).abs() < 1e-6);
    let picture = material("picture");
    let texture = &scene.textures[picture.diffuse_map.unwrap() as usize];
    assert_eq!(texture.rgb, [[0, 128, 255]; 4]);
    assert!(
        loaded
            .report
            .notes
            .iter()
            .any(|n| n.contains("\"picture\" glows"))
    );
    let mesh = &scene.meshes[0];
    let names: Vec<&str> = mesh
        .face_materials
        .iter()
        .map(|m| scene.materials[*m as usize].name.as_str())
        .collect();
    assert_eq!(names, ["plastic", "gold", "picture", "mixed", "default"]);
    let uvs = mesh.face_uvs[2].map(|i| mesh.uvs[i as usize]);
    assert_eq!(
        uvs,
        [[0.5, 0.75], [2.5, 0.75], [0.5, 0.25]],
        "turned upside down"
    );
    assert_eq!(mesh.positions.len(), 3);
}

#[test]
fn cameras_and_point_lights_are_used() {
    let dir = Dir::new();
    let (maker, rest) = triangle();
    let meshes = &rest[rest.find(r#""meshes""#).unwrap()..];
    let more = format!(
        r#""extensionsUsed":["KHR_lights_punctual"],
        "extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"point","intensity":1366,"color":[1,0.5,0]}},{{"type":"directional"}}]}}}},
        "cameras":[{{"type":"perspective","perspective":{{"yfov":1.5707964,"znear":0.1}}}},
            {{"type":"orthographic","orthographic":{{"xmag":1,"ymag":1,"znear":0.1,"zfar":9}}}}],
        "nodes":[{{"mesh":0}},{{"camera":1}},{{"camera":0,"translation":[1,2,3],"rotation":[0,1,0,0]}},
            {{"translation":[0,4,0],"extensions":{{"KHR_lights_punctual":{{"light":0}}}}}},
            {{"extensions":{{"KHR_lights_punctual":{{"light":1}}}}}}],{meshes}"#
    );
    let loaded = dir.load("m.gltf", maker.text(&more)).unwrap();
    let camera = loaded.camera;
    assert_eq!(camera.eye, [1.0, 2.0, 3.0]);
    assert!((camera.fov_y - 90.0).abs() < 1e-4);
    assert!(
        (camera.target[2] - 4.0).abs() < 1e-5,
        "turned round it looks along z"
    );
    assert!(loaded.paths.is_empty());
    let lights = &loaded.scene.lights;
    assert_eq!(
        *lights,
        [Light::Point {
            position: [0.0, 4.0, 0.0],
            intensity: [2.0, 1.0, 0.0]
        }]
    );
    assert_eq!(loaded.report.notes.len(), 2, "{}", loaded.report);
    assert_eq!(loaded.scene.shading.model, Model::Direct);
}

#[test]
fn bad_files_say_where() {
    let dir = Dir::new();
    let (maker, rest) = triangle();
    let good = maker.text(&rest);
    assert!(dir.load("m.gltf", &good).is_ok());
    for (from, to, part) in [
        (r#""mesh":0"#, r#""mesh":7"#, "nodes[0].mesh"),
        (
            r#"{"POSITION":0}"#,
            r#"{"POSITION":0,"NORMAL":1}"#,
            "accessor 1 holds",
        ),
        (
            r#""count":3,"type":"SCALAR""#,
            r#""count":30,"type":"SCALAR""#,
            "do not fit buffer view 1",
        ),
        (
            r#""count":3,"type":"VEC3""#,
            r#""count":2,"type":"VEC3""#,
            "uses vertex 2, counted from 0, but there are 2",
        ),
        (
            r#""count":3,"type":"VEC3""#,
            r#""count":0,"type":"VEC3""#,
            "accessor 0 is empty",
        ),
        (
            r#""byteLength":6"#,
            r#""byteLength":600"#,
            "buffer view 1 goes from byte 36 on for 600 bytes",
        ),
        (
            "data:application/octet-stream;base64,",
            "no%20such.bin",
            "no such.bin",
        ),
        ("base64,", "base64,!", "is not base64"),
        (
            "data:application/octet-stream;base64,",
            "https://example.org/",
            "is not beside the file",
        ),
        (
            r#""asset""#,
            r#""extensionsRequired":["KHR_draco_mesh_compression"],"asset""#,
            "extensionsRequired",
        ),
        (
            r#""nodes":[{"mesh":0,"name":"n"}]"#,
            r#""nodes":[{"children":[1]},{"children":[0],"mesh":0}],"scenes":[{"nodes":[0]}]"#,
            "below itself",
        ),
    ] {
        let text = good.replacen(from, to, 1);
        assert_ne!(text, good, "{from} is not in it");
        let error = line(dir.load("m.gltf", &text));
        assert!(error.contains(part), "{to} gave {error}");
    }
    let broken = good.replacen(r#""meshes":"#, "\n\n\"meshes\":!", 1);
    assert!(line(dir.load("m.gltf", broken)).starts_with("m.gltf:3: not a glTF file"));
    let bytes = maker.binary(&rest);
    for end in [3, 11, 30, bytes.len() - 30] {
        let error = line(dir.load("m.glb", &bytes[..end]));
        assert!(error.contains("glTF"), "{end}: {error}");
    }
    let alone = rest.replace(r#""mesh":0"#, r#""translation":[0,0,0]"#);
    assert!(line(dir.load("m.gltf", maker.text(&alone))).contains("no faces"));
}

fn number() -> impl Strategy<Value = f32> {
    prop_oneof![
        proptest::num::f32::NORMAL | proptest::num::f32::ZERO,
        (-4_i8..4).prop_map(f32::from)
    ]
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 100, rng_seed: RngSeed::Fixed(12), failure_persistence: None, ..ProptestConfig::default()
    })]

    #[test]
    fn corners_come_back_to_the_bit(
        positions in prop::collection::vec(prop::array::uniform3(number()), 1..30),
        picks in prop::collection::vec(prop::array::uniform3(any::<prop::sample::Index>()), 1..40),
        width in prop::sample::select(vec![1_usize, 2, 4]),
    ) {
        let dir = Dir::new();
        let faces: Vec<[u32; 3]> = picks.iter().map(|f| [0, 1, 2].map(|k: usize| f[k].index(positions.len()) as u32)).collect();
        let mut maker = Maker::default();
        let p = maker.floats(&positions);
        let i = maker.indices(&faces.concat(), width);
        let rest = format!(
            r#""nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":{p}}},"indices":{i}}}]}}]"#
        );
        let mesh = dir.load("m.glb", maker.binary(&rest)).unwrap().scene.meshes.swap_remove(0);
        let back: Vec<_> = mesh.faces.iter().map(|f| f.map(|v| mesh.positions[v as usize])).collect();
        let sent: Vec<_> = faces.iter().map(|f| f.map(|v| positions[v as usize])).collect();
        prop_assert_eq!(back, sent);
    }
}
