//! Checks of scenes.

use std::collections::HashSet;

use super::geometry::{cross, dot, length, wide};
use super::{At, Checked, Problem, count, index, position, range, ranges, unit, whole};
use crate::limits::{
    MAX_INTENSITY, MAX_LIGHTS, MAX_MATERIALS, MAX_NAME, MAX_OBJECTS, MAX_RADIANCE, MAX_SIDE,
    MAX_TEXTURES, MIN_DETERMINANT, SCALE,
};
use crate::scene::{Affine, Light, Material, Mesh, Object, Scene, Texture};

/// Checks a whole scene: numbers finite and in bounds, every index inside its table, lights and transforms usable.
///
/// # Errors
/// The first value that is not allowed.
pub fn validate_scene(scene: &Scene) -> Checked {
    ranges(&scene.shading.ambient, 0.0, MAX_RADIANCE).at(|| "shading.ambient".into())?;
    ranges(&scene.shading.background, 0.0, MAX_RADIANCE).at(|| "shading.background".into())?;
    count(scene.lights.len(), 0, MAX_LIGHTS).at(|| "lights".into())?;
    count(scene.materials.len(), 0, MAX_MATERIALS).at(|| "materials".into())?;
    count(scene.textures.len(), 0, MAX_TEXTURES).at(|| "textures".into())?;
    count(scene.meshes.len(), 0, MAX_OBJECTS).at(|| "meshes".into())?;
    count(scene.objects.len(), 0, MAX_OBJECTS).at(|| "objects".into())?;
    for (i, light) in scene.lights.iter().enumerate() {
        validate_light(light).map_err(|e| e.inside(&format!("lights[{i}]")))?;
    }
    for (i, material) in scene.materials.iter().enumerate() {
        validate_material(material, scene.textures.len(), i)?;
    }
    for (i, texture) in scene.textures.iter().enumerate() {
        validate_texture(texture).at(|| format!("textures[{i}]"))?;
    }
    for (i, mesh) in scene.meshes.iter().enumerate() {
        validate_mesh(mesh, scene.materials.len())
            .map_err(|e| e.inside(&format!("meshes[{i}]")))?;
    }
    let mut names = HashSet::with_capacity(scene.objects.len());
    for (i, object) in scene.objects.iter().enumerate() {
        validate_object(object, scene, i)?;
        if !names.insert(object.name.as_str()) {
            return Err(Problem::Other("another object has this name"))
                .at(|| format!("objects[{i}].name"));
        }
    }
    Ok(())
}

/// Checks a light: numbers in bounds, a segment with length, a polygon planar and convex to within
/// [`crate::limits::POLYGON_TOLERANCE`].
///
/// # Errors
/// The first value that is not allowed.
pub fn validate_light(light: &Light) -> Checked {
    match light {
        Light::Point {
            position: place,
            intensity,
        } => {
            position(*place).at(|| "position".into())?;
            ranges(intensity, 0.0, MAX_INTENSITY).at(|| "intensity".into())
        }
        Light::Linear {
            from,
            to,
            intensity,
        } => {
            position(*from).at(|| "from".into())?;
            position(*to).at(|| "to".into())?;
            ranges(intensity, 0.0, MAX_INTENSITY).at(|| "intensity".into())?;
            if from == to {
                return Err(Problem::Other(
                    "is the other end, so that the light has no length",
                ))
                .at(|| "to".into());
            }
            Ok(())
        }
        Light::Area { vertices, radiance } => {
            for (i, &vertex) in vertices.iter().enumerate() {
                position(vertex).at(|| format!("vertices[{i}]"))?;
            }
            ranges(radiance, 0.0, MAX_RADIANCE).at(|| "radiance".into())?;
            super::geometry::convex_polygon(vertices).at(|| "vertices".into())
        }
    }
}

