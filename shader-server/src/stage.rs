//! A scene made ready for shading, in the state that edits have brought it to.

use std::sync::Arc;

use glam::{Affine3A, DAffine3, DMat3, DVec3, Mat3A, Vec3};
use protocol::{
    messages::{LightMove, ObjectMove},
    scene::{Affine, Light, Material, Mesh, Model, Scene, Shading},
};
use rayon::prelude::*;
use rays::{TriangleMesh, World};
use textures::Map;

use crate::{
    irradiance::{IrradianceCache, Moved, Patience},
    lights::{Emitter, Receiver},
    mapped::{Beam, FacePoint},
};

/// A message refers to something that the scene does not have, or changes what it may not.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StageError {
    /// An index past its table.
    #[error("{what} {index} does not exist: the scene has {count}")]
    Index {
        /// What the index is of.
        what: &'static str,
        /// The index.
        index: u32,
        /// Length of the table.
        count: usize,
    },
    /// A light would become one of another kind.
    #[error("light {light} cannot change its kind; send the scene anew")]
    LightKind {
        /// The light.
        light: u32,
    },
}

/// Where an object is.
#[derive(Clone, Debug)]
struct Placement {
    mesh: u32,
    material: u32,
    to_world: DAffine3,
    /// Inverse transpose of the linear part.
    normal_to_world: DMat3,
    /// Rounding of positions, relative to their size, in ulp.
    rounding: f64,
}

/// A scene ready for rays: objects are instances 0.. of [`Stage::world`], area lights follow.
#[derive(Clone)]
pub struct Stage {
    scene: Arc<Scene>,
    /// The scene's textures, decoded.
    maps: Arc<[Map]>,
    placements: Vec<Placement>,
    lights: Vec<Light>,
    emitters: Vec<Emitter>,
    /// Which light each instance after the objects' is.
    light_of_instance: Vec<u32>,
    world: World,
    /// For scenes that ask for interreflection alone.
    irradiance: Option<Arc<IrradianceCache>>,
}

impl Stage {
    /// Builds the trees, in parallel on the current rayon pool.
    ///
    /// # Errors
    /// [`StageError::Index`] where an object names a mesh or a material that is not there.
    pub fn build(scene: Arc<Scene>) -> Result<Self, StageError> {
        let Scene {
            lights,
            materials,
            meshes,
            objects,
            ..
        } = &*scene;
        for object in objects {
            check_index("mesh", object.mesh, meshes.len())?;
            check_index("material", object.material, materials.len())?;
        }
        let trees: Vec<Arc<TriangleMesh>> = meshes
            .par_iter()
            .map(|mesh| {
                let positions: Vec<Vec3> = mesh.positions.iter().map(|p| Vec3::from(*p)).collect();
                Arc::new(TriangleMesh::build(&positions, &mesh.faces))
            })
            .collect();

        let mut instances: Vec<(Arc<TriangleMesh>, Affine3A)> = objects
            .iter()
            .map(|object| {
                (
                    Arc::clone(&trees[object.mesh as usize]),
                    affine(&object.transform),
                )
            })
            .collect();
        let placements = objects
            .iter()
            .map(|object| Placement::new(object.mesh, object.material, &object.transform))
            .collect();
        let mut emitters = Vec::with_capacity(lights.len());
        let mut light_of_instance = Vec::new();
        for (index, light) in lights.iter().enumerate() {
            emitters.push(Emitter::new(light, instances.len() as u32));
            if let Some(mesh) = light_mesh(light) {
                instances.push((mesh, Affine3A::IDENTITY));
                light_of_instance.push(index as u32);
            }
        }
        let (lights, world) = (lights.clone(), World::new(instances));
        let irradiance = (scene.shading.model == Model::Global)
            .then(|| Arc::new(IrradianceCache::new(diagonal_m(&world), Patience::Final)));
        let maps = scene.textures.par_iter().map(Map::new).collect();
        Ok(Self {
            irradiance,
            scene,
            maps,
            placements,
            lights,
            emitters,
            light_of_instance,
            world,
        })
    }

