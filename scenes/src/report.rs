//! What was odd about the geometry that was loaded.

use std::fmt;

/// What was loaded and what was broken in it, summed over all objects (what only a file's reader sees,
/// such as polygons, over all files). Edges and duplicates are counted after welding bit-equal positions, within each
/// object.
#[derive(Debug, Default, Clone, PartialEq, Eq)]
pub struct LoadReport {
    /// Triangles kept.
    pub triangles: usize,
    /// Positions kept.
    pub vertices: usize,
    /// Positions after welding.
    pub welded_vertices: usize,
    /// Edges after welding; zero-area faces count like others.
    pub edges: usize,
    /// Edges with one face: holes and borders.
    pub boundary_edges: usize,
    /// Edges with three faces or more, duplicate faces included.
    pub non_manifold_edges: usize,
    /// Faces whose area is at most 1e-7 of their longest edge squared. They are kept.
    pub zero_area_faces: usize,
    /// Faces with the same three welded corners as an earlier one, either way round. They are kept.
    pub duplicate_faces: usize,
    /// Polygons of more than three sides that were cut into fans.
    pub polygons: usize,
    /// Points and lines, left out.
    pub points_and_lines: usize,
    /// Faces of mesh files left out since a corner of theirs is not finite.
    pub faces_not_finite: usize,
    /// Positions that are not finite; no face that is kept uses them.
    pub unused_not_finite: usize,
    /// Faces without normals in files that have some; they got flat ones.
    pub faces_without_normals: usize,
    /// Normals that were not finite or had no length; replaced by their face's.
    pub bad_normals: usize,
    /// Texture coordinates that were not finite; replaced by (0, 0).
    pub bad_uvs: usize,
    /// Other things worth a line: emissive materials taken for plain ones, missing materials and so on.
    pub notes: Vec<String>,
}

impl LoadReport {
    /// Adds another report's counts and notes to this one.
    pub fn add(&mut self, other: &Self) {
        self.triangles += other.triangles;
        self.vertices += other.vertices;
        self.welded_vertices += other.welded_vertices;
        self.edges += other.edges;
        self.boundary_edges += other.boundary_edges;
        self.non_manifold_edges += other.non_manifold_edges;
        self.zero_area_faces += other.zero_area_faces;
        self.duplicate_faces += other.duplicate_faces;
        self.polygons += other.polygons;
        self.points_and_lines += other.points_and_lines;
        self.faces_not_finite += other.faces_not_finite;
        self.unused_not_finite += other.unused_not_finite;
        self.faces_without_normals += other.faces_without_normals;
        self.bad_normals += other.bad_normals;
        self.bad_uvs += other.bad_uvs;
        self.notes.extend(other.notes.iter().cloned());
    }

    /// True if nothing needed to be mended, left out or warned of. Borders and cut polygons are not broken.
    pub fn is_clean(&self) -> bool {
        self.broken().iter().all(|(n, _)| *n == 0) && self.notes.is_empty()
    }

    fn broken(&self) -> [(usize, &'static str); 9] {
        [
            (self.zero_area_faces, "zero-area faces"),
            (self.duplicate_faces, "duplicate faces"),
            (self.non_manifold_edges, "edges with three faces or more"),
            (self.points_and_lines, "points and lines left out"),
            (
                self.faces_not_finite,
                "faces left out for a corner that is not finite",
            ),
            (self.unused_not_finite, "vertices that are not finite"),
            (
                self.faces_without_normals,
                "faces without the normals that others have",
            ),
            (self.bad_normals, "bad normals replaced"),
            (self.bad_uvs, "bad texture coordinates replaced"),
        ]
    }
}

impl fmt::Display for LoadReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} triangles, {} edges, {} on borders",
            self.triangles, self.edges, self.boundary_edges
        )?;
        for (n, what) in self.broken().into_iter().filter(|(n, _)| *n > 0) {
            write!(f, ", {n} {what}")?;
        }
        for note in &self.notes {
            write!(f, "; {note}")?;
        }
        Ok(())
    }
}
