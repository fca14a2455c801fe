//! Pieces of the sides of faces, for what they reflect.
//!
//! A face is divided into like triangles, so that where a ray ends says at once which patch that is.

use std::sync::OnceLock;

use glam::{DVec3, Vec2, Vec3};
use rays::{Hit, Region};

use super::far::Patch;
use crate::{lights::Receiver, random::Stream, stage::Stage};

/// Most patches of a scene: where there are more, all are made larger.
const MOST_PATCHES: u64 = 1 << 22;

/// Halvings of a face's sides at most.
const MOST_HALVINGS: u32 = 8;

/// A triangle is as large as this share of its longest side at least.
const SLIVER: f64 = 0.25;

/// What is this high above a patch stands on it, from and to, as a share of its size.
const ABOVE: [f64; 2] = [0.02, 0.15];

const SALT: u64 = 0x9A7C;

/// Places for the patches of all faces of a scene, filled when they are first met.
#[derive(Debug)]
pub(crate) struct Patches {
    /// Size of the largest, metres.
    pub(crate) largest_m: f64,
    /// By instance: the place in `firsts` of its first face.
    faces: Vec<u32>,
    /// By face: its first patch; and where the last face's end.
    firsts: Vec<u32>,
    pub(crate) slots: Vec<OnceLock<Box<Patch>>>,
}

/// A piece of a side of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Piece {
    pub(crate) instance: u32,
    pub(crate) face: u32,
    /// The face's sides are halved so often.
    halvings: u32,
    /// Whether it is the side from which the face's vertices run anticlockwise.
    is_front: bool,
    /// Steps along the face's first and second side, and which of the two triangles there.
    at: [u32; 2],
    is_upper: bool,
}

impl Patches {
    /// None filled yet, the largest of this size, metres.
    pub(crate) fn new(stage: &Stage, largest_m: f64) -> Self {
        let mut patches = Self {
            largest_m,
            faces: Vec::new(),
            firsts: Vec::new(),
            slots: Vec::new(),
        };
        while patches.lay_out(stage) > MOST_PATCHES && patches.largest_m.is_finite() {
            patches.largest_m *= 2.;
        }
        let count = patches.firsts.last().map_or(0, |last| *last as usize);
        patches.slots.resize_with(count, OnceLock::new);
        patches
    }

    /// Whether every patch is where it is in `other`.
    pub(crate) fn is_laid_out_as(&self, other: &Self) -> bool {
        self.faces == other.faces && self.firsts == other.firsts
    }

    /// Gives each face its patches; says how many there would be in all.
    fn lay_out(&mut self, stage: &Stage) -> u64 {
        self.faces.clear();
        self.firsts.clear();
        let mut count = 0u64;
        for instance in 0.. {
            self.faces.push(self.firsts.len() as u32);
            let Some(faces) = stage.face_count(instance) else {
                break;
            };
            for face in 0..faces {
                self.firsts.push(count as u32);
                let size = stage.triangle(instance, face).map_or(0., size_m);
                let halvings = (size / self.largest_m).log2().ceil().max(0.) as u32;
                count += 2 << (2 * halvings.min(MOST_HALVINGS));
            }
        }
        self.firsts.push(count as u32);
        // Faces of which there are too many for halvings to matter have two patches each, however large those are.
        if self.largest_m > 1e30 { 0 } else { count }
    }

    /// The place of the patch with a point of a face, given by its second and third barycentric coordinates.
    pub(crate) fn find(
        &self,
        [instance, face]: [u32; 2],
        barycentric: [f32; 2],
        is_front: bool,
    ) -> Option<(u32, Piece)> {
        let row = (*self.faces.get(instance as usize)? + face) as usize;
        let (first, next) = (*self.firsts.get(row)?, *self.firsts.get(row + 1)?);
        let halvings = (next - first).trailing_zeros() / 2;
        let most = (1u32 << halvings) - 1;
        let [v, w] = barycentric.map(|x| x * (1u32 << halvings) as f32);
        let i = (v as u32).min(most);
        let j = (w as u32).min(most - i);
        let piece = Piece {
            instance,
            face,
            halvings,
            is_front,
            at: [i, j],
            is_upper: (v - i as f32) + (w - j as f32) > 1. && i + j < most,
        };
        Some((first + piece.index(), piece))
    }

    /// The patch at a place.
    pub(crate) fn piece(&self, slot: u32) -> Piece {
        let row = self.firsts.partition_point(|first| *first <= slot) - 1;
        let instance = self.faces.partition_point(|first| *first as usize <= row) - 1;
        let (first, next) = (self.firsts[row], self.firsts[row + 1]);
        let mut piece = Piece {
            instance: instance as u32,
            face: row as u32 - self.faces[instance],
            halvings: (next - first).trailing_zeros() / 2,
            is_front: (slot - first) & 1 == 1,
            at: [0; 2],
            is_upper: false,
        };
        let triangle = (slot - first) >> 1;
        while piece.at[0] + 1 < 1 << piece.halvings && piece.before(piece.at[0] + 1) <= triangle {
            piece.at[0] += 1;
        }
        let rest = triangle - piece.before(piece.at[0]);
        piece.at[1] = rest >> 1;
        piece.is_upper = rest & 1 == 1;
        piece
    }
}

