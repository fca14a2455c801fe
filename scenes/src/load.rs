//! From a file to a scene.

use std::path::Path;

use glam::{DMat3, DVec3};
use protocol::messages::ShadowMethod;
use protocol::scene::{Light, Model, Scene, Shading};

use crate::assemble::Assembler;
use crate::error::{ErrorKind, SceneError};
use crate::format::{CameraTable, ModelName, SceneFile, ShadowsName};
use crate::lights::{color, finite, light};
use crate::loaders;
use crate::motion::Motion;
use crate::path::{CameraPath, PathKey};
use crate::paths::{Paths, Subjects};
use crate::report::LoadReport;

/// Where the camera starts. The picture's size is no part of a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraSpec {
    /// World position of the pinhole, metres.
    pub eye: [f32; 3],
    /// World point in the middle of the picture, metres.
    pub target: [f32; 3],
    /// World direction that is up in the picture.
    pub up: [f32; 3],
    /// Vertical field of view, degrees, in (0, 180).
    pub fov_y: f32,
}

/// A scene with all that it was loaded with.
#[derive(Debug, Clone, PartialEq)]
pub struct LoadedScene {
    /// What shader servers are sent.
    pub scene: Scene,
    /// How the visibility of each light is wanted to be found, by index; those past the end: as seems best.
    pub shadows: Vec<ShadowMethod>,
    /// Where the camera starts.
    pub camera: CameraSpec,
    /// Ways of the camera through the scene, in file order.
    pub paths: Vec<CameraPath>,
    /// Paths of objects and lights, in file order.
    pub motions: Vec<Motion>,
    /// What was odd about the geometry.
    pub report: LoadReport,
}

impl LoadedScene {
    /// The path of that name.
    pub fn path(&self, name: &str) -> Option<&CameraPath> {
        self.paths.iter().find(|p| p.name == name)
    }
}

/// Loads a scene file (`.toml`), or a mesh file (`.obj`, `.ply`, `.stl`, `.gltf`, `.glb`) as a scene: framed by its
/// bounds and lit by one area light above, unless the file brings cameras and point lights of its own. The same files give the same scene to the bit.
///
/// # Errors
/// Whatever keeps the scene from being drawn as written, with file and line.
pub fn load(path: &Path) -> Result<LoadedScene, SceneError> {
    if loaders::is_mesh(path) {
        return load_mesh(path);
    }
    let bytes = loaders::read_bytes(path)?;
    match path
        .extension()
        .map(|e| e.to_string_lossy().to_ascii_lowercase())
    {
        Some(e) if e == "toml" => {}
        other => {
            let name = other.unwrap_or_default();
            return Err(SceneError::new(path, ErrorKind::UnknownFormat(name)));
        }
    }
    let text = String::from_utf8(bytes)
        .map_err(|_| SceneError::new(path, ErrorKind::Syntax("it is not UTF-8 text".into())))?;
    load_text(&text, path)
}

/// Loads a scene from the text of a scene file; `file` is named in errors, and meshes are looked for beside it.
pub(crate) fn load_text(text: &str, file: &Path) -> Result<LoadedScene, SceneError> {
    let table: SceneFile = toml::from_str(text).map_err(|e| {
        let kind = ErrorKind::Syntax(e.message().to_string());
        match e.span() {
            Some(span) => SceneError::at(file, line_of(text, span.start), kind),
            None => SceneError::new(file, kind),
        }
    })?;
    let at = |offset: usize| move |kind| SceneError::at(file, line_of(text, offset), kind);
    let mut assembler = Assembler::new(file, text);
    for (name, material) in &table.material {
        assembler.add_material(name, material)?;
    }
    for object in &table.object {
        assembler.add_object(object)?;
    }
    let (objects, report) = assembler.finish();
    let mut lights = Vec::new();
    for l in &table.light {
        lights.push(light(l.get_ref()).map_err(at(l.span().start))?);
    }
    let shade = |key: &str, value: &Option<toml::Spanned<[f32; 3]>>| match value {
        Some(v) => color(key, *v.get_ref()).map_err(at(v.span().start)),
        None => Ok([0.0; 3]),
    };
    let shading = Shading {
        model: match table.shading.model {
            ModelName::Direct => Model::Direct,
            ModelName::Glossy => Model::Glossy,
            ModelName::Global => Model::Global,
        },
        ambient: shade("shading.ambient", &table.shading.ambient)?,
        background: shade("shading.background", &table.shading.background)?,
    };
    let scene = Scene {
        shading,
        lights,
        ..objects
    };
    let camera = match &table.camera {
        Some(c) => camera(c.get_ref()).map_err(at(c.span().start))?,
        None => frame(&scene),
    };
    let names = table.light.iter().map(|l| l.get_ref().name.as_deref());
    let subjects = Subjects::new(&scene, names.collect());
    let mut paths = Paths::default();
    for p in &table.path {
        paths
            .add(p.get_ref(), &subjects)
            .map_err(at(p.span().start))?;
    }
    let Paths { cameras, motions } = paths;
    let shadows = table.light.iter().map(|l| match l.get_ref().shadows {
        ShadowsName::Auto => ShadowMethod::Auto,
        ShadowsName::Rays => ShadowMethod::Rays,
        ShadowsName::Penumbra => ShadowMethod::Penumbra,
        ShadowsName::SoftMap => ShadowMethod::SoftMap,
    });
    Ok(LoadedScene {
        scene,
        shadows: shadows.collect(),
        camera,
        paths: cameras,
        motions,
        report,
    })
}

