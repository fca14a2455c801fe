//! Files good and bad: what loads, what is refused and in which words; never a panic.

use std::fs;
use std::path::{Path, PathBuf};

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use scenes::{ErrorKind, LoadedScene, SceneError, load};

struct Dir(tempfile::TempDir);

impl Dir {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        fs::write(&path, content).unwrap();
        path
    }

    fn load(&self, name: &str, content: impl AsRef<[u8]>) -> Result<LoadedScene, SceneError> {
        load(&self.write(name, content))
    }
}

/// The one line of an error, without the folder.
fn line(result: Result<LoadedScene, SceneError>) -> String {
    let error = result.unwrap_err();
    let text = error.to_string();
    assert_eq!(text.lines().count(), 1, "{text}");
    let name = error
        .file
        .file_name()
        .unwrap()
        .to_string_lossy()
        .into_owned();
    text.replace(&error.file.display().to_string(), &name)
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

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
            .starts_with("m.obj:2: vertex 2 has a coordinate")
    );
    assert!(obj(TRIANGLE).contains("no faces"));
    assert!(obj("").contains("no faces"));
    assert!(line(dir.load("m.stl", "solid")).contains("\"stl\" is not read"));
    dir.write("bad.mtl", "newmtl a\nKd 1\nKd 0.5 x 1\n");
    assert!(obj(&format!("mtllib bad.mtl\n{TRIANGLE}f 1 2 3")).starts_with("bad.mtl:3: Kd"));
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
    ] {
        let error = toml(&text);
        assert!(
            error.starts_with(start) && error.contains(part),
            "{text}\ngave {error}"
        );
    }
}

#[test]
fn obj_oddities_are_read() {
    let dir = Dir::new();
    dir.write(
        "m.mtl",
        "newmtl red\nKd 1 0 0\nNs 98\nnewmtl glow\nKd 0.5\nKe 3 3 3\nmap_Kd none.png\n",
    );
    let text = "mtllib m.mtl\nv 0 0 0 1 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0 # corner\nvn 0 0 1\n\
        g first\nusemtl red\nf -4 -3 \\\n-2 -1 # a quad\nusemtl glow\nf 1//1 2//1 3//1\n\
        g second\nusemtl blue\nf 1 2 4\nl 1 2\ng first\nf 2 3 4\nv nan 0 0\n";
    let loaded = dir.load("m.obj", text).unwrap();
    let scene = &loaded.scene;
    let names: Vec<&str> = scene.objects.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(names, ["m/first", "m/second"]);
    let first = &scene.meshes[scene.objects[0].mesh as usize];
    assert_eq!(first.faces.len(), 4);
    assert_eq!(first.positions.len(), 4, "shared across materials");
    let materials: Vec<&str> = first
        .face_materials
        .iter()
        .map(|&m| scene.materials[m as usize].name.as_str())
        .collect();
    assert_eq!(materials, ["red", "red", "glow", "default"]);
    assert_eq!(
        first.face_normals.len(),
        4,
        "faces without normals got flat ones"
    );
    for normals in &first.face_normals {
        assert!(
            normals
                .iter()
                .all(|&n| first.normals[n as usize] == [0.0, 0.0, 1.0])
        );
    }
    let red = scene.materials.iter().find(|m| m.name == "red").unwrap();
    assert!((red.roughness - (2.0_f32 / 100.0).sqrt()).abs() < 1e-6);
    let report = &loaded.report;
    assert_eq!(
        (
            report.polygons,
            report.points_and_lines,
            report.faces_without_normals
        ),
        (1, 1, 3)
    );
    assert_eq!(report.notes.len(), 3, "{report}");
    let second = &scene.meshes[scene.objects[1].mesh as usize];
    assert!(second.normals.is_empty() && second.face_materials.is_empty());
}

