//! Events against trying everything, against their definition, and against what a light is seen to do.

use glam::{DAffine3, DQuat, DVec3, EulerRot};
use proptest::prelude::*;
use proptest::test_runner::{RngAlgorithm, RngSeed, TestRng};
use protocol::scene::Mesh;

use super::pair::Pair;
use super::{Blocker, EventOptions, EventScratch, Fan, Rings, ev, find_events, ve};
use crate::edges::adjacency::Adjacency;
use crate::edges::test_meshes;
use crate::edges::tree::EdgeTree;
use crate::shadows::light::ShadowLight;
use crate::shadows::wedge::Event;

mod definition;
mod meshes;
mod search;
mod visibility;

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: RngSeed::Fixed(11),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

fn rng(seed: u64) -> impl FnMut(f64, f64) -> f64 {
    let mut bytes = [3; 32];
    bytes[..8].copy_from_slice(&seed.to_le_bytes());
    let mut rng = TestRng::from_seed(RngAlgorithm::ChaCha, &bytes);
    move |low, high| low + (high - low) * (f64::from(rng.next_u32()) / f64::from(u32::MAX))
}

/// A mesh with all that is built of it.
struct Fixture {
    adjacency: Adjacency,
    tree: EdgeTree,
    rings: Rings,
}

impl Fixture {
    fn new(mesh: &Mesh) -> Self {
        let adjacency = Adjacency::new(mesh);
        Self {
            tree: EdgeTree::new(&adjacency, 60.0),
            rings: Rings::new(&adjacency),
            adjacency,
        }
    }

    fn find(&self, light: &ShadowLight, options: EventOptions) -> Vec<Event> {
        let blocker = Blocker {
            adjacency: &self.adjacency,
            tree: &self.tree,
            rings: &self.rings,
        };
        let mut out = Vec::new();
        let mut scratch = EventScratch::default();
        find_events(blocker, light, options, &mut scratch, &mut out);
        out
    }

    fn at(&self, vertex: u32) -> DVec3 {
        DVec3::from(self.adjacency.positions[vertex as usize].map(f64::from))
    }
}

/// Something to sort events by that tells all of them apart.
fn key(e: &Event) -> impl Ord + std::fmt::Debug + use<> {
    let bits = |p: [DVec3; 2]| p.map(|p| (p + DVec3::ZERO).to_array().map(f64::to_bits));
    let wedge = (bits(e.wedge.light), bits(e.wedge.blocker));
    (e.kind, e.corners, e.vertices, wedge)
}

fn keys(events: &[Event]) -> Vec<impl Ord + std::fmt::Debug + use<>> {
    let mut keys: Vec<_> = events.iter().map(key).collect();
    keys.sort_unstable();
    keys
}

fn vector(next: &mut impl FnMut(f64, f64) -> f64) -> DVec3 {
    DVec3::new(next(-1.0, 1.0), next(-1.0, 1.0), next(-1.0, 1.0))
}

fn turn(next: &mut impl FnMut(f64, f64) -> f64) -> DQuat {
    let [a, b, c] = [0; 3].map(|_| next(-3.0, 3.0));
    DQuat::from_euler(EulerRot::XYZ, a, b, c)
}

/// A regular polygon of `n` vertices with this radius round a point.
fn polygon(n: usize, centre: DVec3, radius: f64, turn: DQuat) -> ShadowLight {
    let vertices: Vec<[f32; 3]> = (0..n)
        .map(|k| {
            let a = k as f64 / n as f64 * std::f64::consts::TAU + 0.3;
            let p = centre + turn * DVec3::new(a.cos(), a.sin(), 0.0) * radius;
            p.as_vec3().to_array()
        })
        .collect();
    ShadowLight::polygon(&vertices)
}
