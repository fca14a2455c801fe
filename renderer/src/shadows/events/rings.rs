//! What lies around each vertex of a mesh.

use glam::DVec3;

use crate::edges::adjacency::Adjacency;

const NONE: u32 = u32::MAX;

/// Corners of faces and edges at vertices, in the numbers of an [`Adjacency`]. Built once a mesh.
#[derive(Clone, Debug, Default)]
pub struct Rings {
    /// For each face its welded corners, anticlockwise as seen from where its normal points. Nothing sensible for a face that
    /// takes no part.
    corners: Vec<[u32; 3]>,
    /// Edges at vertex `v`: `edges[first[v]..first[v + 1]]`.
    first: Vec<u32>,
    edges: Vec<u32>,
    /// Edges with three or more faces, which the edge tree prunes by a rule of its own.
    pub(super) branching: Vec<u32>,
}

impl Rings {
    /// Gathers the rings of a mesh.
    pub fn new(adjacency: &Adjacency) -> Self {
        let mut rings = Self {
            corners: vec![[NONE; 3]; adjacency.normals.len()],
            first: vec![0; adjacency.positions.len() + 1],
            edges: vec![0; adjacency.edges.len() * 2],
            branching: Vec::new(),
        };
        for (edge, ends) in adjacency.edges.iter().enumerate() {
            let faces = adjacency.faces(edge);
            for v in ends {
                rings.first[*v as usize + 1] += 1;
                for face in faces {
                    insert(&mut rings.corners[*face as usize], *v);
                }
            }
            if faces.len() > 2 {
                rings.branching.push(edge as u32);
            }
        }
        for v in 1..rings.first.len() {
            rings.first[v] += rings.first[v - 1];
        }
        let mut next = rings.first.clone();
        for (edge, ends) in adjacency.edges.iter().enumerate() {
            for v in ends {
                let slot = &mut next[*v as usize];
                rings.edges[*slot as usize] = edge as u32;
                *slot += 1;
            }
        }
        for (face, corners) in rings.corners.iter_mut().enumerate() {
            if !corners.contains(&NONE) {
                wind(adjacency, face, corners);
            }
        }
        rings
    }

    /// Edges at a vertex.
    #[inline]
    pub fn edges_at(&self, vertex: u32) -> &[u32] {
        let v = vertex as usize;
        &self.edges[self.first[v] as usize..self.first[v + 1] as usize]
    }

    /// Corners of a face that takes part.
    #[inline]
    pub fn corners(&self, face: u32) -> [u32; 3] {
        self.corners[face as usize]
    }

    /// The corner of a face that comes after one of its corners.
    #[inline]
    pub(super) fn after(&self, face: u32, vertex: u32) -> u32 {
        let [a, b, c] = self.corners(face);
        if vertex == a {
            b
        } else if vertex == b {
            c
        } else {
            a
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.corners.len() * 12 + (self.first.len() + self.edges.len() + self.branching.len()) * 4
    }
}

fn insert(corners: &mut [u32; 3], vertex: u32) {
    for corner in corners {
        if *corner == vertex {
            return;
        }
        if *corner == NONE {
            *corner = vertex;
            return;
        }
    }
}

/// Sorts the corners of a face so that they run round its normal.
fn wind(adjacency: &Adjacency, face: usize, corners: &mut [u32; 3]) {
    let anchor = adjacency.anchors[face];
    let start = corners
        .iter()
        .position(|v| adjacency.positions[*v as usize] == anchor);
    // From the anchor on, the cross product is the one that the normal was made of, bit for bit but for its sign.
    corners.rotate_left(start.unwrap_or(0));
    let [a, b, c] = corners.map(|v| DVec3::from(adjacency.positions[v as usize].map(f64::from)));
    if (b - a).cross(c - a).dot(adjacency.normals[face]) < 0.0 {
        corners.swap(1, 2);
    }
}