/// Checks that a transform is finite and can be inverted.
///
/// # Errors
/// What is wrong with it; the caller says where it stands.
pub fn validate_transform(transform: &Affine) -> Result<(), Problem> {
    let column = |c: usize| [transform[0][c], transform[1][c], transform[2][c]];
    position(column(3))?;
    let max = SCALE[1] as f32;
    for c in 0..3 {
        ranges(&column(c), -max, max)?;
    }
    let [x, y, z] = [0, 1, 2].map(|c| wide(column(c)));
    let lengths = [x, y, z].map(length);
    if let Some(&value) = lengths.iter().find(|l| !(SCALE[0]..=SCALE[1]).contains(*l)) {
        return Err(Problem::Range {
            value,
            min: SCALE[0],
            max: SCALE[1],
        });
    }
    let determinant = dot(cross(x, y), z);
    if determinant.abs() < MIN_DETERMINANT * lengths.iter().product::<f64>() {
        return Err(Problem::Other("cannot be inverted"));
    }
    Ok(())
}

fn validate_material(material: &Material, textures: usize, i: usize) -> Checked {
    let at = |field: &str| format!("materials[{i}].{field}");
    count(material.name.len(), 0, MAX_NAME).at(|| at("name"))?;
    ranges(&material.diffuse, 0.0, 1.0).at(|| at("diffuse"))?;
    ranges(&material.specular, 0.0, 1.0).at(|| at("specular"))?;
    range(material.roughness, f32::MIN_POSITIVE, 1.0).at(|| at("roughness"))?;
    material
        .diffuse_map
        .map_or(Ok(()), |map| index(map, textures))
        .at(|| at("diffuse_map"))
}

fn validate_texture(texture: &Texture) -> Result<(), Problem> {
    whole(texture.width, 1, MAX_SIDE)?;
    whole(texture.height, 1, MAX_SIDE)?;
    let pixels = texture.width as usize * texture.height as usize;
    count(texture.rgb.len(), pixels, pixels)
}

fn validate_mesh(mesh: &Mesh, materials: usize) -> Checked {
    let faces = mesh.faces.len();
    for (i, &point) in mesh.positions.iter().enumerate() {
        position(point).at(|| format!("positions[{i}]"))?;
    }
    for (i, &normal) in mesh.normals.iter().enumerate() {
        unit(normal).at(|| format!("normals[{i}]"))?;
    }
    for (i, uv) in mesh.uvs.iter().enumerate() {
        let max = crate::limits::MAX_COORDINATE;
        ranges(uv, -max, max).at(|| format!("uvs[{i}]"))?;
    }
    corners(&mesh.faces, faces, mesh.positions.len(), "faces")?;
    if !mesh.face_normals.is_empty() {
        corners(
            &mesh.face_normals,
            faces,
            mesh.normals.len(),
            "face_normals",
        )?;
    }
    if !mesh.face_uvs.is_empty() {
        corners(&mesh.face_uvs, faces, mesh.uvs.len(), "face_uvs")?;
    }
    if !mesh.face_materials.is_empty() {
        count(mesh.face_materials.len(), faces, faces).at(|| "face_materials".into())?;
        for (i, &material) in mesh.face_materials.iter().enumerate() {
            index(material, materials).at(|| format!("face_materials[{i}]"))?;
        }
    }
    Ok(())
}

fn corners(table: &[[u32; 3]], faces: usize, len: usize, name: &str) -> Checked {
    count(table.len(), faces, faces).at(|| name.into())?;
    for (i, face) in table.iter().enumerate() {
        for &corner in face {
            index(corner, len).at(|| format!("{name}[{i}]"))?;
        }
    }
    Ok(())
}

fn validate_object(object: &Object, scene: &Scene, i: usize) -> Checked {
    let at = |field: &str| format!("objects[{i}].{field}");
    count(object.name.len(), 0, MAX_NAME).at(|| at("name"))?;
    index(object.mesh, scene.meshes.len()).at(|| at("mesh"))?;
    index(object.material, scene.materials.len()).at(|| at("material"))?;
    range(object.crease_angle, 0.0, 180.0).at(|| at("crease_angle"))?;
    validate_transform(&object.transform).at(|| at("transform"))
}

#[cfg(test)]
#[path = "scene_tests.rs"]
mod tests;
