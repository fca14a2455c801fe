//! Indirect irradiance, kept where it was computed and interpolated in between (Ward, Rubinstein and Clear, "A Ray Tracing
//! Solution for Diffuse Interreflection", 1988; Ward and Heckbert, "Irradiance Gradients", 1992).
//!
//! Unlike in those papers records do not lie where samples happened to be: they lie at the sites of a `lattice`, so that
//! irradiance is a function of the scene, the point and the pixel's size, whoever asked for what before. A `record`
//! gathers a `hemisphere` of rays, each bringing direct light and, from the `far` field, what was reflected before;
//! `interpolate` asks the records around a point. What moves makes those `stale` whose rays it concerns.

mod bounce;
mod far;
pub mod hemisphere;
mod interpolate;
mod lattice;
mod patch;
mod points;
mod record;
mod stale;
mod store;
mod worker;

use std::{
    collections::VecDeque,
    sync::{
        Arc, Mutex, OnceLock, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
};

use glam::Vec3;

pub(crate) use bounce::leaving;
pub use interpolate::Indirect;
use lattice::{Cell, Lattice, Orientation, Place};
use patch::Patches;
use record::Record;
pub(crate) use stale::Moved;
use store::Store;

use crate::{lights::Receiver, random::Stream, stage::Stage};

/// Whether an answer waits for what it needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Patience {
    /// Records that are missing are computed before the answer is given: it is the same whatever was asked before.
    #[default]
    Final,
    /// The answer is made from what is there, and what is missing is left to [`IrradianceCache::work`].
    AtOnce,
}

/// A point where records can be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Site {
    pub(crate) receiver: Receiver,
    /// Free way along the normal, metres.
    pub(crate) headroom_m: f32,
}

type Sites = Vec<(Orientation, Site)>;

/// The record of a place.
#[derive(Debug, Default)]
struct Slot {
    fresh: OnceLock<Arc<Record>>,
    /// From before the last edit.
    old: Option<Arc<Record>>,
    /// Whether the edit concerns the old one.
    is_stale: bool,
    is_wanted: AtomicBool,
}

/// What a cache has come to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Records computed in this state of the scene.
    pub records: u64,
    /// Records kept from before an edit that does not concern them.
    pub kept: u64,
    /// Records kept from before an edit until they are replaced.
    pub stale: u64,
    /// Points where no record fitted, so that they were gathered for alone.
    pub alone: u64,
    /// Rays traced for records and the far field.
    pub rays: u64,
}

/// Records of a scene in one state.
#[derive(Debug)]
pub struct IrradianceCache {
    lattice: Lattice,
    patience: Patience,
    cells: Store<Cell, OnceLock<Sites>>,
    patches: OnceLock<Patches>,
    records: Store<Place, Slot>,
    // A std mutex, since nothing is awaited or computed while it is held.
    wanted: Mutex<VecDeque<Place>>,
    /// Sum and number of records' irradiance.
    total: Mutex<(Vec3, f32)>,
    rays: AtomicU64,
    alone: AtomicU64,
}

impl IrradianceCache {
    /// Nothing yet, for a scene whose bounds have this diagonal.
    #[must_use]
    pub fn new(diagonal_m: f64, patience: Patience) -> Self {
        Self {
            lattice: Lattice::new(diagonal_m),
            patience,
            cells: Store::new(),
            patches: OnceLock::new(),
            records: Store::new(),
            wanted: Mutex::default(),
            total: Mutex::default(),
            rays: AtomicU64::new(0),
            alone: AtomicU64::new(0),
        }
    }

    /// Whether answers wait.
    #[must_use]
    pub fn patience(&self) -> Patience {
        self.patience
    }

    /// What there is.
    #[must_use]
    pub fn tally(&self) -> Tally {
        let mut tally = Tally {
            alone: self.alone.load(Ordering::Relaxed),
            rays: self.rays.load(Ordering::Relaxed),
            ..Tally::default()
        };
        self.records
            .each(|_, slot| match (slot.fresh.get(), &slot.old) {
                (Some(_), _) => tally.records += 1,
                (None, Some(_)) if slot.is_stale => tally.stale += 1,
                (None, Some(_)) => tally.kept += 1,
                (None, None) => {}
            });
        tally
    }

    fn count_rays(&self, rays: u64) {
        self.rays.fetch_add(rays, Ordering::Relaxed);
    }

    fn count_alone(&self) {
        self.alone.fetch_add(1, Ordering::Relaxed);
    }

    /// Mean irradiance of all records so far.
    fn mean(&self) -> Vec3 {
        let (sum, count) = *self.total.lock().unwrap_or_else(PoisonError::into_inner);
        sum / count.max(1.)
    }

    /// The sites of a cell.
    fn sites(&self, stage: &Stage, cell: Cell) -> CellSites {
        let slot = self.cells.value(cell, OnceLock::new);
        slot.get_or_init(|| {
            let sites = self.lattice.sites(stage, cell);
            let with_headroom = |(orientation, receiver)| {
                let headroom_m = headroom_m(stage, &receiver);
                let site = Site {
                    receiver,
                    headroom_m,
                };
                (orientation, site)
            };
            sites.into_iter().map(with_headroom).collect()
        });
        CellSites(slot)
    }

    fn site(&self, stage: &Stage, place: Place) -> Option<Site> {
        let sites = self.sites(stage, place.cell);
        let own = sites.iter().find(|(o, _)| *o == place.orientation);
        own.map(|(_, site)| *site)
    }

    /// The record of a place in this state of the scene, computed now if need be.
    fn fresh(&self, stage: &Stage, place: Place, site: &Receiver, slot: &Slot) -> Arc<Record> {
        let record = slot.fresh.get_or_init(|| {
            let record = Arc::new(self.gather(stage, place, site));
            let mut total = self.total.lock().unwrap_or_else(PoisonError::into_inner);
            total.0 += record.gathered.irradiance;
            total.1 += 1.;
            record
        });
        Arc::clone(record)
    }
}

/// The sites of a cell, kept alive while they are looked at.
struct CellSites(Arc<OnceLock<Sites>>);

impl CellSites {
    fn iter(&self) -> std::slice::Iter<'_, (Orientation, Site)> {
        self.0.get().map_or(&[][..], Vec::as_slice).iter()
    }
}

/// How far the way is free along the normal, metres.
fn headroom_m(stage: &Stage, at: &Receiver) -> f32 {
    let up = leaving(at, at.normal);
    let hit = stage.world().closest(&up, f32::INFINITY);
    hit.map_or(f32::INFINITY, |hit| hit.t)
}

impl Receiver {
    /// Whether it is the side of the face from which its vertices run anticlockwise.
    fn is_front(&self) -> bool {
        self.face_normal.as_dvec3().dot(self.normal) >= 0.
    }
}

impl Place {
    /// Random numbers that depend on the place and their purpose alone.
    fn stream(&self, purpose: u64) -> Stream {
        let Cell { level, at } = self.cell;
        let word = |x: i32| u64::from(x.cast_unsigned());
        Stream::new(purpose, u64::from(level) << 8 | u64::from(self.orientation))
            .part(word(at.x) << 32 | word(at.y))
            .part(word(at.z))
    }
}
