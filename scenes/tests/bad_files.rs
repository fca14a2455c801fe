//! Files that are refused, and in which words; never a panic.

mod common;

use std::path::Path;

use common::{Dir, TRIANGLE, line, ply};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use scenes::{ErrorKind, load};

#[test]
fn bad_files_give_one_line_that_names_the_place() {
    let dir = Dir::new();
    let missing = line(load(&dir.0.path().join("none.toml")));
    assert!(
        missing.starts_with("none.toml: cannot be read"),
        "{missing}"
    );
    let obj = |text: &str| line(dir.load("m.obj", text));
    assert_eq!(
        obj(&format!("{TRIANGLE}\nf 1 2 9\n")),
        "m.obj:5: face uses vertex 9, but there are 3; correct the index or export the mesh again"
    );
    assert!(obj(&format!("{TRIANGLE}f 1 2 -4\n")).starts_with("m.obj:4: face uses vertex -4"));
    assert!(obj(&format!("{TRIANGLE}f 0 1 2\n")).starts_with("m.obj:4: face uses vertex 0"));
    assert!(
        obj(&format!("{TRIANGLE}f 1/1 2/1 3/1\n"))
            .contains("texture coordinate 1, but there are 0")
    );
    assert!(obj("v 0 0 x\n").starts_with("m.obj:1: \"x\" is not a number"));
    assert!(
        obj("v 1 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3")
            .contains("every face has a corner that is not finite, vertex 2")
    );
    assert!(obj(TRIANGLE).contains("no faces"));
    assert!(obj("").contains("no faces"));
    assert!(line(dir.load("m.fbx", "solid")).contains("\"fbx\" is not read"));
    dir.write("bad.mtl", "newmtl a\nKd 1\nKd 0.5 x 1\n");
    assert!(obj(&format!("mtllib bad.mtl\n{TRIANGLE}f 1 2 3")).starts_with("bad.mtl:3: Kd"));
}

const LIGHT: &str =
    "[[light]]\nname = 'a'\nkind = 'point'\nposition = [0, 1, 0]\nintensity = [1, 1, 1]\n";

fn path(rest: &str) -> String {
    format!("[[path]]\nname = 'p'\nseconds = 1\n{rest}\n")
}

