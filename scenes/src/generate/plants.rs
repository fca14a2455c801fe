//! Foliage: flowers in a bed, grass, crowns of leaves. Thin sheets with borders, seen from both sides.

use std::f32::consts::TAU;

use glam::{Vec3, vec3};
use protocol::scene::Mesh;
use serde::Deserialize;

use super::furniture::Random;
use super::limits::{counts, positive};

/// Sides of a stem, and pieces along it.
const STEM: [u32; 2] = [3, 6];
/// Leaves a plant, petals a flower, and pieces along each.
const LEAVES: [u32; 2] = [16, 5];
const PETALS: [u32; 2] = [12, 3];
/// Pieces along a blade of grass, and along a leaf in a crown.
const GRASS: u32 = 3;
const CROWN: u32 = 2;

/// What of a bed of plants to make: beds of one seed, size and count grow the same plants, so that each part can have its
/// material.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Part {
    /// Of flowers.
    Stems,
    /// Of flowers.
    Leaves,
    /// Of flowers.
    Petals,
    /// Blades.
    Grass,
}

/// Plants at random places of a rectangle about the origin, on y = 0.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlantsSpec {
    pub(crate) size: [f32; 2],
    pub(crate) count: u32,
    /// Of the highest; the least has half of it.
    pub(crate) height: f32,
    pub(crate) part: Part,
    #[serde(default)]
    pub(crate) seed: u32,
}

/// Leaves in a ball about the origin.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CrownSpec {
    pub(crate) radius: f32,
    pub(crate) leaves: u32,
    /// Length of a leaf.
    pub(crate) leaf: f32,
    #[serde(default)]
    pub(crate) seed: u32,
}

/// A thin sheet that grows from `root` along `along` and sinks with `bend`; `side` is across it.
struct Blade {
    root: Vec3,
    along: Vec3,
    side: Vec3,
    length: f32,
    width: f32,
    bend: f32,
    pieces: u32,
    /// How far its middle is below its sides, widths; flat and without a midrib at 0.
    fold: f32,
}

/// The mesh of a part of a bed.
pub(super) fn plants(spec: &PlantsSpec) -> Result<Mesh, String> {
    positive("size", spec.size[0].min(spec.size[1]))?;
    positive("height", spec.height)?;
    let faces = match spec.part {
        Part::Stems => 2 * STEM[0] * STEM[1],
        Part::Leaves => LEAVES[0] * (4 * LEAVES[1] - 2),
        Part::Petals => PETALS[0] * (4 * PETALS[1] - 2),
        Part::Grass => 2 * GRASS - 1,
    };
    counts(&[("count", spec.count, 1), ("faces each", faces, 1)])?;
    let mut mesh = Mesh::default();
    for plant in 0..spec.count {
        let mut random = Random(u64::from(spec.seed) << 32 ^ u64::from(plant) << 3 ^ 0x9a7d);
        let mut between = |low: f32, high: f32| low + (high - low) * random.next();
        let [w, d] = spec.size.map(|s| 0.5 * s);
        let root = vec3(between(-w, w), 0.0, between(-d, d));
        let height = spec.height * between(0.5, 1.0);
        let turn = between(0.0, TAU);
        let lean = vec3(turn.cos(), 0.0, turn.sin()) * height * between(0.05, 0.35);
        match spec.part {
            Part::Grass => add_blade(
                &mut mesh,
                &Blade {
                    root,
                    along: (vec3(0.0, height, 0.0) + lean * 0.5).normalize(),
                    side: vec3(-turn.sin(), 0.0, turn.cos()),
                    length: height,
                    width: 0.03 * height + 0.003,
                    bend: between(0.05, 0.5),
                    pieces: GRASS,
                    fold: 0.0,
                },
            ),
            part => flower(&mut mesh, part, &mut between, (root, height, lean)),
        }
    }
    Ok(mesh)
}

/// A part of one flower.
fn flower(
    mesh: &mut Mesh,
    part: Part,
    between: &mut impl FnMut(f32, f32) -> f32,
    (root, height, lean): (Vec3, f32, Vec3),
) {
    let stem = |t: f32| root + vec3(0.0, height * t, 0.0) + lean * (t * t);
    let turn = between(0.0, TAU);
    // Both kinds of sheet draw their numbers whichever is made.
    let [leaf_size, petal_size] = [between(0.22, 0.34), between(0.12, 0.18)];
    match part {
        Part::Stems => add_stem(mesh, stem, 0.008 * height),
        Part::Leaves => {
            for leaf in 0..LEAVES[0] {
                let t = 0.08 + 0.72 * leaf as f32 / LEAVES[0] as f32;
                let angle = turn + 2.4 * leaf as f32 + between(-0.3, 0.3);
                let (sin, cos) = angle.sin_cos();
                let length = height * leaf_size * (1.1 - 0.5 * t) * between(0.8, 1.2);
                add_blade(
                    mesh,
                    &Blade {
                        root: stem(t),
                        along: vec3(cos, between(0.3, 0.9), sin).normalize(),
                        side: vec3(-sin, between(-0.2, 0.2), cos).normalize(),
                        length,
                        width: 0.3 * length,
                        bend: between(0.2, 0.6),
                        pieces: LEAVES[1],
                        fold: 0.25,
                    },
                );
            }
        }
        _ => {
            for petal in 0..PETALS[0] {
                let angle = turn + TAU * petal as f32 / PETALS[0] as f32;
                let (sin, cos) = angle.sin_cos();
                let length = height * petal_size;
                add_blade(
                    mesh,
                    &Blade {
                        root: stem(1.0),
                        along: vec3(cos, between(0.2, 0.5), sin).normalize(),
                        side: vec3(-sin, 0.0, cos),
                        length,
                        width: 0.4 * length,
                        bend: between(0.0, 0.3),
                        pieces: PETALS[1],
                        fold: 0.15,
                    },
                );
            }
        }
    }
}