    /// The same scene after an edit.
    ///
    /// # Errors
    /// Where the edit names an object or a light that is not there, or changes a light's kind.
    pub fn edited(&self, objects: &[ObjectMove], lights: &[LightMove]) -> Result<Self, StageError> {
        let mut stage = self.clone();
        let mut moved = Moved::default();
        for change in objects {
            check_index("object", change.object, stage.placements.len())?;
            let before = stage.world.instance_bounds(change.object);
            let slot = &mut stage.placements[change.object as usize];
            *slot = Placement::new(slot.mesh, slot.material, &change.transform);
            stage
                .world
                .set_transform(change.object, affine(&change.transform));
            let after = stage.world.instance_bounds(change.object);
            moved.instances.push((change.object, before, after));
        }
        for change in lights {
            check_index("light", change.light, stage.lights.len())?;
            stage.change_light(change)?;
        }
        stage.world.refit();
        moved.lights = !lights.is_empty();
        if let Some(cache) = &self.irradiance {
            let next = cache.after([self, &stage], &moved, diagonal_m(&stage.world));
            stage.irradiance = Some(Arc::new(next));
        }
        Ok(stage)
    }

    /// The same scene, with a cache that has or has not the patience to answer for good. Nothing is in it.
    #[must_use]
    pub fn with_patience(mut self, patience: Patience) -> Self {
        if self.irradiance.is_some() {
            let cache = IrradianceCache::new(diagonal_m(&self.world), patience);
            self.irradiance = Some(Arc::new(cache));
        }
        self
    }

    /// Whether indirect light is waited for, in scenes that ask for it.
    #[must_use]
    pub fn patience(&self) -> Option<Patience> {
        self.irradiance.as_ref().map(|cache| cache.patience())
    }

    /// Indirect irradiance, in scenes that ask for it.
    #[must_use]
    pub fn irradiance(&self) -> Option<&IrradianceCache> {
        self.irradiance.as_deref()
    }

    fn change_light(&mut self, change: &LightMove) -> Result<(), StageError> {
        let slot = &mut self.lights[change.light as usize];
        if std::mem::discriminant(slot) != std::mem::discriminant(&change.value) {
            return Err(StageError::LightKind {
                light: change.light,
            });
        }
        *slot = change.value.clone();
        let place = self
            .light_of_instance
            .iter()
            .position(|light| *light == change.light);
        let instance = (self.placements.len() + place.unwrap_or(0)) as u32;
        self.emitters[change.light as usize] = Emitter::new(&change.value, instance);
        if let Some(mesh) = light_mesh(&change.value) {
            self.world.set_instance(instance, mesh, Affine3A::IDENTITY);
        }
        Ok(())
    }

    /// The scene as it was sent, before edits.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// What rays are traced against.
    #[must_use]
    pub fn world(&self) -> &World {
        &self.world
    }

    /// The lights, in the scene's order.
    #[must_use]
    pub fn emitters(&self) -> &[Emitter] {
        &self.emitters
    }

    /// What holds for the whole scene.
    #[must_use]
    pub fn shading(&self) -> &Shading {
        &self.scene.shading
    }