#[test]
fn bad_scenes_name_line_and_key() {
    let dir = Dir::new();
    dir.write("m.obj", format!("{TRIANGLE}f 1 2 3\n"));
    let toml = |text: &str| line(dir.load("s.toml", text));
    assert!(toml("[camera\n").starts_with("s.toml:1: is not a scene file"));
    let unknown = toml("[camera]\neye = [0, 0, 0]\ntarget = [0, 0, 1]\nzoom = 2\n");
    assert!(
        unknown.starts_with("s.toml:4: ") && unknown.contains("zoom"),
        "{unknown}"
    );
    let object = "\n[[object]]\nname = 'a'\n";
    for (text, start, part) in [
        (
            format!("{object}mesh = 'none.obj'"),
            "s.toml:4: object.mesh",
            "none.obj: cannot be read",
        ),
        (
            format!("{object}mesh = 'm.obj'\nmaterial = 'x'"),
            "s.toml:5: object.material",
            "\"x\"",
        ),
        (
            format!("{object}mesh = 'm.obj'\nscale = 0"),
            "s.toml:2: object.scale",
            "other than 0",
        ),
        (
            format!("{object}mesh = 'm.obj'\ntranslate = [nan, 0, 0]"),
            "s.toml:2: object.translate",
            "finite",
        ),
        (
            object.to_string(),
            "s.toml:2: object.mesh",
            "either mesh or generate",
        ),
        (
            format!("{object}mesh = 'm.obj'{object}mesh = 'm.obj'"),
            "s.toml:6: object.name",
            "taken",
        ),
        (
            format!("{object}generate = {{ kind = 'box', size = [1, 1, 0] }}"),
            "s.toml:4: object.generate",
            "size = 0",
        ),
        (
            format!("{object}generate = {{ kind = 'cube' }}"),
            "s.toml:4: ",
            "cube",
        ),
        (
            "[[light]]\nkind = 'point'\nintensity = [1, 1, 1]".into(),
            "s.toml:1: light.position",
            "needs",
        ),
        (
            "[[light]]\nkind = 'point'\nposition = [0, 0, 0]\nintensity = [1, 1, -1]".into(),
            "s.toml:1: light",
            "colour",
        ),
        (
            "[camera]\neye = [0, 0, 0]\ntarget = [0, 1, 0]".into(),
            "s.toml:1: camera.up",
            "line of sight",
        ),
        (
            "[material.a]\ndiffuse = [2, 0, 0]".into(),
            "s.toml:1: material.a.diffuse",
            "0 to 1",
        ),
        (
            "[material.a]\ndiffuse_map = 'no.png'".into(),
            "s.toml:2: material.a.diffuse_map",
            "no.png",
        ),
        (
            "[[path]]\nname = 'p'\nseconds = 1\nkeys = []".into(),
            "s.toml:1: path.keys",
            "too few",
        ),
        (
            path("object = 'x'\nkeys = [{}, {}]"),
            "s.toml:1: path.object: there is no object \"x\"",
            "no object has a name",
        ),
        (
            format!(
                "{object}mesh = 'm.obj'\n{}",
                path("object = 'x'\nkeys = [{}, {}]")
            ),
            "s.toml:5: path.object: there is no object \"x\"",
            "name one of a",
        ),
        (
            path("light = 0\nkeys = [{}, {}]"),
            "s.toml:1: path.light: there is no light 0",
            "number from 0",
        ),
        (
            format!("{LIGHT}{}", path("light = 'b'\nkeys = [{}, {}]")),
            "s.toml:6: path.light: there is no light \"b\"",
            "name one of a",
        ),
        (
            format!(
                "{LIGHT}{}",
                path("light = 'a'\nobject = 'a'\nkeys = [{}, {}]")
            ),
            "s.toml:6: path.light: is given beside",
            "a path for each",
        ),
        (
            format!(
                "{LIGHT}{}",
                path("light = 'a'\nkeys = [{}, { eye = [0, 0, 1] }]")
            ),
            "s.toml:6: path.keys[1].eye: is a key of the camera",
            "with the same name",
        ),
        (
            format!(
                "{LIGHT}{}",
                path("light = 'a'\nkeys = [{}, { rotate = [0, 0, 1] }]")
            ),
            "s.toml:6: path.keys[1].rotate: a light only",
            "remove",
        ),
        (
            format!(
                "{LIGHT}{}",
                path("light = 'a'\nkeys = [{}, { power = -1 }]")
            ),
            "s.toml:6: path.keys[1].power: -1 is no factor",
            "at least 0",
        ),
        (
            format!("{LIGHT}{0}{0}", path("light = 'a'\nkeys = [{}, {}]")),
            "s.toml:11: path.name: two paths",
            "its own name",
        ),
        (
            path(
                "open = true\nkeys = [{ eye = [0, 0, 1], target = [0, 0, 0] }, { translate = [0, 0, 0] }]",
            ),
            "s.toml:1: path.keys[1].translate: is no key of a camera",
            "object or light",
        ),
        (
            path(
                "open = true\nkeys = [{ eye = [0, 0, 1], target = [0, 0, 0] }, { eye = [0, 0, 0] }]",
            ),
            "s.toml:1: path.keys[1].target: is missing",
            "eye and target",
        ),
        (
            format!(
                "{object}mesh = 'm.obj'\n{}",
                path("object = 'a'\nkeys = [{}, { scale = 0 }]")
            ),
            "s.toml:5: path.keys[1].scale: [0.0, 0.0, 0.0] is no factor",
            "greater than 0",
        ),
        (
            format!(
                "{object}mesh = 'm.obj'\n{}",
                path("object = 'a'\nkeys = [{}, { power = 0 }]")
            ),
            "s.toml:5: path.keys[1].power: only a light",
            "remove",
        ),
    ] {
        let error = toml(&text);
        assert!(
            error.starts_with(start) && error.contains(part),
            "{text}\ngave {error}"
        );
    }
}

/// Bytes replaced, removed and doubled.
fn mutate(bytes: &[u8], edits: &[(u16, u8, u8)]) -> Vec<u8> {
    let mut out = bytes.to_vec();
    for &(place, kind, value) in edits {
        if out.is_empty() {
            break;
        }
        let i = usize::from(place) % out.len();
        match kind % 4 {
            0 => out[i] = value,
            1 => {
                out.remove(i);
            }
            2 => out.truncate(i),
            _ => out.insert(i, b"0123456789-.e/ \n\\#"[usize::from(value) % 18]),
        }
    }
    out
}