/// The mesh of a crown.
pub(super) fn crown(spec: &CrownSpec) -> Result<Mesh, String> {
    positive("radius", spec.radius)?;
    positive("leaf", spec.leaf)?;
    counts(&[("leaves", spec.leaves, 1), ("faces each", 4 * CROWN - 2, 1)])?;
    let mut random = Random(u64::from(spec.seed) ^ 0xc0_4e);
    let mut mesh = Mesh::default();
    for _ in 0..spec.leaves {
        let mut between = |low: f32, high: f32| low + (high - low) * random.next();
        let (height, angle) = (between(-1.0, 1.0), between(0.0, TAU));
        let ring = (1.0 - height * height).max(0.0).sqrt();
        let out = vec3(ring * angle.cos(), height, ring * angle.sin());
        let stray = vec3(between(-1.0, 1.0), between(-1.0, 0.6), between(-1.0, 1.0));
        let along = (out + stray).normalize_or(Vec3::Y);
        add_blade(
            &mut mesh,
            &Blade {
                // Denser towards the outside, as leaves are.
                root: out * spec.radius * between(0.1, 1.0).sqrt(),
                along,
                side: along.any_orthonormal_vector(),
                length: spec.leaf * between(0.7, 1.0),
                width: 0.45 * spec.leaf,
                bend: between(0.0, 0.4),
                pieces: CROWN,
                fold: 0.15,
            },
        );
    }
    Ok(mesh)
}

/// Two triangles from four corners in order, or one from three.
fn add_faces(mesh: &mut Mesh, corners: &[u32]) {
    for i in 2..corners.len() {
        mesh.faces.push([corners[0], corners[i - 1], corners[i]]);
    }
}

fn add_blade(mesh: &mut Mesh, blade: &Blade) {
    let across = if blade.fold > 0.0 { 3 } else { 2 };
    let down = blade.along.cross(blade.side).normalize_or(Vec3::NEG_Y);
    let first = mesh.positions.len() as u32;
    for piece in 0..=blade.pieces {
        let t = piece as f32 / blade.pieces as f32;
        let middle = blade.root + blade.along * (blade.length * t)
            - vec3(0.0, blade.bend * blade.length * t * t, 0.0);
        if piece == blade.pieces {
            mesh.positions.push(middle.to_array());
            break;
        }
        // Widest in its first half, never nothing.
        let half = 0.5 * blade.width * (0.25 + 2.2 * t * (1.0 - t) + 0.45 * (1.0 - t));
        for i in 0..across {
            let s = 2.0 * i as f32 / (across - 1) as f32 - 1.0;
            let sunk = if across == 3 && i == 1 {
                blade.fold * half
            } else {
                0.0
            };
            let place = middle + blade.side * (half * s) + down * sunk;
            mesh.positions.push(place.to_array());
        }
    }
    for piece in 0..blade.pieces {
        let row = first + piece * across;
        for i in row..row + across - 1 {
            if piece + 1 == blade.pieces {
                add_faces(mesh, &[i, i + 1, row + across]);
            } else {
                add_faces(mesh, &[i, i + 1, i + 1 + across, i + across]);
            }
        }
    }
}

/// A bent prism, open at its ends.
fn add_stem(mesh: &mut Mesh, at: impl Fn(f32) -> Vec3, radius: f32) {
    let [sides, pieces] = STEM;
    let first = mesh.positions.len() as u32;
    for piece in 0..=pieces {
        let t = piece as f32 / pieces as f32;
        for side in 0..sides {
            let (sin, cos) = (TAU * side as f32 / sides as f32).sin_cos();
            let thin = radius * (1.0 - 0.5 * t);
            let place = at(t) + vec3(cos * thin, 0.0, sin * thin);
            mesh.positions.push(place.to_array());
        }
    }
    for piece in 0..pieces {
        for side in 0..sides {
            let corner = |piece: u32, side: u32| first + piece * sides + side % sides;
            let corners = [
                corner(piece, side),
                corner(piece + 1, side),
                corner(piece + 1, side + 1),
                corner(piece, side + 1),
            ];
            add_faces(mesh, &corners);
        }
    }
}