    /// The objects' meshes, by index in the scene, and where they are: object space to world space.
    pub fn placements(&self) -> impl ExactSizeIterator<Item = (u32, Affine3A)> + '_ {
        let placements = self.placements.iter();
        placements.map(|at| (at.mesh, at.to_world.as_affine3a()))
    }

    /// The lights that block, in the order of their instances, which follow the objects'.
    pub fn blocking_lights(&self) -> impl Iterator<Item = &Light> + '_ {
        let lights = self.light_of_instance.iter();
        lights.map(|light| &self.lights[*light as usize])
    }

    /// The light that instance `instance` of the world is, if it is one.
    #[must_use]
    pub fn light_of(&self, instance: u32) -> Option<u32> {
        let after = (instance as usize).checked_sub(self.placements.len())?;
        self.light_of_instance.get(after).copied()
    }

    /// Faces of an object; nothing for lights.
    #[must_use]
    pub fn face_count(&self, instance: u32) -> Option<u32> {
        let placement = self.placements.get(instance as usize)?;
        let mesh = self.scene.meshes.get(placement.mesh as usize)?;
        Some(mesh.faces.len() as u32)
    }

    /// The corners of an object's face, world space; nothing for lights.
    #[must_use]
    pub fn triangle(&self, instance: u32, face: u32) -> Option<[DVec3; 3]> {
        let placement = self.placements.get(instance as usize)?;
        let mesh = self.scene.meshes.get(placement.mesh as usize)?;
        let [i, j, k] = *mesh.faces.get(face as usize)?;
        let corner = |i: u32| {
            let position = Vec3::from(*mesh.positions.get(i as usize)?);
            Some(placement.to_world.transform_point3(position.as_dvec3()))
        };
        Some([corner(i)?, corner(j)?, corner(k)?])
    }

    /// The surface at a hit of the world that is not a light's.
    #[must_use]
    pub fn surface(&self, hit: &rays::Hit) -> Option<Surface> {
        self.surface_in(hit, None)
    }

    /// The same with maps averaged over what a beam covers, instead of read at a point.
    #[must_use]
    pub fn surface_in(&self, hit: &rays::Hit, beam: Option<&Beam>) -> Option<Surface> {
        let placement = self.placements.get(hit.instance as usize)?;
        let mesh = self.scene.meshes.get(placement.mesh as usize)?;
        let face = hit.face as usize;
        let corner = |i: u32| Some(Vec3::from(*mesh.positions.get(i as usize)?).as_dvec3());
        let [i, j, k] = *mesh.faces.get(face)?;
        let [a, b, c] = [corner(i)?, corner(j)?, corner(k)?];
        let [v, w] = hit.barycentric.map(f64::from);
        let weights = [1. - v - w, v, w];
        let position = a * weights[0] + b * weights[1] + c * weights[2];

        let flat = (b - a).cross(c - a).normalize_or_zero();
        let smooth = mesh
            .face_normals
            .get(face)
            .and_then(|corners| interpolated_normal(mesh, corners, weights))
            .unwrap_or(flat);
        let index = mesh.face_materials.get(face).copied();
        let material = index.unwrap_or(placement.material) as usize;
        let material = self.scene.materials.get(material);
        let to_world = |n: DVec3| (placement.normal_to_world * n).normalize_or_zero();
        let extent = [a, b, c]
            .map(|p| {
                p.abs()
                    .max_element()
                    .max(placement.to_world.transform_point3(p).abs().max_element())
            })
            .into_iter()
            .fold(0., f64::max);
        let place = FacePoint {
            to_world: &placement.to_world,
            mesh,
            face,
            corners: [a, b, c],
            weights,
        };
        let (diffuse, textured) =
            material.map_or((Vec3::ZERO, false), |m| self.diffuse(&place, m, beam));
        Some(Surface {
            position: placement.to_world.transform_point3(position),
            normal: to_world(smooth),
            face_normal: to_world(flat).as_vec3(),
            clearance: (extent * placement.rounding * f64::from(f32::EPSILON)) as f32,
            diffuse,
            textured,
            specular: material
                .filter(|_| self.scene.shading.model != Model::Direct)
                .map_or(Vec3::ZERO, |m| Vec3::from(m.specular)),
            roughness: material.map_or(1., |m| m.roughness),
        })
    }

    /// Diffuse reflectance of a point of a face, and whether a map has a part in it.
    fn diffuse(
        &self,
        at: &FacePoint<'_>,
        material: &Material,
        beam: Option<&Beam>,
    ) -> (Vec3, bool) {
        let base = Vec3::from(material.diffuse);
        let map = material.diffuse_map.and_then(|m| self.maps.get(m as usize));
        match map.and_then(|map| at.colour(map, beam)) {
            Some(colour) => (base * colour, true),
            None => (base, false),
        }
    }
}

