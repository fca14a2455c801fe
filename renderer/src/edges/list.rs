//! The edges of a frame.

use super::tree::EdgeKind;

/// No face: the other side of a border, or a light's edge.
pub const NO_FACE: u32 = u32::MAX;

/// Edges that matter to a view, as parallel arrays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EdgeList {
    /// First ends, view space (right, up, depth), metres. An end that several edges of an object share is the same to
    /// the bit in all of them.
    pub from: Vec<[f32; 3]>,
    /// Second ends, view space.
    pub to: Vec<[f32; 3]>,
    /// What each edge is.
    pub kind: Vec<EdgeKind>,
    /// Index of its object; those past the scene's objects are area lights, in the scene's order among area lights.
    pub object: Vec<u32>,
    /// The object that the second of its faces belongs to: another one where two objects pass through one another.
    pub second: Vec<u32>,
    /// Two of its faces in the object's mesh, or [`NO_FACE`]; of a shadow edge the one that it lies on.
    pub faces: Vec<[u32; 2]>,
    /// Its ends among the object's welded vertices: equal where edges of one object meet.
    pub vertices: Vec<[u32; 2]>,
    /// Which search filled this list: changes whenever the edges do, and is 0 for a list that was never filled.
    pub generation: u64,
    /// Changes whenever shadow edges and intersection creases do, which follow those of the meshes.
    pub appended: u64,
}

impl EdgeList {
    /// How many edges there are.
    pub fn len(&self) -> usize {
        self.from.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.from.is_empty()
    }

    /// Forgets all edges and keeps the memory.
    pub fn clear(&mut self) {
        self.from.clear();
        self.to.clear();
        self.kind.clear();
        self.object.clear();
        self.second.clear();
        self.faces.clear();
        self.vertices.clear();
    }

    /// Forgets all edges but the first ones.
    pub fn truncate(&mut self, len: usize) {
        self.from.truncate(len);
        self.to.truncate(len);
        self.kind.truncate(len);
        self.object.truncate(len);
        self.second.truncate(len);
        self.faces.truncate(len);
        self.vertices.truncate(len);
    }

    /// How many edges are of a kind.
    pub fn count(&self, kind: EdgeKind) -> usize {
        self.kind.iter().filter(|k| **k == kind).count()
    }
}
