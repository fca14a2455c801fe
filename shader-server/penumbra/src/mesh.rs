//! Meshes that block light, in object space.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use crate::{
    alpha::Alpha,
    merge::{self, Merged},
    shells,
};

/// Largest coordinate that is cast from, as in [`rays::TriangleMesh`].
const MAX_COORDINATE: f32 = 1e12;
/// No such face, polygon or corner.
pub(crate) const NONE: u32 = u32::MAX;

/// A blocker: a triangle, or coplanar ones merged to a convex quadrilateral.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Polygon {
    /// Anticlockwise seen from the front; the last is [`NONE`] in a triangle.
    pub(crate) corners: [u32; 4],
    /// Which shell it is part of.
    pub(crate) shell: u32,
    /// The face whose alpha counts, or [`NONE`] if it is opaque.
    pub(crate) alpha_face: u32,
}

/// Triangles of one mesh, merged where they lie in one plane.
#[derive(Clone, Debug, Default)]
pub struct BlockerMesh {
    /// Each place once.
    pub(crate) positions: Vec<Vec3>,
    pub(crate) polygons: Vec<Polygon>,
    /// [`NONE`] where a face has no area or no finite corners.
    pub(crate) polygon_of_face: Vec<u32>,
    /// Of each shell, whether it is closed: no edge lacks a neighbour that runs the other way.
    pub(crate) closed: Vec<bool>,
    pub(crate) alpha: Option<Alpha>,
}

impl BlockerMesh {
    /// Welds corners by position, finds closed shells and merges neighbours that lie in one plane as far as rounding tells.
    ///
    /// Faces without area, with an index past `positions` or a coordinate that is not finite or is above 1e12 block nothing.
    #[must_use]
    pub fn new(positions: &[Vec3], faces: &[[u32; 3]]) -> Self {
        Self::build(positions, faces, None, true)
    }

    /// The same without merging: one polygon a face.
    #[must_use]
    pub fn unmerged(positions: &[Vec3], faces: &[[u32; 3]]) -> Self {
        Self::build(positions, faces, None, false)
    }

    /// With faces that are transparent in places; those are not merged.
    #[must_use]
    pub fn with_alpha(positions: &[Vec3], faces: &[[u32; 3]], alpha: Alpha) -> Self {
        Self::build(positions, faces, Some(alpha), true)
    }

    fn build(positions: &[Vec3], faces: &[[u32; 3]], alpha: Option<Alpha>, merging: bool) -> Self {
        let (welded, index_of) = weld(positions);
        let name = |i: u32| index_of.get(i as usize).copied().unwrap_or(NONE);
        let corners: Vec<[u32; 3]> = faces.iter().map(|face| face.map(name)).collect();
        let (shell_of_face, mut closed) = shells::shells(&corners);
        let usable = |face: usize| {
            let [a, b, c] = corners[face];
            let at = |i: u32| welded.get(i as usize).map(|p| p.as_dvec3());
            match (at(a), at(b), at(c)) {
                (Some(a), Some(b), Some(c)) => (b - a).cross(c - a) != DVec3::ZERO,
                _ => false,
            }
        };
        let is_alpha = |face: usize| alpha.as_ref().is_some_and(|a| a.has(face));
        for face in (0..faces.len()).filter(|f| is_alpha(*f)) {
            // What is seen through is no shell.
            if let Some(closed) = closed.get_mut(shell_of_face[face] as usize) {
                *closed = false;
            }
        }
        let mut opaque: Vec<u32> = Vec::with_capacity(faces.len());
        let mut seen_through: Vec<u32> = Vec::new();
        for face in (0..faces.len()).filter(|face| usable(*face)) {
            if is_alpha(face) {
                seen_through.push(face as u32);
            } else {
                opaque.push(face as u32);
            }
        }
        let Merged {
            polygons: merged,
            of_triangle,
        } = merge::merge(&welded, &opaque, &corners, merging);
        let mut polygon_of_face = vec![NONE; faces.len()];
        for (face, polygon) in opaque.iter().zip(of_triangle) {
            polygon_of_face[*face as usize] = polygon;
        }
        let mut polygons: Vec<Polygon> = merged
            .into_iter()
            .map(|(corners, triangle)| Polygon {
                corners,
                shell: shell_of_face[opaque[triangle as usize] as usize],
                alpha_face: NONE,
            })
            .collect();
        for face in seen_through {
            polygon_of_face[face as usize] = polygons.len() as u32;
            let [a, b, c] = corners[face as usize];
            polygons.push(Polygon {
                corners: [a, b, c, NONE],
                shell: shell_of_face[face as usize],
                alpha_face: face,
            });
        }
        Self {
            positions: welded,
            polygons,
            polygon_of_face,
            closed,
            alpha,
        }
    }

    /// How many polygons block, after merging.
    #[must_use]
    pub fn polygons(&self) -> usize {
        self.polygons.len()
    }

    /// Size in memory, bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(&self.positions[..])
            + size_of_val(&self.polygons[..])
            + size_of_val(&self.polygon_of_face[..])
    }
}

/// Each usable place once, and which of them each position is.
fn weld(positions: &[Vec3]) -> (Vec<Vec3>, Vec<u32>) {
    let mut index: HashMap<[u32; 3], u32> = HashMap::with_capacity(positions.len());
    let mut welded = Vec::with_capacity(positions.len());
    let of = positions
        .iter()
        .map(|position| {
            if !position.abs().cmple(Vec3::splat(MAX_COORDINATE)).all() {
                return NONE;
            }
            // Zero has one sign.
            let position = *position + 0.;
            let key = position.to_array().map(f32::to_bits);
            *index.entry(key).or_insert_with(|| {
                welded.push(position);
                welded.len() as u32 - 1
            })
        })
        .collect();
    (welded, of)
}
