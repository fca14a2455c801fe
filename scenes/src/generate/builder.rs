//! Puts a made mesh together corner by corner.

use protocol::scene::Mesh;

use crate::normals;

/// A mesh in the making. Faces run anticlockwise seen from outside.
#[derive(Default)]
pub(super) struct Builder {
    mesh: Mesh,
}

/// A corner of a face: position, normal and texture coordinate indices.
#[derive(Clone, Copy)]
pub(super) struct Corner {
    pub(super) position: u32,
    pub(super) normal: u32,
    pub(super) uv: u32,
}

impl Builder {
    pub(super) fn position(&mut self, p: [f32; 3]) -> u32 {
        self.mesh.positions.push(p.map(|x| x + 0.0));
        self.mesh.positions.len() as u32 - 1
    }

    /// How many positions there are.
    pub(super) fn positions(&self) -> usize {
        self.mesh.positions.len()
    }

    /// Raises the positions from number `first` on.
    pub(super) fn lift(&mut self, first: usize, height: f32) {
        for position in &mut self.mesh.positions[first..] {
            position[1] += height;
        }
    }

    pub(super) fn normal(&mut self, n: [f32; 3]) -> u32 {
        self.mesh.normals.push(n.map(|x| x + 0.0));
        self.mesh.normals.len() as u32 - 1
    }

    pub(super) fn uv(&mut self, uv: [f32; 2]) -> u32 {
        self.mesh.uvs.push(uv);
        self.mesh.uvs.len() as u32 - 1
    }

    pub(super) fn triangle(&mut self, corners: [Corner; 3]) {
        self.mesh.faces.push(corners.map(|c| c.position));
        self.mesh.face_normals.push(corners.map(|c| c.normal));
        self.mesh.face_uvs.push(corners.map(|c| c.uv));
    }

    /// Two triangles, cut from the first corner to the third.
    pub(super) fn quad(&mut self, [a, b, c, d]: [Corner; 4]) {
        self.triangle([a, b, c]);
        self.triangle([a, c, d]);
    }

    /// Computes smooth normals for all that was made so far.
    pub(super) fn smooth(&mut self, crease_angle: f32) {
        normals::smooth(&mut self.mesh, crease_angle);
    }

    pub(super) fn finish(self) -> Mesh {
        self.mesh
    }
}