/// A point of a surface as a ray met it.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// World space, metres; in the plane of the face to double precision.
    pub position: DVec3,
    /// Unit shading normal, on either side.
    pub normal: DVec3,
    /// Unit normal of the face.
    pub face_normal: Vec3,
    /// How far along the face normal a ray in single precision must start to be clear of the face, metres.
    pub clearance: f32,
    /// Diffuse reflectance, linear.
    pub diffuse: Vec3,
    /// A map has a part in the diffuse reflectance.
    pub textured: bool,
    /// Specular reflectance at normal incidence; zero in scenes that ask for direct light alone.
    pub specular: Vec3,
    /// GGX alpha.
    pub roughness: f32,
}

impl Surface {
    /// Share of light reflected in all, as where it is not worth telling how: what the specular part lets through at normal
    /// incidence is reflected diffusely.
    #[must_use]
    pub fn albedo(&self) -> Vec3 {
        self.specular + self.diffuse * (Vec3::ONE - self.specular)
    }

    /// The surface as one sees it who looks along `direction`: the shading normal is turned to that side.
    #[must_use]
    pub fn seen_along(&self, direction: DVec3, instance: u32, face: u32) -> Receiver {
        let faces_viewer = self.normal.dot(direction) <= 0.;
        Receiver {
            position: self.position,
            normal: if faces_viewer {
                self.normal
            } else {
                -self.normal
            },
            face_normal: self.face_normal,
            clearance: self.clearance,
            instance,
            face,
        }
    }
}

/// Length of the diagonal of all that can be met.
fn diagonal_m(world: &World) -> f64 {
    let bounds = world.bounds();
    if bounds.is_empty() {
        0.
    } else {
        (bounds.max.as_dvec3() - bounds.min.as_dvec3()).length()
    }
}

impl Placement {
    fn new(mesh: u32, material: u32, transform: &Affine) -> Self {
        let at = affine(transform);
        let linear = DMat3::from_cols(
            at.matrix3.x_axis.as_dvec3(),
            at.matrix3.y_axis.as_dvec3(),
            at.matrix3.z_axis.as_dvec3(),
        );
        let norm = |m: &DMat3| (m.x_axis.abs() + m.y_axis.abs() + m.z_axis.abs()).max_element();
        let inverse = linear.inverse();
        // Half an ulp for each of the point's rounding, its trip to object space (a few products, enlarged by the
        // transform's condition) and the triangle test's differences; doubled.
        let rounding = if at == Affine3A::IDENTITY {
            4.
        } else {
            4. + 4. * norm(&linear) * norm(&inverse)
        };
        Self {
            mesh,
            material,
            to_world: DAffine3 {
                matrix3: linear,
                translation: at.translation.as_dvec3(),
            },
            normal_to_world: inverse.transpose(),
            rounding: if rounding.is_finite() { rounding } else { 4. },
        }
    }
}

fn check_index(what: &'static str, index: u32, count: usize) -> Result<(), StageError> {
    if (index as usize) < count {
        Ok(())
    } else {
        Err(StageError::Index { what, index, count })
    }
}

fn interpolated_normal(mesh: &Mesh, corners: &[u32; 3], weights: [f64; 3]) -> Option<DVec3> {
    let mut sum = DVec3::ZERO;
    for (corner, weight) in corners.iter().zip(weights) {
        sum += Vec3::from(*mesh.normals.get(*corner as usize)?).as_dvec3() * weight;
    }
    sum.try_normalize()
}

fn affine(rows: &Affine) -> Affine3A {
    let column = |i: usize| Vec3::new(rows[0][i], rows[1][i], rows[2][i]);
    Affine3A {
        matrix3: Mat3A::from_cols(column(0).into(), column(1).into(), column(2).into()),
        translation: column(3).into(),
    }
}

/// The polygon of an area light as a fan; none for other lights.
fn light_mesh(light: &Light) -> Option<Arc<TriangleMesh>> {
    let Light::Area { vertices, .. } = light else {
        return None;
    };
    let positions: Vec<Vec3> = vertices.iter().map(|v| Vec3::from(*v)).collect();
    let faces: Vec<[u32; 3]> = (2..vertices.len() as u32).map(|i| [0, i - 1, i]).collect();
    Some(Arc::new(TriangleMesh::build(&positions, &faces)))
}
