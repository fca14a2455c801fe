//! Visibility by penumbra casting: all receivers of a batch at once, against what is between them and the light.

use std::{cell::Cell, sync::Arc};

use glam::{Affine3A, Vec3};
use penumbra::{
    BlockerMesh, Caster, Instance, Light, LightError, Receivers, Route, Sampling, Seen,
    Shape as Source, Wanted,
};
use protocol::scene::{self, Mesh};
use rayon::prelude::*;

use super::{Asked, Shadows, Visibility};
use crate::{
    lights::{Emitter, Shape},
    stage::Stage,
};

/// Receivers of a batch: enough that the search for blockers is shared, and few enough that answers come soon.
const BATCH: usize = 4096;

/// What blocks, of all lights of a scene: its meshes, each made ready once.
#[derive(Clone)]
pub(super) struct Blockers(Arc<[Arc<BlockerMesh>]>);

impl Blockers {
    pub(super) fn new(stage: &Stage) -> Self {
        let meshes = stage.scene().meshes.par_iter();
        Self(meshes.map(|mesh| Arc::new(of_mesh(mesh))).collect())
    }

    /// In the order of the world's instances.
    fn instances(&self, stage: &Stage) -> Vec<Instance> {
        let objects = stage.placements().map(|(mesh, to_world)| Instance {
            mesh: Arc::clone(&self.0[mesh as usize]),
            to_world,
        });
        let lights = stage.blocking_lights().map(|light| Instance {
            mesh: Arc::new(of_light(light)),
            to_world: Affine3A::IDENTITY,
        });
        objects.chain(lights).collect()
    }
}

fn of_mesh(mesh: &Mesh) -> BlockerMesh {
    let positions: Vec<Vec3> = mesh.positions.iter().map(|p| Vec3::from(*p)).collect();
    BlockerMesh::new(&positions, &mesh.faces)
}

fn of_light(light: &scene::Light) -> BlockerMesh {
    let scene::Light::Area { vertices, .. } = light else {
        return BlockerMesh::default();
    };
    let positions: Vec<Vec3> = vertices.iter().map(|v| Vec3::from(*v)).collect();
    let faces: Vec<[u32; 3]> = (2..vertices.len() as u32).map(|i| [0, i - 1, i]).collect();
    BlockerMesh::new(&positions, &faces)
}

thread_local! {
    static SCRATCH: Cell<Option<Box<(Receivers, Seen)>>> = const { Cell::new(None) };
}

/// Penumbra casting for one light.
///
/// Tiles of receivers do not choose rays where those are cheaper, although [`Route::Cheaper`] could: rays and casting break ties
/// on the very edge of a blocker differently, and a sample must not depend on what else is in its batch.
#[derive(Clone)]
pub(super) struct Casting {
    caster: Caster,
}

impl Casting {
    /// Casts for `light`.
    ///
    /// # Errors
    /// The light has a coordinate that is not finite, or `sampling` is out of bounds.
    pub(super) fn new(
        stage: &Stage,
        blockers: &Blockers,
        light: &Emitter,
        sampling: Sampling,
    ) -> Result<Self, LightError> {
        let (corners, own) = match &light.shape {
            Shape::Point(position) => (vec![*position], None),
            Shape::Segment(from, to) => (vec![*from, *to], None),
            Shape::Polygon(polygon) => (polygon.vertices.clone(), Some(polygon.instance)),
        };
        let light = Light::new(Source::Polygon(corners), sampling)?;
        let caster = Caster::new(blockers.instances(stage), light, own);
        Ok(Self { caster })
    }

    /// The same where nothing but objects has moved.
    pub(super) fn after(&self, stage: &Stage, moved: &[u32]) -> Self {
        let mut caster = self.caster.clone();
        let places: Vec<(u32, Affine3A)> = stage
            .placements()
            .enumerate()
            .map(|(index, (_, to_world))| (index as u32, to_world))
            .filter(|(index, _)| moved.contains(index))
            .collect();
        caster.move_instances(&places);
        Self { caster }
    }

    /// How the light is sampled.
    pub(super) fn sampling(&self) -> Sampling {
        self.caster.light().sampling()
    }

    /// Memory, bytes.
    pub(super) fn bytes(&self) -> usize {
        self.caster.bytes()
    }
}

impl Visibility for Casting {
    fn batch(&self) -> usize {
        BATCH
    }

    fn ask(&self, _stage: &Stage, _light: usize, asked: &mut [Asked], shadows: &mut Shadows) {
        let mut scratch = SCRATCH.take().unwrap_or_default();
        let (receivers, seen) = &mut *scratch;
        receivers.clear();
        let sets = u64::from(self.caster.light().sampling().sets);
        for asked in asked.iter_mut() {
            let at = &asked.receiver;
            let normal = at.normal.as_vec3();
            let side = normal.dot(at.face_normal).signum();
            receivers.push(
                at.position.as_vec3() + at.face_normal * (side * at.clearance),
                normal,
                (at.instance, at.face),
                (asked.stream.bits() % sets) as u8,
            );
        }
        let wanted = Wanted {
            masks: false,
            pairs: true,
        };
        self.caster.cast(receivers, Route::Cast, wanted, seen);
        for (asked, share) in asked.iter_mut().zip(&seen.shares) {
            asked.seen = *share;
        }
        shadows.rays += seen.counts.rays;
        shadows.cast.add(&seen.counts);
        shadows.met.extend_from_slice(&seen.pairs);
        SCRATCH.set(Some(scratch));
    }
}
