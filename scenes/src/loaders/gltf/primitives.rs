//! A glTF mesh's primitives as one mesh.

use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::{Mode, Primitive};
use gltf::{Accessor, Semantic};

use super::buffers::Buffers;
use super::materials::UvChoice;
use crate::loaders::{Part, fill_in, weld};
use crate::report::LoadReport;

/// Puts a mesh together, primitive by primitive.
#[derive(Default)]
pub(super) struct Gather {
    part: Part,
    without_normals: Vec<u32>,
    without_uvs: Vec<u32>,
    points_and_lines: usize,
}

impl Gather {
    /// Adds a primitive's triangles; `material` is its index in the file's table.
    ///
    /// # Errors
    /// What is wrong with which accessor.
    pub(super) fn add(
        &mut self,
        primitive: &Primitive<'_>,
        buffers: &Buffers,
        material: Option<usize>,
        uv: UvChoice,
    ) -> Result<(), String> {
        if matches!(
            primitive.mode(),
            Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip
        ) {
            self.points_and_lines += 1;
            return Ok(());
        }
        let reader = primitive.reader(|b| buffers.get(&b));
        let Some(accessor) = primitive.get(&Semantic::Positions) else {
            return Err("has no positions".into());
        };
        buffers.check(&accessor, Dimensions::Vec3, &[DataType::F32])?;
        let positions: Vec<[f32; 3]> = reader.read_positions().into_iter().flatten().collect();
        let same_count = |accessor: &Accessor<'_>| {
            if accessor.count() == positions.len() {
                Ok(())
            } else {
                let (n, m) = (accessor.count(), positions.len());
                Err(format!(
                    "accessor {} has {n} elements for {m} positions",
                    accessor.index()
                ))
            }
        };
        let mut normals = None;
        if let Some(accessor) = primitive.get(&Semantic::Normals) {
            buffers.check(&accessor, Dimensions::Vec3, &[DataType::F32])?;
            same_count(&accessor)?;
            normals = reader.read_normals();
        }
        let mut uvs = None;
        if let Some(set) = uv.set
            && let Some(accessor) = primitive.get(&Semantic::TexCoords(set))
        {
            let types = [DataType::F32, DataType::U8, DataType::U16];
            buffers.check(&accessor, Dimensions::Vec2, &types)?;
            same_count(&accessor)?;
            uvs = reader.read_tex_coords(set).map(|t| t.into_f32());
        }
        let indices: Vec<u32> = match primitive.indices() {
            None => (0..positions.len() as u32).collect(),
            Some(accessor) => {
                let types = [DataType::U8, DataType::U16, DataType::U32];
                buffers.check(&accessor, Dimensions::Scalar, &types)?;
                reader
                    .read_indices()
                    .into_iter()
                    .flat_map(|i| i.into_u32())
                    .collect()
            }
        };
        if let Some(index) = indices.iter().find(|i| **i as usize >= positions.len()) {
            return Err(format!(
                "uses vertex {index}, counted from 0, but there are {}",
                positions.len()
            ));
        }
        let faces = triangles(&indices, primitive.mode());
        let mesh = &mut self.part.mesh;
        let shifted = |by: usize| {
            faces
                .iter()
                .map(move |f| f.map(|v| v + by as u32))
                .collect::<Vec<_>>()
        };
        let numbers = mesh.faces.len() as u32..(mesh.faces.len() + faces.len()) as u32;
        mesh.faces.extend(shifted(mesh.positions.len()));
        mesh.positions.extend(positions);
        if let Some(normals) = normals {
            mesh.face_normals.extend(shifted(mesh.normals.len()));
            mesh.normals.extend(normals);
        } else {
            mesh.face_normals.extend(faces.iter().map(|_| [0; 3]));
            self.without_normals.extend(numbers.clone());
        }
        if let Some(uvs) = uvs {
            mesh.face_uvs.extend(shifted(mesh.uvs.len()));
            mesh.uvs.extend(uvs.map(|t| uv.apply(t)));
        } else {
            mesh.face_uvs.extend(faces.iter().map(|_| [0; 3]));
            self.without_uvs.extend(numbers);
        }
        self.part
            .face_materials
            .extend(faces.iter().map(|_| material));
        Ok(())
    }

    /// The whole; its normals and texture coordinates are filled in where only some primitives have them.
    pub(super) fn finish(mut self, report: &mut LoadReport) -> Part {
        report.points_and_lines += self.points_and_lines;
        let mesh = &mut self.part.mesh;
        fill_in(mesh, &self.without_normals, &self.without_uvs, report);
        weld(mesh);
        if self.part.face_materials.iter().all(Option::is_none) {
            self.part.face_materials.clear();
        }
        self.part
    }
}

/// Corners of each triangle (glTF 2.0, 3.7.2.1); every other one of a strip is turned round.
fn triangles(indices: &[u32], mode: Mode) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => indices
            .windows(3)
            .enumerate()
            .map(|(i, w)| {
                if i % 2 == 0 {
                    [w[0], w[1], w[2]]
                } else {
                    [w[0], w[2], w[1]]
                }
            })
            .collect(),
        Mode::TriangleFan => match indices.split_first() {
            Some((&first, rest)) => rest.windows(2).map(|w| [first, w[0], w[1]]).collect(),
            None => Vec::new(),
        },
        _ => indices.as_chunks::<3>().0.to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_keep_their_sides() {
        let list = [0, 1, 2, 3, 4];
        assert_eq!(
            triangles(&list, Mode::TriangleStrip),
            [[0, 1, 2], [1, 3, 2], [2, 3, 4]]
        );
        assert_eq!(
            triangles(&list, Mode::TriangleFan),
            [[0, 1, 2], [0, 2, 3], [0, 3, 4]]
        );
        assert_eq!(triangles(&list, Mode::Triangles), [[0, 1, 2]]);
        assert!(triangles(&[], Mode::TriangleFan).is_empty());
    }
}
