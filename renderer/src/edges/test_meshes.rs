//! Small meshes that are hard in one way or another.

use glam::Vec3;
use protocol::scene::Mesh;

pub(crate) fn mesh(positions: Vec<[f32; 3]>, faces: Vec<[u32; 3]>) -> Mesh {
    Mesh {
        positions,
        faces,
        ..Mesh::default()
    }
}

/// A torus around the y axis of `n` by `m` quads, each two triangles; every vertex has its own index in every row.
pub(crate) fn torus(n: u32, m: u32, major: f32, minor: f32) -> Mesh {
    let mut positions = Vec::new();
    for i in 0..n {
        for j in 0..m {
            let (a, b) = (
                i as f32 / n as f32 * std::f32::consts::TAU,
                j as f32 / m as f32 * std::f32::consts::TAU,
            );
            let r = major + minor * b.cos();
            positions.push([r * a.cos(), minor * b.sin(), r * a.sin()]);
        }
    }
    let at = |i: u32, j: u32| (i % n) * m + j % m;
    let mut faces = Vec::new();
    for i in 0..n {
        for j in 0..m {
            let (a, b, c, d) = (at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j));
            faces.push([a, b, c]);
            faces.push([a, c, d]);
        }
    }
    mesh(positions, faces)
}

/// A box with corners at -1 and 1, whose faces do not share vertex indices.
pub(crate) fn cube() -> Mesh {
    let (mut positions, mut faces) = (Vec::new(), Vec::new());
    for axis in 0..3 {
        for side in [-1.0_f32, 1.0] {
            let first = positions.len() as u32;
            for (u, v) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                let mut p = [0.0; 3];
                p[axis] = side;
                p[(axis + 1) % 3] = u * side;
                p[(axis + 2) % 3] = v;
                positions.push(p);
            }
            faces.push([first, first + 1, first + 2]);
            faces.push([first, first + 2, first + 3]);
        }
    }
    mesh(positions, faces)
}

/// A subdivided icosahedron pushed in and out by a wave: closed and concave.
pub(crate) fn bumpy_sphere(levels: u32, amplitude: f32) -> Mesh {
    let t = (1.0 + 5.0_f32.sqrt()) / 2.0;
    let mut points: Vec<Vec3> = Vec::new();
    for (a, b) in [(1.0, t), (-1.0, t), (1.0, -t), (-1.0, -t)] {
        points.push(Vec3::new(0.0, a, b).normalize());
        points.push(Vec3::new(a, b, 0.0).normalize());
        points.push(Vec3::new(b, 0.0, a).normalize());
    }
    // Faces of the icosahedron: all triples at the least distance.
    let near = |a: usize, b: usize| points[a].distance(points[b]) < 1.2;
    let mut faces: Vec<[u32; 3]> = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(a, c) {
                    let out = (points[b] - points[a])
                        .cross(points[c] - points[a])
                        .dot(points[a])
                        > 0.0;
                    faces.push(if out { [a, b, c] } else { [a, c, b] }.map(|v| v as u32));
                }
            }
        }
    }
    for _ in 0..levels {
        let mut middle = std::collections::HashMap::new();
        let mut split = |points: &mut Vec<Vec3>, a: u32, b: u32| {
            *middle.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        let mut finer = Vec::new();
        for [a, b, c] in faces {
            let (ab, bc, ca) = (
                split(&mut points, a, b),
                split(&mut points, b, c),
                split(&mut points, c, a),
            );
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        faces = finer;
    }
    let wave =
        |p: Vec3| p * (1.0 + amplitude * (7.0 * p.x).sin() * (5.0 * p.y).cos() * (6.0 * p.z).sin());
    mesh(points.into_iter().map(|p| wave(p).into()).collect(), faces)
}

/// Two tetrahedra that share a vertex only.
pub(crate) fn bow_tie() -> Mesh {
    let p = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.2],
        [0.9, 1.0, 0.0],
        [0.8, 0.3, 1.0],
        [-1.0, 0.0, 0.2],
        [-0.9, 1.0, 0.0],
        [-0.8, 0.3, 1.0],
    ];
    let f = vec![
        [0, 2, 1],
        [0, 1, 3],
        [0, 3, 2],
        [1, 2, 3],
        [0, 4, 5],
        [0, 6, 4],
        [0, 5, 6],
        [4, 6, 5],
    ];
    mesh(p.to_vec(), f)
}