fn load_mesh(path: &Path) -> Result<LoadedScene, SceneError> {
    let mut assembler = Assembler::new(path, "");
    let setting = assembler.add_mesh_file(path)?;
    let (mut scene, report) = assembler.finish();
    let camera = match setting.cameras.first() {
        Some(camera) => *camera,
        None => frame(&scene),
    };
    if setting.has_metal {
        scene.shading.model = Model::Glossy;
    }
    scene.shading.ambient = [0.06; 3];
    scene.shading.background = [0.03, 0.035, 0.04];
    scene.lights = setting.lights;
    if scene.lights.is_empty() {
        scene.lights.push(light_above(&scene));
    }
    Ok(LoadedScene {
        scene,
        shadows: Vec::new(),
        camera,
        paths: Vec::from_iter(through(&setting.cameras)),
        motions: Vec::new(),
        report,
    })
}

/// A path that holds each of a file's cameras for two seconds, if there is more than one.
fn through(cameras: &[CameraSpec]) -> Option<CameraPath> {
    (cameras.len() > 1).then(|| CameraPath {
        name: "cameras".into(),
        seconds: 2.0 * cameras.len() as f32,
        open: true,
        step: true,
        keys: cameras
            .iter()
            .map(|c| PathKey {
                eye: c.eye,
                target: c.target,
            })
            .collect(),
    })
}

/// The line, counted from 1, that holds byte `offset`.
pub(crate) fn line_of(text: &str, offset: usize) -> usize {
    let before = text.as_bytes().iter().take(offset);
    1 + before.filter(|b| **b == b'\n').count()
}

fn camera(table: &CameraTable) -> Result<CameraSpec, ErrorKind> {
    let spec = CameraSpec {
        eye: finite("camera.eye", table.eye)?,
        target: finite("camera.target", table.target)?,
        up: finite("camera.up", table.up)?,
        fov_y: table.fov_y,
    };
    if !(spec.fov_y > 0.0 && spec.fov_y < 180.0) {
        let problem = format!("{} is no angle of view", spec.fov_y);
        return Err(ErrorKind::value(
            "camera.fov_y",
            problem,
            "write degrees between 0 and 180",
        ));
    }
    check_view("camera", spec.eye, spec.target, spec.up)?;
    Ok(spec)
}

fn check_view(key: &str, eye: [f32; 3], target: [f32; 3], up: [f32; 3]) -> Result<(), ErrorKind> {
    let [eye, target, up] = [eye, target, up].map(|v| DVec3::from_array(v.map(f64::from)));
    let ahead = target - eye;
    if ahead.length() == 0.0 {
        return Err(ErrorKind::value(
            format!("{key}.target"),
            "is where the eye is",
            "move one of them",
        ));
    }
    if ahead.normalize().cross(up.normalize_or_zero()).length() < 1e-6 {
        let problem = "is along the line of sight or zero";
        return Err(ErrorKind::value(
            format!("{key}.up"),
            problem,
            "turn it away from it",
        ));
    }
    Ok(())
}

/// World bounds of all objects, lowest and highest corner; a unit cube if there is nothing.
fn bounds(scene: &Scene) -> (DVec3, DVec3) {
    let mut low = DVec3::INFINITY;
    let mut high = DVec3::NEG_INFINITY;
    for object in &scene.objects {
        let mesh = &scene.meshes[object.mesh as usize];
        let m = object.transform.map(|row| row.map(f64::from));
        let linear = DMat3::from_cols_array_2d(&[0, 1, 2].map(|c| [m[0][c], m[1][c], m[2][c]]));
        let offset = DVec3::new(m[0][3], m[1][3], m[2][3]);
        for &v in mesh.faces.iter().flatten() {
            let p = DVec3::from_array(mesh.positions[v as usize].map(f64::from));
            let p = linear * p + offset;
            low = low.min(p);
            high = high.max(p);
        }
    }
    if low.is_finite() && high.is_finite() {
        (low, high)
    } else {
        (DVec3::splat(-0.5), DVec3::splat(0.5))
    }
}

const FRAME_FOV_Y: f64 = 40.0;

/// A camera in front, a little to the right and above, from which the bounding sphere fills the picture's height.
fn frame(scene: &Scene) -> CameraSpec {
    let (low, high) = bounds(scene);
    let radius = (0.5 * (high - low).length()).max(1e-6);
    let middle = 0.5 * (low + high);
    let away = DVec3::new(0.45, 0.4, 1.0).normalize();
    let distance = 0.92 * radius / (FRAME_FOV_Y / 2.0).to_radians().sin();
    CameraSpec {
        eye: (middle + away * distance).as_vec3().to_array(),
        target: middle.as_vec3().to_array(),
        up: [0.0, 1.0, 0.0],
        fov_y: FRAME_FOV_Y as f32,
    }
}

/// A square light above, to the camera's left, facing the middle; it lights a grey surface to about 0.6.
fn light_above(scene: &Scene) -> Light {
    let (low, high) = bounds(scene);
    let radius = (0.5 * (high - low).length()).max(1e-6);
    let middle = 0.5 * (low + high);
    let towards = DVec3::new(-0.7, 1.6, 0.9).normalize();
    let distance = 3.0 * radius;
    let side = DVec3::Y.cross(towards).normalize();
    let up = towards.cross(side);
    let half = 0.3 * radius;
    let centre = middle + towards * distance;
    // The normal side × up is towards; the light must face the other way.
    let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)];
    let irradiance = 3.0;
    let radiance = irradiance * distance * distance / (4.0 * half * half);
    Light::Area {
        vertices: corners
            .map(|(u, v)| {
                (centre + side * (u * half) + up * (v * half))
                    .as_vec3()
                    .to_array()
            })
            .to_vec(),
        radiance: [radiance as f32; 3],
    }
}
