//! Welding by exact position, and counting what is broken in a mesh.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};
use std::path::Path;

use glam::DVec3;
use protocol::scene::Mesh;

use crate::error::{ErrorKind, SceneError};
use crate::report::LoadReport;

/// One id for each set of bit-equal positions (0 and -0 are equal), numbered in order of first appearance.
pub(crate) struct Weld {
    /// Id of each position.
    pub(crate) ids: Vec<u32>,
    /// How many ids there are.
    pub(crate) count: usize,
}

impl Weld {
    pub(crate) fn new(positions: &[[f32; 3]]) -> Self {
        let mut seen: HashMap<[u32; 3], u32, BuildHasherDefault<PositionHasher>> =
            HashMap::with_capacity_and_hasher(positions.len(), BuildHasherDefault::default());
        let ids = positions
            .iter()
            .map(|p| {
                let new = seen.len() as u32;
                *seen.entry(p.map(|x| (x + 0.0).to_bits())).or_insert(new)
            })
            .collect();
        Self {
            ids,
            count: seen.len(),
        }
    }

    /// A face's three welded corners.
    pub(crate) fn face(&self, face: [u32; 3]) -> [u32; 3] {
        face.map(|v| self.ids[v as usize])
    }
}

/// Mixes three coordinates' bits; the standard hasher takes twice as long on a mesh of half a million vertices.
#[derive(Default)]
pub(crate) struct PositionHasher(u64);

impl Hasher for PositionHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for &b in bytes {
            self.write_u32(b.into());
        }
    }

    fn write_u32(&mut self, word: u32) {
        let mixed = (self.0 ^ u64::from(word)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 = mixed ^ (mixed >> 29);
    }

    fn write_usize(&mut self, _length: usize) {}
}

/// An undirected edge between welded vertices, lower id first, as one number that sorts.
pub(crate) fn edge_key(a: u32, b: u32) -> u64 {
    u64::from(a.min(b)) << 32 | u64::from(a.max(b))
}

/// Twice the area times the normal, in `f64`.
pub(crate) fn face_vector(mesh: &Mesh, face: [u32; 3]) -> DVec3 {
    let [a, b, c] = corners(mesh, face);
    (b - a).cross(c - a)
}

pub(crate) fn corners(mesh: &Mesh, face: [u32; 3]) -> [DVec3; 3] {
    face.map(|v| DVec3::from_array(mesh.positions[v as usize].map(f64::from)))
}

/// True if the area is at most 1e-7 of the longest edge squared: no normal can be trusted.
pub(crate) fn is_zero_area(mesh: &Mesh, face: [u32; 3]) -> bool {
    let [a, b, c] = corners(mesh, face);
    let longest = (b - a)
        .length_squared()
        .max((c - b).length_squared())
        .max((a - c).length_squared());
    0.5 * face_vector(mesh, face).length() <= 1e-7 * longest
}

/// Counts what is odd about a mesh from `file`, mends its normals and texture coordinates.
///
/// # Errors
/// A face that uses a vertex that is not finite.
pub(crate) fn examine(mesh: &mut Mesh, file: &Path) -> Result<LoadReport, SceneError> {
    let mut report = LoadReport {
        triangles: mesh.faces.len(),
        vertices: mesh.positions.len(),
        ..LoadReport::default()
    };
    check_finite(mesh, file, &mut report)?;
    report.zero_area_faces = mesh
        .faces
        .iter()
        .filter(|f| is_zero_area(mesh, **f))
        .count();
    count_topology(mesh, &mut report);
    mend_normals(mesh, &mut report);
    for uv in &mut mesh.uvs {
        if !uv.iter().all(|x| x.is_finite()) {
            *uv = [0.0; 2];
            report.bad_uvs += 1;
        }
    }
    Ok(report)
}

/// A position that no face uses may be anything; it becomes 0 so that what is sent is finite throughout.
fn check_finite(mesh: &mut Mesh, file: &Path, report: &mut LoadReport) -> Result<(), SceneError> {
    let finite = |p: &[f32; 3]| p.iter().all(|x| x.is_finite());
    if mesh.positions.iter().all(finite) {
        return Ok(());
    }
    for face in &mesh.faces {
        for &v in face {
            if !finite(&mesh.positions[v as usize]) {
                let vertex = v as usize + 1;
                return Err(SceneError::new(file, ErrorKind::NotFinite { vertex }));
            }
        }
    }
    for p in &mut mesh.positions {
        if !finite(p) {
            *p = [0.0; 3];
            report.unused_not_finite += 1;
        }
    }
    Ok(())
}