fn check_any(path: &Path) {
    match load(path) {
        Ok(loaded) => {
            for mesh in &loaded.scene.meshes {
                let n = mesh.positions.len();
                assert!(mesh.faces.iter().flatten().all(|v| (*v as usize) < n));
                assert!(mesh.positions.iter().flatten().all(|x| x.is_finite()));
                assert!(mesh.normals.iter().flatten().all(|x| x.is_finite()));
                assert!(
                    mesh.face_normals
                        .iter()
                        .flatten()
                        .all(|v| (*v as usize) < mesh.normals.len())
                );
                assert!(
                    mesh.face_uvs
                        .iter()
                        .flatten()
                        .all(|v| (*v as usize) < mesh.uvs.len())
                );
            }
        }
        Err(e) => assert_eq!(e.to_string().lines().count(), 1, "{e}"),
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 200, rng_seed: RngSeed::Fixed(7), failure_persistence: None, ..ProptestConfig::default()
    })]

    #[test]
    fn no_file_panics(edits in prop::collection::vec((any::<u16>(), any::<u8>(), any::<u8>()), 1..6)) {
        let dir = Dir::new();
        let obj = "mtllib m.mtl\no a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvn 0 0 1\nusemtl a\nf 1/1/1 2/1/1 3/1/1\n\
            usemtl b\nf -1//-1 -2//-1 -3//-1\ng c\nf 1 2 3 4\n";
        let mtl = "newmtl a\nKd 0.5 0.5 0.5\nNs 10\nKe 0 0 0\nmap_Kd -s 1 1 1 x.png\nnewmtl b\nKs 0.1\n";
        dir.write("m.mtl", mutate(mtl.as_bytes(), &edits));
        check_any(&dir.write("m.obj", obj));
        check_any(&dir.write("m.obj", mutate(obj.as_bytes(), &edits)));
        for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
            check_any(&dir.write("m.ply", mutate(&ply(encoding), &edits)));
        }
        let stl = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n";
        check_any(&dir.write("m.stl", mutate(stl.as_bytes(), &edits)));
        let mut soup = vec![b' '; 80];
        soup.extend([2, 0, 0, 0]);
        soup.extend((0..100).map(|i| if i % 4 == 3 { 0x3f } else { i as u8 }));
        check_any(&dir.write("b.stl", mutate(&soup, &edits)));
        let (maker, rest) = common::gltf::triangle();
        check_any(&dir.write("m.gltf", mutate(maker.text(&rest).as_bytes(), &edits)));
        check_any(&dir.write("m.glb", mutate(&maker.binary(&rest), &edits)));
        let toml = "[camera]\neye = [0, 1, 4]\ntarget = [0, 0, 0]\n[[light]]\nkind = 'point'\nposition = [0, 3, 0]\n\
            intensity = [1, 1, 1]\n[[object]]\nname = 'a'\ngenerate = { kind = 'torus', major = 1, minor = 0.2, around = 9 }\n\
            rotate = [0, 30, 0]\nscale = 2\n[[path]]\nname = 'p'\nseconds = 4\nopen = true\n\
            keys = [{ eye = [0, 0, 1], target = [0, 0, 0] }, { eye = [1, 0, 1], target = [0, 0, 0] }]\n";
        check_any(&dir.write("s.toml", mutate(toml.as_bytes(), &edits)));
    }
}

#[test]
fn huge_counts_do_not_allocate() {
    let dir = Dir::new();
    let text = "ply\nformat binary_little_endian 1.0\nelement vertex 9000000000000000000\nproperty float x\n\
        property float y\nproperty float z\nelement face 1\nproperty list uint int vertex_indices\nend_header\n";
    assert!(matches!(
        dir.load("h.ply", text).unwrap_err().kind,
        ErrorKind::Malformed(_)
    ));
    let list = text.replace("9000000000000000000", "0") + "\u{7f}\u{7f}\u{7f}\u{7f}";
    assert!(matches!(
        dir.load("h.ply", list).unwrap_err().kind,
        ErrorKind::Malformed(_)
    ));
}
