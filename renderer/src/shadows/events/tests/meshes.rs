//! Blockers with corners that point inwards.

use super::*;

/// An outline in the xz plane, anticlockwise as seen against y, and its triangles.
type Outline = (Vec<[f32; 2]>, Vec<[u32; 3]>);

/// A flat L.
pub(super) fn l_outline() -> Outline {
    let p = vec![
        [-1.0, -1.0],
        [1.0, -1.0],
        [1.0, 0.1],
        [0.2, 0.1],
        [0.2, 1.2],
        [-1.0, 1.2],
    ];
    (p, vec![[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
}

/// A star with a vertex in its middle.
pub(super) fn star_outline(points: u32) -> Outline {
    let mut p = vec![[0.03, -0.02]];
    let mut faces = Vec::new();
    for k in 0..2 * points {
        let a = k as f32 / (2 * points) as f32 * std::f32::consts::TAU;
        let r = if k % 2 == 0 { 1.4 } else { 0.5 };
        p.push([r * a.cos(), r * a.sin()]);
        faces.push([0, k + 1, (k + 1) % (2 * points) + 1]);
    }
    (p, faces)
}

/// A square with a square hole.
pub(super) fn frame_outline() -> Outline {
    let ring = |r: f32| [[-r, -r], [r, -r], [r, r], [-r, r]];
    let p = [ring(1.3), ring(0.6)].concat();
    let mut faces = Vec::new();
    for k in 0..4 {
        let next = (k + 1) % 4;
        faces.extend([[k, next, next + 4], [k, next + 4, k + 4]]);
    }
    (p, faces)
}

/// A sheet without thickness.
pub(super) fn sheet((points, faces): Outline) -> Mesh {
    let positions = points.iter().map(|p| [p[0], 0.0, p[1]]).collect();
    test_meshes::mesh(positions, faces)
}

/// A closed solid with the outline as top and bottom.
pub(super) fn prism((points, faces): Outline, height: f32) -> Mesh {
    let n = points.len() as u32;
    let level = |y: f32| points.iter().map(move |p| [p[0], y, p[1]]);
    let positions = level(0.5 * height).chain(level(-0.5 * height)).collect();
    let mut all = Vec::new();
    for f in &faces {
        all.push([f[0], f[2], f[1]]);
        all.push([f[0] + n, f[1] + n, f[2] + n]);
        for k in 0..3 {
            let (a, b) = (f[k], f[(k + 1) % 3]);
            let inner = faces
                .iter()
                .any(|g| (0..3).any(|j| g[j] == b && g[(j + 1) % 3] == a));
            if !inner {
                all.extend([[a, b, b + n], [a, b + n, a + n]]);
            }
        }
    }
    test_meshes::mesh(positions, all)
}

/// Three sheets at an edge, close enough to be on one side of it.
fn book() -> Mesh {
    let positions = vec![
        [0.0, -0.9, 0.1],
        [0.1, 1.0, 0.0],
        [1.0, 0.5, 0.0],
        [0.9, 0.4, 0.5],
        [0.8, 0.3, -0.6],
    ];
    test_meshes::mesh(positions, vec![[0, 1, 2], [1, 0, 3], [0, 1, 4]])
}

/// All meshes, small enough to try everything.
pub(super) fn all() -> Vec<(&'static str, Mesh)> {
    let mut meshes = vec![
        ("small torus", test_meshes::torus(12, 8, 1.0, 0.4)),
        ("cube", test_meshes::cube()),
        ("bumpy", test_meshes::bumpy_sphere(1, 0.4)),
        ("sphere", test_meshes::bumpy_sphere(2, 0.0)),
        ("bow tie", test_meshes::bow_tie()),
        ("flipped", test_meshes::flipped()),
        ("l", prism(l_outline(), 0.5)),
        ("star", prism(star_outline(5), 0.3)),
        ("frame", prism(frame_outline(), 0.2)),
        ("flat l", sheet(l_outline())),
        ("flat star", sheet(star_outline(6))),
        ("flat frame", sheet(frame_outline())),
        ("book", book()),
    ];
    meshes.extend(test_meshes::open().into_iter().filter(|m| m.0 != "zigzag"));
    meshes.push(("short zigzag", test_meshes::zigzag(12)));
    meshes
}

/// A mesh turned round.
pub(super) fn turned(mesh: &Mesh, by: DQuat) -> Mesh {
    let turn = |p: &[f32; 3]| (by * DVec3::from(p.map(f64::from))).as_vec3().to_array();
    Mesh {
        positions: mesh.positions.iter().map(turn).collect(),
        ..mesh.clone()
    }
}