fn count_topology(mesh: &Mesh, report: &mut LoadReport) {
    let weld = Weld::new(&mesh.positions);
    report.welded_vertices = weld.count;
    let mut keys = Vec::with_capacity(mesh.faces.len() * 3);
    for &face in &mesh.faces {
        let [a, b, c] = weld.face(face);
        keys.extend(
            [(a, b), (b, c), (c, a)]
                .into_iter()
                .filter(|(s, t)| s != t)
                .map(|(s, t)| edge_key(s, t)),
        );
    }
    keys.sort_unstable();
    for edge in keys.chunk_by(|a, b| a == b) {
        report.edges += 1;
        match edge.len() {
            1 => report.boundary_edges += 1,
            2 => {}
            _ => report.non_manifold_edges += 1,
        }
    }
    drop(keys);
    let mut triples: Vec<[u32; 3]> = mesh
        .faces
        .iter()
        .map(|&face| {
            let mut corners = weld.face(face);
            corners.sort_unstable();
            corners
        })
        .collect();
    triples.sort_unstable();
    report.duplicate_faces = triples.windows(2).filter(|w| w[0] == w[1]).count();
}

/// Normals get unit length; those that cannot are replaced by their faces' own.
fn mend_normals(mesh: &mut Mesh, report: &mut LoadReport) {
    let mut bad = vec![false; mesh.normals.len()];
    for (normal, bad) in mesh.normals.iter_mut().zip(&mut bad) {
        let n = DVec3::from_array(normal.map(f64::from));
        let length = n.length();
        *bad = !(length.is_finite() && length > 1e-12);
        // Lengths that are right already keep their bits.
        if !*bad && (length - 1.0).abs() > 1e-6 {
            *normal = (n / length).as_vec3().to_array();
        }
    }
    report.bad_normals = bad.iter().filter(|b| **b).count();
    if report.bad_normals == 0 {
        return;
    }
    for f in 0..mesh.face_normals.len() {
        if mesh.face_normals[f].iter().any(|&n| bad[n as usize]) {
            let flat = crate::normals::face_normal(mesh, f);
            let new = mesh.normals.len() as u32;
            mesh.normals.push(flat);
            for n in &mut mesh.face_normals[f] {
                if bad[*n as usize] {
                    *n = new;
                }
            }
        }
    }
    for (normal, bad) in mesh.normals.iter_mut().zip(bad) {
        if bad {
            *normal = [0.0, 1.0, 0.0];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(positions: &[[f32; 3]], faces: &[[u32; 3]]) -> Mesh {
        Mesh {
            positions: positions.to_vec(),
            faces: faces.to_vec(),
            ..Mesh::default()
        }
    }

    #[test]
    fn counts_what_is_broken() {
        let p = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [-0.0, 0.0, 0.0],
            [2.0, 0.0, 0.0],
            [f32::NAN, 0.0, 0.0],
        ];
        let mut m = mesh(&p, &[[0, 1, 2], [2, 1, 3], [3, 1, 4], [1, 0, 2]]);
        let r = examine(&mut m, Path::new("x")).unwrap();
        assert_eq!(
            (r.triangles, r.zero_area_faces, r.duplicate_faces),
            (4, 1, 2)
        );
        assert_eq!(r.unused_not_finite, 1);
        assert_eq!(m.positions[5], [0.0; 3]);
        // 0-1 has four faces, 1-2 and 0-2 three, 1-4 and 0-4 one.
        assert_eq!((r.edges, r.non_manifold_edges, r.boundary_edges), (5, 3, 2));
    }

    #[test]
    fn a_used_vertex_that_is_not_finite_is_an_error() {
        let mut m = mesh(
            &[[0.0; 3], [f32::INFINITY, 0.0, 0.0], [0.0, 1.0, 0.0]],
            &[[0, 1, 2]],
        );
        let e = examine(&mut m, Path::new("x.obj")).unwrap_err();
        assert_eq!(e.kind, ErrorKind::NotFinite { vertex: 2 });
    }

    #[test]
    fn bad_normals_become_flat_ones() {
        let mut m = mesh(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]]);
        m.normals = vec![[0.0, 3.0, 0.0], [0.0; 3], [f32::NAN; 3]];
        m.face_normals = vec![[0, 1, 2]];
        let r = examine(&mut m, Path::new("x")).unwrap();
        assert_eq!(r.bad_normals, 2);
        let used = m.face_normals[0].map(|n| m.normals[n as usize]);
        assert_eq!(used, [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]]);
        assert!(m.normals.iter().flatten().all(|x| x.is_finite()));
    }
}
