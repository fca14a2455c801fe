//! Shading normals computed from the faces.

use glam::DVec3;
use protocol::scene::Mesh;

use crate::geometry::{Weld, corners, edge_key, face_vector, is_zero_area};

/// A face's own unit normal; straight up where it has no area.
pub(crate) fn face_normal(mesh: &Mesh, face: usize) -> [f32; 3] {
    let n = face_vector(mesh, mesh.faces[face]).normalize_or(DVec3::Y);
    n.as_vec3().to_array()
}

/// Replaces a mesh's normals by smooth ones: at each welded vertex the faces that meet without a crease between them
/// share one normal, the sum of theirs weighted by their angles there (Thürmer and Wüthrich 1998).
///
/// An edge is a crease if its two faces' normals differ by more than `crease_angle` degrees, or if it has not exactly
/// two faces. Faces without area weigh nothing and make no crease.
pub(crate) fn smooth(mesh: &mut Mesh, crease_angle: f32) {
    let weld = Weld::new(&mesh.positions);
    let mut groups = join_corners(mesh, &weld, crease_angle);
    let corner_count = mesh.faces.len() * 3;
    let mut sums = vec![DVec3::ZERO; corner_count];
    for (f, &face) in mesh.faces.iter().enumerate() {
        if is_zero_area(mesh, face) {
            continue;
        }
        let normal = face_vector(mesh, face).normalize_or_zero();
        let p = corners(mesh, face);
        for k in 0..3 {
            let (to_next, to_last) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
            let angle = to_next.cross(to_last).length().atan2(to_next.dot(to_last));
            sums[groups.root(f * 3 + k)] += normal * angle;
        }
    }
    let mut index = vec![u32::MAX; corner_count];
    let mut normals = Vec::new();
    let mut face_normals = vec![[0; 3]; mesh.faces.len()];
    for corner in 0..corner_count {
        let root = groups.root(corner);
        if index[root] == u32::MAX {
            index[root] = normals.len() as u32;
            let flat = || face_vector(mesh, mesh.faces[corner / 3]).normalize_or(DVec3::Y);
            let normal = sums[root].try_normalize().unwrap_or_else(flat);
            normals.push((normal.as_vec3() + 0.0).to_array());
        }
        face_normals[corner / 3][corner % 3] = index[root];
    }
    mesh.normals = normals;
    mesh.face_normals = face_normals;
}

/// Joins the corners of neighbouring faces at both ends of every edge that is no crease.
fn join_corners(mesh: &Mesh, weld: &Weld, crease_angle: f32) -> DisjointSets {
    let limit = f64::from(crease_angle).to_radians().cos();
    let mut sides: Vec<(u64, u32)> = Vec::with_capacity(mesh.faces.len() * 3);
    for (f, &face) in mesh.faces.iter().enumerate() {
        let ids = weld.face(face);
        for k in 0..3 {
            let (a, b) = (ids[k], ids[(k + 1) % 3]);
            if a != b {
                sides.push((edge_key(a, b), f as u32));
            }
        }
    }
    sides.sort_unstable();
    let mut groups = DisjointSets::new(mesh.faces.len() * 3);
    for edge in sides.chunk_by(|a, b| a.0 == b.0) {
        let &[(key, f), (_, g)] = edge else { continue };
        let (f, g) = (f as usize, g as usize);
        let (face_f, face_g) = (mesh.faces[f], mesh.faces[g]);
        let flat = is_zero_area(mesh, face_f) || is_zero_area(mesh, face_g);
        let n = face_vector(mesh, face_f).normalize_or_zero();
        let m = face_vector(mesh, face_g).normalize_or_zero();
        if !flat && n.dot(m) < limit {
            continue;
        }
        for end in [(key >> 32) as u32, key as u32] {
            let at = |face| weld.face(face).iter().position(|&v| v == end);
            if let (Some(i), Some(j)) = (at(face_f), at(face_g)) {
                groups.join(f * 3 + i, g * 3 + j);
            }
        }
    }
    groups
}

/// Union-find in which the lowest member is the root, so that the result does not depend on the order of joining.
struct DisjointSets(Vec<u32>);

impl DisjointSets {
    fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    fn root(&mut self, mut i: usize) -> usize {
        while self.0[i] as usize != i {
            let above = self.0[self.0[i] as usize];
            self.0[i] = above;
            i = above as usize;
        }
        i
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b)] = a.min(b) as u32;
    }
}
