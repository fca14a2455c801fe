//! Writes a scene as other renderers read it: a binary PLY for each object, in world space, split by material, and
//! `scene.json` with camera, lights and materials: `cargo run --release -p scenes --example export -- SCENE FOLDER`

use std::collections::BTreeMap;
use std::error::Error;
use std::fs;
use std::path::Path;
use std::process::ExitCode;

use glam::{Mat3, Vec3};
use protocol::scene::{Light, Mesh, Object, Scene};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, folder] = arguments.as_slice() else {
        eprintln!("usage: export SCENE FOLDER");
        return ExitCode::from(2);
    };
    match export(scene, Path::new(folder)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("{e}");
            ExitCode::from(2)
        }
    }
}

fn export(name: &str, folder: &Path) -> Result<(), Box<dyn Error>> {
    let loaded = scenes::open(name)?;
    let scene = &loaded.scene;
    fs::create_dir_all(folder)?;
    let mut shapes = Vec::new();
    for (i, object) in scene.objects.iter().enumerate() {
        let mesh = &scene.meshes[object.mesh as usize];
        for (material, faces) in by_material(object, mesh) {
            let file = format!("{i}-{material}.ply");
            fs::write(folder.join(&file), ply(object, mesh, &faces))?;
            shapes.push(format!(
                "{{\"file\": \"{file}\", \"material\": {material}}}"
            ));
        }
    }
    for (i, texture) in scene.textures.iter().enumerate() {
        let bytes = texture.rgb.concat();
        let picture = image::RgbImage::from_raw(texture.width, texture.height, bytes)
            .ok_or("a texture's size is not its bytes'")?;
        picture.save(folder.join(format!("texture-{i}.png")))?;
    }
    let c = loaded.camera;
    let json = format!(
        "{{\n\"camera\": {{\"eye\": {:?}, \"target\": {:?}, \"up\": {:?}, \"fov_y\": {:?}}},\n\"ambient\": {:?},\n\
         \"background\": {:?},\n\"model\": \"{:?}\",\n\"lights\": [{}],\n\"materials\": [{}],\n\"shapes\": [{}]\n}}\n",
        c.eye,
        c.target,
        c.up,
        c.fov_y,
        scene.shading.ambient,
        scene.shading.background,
        scene.shading.model,
        join(&scene.lights, light),
        materials(scene),
        shapes.join(",\n")
    );
    fs::write(folder.join("scene.json"), json)?;
    Ok(())
}

fn join<T>(items: &[T], text: impl Fn(&T) -> String) -> String {
    items.iter().map(text).collect::<Vec<_>>().join(",\n")
}

fn light(light: &Light) -> String {
    match light {
        Light::Point {
            position,
            intensity,
        } => format!(
            "{{\"kind\": \"point\", \"position\": {position:?}, \"intensity\": {intensity:?}}}"
        ),
        Light::Linear {
            from,
            to,
            intensity,
        } => format!(
            "{{\"kind\": \"linear\", \"from\": {from:?}, \"to\": {to:?}, \"intensity\": {intensity:?}}}"
        ),
        Light::Area { vertices, radiance } => format!(
            "{{\"kind\": \"area\", \"vertices\": {vertices:?}, \"radiance\": {radiance:?}}}"
        ),
    }
}

fn materials(scene: &Scene) -> String {
    join(&scene.materials, |m| {
        let map = m
            .diffuse_map
            .map_or("null".into(), |t| format!("\"texture-{t}.png\""));
        format!(
            "{{\"diffuse\": {:?}, \"map\": {map}, \"specular\": {:?}, \"roughness\": {:?}}}",
            m.diffuse, m.specular, m.roughness
        )
    })
}

/// Numbers of an object's faces by the material that they wear.
fn by_material(object: &Object, mesh: &Mesh) -> BTreeMap<u32, Vec<usize>> {
    let mut faces: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for f in 0..mesh.faces.len() {
        let material = mesh.face_materials.get(f).copied();
        faces
            .entry(material.unwrap_or(object.material))
            .or_default()
            .push(f);
    }
    faces
}

/// Each corner a vertex of its own, so that normals and texture coordinates can differ.
fn ply(object: &Object, mesh: &Mesh, faces: &[usize]) -> Vec<u8> {
    let rows = object.transform;
    let linear = Mat3::from_cols_array_2d(&[0, 1, 2].map(|c| [rows[0][c], rows[1][c], rows[2][c]]));
    let offset = Vec3::from_array(rows.map(|r| r[3]));
    let turned = linear.inverse().transpose();
    let count = faces.len();
    let mut out = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         property float nx\nproperty float ny\nproperty float nz\nproperty float u\nproperty float v\n\
         element face {count}\nproperty list uchar int vertex_indices\nend_header\n",
        3 * count
    )
    .into_bytes();
    for &f in faces {
        let p =
            mesh.faces[f].map(|v| linear * Vec3::from_array(mesh.positions[v as usize]) + offset);
        let flat = (p[1] - p[0]).cross(p[2] - p[0]).normalize_or(Vec3::Y);
        for k in 0..3 {
            let n = mesh.face_normals.get(f).map_or(flat, |n| {
                (turned * Vec3::from_array(mesh.normals[n[k] as usize])).normalize_or(flat)
            });
            let uv = mesh
                .face_uvs
                .get(f)
                .map_or([0.0; 2], |t| mesh.uvs[t[k] as usize]);
            for x in p[k].to_array().into_iter().chain(n.to_array()).chain(uv) {
                out.extend(x.to_le_bytes());
            }
        }
    }
    for f in 0..count as u32 {
        out.push(3);
        for k in 0..3 {
            out.extend((3 * f + k).to_le_bytes());
        }
    }
    out
}
