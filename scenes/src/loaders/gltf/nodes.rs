//! The node tree: where meshes, cameras and lights are.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use glam::{DMat4, DVec3};
use gltf::json::extensions::scene::khr_lights_punctual::{Light as Punctual, Type};
use gltf::json::validation::Checked;
use gltf::{Document, Node};
use protocol::scene::{Affine, Light};

use super::malformed;
use crate::error::SceneError;
use crate::load::CameraSpec;
use crate::loaders::{PartCopy, Setting};
use crate::report::LoadReport;

/// Lumens of a watt, which defines the candela (at 555 nm). Writers that start from watts, Blender's by default, multiply
/// by the same number.
const LUMENS_PER_WATT: f32 = 683.0;

/// What the nodes of a scene place.
pub(super) struct Placed {
    /// Copies of each mesh, in the order of the tree.
    pub(super) meshes: BTreeMap<usize, Vec<PartCopy>>,
    pub(super) setting: Setting,
}

/// Walks the file's scene: its own choice, else its first, else all nodes.
pub(super) fn walk(
    document: &Document,
    path: &Path,
    report: &mut LoadReport,
) -> Result<Placed, SceneError> {
    let mut placed = Placed {
        meshes: BTreeMap::new(),
        setting: Setting::default(),
    };
    let mut notes = Vec::new();
    let mut seen = BTreeSet::new();
    let mut waiting: Vec<(Node<'_>, DMat4)> = roots(document)
        .into_iter()
        .rev()
        .map(|n| (n, DMat4::IDENTITY))
        .collect();
    while let Some((node, outer)) = waiting.pop() {
        if !seen.insert(node.index()) {
            let what = format!("node {} is below two nodes, or below itself", node.index());
            return Err(malformed(path, what));
        }
        let own = DMat4::from_cols_array_2d(&node.transform().matrix().map(|c| c.map(f64::from)));
        let world = outer * own;
        placed.node(&node, &world, document, &mut notes);
        let first = waiting.len();
        waiting.extend(node.children().map(|child| (child, world)));
        waiting[first..].reverse();
    }
    let file = path.display();
    report
        .notes
        .extend(notes.into_iter().map(|n| format!("{file}: {n}")));
    Ok(placed)
}

fn roots(document: &Document) -> Vec<Node<'_>> {
    let scene = document.default_scene().or(document.scenes().next());
    match scene {
        Some(scene) => scene.nodes().collect(),
        None => {
            let below: BTreeSet<usize> = document
                .nodes()
                .flat_map(|n| n.children().map(|c| c.index()))
                .collect();
            document
                .nodes()
                .filter(|n| !below.contains(&n.index()))
                .collect()
        }
    }
}

impl Placed {
    fn node(
        &mut self,
        node: &Node<'_>,
        world: &DMat4,
        document: &Document,
        notes: &mut Vec<String>,
    ) {
        let name = match node.name() {
            Some(name) if !name.is_empty() => name.to_string(),
            _ => format!("node {}", node.index()),
        };
        if let Some(mesh) = node.mesh() {
            match affine(world) {
                Some(transform) => {
                    let copy = PartCopy {
                        name: Some(name.clone()),
                        transform,
                    };
                    self.meshes.entry(mesh.index()).or_default().push(copy);
                }
                None => notes.push(format!("node {name:?} is scaled to nothing and left out")),
            }
            if node.skin().is_some() {
                notes.push(format!(
                    "node {name:?} has a skin; it is shown in its bind pose"
                ));
            }
        }
        if let Some(camera) = node.camera() {
            match camera_spec(&camera, document, world) {
                Some(spec) => self.setting.cameras.push(spec),
                None => notes.push(format!(
                    "camera {name:?} is not one of perspective and is left out"
                )),
            }
        }
        if let Some(punctual) = light_of(node, document) {
            match light(punctual, world) {
                Some(light) => self.setting.lights.push(light),
                None => notes.push(format!("light {name:?} is no point light and is left out")),
            }
        }
    }
}

/// `None` for what cannot be inverted.
fn affine(world: &DMat4) -> Option<Affine> {
    let rows: Affine = std::array::from_fn(|r| {
        // Adding zero turns -0 into 0, so that equal scenes have equal bytes.
        std::array::from_fn(|c| world.col(c)[r] as f32 + 0.0)
    });
    let finite = rows.iter().flatten().all(|x| x.is_finite());
    let axes = [0, 1, 2].map(|c| world.col(c).truncate());
    let volume = axes[0].cross(axes[1]).dot(axes[2]).abs();
    let size: f64 = axes.iter().map(|a| a.length()).product();
    (finite && volume > 1e-9 * size && size > 0.0).then_some(rows)
}

/// Read from the file's own words: the crate panics on a camera without the table that its type needs.
fn camera_spec(
    camera: &gltf::Camera<'_>,
    document: &Document,
    world: &DMat4,
) -> Option<CameraSpec> {
    let words = &document.as_json().cameras[camera.index()];
    let fov_y = words.perspective.as_ref()?.yfov.to_degrees();
    let eye = world.w_axis.truncate();
    let ahead = -world.z_axis.truncate().normalize_or_zero();
    let up = world.y_axis.truncate().normalize_or_zero();
    let sane = eye.is_finite() && ahead.cross(up).length() > 1e-6;
    (sane && fov_y > 0.0 && fov_y < 180.0).then(|| CameraSpec {
        eye: single(eye),
        target: single(eye + ahead),
        up: single(up),
        fov_y,
    })
}

/// Read from the file's own words: the crate panics on a light that is not in the file's table, and on a spot without
/// angles.
fn light_of<'a>(node: &Node<'_>, document: &'a Document) -> Option<&'a Punctual> {
    let root = document.as_json();
    let table = root.extensions.as_ref()?.khr_lights_punctual.as_ref()?;
    let words = root.nodes[node.index()].extensions.as_ref()?;
    let index = words.khr_lights_punctual.as_ref()?.light.value();
    table.lights.get(index)
}

fn light(punctual: &Punctual, world: &DMat4) -> Option<Light> {
    if !matches!(punctual.type_, Checked::Valid(Type::Point)) {
        return None;
    }
    let position = single(world.w_axis.truncate());
    let intensity = punctual
        .color
        .map(|c| c * punctual.intensity / LUMENS_PER_WATT);
    let sane = position.iter().all(|x| x.is_finite())
        && intensity.iter().all(|x| x.is_finite() && *x >= 0.0);
    sane.then_some(Light::Point {
        position,
        intensity,
    })
}

fn single(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}
