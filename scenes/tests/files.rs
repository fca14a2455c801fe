//! Files that load, odd ones among them.

mod common;

use common::{Dir, TRIANGLE, line, ply};

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

#[test]
fn faces_with_a_corner_that_is_not_finite_are_left_out_and_counted() {
    let dir = Dir::new();
    let text =
        format!("{TRIANGLE}v nan 0 0\nvn 0 0 1\ng a\nf 1//1 2//1 4//1\nf 1 2 3\ng b\nf 1 2 -1\n");
    let loaded = dir.load("m.obj", text).unwrap();
    let r = &loaded.report;
    assert_eq!(
        (r.triangles, r.faces_not_finite, r.unused_not_finite),
        (1, 2, 1)
    );
    assert_eq!(
        loaded.scene.objects.len(),
        1,
        "a group of which nothing is left is no object"
    );
    let mesh = &loaded.scene.meshes[0];
    assert_eq!((mesh.faces.len(), mesh.face_normals.len()), (1, 1));
    assert!(mesh.positions.iter().flatten().all(|x| x.is_finite()));
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

#[test]
fn lights_say_how_their_shadows_are_wanted() {
    use protocol::messages::ShadowMethod::{Auto, Penumbra, Rays, SoftMap};
    let dir = Dir::new();
    let light = |key: &str| {
        format!("[[light]]\nkind = 'point'\nposition = [0, 1, 0]\nintensity = [1, 1, 1]\n{key}\n")
    };
    let keys = ["", "'auto'", "'rays'", "'penumbra'", "'soft-map'"];
    let text: String = keys
        .iter()
        .map(|name| match *name {
            "" => light(""),
            name => light(&format!("shadows = {name}")),
        })
        .collect();
    let loaded = dir.load("s.toml", &text).unwrap();
    assert_eq!(loaded.shadows, [Auto, Auto, Rays, Penumbra, SoftMap]);
    let error = dir.load("bad.toml", light("shadows = 'maps'")).unwrap_err();
    assert_eq!(error.line, Some(5), "{error}");
}