impl Piece {
    /// Triangles in the rows before one: a row has two a step less one, and one step less than the row before.
    fn before(&self, row: u32) -> u32 {
        (row << (self.halvings + 1)) - row * row
    }

    /// Among the patches of its face.
    fn index(&self) -> u32 {
        let [i, j] = self.at;
        (self.before(i) + 2 * j + u32::from(self.is_upper)) << 1 | u32::from(self.is_front)
    }

    /// Random numbers that depend on the patch alone.
    pub(crate) fn stream(&self) -> Stream {
        let face = u64::from(self.instance) << 32 | u64::from(self.face);
        Stream::new(SALT, face).part(self.index().into())
    }

    /// Its size, metres.
    pub(crate) fn size_m(&self, stage: &Stage) -> f64 {
        let face = stage.triangle(self.instance, self.face);
        face.map_or(0., size_m) / f64::from(1u32 << self.halvings)
    }

    /// The second and third barycentric coordinates of a point of the patch, for one of the square.
    fn barycentric(&self, mut place: Vec2) -> [f32; 2] {
        if place.element_sum() > 1. {
            place = 1. - place;
        }
        let corner = glam::UVec2::from(self.at).as_vec2();
        let at = if self.is_upper {
            corner + 1. - place
        } else {
            corner + place
        };
        (at / (1u32 << self.halvings) as f32).to_array()
    }

    /// The surface at a point of the patch, for one of the square, and its albedo.
    pub(crate) fn point(&self, stage: &Stage, place: Vec2) -> Option<(Receiver, Vec3)> {
        let hit = Hit {
            t: 0.,
            instance: self.instance,
            face: self.face,
            barycentric: self.barycentric(place),
        };
        let surface = stage.surface(&hit)?;
        let side = if self.is_front { -1. } else { 1. };
        let towards = surface.face_normal.as_dvec3() * side;
        let receiver = surface.seen_along(towards, hit.instance, hit.face);
        Some((receiver, surface.albedo()))
    }

    /// Whether nothing stands on the patch: sure if it says so.
    pub(crate) fn is_bare(&self, stage: &Stage) -> bool {
        let Some([a, b, c]) = stage.triangle(self.instance, self.face) else {
            return true;
        };
        let corner = |u: f32, v: f32| {
            let [v, w] = self.barycentric(glam::vec2(u, v)).map(f64::from);
            a + (b - a) * v + (c - a) * w
        };
        let corners = [corner(0., 0.), corner(1., 0.), corner(0., 1.)];
        let middle = corners.iter().sum::<DVec3>() / 3.;
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let up = if self.is_front { normal } else { -normal };
        let size = size_m(corners);
        let [low, high] = ABOVE.map(|share| (share * size) as f32);
        let mut planes = [(Vec3::ZERO, 0.); 6];
        for (i, plane) in planes.iter_mut().take(3).enumerate() {
            let (from, to) = (corners[i] - middle, corners[(i + 1) % 3] - middle);
            let mut inward = (to - from).cross(normal).normalize_or_zero();
            if inward.dot(from) > 0. {
                inward = -inward;
            }
            // What touches a border stands on the next patch.
            let inset = -inward.dot(from) * 0.95;
            *plane = (inward.as_vec3(), -inset as f32);
        }
        planes[3] = (up.as_vec3(), low);
        planes[4] = (-up.as_vec3(), -high);
        let region = Region::new(middle.as_vec3(), planes);
        let own = (self.instance, self.face);
        let reaches_in = |instance, face| {
            let Some(triangle) = stage.triangle(instance, face) else {
                return true;
            };
            let corners = triangle.map(|corner| (corner - middle).as_vec3());
            let is_inside = |(normal, offset): &(Vec3, f32)| {
                corners.iter().any(|corner| normal.dot(*corner) >= *offset)
            };
            planes.iter().all(is_inside)
        };
        let may = |instance, face| (instance, face) != own && reaches_in(instance, face);
        !stage.world().may_touch(&region, may)
    }
}

/// The size of a triangle: side of a square with twice its area, but no less than this share of its longest side.
fn size_m([a, b, c]: [DVec3; 3]) -> f64 {
    let sides = [b - a, c - b, a - c].map(DVec3::length_squared);
    let longest = sides.into_iter().fold(0., f64::max).sqrt();
    let twice_area = (b - a).cross(c - a).length();
    twice_area.sqrt().max(SLIVER * longest)
}

#[cfg(test)]
#[path = "patch_tests.rs"]
mod tests;
