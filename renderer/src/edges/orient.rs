//! Making the faces of a surface agree on which side is out.

use glam::DVec3;

use super::adjacency::Edges;

/// What is known about the surfaces of a mesh.
pub(super) struct Orientation {
    /// For each face: its normal is to be turned round.
    pub(super) flipped: Vec<bool>,
    /// For each edge: its two faces disagree all the same.
    pub(super) twisted: Vec<bool>,
    /// For each face: its surface is closed and its normal, once turned, points outwards.
    pub(super) solid: Vec<bool>,
}

impl Orientation {
    /// Joins faces over edges that have two, and turns whole surfaces outwards where they are closed.
    pub(super) fn find(
        edges: &Edges,
        corners: &[Option<[u32; 3]>],
        normals: &[DVec3],
        positions: &[[f32; 3]],
    ) -> Self {
        let faces = corners.len();
        let mut surfaces = Surfaces::new(faces);
        let mesh = &edges.adjacency;
        let runs = || {
            mesh.first_face
                .windows(2)
                .map(|w| w[0] as usize..w[1] as usize)
        };
        let mut twisted = Vec::with_capacity(mesh.edges.len());
        for run in runs() {
            let pair = run.len() == 2;
            let joined = pair && {
                let same_way = edges.ascending[run.start] == edges.ascending[run.start + 1];
                surfaces.join(
                    mesh.edge_faces[run.start],
                    mesh.edge_faces[run.start + 1],
                    same_way,
                )
            };
            twisted.push(pair && !joined);
        }
        let mut closed = vec![true; faces];
        for (run, twisted) in runs().zip(&twisted) {
            if run.len() != 2 || *twisted {
                for face in &mesh.edge_faces[run] {
                    closed[surfaces.root(*face).0 as usize] = false;
                }
            }
        }
        let origin = positions
            .first()
            .map_or(DVec3::ZERO, |p| DVec3::from(p.map(f64::from)));
        let mut volume = vec![0.0_f64; faces];
        for (f, c) in corners.iter().enumerate() {
            let Some(c) = c.filter(|_| normals[f] != DVec3::ZERO) else {
                continue;
            };
            let [a, b, c] = c.map(|v| DVec3::from(positions[v as usize].map(f64::from)) - origin);
            let (root, flip) = surfaces.root(f as u32);
            let v = a.dot(b.cross(c));
            volume[root as usize] += if flip { -v } else { v };
        }
        let mut flipped = vec![false; faces];
        let mut solid = vec![false; faces];
        for f in 0..faces {
            let (root, flip) = surfaces.root(f as u32);
            let root = root as usize;
            flipped[f] = flip != (closed[root] && volume[root] < 0.0);
            solid[f] = closed[root] && volume[root] != 0.0 && normals[f] != DVec3::ZERO;
        }
        Self {
            flipped,
            twisted,
            solid,
        }
    }
}

/// Disjoint sets of faces; each face knows whether it is turned against its parent.
struct Surfaces {
    parent: Vec<u32>,
    against: Vec<bool>,
    size: Vec<u32>,
}

impl Surfaces {
    fn new(faces: usize) -> Self {
        Self {
            parent: (0..faces as u32).collect(),
            against: vec![false; faces],
            size: vec![1; faces],
        }
    }

    /// The face that stands for the surface, and whether the given face is turned against it.
    fn root(&mut self, face: u32) -> (u32, bool) {
        let mut face = face as usize;
        let mut against = false;
        loop {
            let parent = self.parent[face] as usize;
            if parent == face {
                return (face as u32, against);
            }
            // Path halving: point at the grandparent on the way.
            self.against[face] ^= self.against[parent];
            self.parent[face] = self.parent[parent];
            against ^= self.against[face];
            face = self.parent[face] as usize;
        }
    }

    /// Joins the surfaces of two faces; false if they are one already and the faces disagree.
    fn join(&mut self, a: u32, b: u32, turned: bool) -> bool {
        let (ra, flip_a) = self.root(a);
        let (rb, flip_b) = self.root(b);
        let against = flip_a ^ flip_b ^ turned;
        if ra == rb {
            return !against;
        }
        let (child, root) = if self.size[ra as usize] < self.size[rb as usize] {
            (ra, rb)
        } else {
            (rb, ra)
        };
        self.parent[child as usize] = root;
        self.against[child as usize] = against;
        self.size[root as usize] += self.size[child as usize];
        true
    }
}
