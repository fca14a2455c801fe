//! Which faces meet at which edge of a mesh (paper section 6.1, with the open, doubled and non-manifold meshes that
//! it leaves out).

use glam::DVec3;
use protocol::scene::Mesh;

use super::orient::Orientation;
use super::weld::weld;

/// Where an eye or a light may be, in object space: a box, or a point if both corners are the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EyeBox {
    /// Least coordinates.
    pub low: DVec3,
    /// Greatest coordinates.
    pub high: DVec3,
}

impl EyeBox {
    /// A single position.
    pub fn point(at: DVec3) -> Self {
        Self { low: at, high: at }
    }
}

/// On which side of a face's plane an [`EyeBox`] lies. A point on the plane is at the back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Facing {
    /// All of it is in front.
    Front,
    /// All of it is behind or on the plane.
    Back,
    /// Some of it is in front and some is not. Never so for a point.
    Mixed,
}

/// The edges of a mesh, welded by exact position, and the planes of its faces, in object space.
///
/// Faces without area, faces with coordinates that are not finite or with indices that are out of range, and repeats of
/// a face (whichever way they are wound) take no part. Faces are turned so that they agree with their neighbours
/// wherever that can be done, and outwards where they enclose a volume.
#[derive(Clone, Debug, Default)]
pub struct Adjacency {
    /// Positions without repeats.
    pub positions: Vec<[f32; 3]>,
    /// The two ends of each edge, lesser index first; indices into `positions`.
    pub edges: Vec<[u32; 2]>,
    /// Faces of edge `e`: `edge_faces[first_face[e]..first_face[e + 1]]`, face indices of the mesh.
    pub first_face: Vec<u32>,
    /// See `first_face`.
    pub edge_faces: Vec<u32>,
    /// For each edge: its two faces cannot be made to agree in winding (a one-sided surface).
    pub twisted: Vec<bool>,
    /// Unit normal of each face of the mesh; zero where the face takes no part.
    pub normals: Vec<DVec3>,
    /// The vertex of each face that Eq. 1 uses.
    pub anchors: Vec<[f32; 3]>,
    /// For each face: it belongs to a closed surface, and its normal points out of it.
    pub solid: Vec<bool>,
    /// Corners of the box around the faces that take part.
    pub bounds: [[f32; 3]; 2],
    /// Material of each face, for comparing; empty where all have the same.
    pub materials: Vec<u32>,
}

impl Adjacency {
    /// Finds the edges of a mesh.
    pub fn new(mesh: &Mesh) -> Self {
        let (ids, positions) = weld(&mesh.positions);
        let corners: Vec<Option<[u32; 3]>> = mesh
            .faces
            .iter()
            .map(|face| {
                let corner = |i: usize| ids.get(face[i] as usize).copied();
                Some([corner(0)?, corner(1)?, corner(2)?])
            })
            .collect();
        let mut normals: Vec<DVec3> = corners
            .iter()
            .map(|c| c.map_or(DVec3::ZERO, |c| unit_normal(&positions, c)))
            .collect();
        let anchors = corners
            .iter()
            .zip(&normals)
            .map(|(c, n)| match c {
                Some(c) if *n != DVec3::ZERO => positions[c[0] as usize],
                _ => [0.0; 3],
            })
            .collect();
        let sides = Sides::collect(positions.len(), &corners, &mut normals);
        let mut edges = sides.edges();
        let orientation = Orientation::find(&edges, &corners, &normals, &positions);
        for (normal, flip) in normals.iter_mut().zip(&orientation.flipped) {
            if *flip {
                *normal = -*normal;
            }
        }
        edges.adjacency.twisted = orientation.twisted;
        edges.adjacency.solid = orientation.solid;
        edges.adjacency.bounds = bounds(&corners, &normals, &positions);
        Self {
            positions,
            normals,
            anchors,
            materials: materials(mesh),
            ..edges.adjacency
        }
    }

    /// Faces of an edge.
    #[inline]
    pub fn faces(&self, edge: usize) -> &[u32] {
        &self.edge_faces[self.first_face[edge] as usize..self.first_face[edge + 1] as usize]
    }

    /// Whether two of these faces have different materials: the surface changes its colour where they meet.
    pub fn changes_material(&self, faces: &[u32]) -> bool {
        let material = |f: &u32| self.materials.get(*f as usize);
        faces
            .windows(2)
            .any(|pair| material(&pair[0]) != material(&pair[1]))
    }

    /// The one predicate that says which side of a face is seen (Eq. 1): the sign of `N · (eye - vertex)`, with zero
    /// counting as back. It is a face's, not an edge's, so that the edges of a face never disagree.
    #[inline]
    pub fn facing(&self, face: u32, eye: &EyeBox) -> Facing {
        let n = self.normals[face as usize];
        let v = DVec3::from(self.anchors[face as usize].map(f64::from));
        let at_low = n * (eye.low - v);
        let at_high = n * (eye.high - v);
        let (least, most) = (at_low.min(at_high), at_low.max(at_high));
        if least.x + least.y + least.z > 0.0 {
            Facing::Front
        } else if most.x + most.y + most.z > 0.0 {
            Facing::Mixed
        } else {
            Facing::Back
        }
    }