/// Three sheets that meet in an edge.
pub(crate) fn fin() -> Mesh {
    mesh(
        vec![
            [0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [1.0, 0.5, 0.0],
            [-0.5, 0.5, 0.8],
            [-0.5, 0.5, -0.8],
        ],
        vec![[0, 1, 2], [0, 1, 3], [0, 1, 4]],
    )
}

/// A square of two triangles.
pub(crate) fn quad() -> Mesh {
    mesh(
        vec![
            [-1.0, -1.0, 0.0],
            [1.0, -1.0, 0.0],
            [1.0, 1.0, 0.0],
            [-1.0, 1.0, 0.0],
        ],
        vec![[0, 1, 2], [0, 2, 3]],
    )
}

/// A band with half a twist: one-sided.
pub(crate) fn moebius(n: u32) -> Mesh {
    let mut positions = Vec::new();
    for i in 0..n {
        let a = i as f32 / n as f32 * std::f32::consts::TAU;
        for side in [-0.3_f32, 0.3] {
            let r = 1.0 + side * (a / 2.0).cos();
            positions.push([r * a.cos(), side * (a / 2.0).sin(), r * a.sin()]);
        }
    }
    let mut faces = Vec::new();
    for i in 0..n {
        let (a, b) = (2 * i, 2 * i + 1);
        let (c, d) = if i + 1 == n {
            (1, 0)
        } else {
            (2 * i + 2, 2 * i + 3)
        };
        faces.extend([[a, b, c], [b, d, c]]);
    }
    mesh(positions, faces)
}

/// Faces without area, a face that lists a vertex twice, one with a bad index and one with a bad coordinate.
pub(crate) fn broken() -> Mesh {
    let mut m = quad();
    m.positions
        .extend([[0.5, 0.5, 0.0], [f32::NAN, 0.0, 0.0], [-1.0, -1.0, -0.0]]);
    m.faces
        .extend([[0, 2, 4], [1, 1, 2], [0, 1, 99], [0, 1, 5], [0, 6, 3]]);
    m
}

/// Two squares in the same place, one wound the other way.
pub(crate) fn doubled() -> Mesh {
    let mut m = quad();
    m.faces.extend([[2, 1, 0], [0, 3, 2]]);
    m
}

/// A cube of which one face is wound the other way.
pub(crate) fn flipped() -> Mesh {
    let mut m = cube();
    m.faces[0].swap(0, 1);
    m.faces[1].swap(0, 1);
    m
}

/// Two squares side by side, one of which has a vertex in the middle of their common side.
pub(crate) fn t_junction() -> Mesh {
    mesh(
        vec![
            [-1.0, -1.0, 0.0],
            [0.0, -1.0, 0.0],
            [0.0, 1.0, 0.0],
            [-1.0, 1.0, 0.0],
            [0.0, 0.0, 0.0],
            [1.0, -1.0, 0.0],
            [1.0, 1.0, 0.0],
        ],
        vec![[0, 1, 2], [0, 2, 3], [1, 5, 4], [4, 5, 6], [4, 6, 2]],
    )
}

/// A thin cylinder with zig-zag rows: a view along it has many silhouettes.
pub(crate) fn zigzag(rows: u32) -> Mesh {
    let mut positions = Vec::new();
    for i in 0..rows {
        let r = if i % 2 == 0 { 0.2 } else { 0.21 };
        for j in 0..6 {
            let a = (j as f32 + 0.5 * (i % 2) as f32) / 6.0 * std::f32::consts::TAU;
            positions.push([r * a.cos(), r * a.sin(), i as f32 * 0.05]);
        }
    }
    let mut faces = Vec::new();
    for i in 0..rows - 1 {
        for j in 0..6 {
            let (a, b) = (i * 6 + j, i * 6 + (j + 1) % 6);
            faces.extend([[a, b, a + 6], [b, b + 6, a + 6]]);
        }
    }
    mesh(positions, faces)
}

/// All of the above that enclose a volume.
pub(crate) fn closed() -> Vec<(&'static str, Mesh)> {
    vec![
        ("torus", torus(48, 24, 1.0, 0.35)),
        ("cube", cube()),
        ("bumpy", bumpy_sphere(3, 0.25)),
        ("bow tie", bow_tie()),
        ("flipped", flipped()),
    ]
}

/// All of the above that do not.
pub(crate) fn open() -> Vec<(&'static str, Mesh)> {
    vec![
        ("fin", fin()),
        ("quad", quad()),
        ("moebius", moebius(24)),
        ("broken", broken()),
        ("doubled", doubled()),
        ("t junction", t_junction()),
        ("zigzag", zigzag(300)),
    ]
}

/// A mesh scaled and then moved.
pub(crate) fn placed(mesh: &Mesh, scale: f32, offset: f32) -> Mesh {
    let positions = mesh
        .positions
        .iter()
        .map(|p| p.map(|x| x * scale + offset))
        .collect();
    Mesh {
        positions,
        ..mesh.clone()
    }
}