/// A pyramid with a quad base, as PLY in each encoding.
fn ply(encoding: &str) -> Vec<u8> {
    let points: [[f32; 3]; 5] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 0.0, 1.0],
        [0.0, 0.0, 1.0],
        [0.5, 1.0, 0.5],
    ];
    let faces: [&[u32]; 5] = [
        &[0, 1, 2, 3],
        &[1, 0, 4],
        &[2, 1, 4],
        &[3, 2, 4],
        &[0, 3, 4],
    ];
    let mut out = format!(
        "ply\nformat {encoding} 1.0\ncomment made here\nelement vertex 5\nproperty float x\nproperty float y\n\
         property double z\nproperty uchar red\nelement face 5\nproperty list uchar uint vertex_indices\nend_header\n"
    )
    .into_bytes();
    for p in points {
        match encoding {
            "ascii" => out.extend(format!("{} {} {} 7\n", p[0], p[1], p[2]).bytes()),
            "binary_little_endian" => {
                out.extend([p[0].to_le_bytes(), p[1].to_le_bytes()].concat());
                out.extend(f64::from(p[2]).to_le_bytes());
                out.push(7);
            }
            _ => {
                out.extend([p[0].to_be_bytes(), p[1].to_be_bytes()].concat());
                out.extend(f64::from(p[2]).to_be_bytes());
                out.push(7);
            }
        }
    }
    for f in faces {
        if encoding == "ascii" {
            let words: Vec<String> = f.iter().map(u32::to_string).collect();
            out.extend(format!("{} {}\n", f.len(), words.join(" ")).bytes());
            continue;
        }
        out.push(f.len() as u8);
        for v in f {
            out.extend(if encoding == "binary_little_endian" {
                v.to_le_bytes()
            } else {
                v.to_be_bytes()
            });
        }
    }
    out
}

#[test]
fn ply_reads_the_same_in_every_encoding() {
    let dir = Dir::new();
    let load = |encoding: &str| dir.load("p.ply", ply(encoding)).unwrap();
    let ascii = load("ascii");
    assert_eq!(
        (
            ascii.report.triangles,
            ascii.report.edges,
            ascii.report.boundary_edges
        ),
        (6, 9, 0)
    );
    assert_eq!(ascii.report.polygons, 1);
    assert_eq!(ascii, load("binary_little_endian"));
    assert_eq!(ascii, load("binary_big_endian"));
    let bad = String::from_utf8(ply("ascii"))
        .unwrap()
        .replace("3 1 0 4", "3 1 0 5");
    assert!(line(dir.load("p.ply", bad)).contains("vertex 5, but there are 5"));
    let text = String::from_utf8(ply("ascii"))
        .unwrap()
        .replace("0.5 1 0.5 7", "0.5 one 0.5 7");
    assert!(line(dir.load("p.ply", text)).starts_with("p.ply:16: "));
}

#[test]
fn smooth_normals_split_at_creases() {
    let dir = Dir::new();
    let normals = |crease: f32| {
        let text = format!(
            "[[object]]\nname = 'a'\ngenerate = {{ kind = 'box', size = [1, 1, 1] }}\nnormals = 'smooth'\n\
             crease_angle = {crease}"
        );
        dir.load("s.toml", text)
            .unwrap()
            .scene
            .meshes
            .swap_remove(0)
    };
    assert_eq!(normals(85.0).normals.len(), 24, "each side its own");
    let round = normals(95.0);
    assert_eq!(round.normals.len(), 8);
    for (face, n) in round.faces.iter().zip(&round.face_normals) {
        for (v, n) in face.iter().zip(n) {
            let (p, n) = (round.positions[*v as usize], round.normals[*n as usize]);
            for k in 0..3 {
                // Three right angles weigh the same: the normal is the diagonal.
                assert!((n[k] - p[k].signum() / 3.0_f32.sqrt()).abs() < 1e-6);
            }
        }
    }
}

#[test]
fn a_mesh_alone_is_framed_and_lit() {
    let dir = Dir::new();
    let loaded = dir.load("p.ply", ply("ascii")).unwrap();
    assert_eq!(loaded.scene.lights.len(), 1);
    let protocol::scene::Light::Area { vertices, .. } = &loaded.scene.lights[0] else {
        panic!("no area light");
    };
    let v: Vec<glam::Vec3> = vertices.iter().map(|v| (*v).into()).collect();
    let normal = (v[1] - v[0]).cross(v[2] - v[1]);
    let middle = glam::Vec3::from(loaded.camera.target);
    assert!(normal.dot(middle - v[0]) > 0.0, "it shines on the mesh");
    assert!(v.iter().all(|p| p.y > 1.0));
}

#[test]
fn meshes_named_twice_are_stored_once() {
    let dir = Dir::new();
    dir.write("m.obj", format!("{TRIANGLE}f 1 2 3\n"));
    let object =
        |name: &str, more: &str| format!("[[object]]\nname = '{name}'\nmesh = 'm.obj'\n{more}\n");
    let text = object("a", "")
        + &object("b", "translate = [1, 0, 0]")
        + &object("c", "normals = 'smooth'");
    let scene = dir.load("s.toml", text).unwrap().scene;
    assert_eq!(
        scene.objects.iter().map(|o| o.mesh).collect::<Vec<_>>(),
        [0, 0, 1]
    );
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