    /// Length of an object's box diagonal, object space.
    pub fn diagonal(&self) -> f64 {
        let [low, high] = self.bounds.map(|p| DVec3::from(p.map(f64::from)));
        (high - low).length()
    }
}

/// Edges with their faces, and for each of those whether the face runs from the lesser to the greater end.
pub(super) struct Edges {
    /// All but the normals, anchors and what the orientation says.
    pub(super) adjacency: Adjacency,
    /// Parallel to `edge_faces`.
    pub(super) ascending: Vec<bool>,
}

/// One side of a face: an edge as the face sees it.
#[derive(Clone, Copy, Default)]
struct Side {
    high: u32,
    opposite: u32,
    face: u32,
    ascending: bool,
}

/// All sides of all faces, sorted by lesser end, greater end and opposite vertex.
struct Sides {
    first: Vec<u32>,
    sides: Vec<Side>,
    dropped: Vec<bool>,
}

impl Sides {
    /// Sorts the sides and drops repeated faces, whose normals become zero.
    fn collect(vertices: usize, corners: &[Option<[u32; 3]>], normals: &mut [DVec3]) -> Self {
        let live = |f: usize| {
            if normals[f] == DVec3::ZERO {
                None
            } else {
                corners[f]
            }
        };
        let mut first = vec![0_u32; vertices + 1];
        for f in 0..corners.len() {
            let Some(c) = live(f) else { continue };
            for k in 0..3 {
                first[c[k].min(c[(k + 1) % 3]) as usize + 1] += 1;
            }
        }
        for v in 0..vertices {
            first[v + 1] += first[v];
        }
        let mut next = first.clone();
        let mut sides = vec![Side::default(); first[vertices] as usize];
        for f in 0..corners.len() {
            let Some(c) = live(f) else { continue };
            for k in 0..3 {
                let (a, b) = (c[k], c[(k + 1) % 3]);
                let slot = &mut next[a.min(b) as usize];
                sides[*slot as usize] = Side {
                    high: a.max(b),
                    opposite: c[(k + 2) % 3],
                    face: f as u32,
                    ascending: a < b,
                };
                *slot += 1;
            }
        }
        let mut dropped = vec![false; corners.len()];
        for v in 0..vertices {
            let bucket = &mut sides[first[v] as usize..first[v + 1] as usize];
            bucket.sort_unstable_by_key(|s| (s.high, s.opposite, s.face));
            for pair in bucket.windows(2) {
                if (pair[0].high, pair[0].opposite) == (pair[1].high, pair[1].opposite) {
                    dropped[pair[1].face as usize] = true;
                }
            }
        }
        for (normal, drop) in normals.iter_mut().zip(&dropped) {
            if *drop {
                *normal = DVec3::ZERO;
            }
        }
        Self {
            first,
            sides,
            dropped,
        }
    }

    /// Gathers the sides that share both ends.
    fn edges(&self) -> Edges {
        let mut adjacency = Adjacency {
            first_face: vec![0],
            ..Adjacency::default()
        };
        let mut ascending = Vec::with_capacity(self.sides.len());
        adjacency.edge_faces.reserve(self.sides.len());
        adjacency.edges.reserve(self.sides.len() / 2 + 1);
        for low in 0..self.first.len() - 1 {
            let bucket = &self.sides[self.first[low] as usize..self.first[low + 1] as usize];
            for run in bucket.chunk_by(|a, b| a.high == b.high) {
                let before = ascending.len();
                for side in run.iter().filter(|s| !self.dropped[s.face as usize]) {
                    adjacency.edge_faces.push(side.face);
                    ascending.push(side.ascending);
                }
                if ascending.len() > before {
                    adjacency.edges.push([low as u32, run[0].high]);
                    adjacency.first_face.push(ascending.len() as u32);
                }
            }
        }
        Edges {
            adjacency,
            ascending,
        }
    }
}

fn materials(mesh: &Mesh) -> Vec<u32> {
    let own = &mesh.face_materials;
    if own.len() == mesh.faces.len() && own.windows(2).any(|pair| pair[0] != pair[1]) {
        own.clone()
    } else {
        Vec::new()
    }
}

/// The normal of a face, or zero if it has none.
fn unit_normal(positions: &[[f32; 3]], corners: [u32; 3]) -> DVec3 {
    let [a, b, c] = corners.map(|v| DVec3::from(positions[v as usize].map(f64::from)));
    let n = (b - a).cross(c - a);
    let length = n.length();
    // Not `length <= 0`: coordinates that are not finite must fail too.
    if length > 0.0 && length.is_finite() {
        n / length
    } else {
        DVec3::ZERO
    }
}

fn bounds(
    corners: &[Option<[u32; 3]>],
    normals: &[DVec3],
    positions: &[[f32; 3]],
) -> [[f32; 3]; 2] {
    let mut low = [f32::INFINITY; 3];
    let mut high = [f32::NEG_INFINITY; 3];
    for (c, n) in corners.iter().zip(normals) {
        let Some(c) = c.filter(|_| *n != DVec3::ZERO) else {
            continue;
        };
        for v in c {
            for k in 0..3 {
                low[k] = low[k].min(positions[v as usize][k]);
                high[k] = high[k].max(positions[v as usize][k]);
            }
        }
    }
    if low[0] > high[0] {
        [[0.0; 3]; 2]
    } else {
        [low, high]
    }
}
