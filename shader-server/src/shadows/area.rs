//! Visible share of a polygon, by strata that are divided where light meets shadow.

use glam::{DVec3, Vec2, Vec3};
use rays::Region;

use crate::{
    lights::{PolygonShape, Receiver},
    random::Stream,
    stage::Stage,
};

use super::{
    Shadows, cover,
    shadow_rays::{STOP_SHORT, ShadowRays, sees},
};

/// Strata a side at most.
pub(super) const FINEST: usize = 32;

/// Corners that are asked, at most about so many.
const CORNERS: usize = 4;

/// How far from a corner towards the middle its ray goes, since things may touch the light there.
const INSET: f64 = 0.015;

/// One bit a stratum, a word a row.
type Bits = [u32; FINEST];

/// A level of strata: which were asked at this level, which are known to see the receiver and which have an answer at all.
struct Level {
    size: usize,
    asked: Bits,
    seen: Bits,
    known: Bits,
}

impl Level {
    /// Strata that differ from a neighbour, or from what lies beyond their side of the square.
    fn changes(&self, beyond: &Beyond) -> Bits {
        let mut changes = [0; FINEST];
        let last = self.size - 1;
        let halves = self.size / 2;
        let differs = |row: usize, corner: Option<bool>, columns: u32| match corner {
            Some(true) => self.known[row] & !self.seen[row] & columns,
            Some(false) => self.known[row] & self.seen[row] & columns,
            None => 0,
        };
        // Each corner speaks for what lies beyond the nearer halves of its two sides.
        let (low, high) = (full(halves), full(halves) << (self.size - halves));
        let [a, b, c, d] = beyond.0;
        changes[0] |= differs(0, a, low) | differs(0, b, high);
        changes[last] |= differs(last, d, low) | differs(last, c, high);
        for i in 0..halves {
            let (row, mirrored) = (i, last - i);
            changes[row] |= differs(row, a, 1) | differs(row, b, 1 << last);
            changes[mirrored] |= differs(mirrored, d, 1) | differs(mirrored, c, 1 << last);
        }
        for row in 0..self.size {
            let (seen, known) = (self.seen[row], self.known[row]);
            let right = (seen ^ (seen >> 1)) & known & (known >> 1);
            changes[row] |= right | (right << 1);
            if row + 1 < self.size {
                let below = (seen ^ self.seen[row + 1]) & known & self.known[row + 1];
                changes[row] |= below;
                changes[row + 1] |= below;
            }
        }
        changes
    }

    fn sees_anything(&self) -> bool {
        self.seen.iter().any(|row| *row != 0)
    }

    fn disagrees_with(&self, corners: &[Option<bool>]) -> bool {
        let any_seen = self.sees_anything();
        let any_blocked = (0..self.size).any(|row| self.known[row] & !self.seen[row] != 0);
        corners.contains(&Some(true)) && any_blocked || corners.contains(&Some(false)) && any_seen
    }

    /// The next level, with `asked` to be asked again in quarters and all else as it is.
    fn divide(&self, asked: &Bits) -> Self {
        let spread = |bits: &Bits| std::array::from_fn(|row| double(bits[row / 2]));
        Self {
            size: 2 * self.size,
            asked: spread(asked),
            seen: spread(&self.seen),
            known: spread(&self.known),
        }
    }
}

/// Each of the lower 16 bits twice.
fn double(bits: u32) -> u32 {
    let mut x = bits & 0xFFFF;
    x = (x | (x << 8)) & 0x00FF_00FF;
    x = (x | (x << 4)) & 0x0F0F_0F0F;
    x = (x | (x << 2)) & 0x3333_3333;
    x = (x | (x << 1)) & 0x5555_5555;
    x | (x << 1)
}

/// A row of `size` strata.
fn full(size: usize) -> u32 {
    u32::MAX.checked_shr((FINEST - size) as u32).unwrap_or(0)
}

fn count(bits: &Bits) -> u32 {
    bits.iter().map(|row| row.count_ones()).sum()
}

/// Whether the corners (0, 0), (1, 0), (1, 1) and (0, 1) of the square are seen, where that is known.
///
/// Shadows come in over the border, and one ray a stratum notices the first tenth of one too seldom.
#[derive(Default)]
struct Beyond([Option<bool>; 4]);

/// What rays to a light found so far.
struct Probe<'a> {
    stage: &'a Stage,
    receiver: &'a Receiver,
    shape: &'a PolygonShape,
    shadows: &'a mut Shadows,
}

impl Probe<'_> {
    /// Weight of the stratum around `centre` and whether `place` in it is seen; nothing if that gives no light.
    ///
    /// The weight is the centre's, where that gives light: the estimate's noise is then that of visibility alone.
    fn at(&mut self, place: Vec2, centre: Vec2) -> Option<(f32, bool)> {
        let weight = |probe: &Self, point| probe.shape.weight(probe.receiver, point) as f32;
        let point = self.shape.at(place)?;
        let own = weight(self, point);
        let middle = self
            .shape
            .at(centre)
            .map_or(0., |point| weight(self, point));
        let weight = if middle > 0. { middle } else { own };
        (own > 0.).then(|| (weight, self.sees(point)))
    }

    /// Asks one ray of each stratum in `level.asked`; puts what they say into `level` and `answers`.
    fn ask(&mut self, level: &mut Level, stream: &mut Stream, answers: &mut Vec<Answer>) {
        answers.clear();
        for row in 0..level.size {
            let mut asked = level.asked[row];
            while asked != 0 {
                let column = asked.trailing_zeros();
                let bit = 1 << column;
                asked ^= bit;
                let cell = Vec2::new(column as f32, row as f32);
                let place = (cell + stream.square()) / level.size as f32;
                let centre = (cell + 0.5) / level.size as f32;
                level.known[row] &= !bit;
                level.seen[row] &= !bit;
                if let Some((weight, seen)) = self.at(place, centre) {
                    level.known[row] |= bit;
                    level.seen[row] |= if seen { bit } else { 0 };
                    answers.push(Answer {
                        row,
                        bit,
                        weight,
                        seen,
                    });
                }
            }
        }
    }

    fn sees(&mut self, point: DVec3) -> bool {
        sees(
            self.stage,
            self.receiver,
            point,
            Some(self.shape.instance),
            self.shadows,
        )
    }

    /// Whether the receiver sees the first vertex that gives it light: of a light almost below the horizon no stratum may.
    fn vertex_seen(&mut self) -> bool {
        let gives = |v: &&DVec3| self.shape.weight(self.receiver, **v) > 0.;
        let vertex = self.shape.vertices.iter().find(gives).copied();
        vertex.is_some_and(|vertex| self.sees(vertex))
    }

    /// Asks rays to corners of the light: what they say, in order, where it gives light.
    fn corners(&mut self) -> Vec<Option<bool>> {
        let vertices = &self.shape.vertices;
        let middle = vertices.iter().sum::<DVec3>() / vertices.len().max(1) as f64;
        let step = vertices.len().div_ceil(CORNERS).max(1);
        let asked = vertices.iter().step_by(step).map(|v| v.lerp(middle, INSET));
        asked
            .map(|corner| {
                let gives = self.shape.weight(self.receiver, corner) > 0.;
                gives.then(|| self.sees(corner))
            })
            .collect()
    }
}

impl Beyond {
    /// From the corners of a light that fills the square.
    fn new(corners: &[Option<bool>]) -> Self {
        Self(std::array::from_fn(|i| corners.get(i).copied().flatten()))
    }
}

/// What the ray to a stratum that gives light came to.
struct Answer {
    row: usize,
    bit: u32,
    weight: f32,
    seen: bool,
}

/// What there may be between a receiver and a light.
enum Between {
    Nothing,
    /// The faces in `Shadows::between`.
    FewFaces,
    Anything,
}

/// Looks for faces between a receiver and a light: finds none where there certainly are none, and those that there are if
/// they are at most `most`.
fn between(
    stage: &Stage,
    receiver: &Receiver,
    shape: &PolygonShape,
    most: usize,
    faces: &mut Vec<(u32, u32)>,
) -> Between {
    faces.clear();
    let Some(region) = shaft(receiver, shape) else {
        return Between::Anything;
    };
    let own = (receiver.instance, receiver.face);
    let too_many = stage.world().may_touch(&region, |instance, face| {
        if instance == shape.instance || (instance, face) == own {
            return false;
        }
        faces.push((instance, face));
        faces.len() > most
    });
    if faces.is_empty() {
        return Between::Nothing;
    }
    // The tree's order depends on how it came to be.
    faces.sort_unstable();
    if too_many {
        Between::Anything
    } else {
        Between::FewFaces
    }
}

/// The pyramid from the receiver over the light, without what shadow rays do not notice: the surface that they start from and
/// what touches the light. None if the receiver's own plane cuts the light, as rays then start on both sides.
fn shaft(receiver: &Receiver, shape: &PolygonShape) -> Option<Region> {
    let corners = shape.enclosing().map(|corner| corner - receiver.position);
    let face_normal = receiver.face_normal.as_dvec3();
    let above = corners
        .iter()
        .filter(|corner| corner.dot(face_normal) > 0.)
        .count();
    let side = match above {
        4 => 1.,
        0 => -1.,
        _ => return None,
    };
    let middle = corners.iter().sum::<DVec3>();
    let reach = corners
        .iter()
        .map(|corner| corner.length())
        .fold(0., f64::max);
    let clearance = receiver.clearance;
    let margin = 2. * clearance + 8. * f32::EPSILON * reach as f32;
    let mut planes = [(Vec3::ZERO, 0.); 6];
    for (i, plane) in planes[..4].iter_mut().enumerate() {
        let normal = corners[i].cross(corners[(i + 1) % 4]).normalize_or_zero();
        let inward = if normal.dot(middle) < 0. {
            -normal
        } else {
            normal
        };
        *plane = (inward.as_vec3(), -margin);
    }
    planes[4] = ((face_normal * side).as_vec3(), 0.5 * clearance);
    let to_light = shape.normal.dot(corners[0]) * f64::from(1. - STOP_SHORT);
    planes[5] = (shape.normal.as_vec3(), to_light as f32);
    Some(Region::new(receiver.position.as_vec3(), planes))
}

/// Share of the polygon's unoccluded irradiance that reaches `receiver`.
///
/// If nothing is between the two that is the answer, and few faces are drawn onto the light. Else the first strata and the corners are asked. If all agree that is the answer; else strata that differ from a neighbour
/// are divided in four and asked afresh, as long as the rays allowed last. Fresh rays keep each divided stratum
/// unbiased; the error is that of strata of the finest size along the shadow's outline, at the cost of that outline alone.
pub(super) fn fraction(
    stage: &Stage,
    receiver: &Receiver,
    shape: &PolygonShape,
    method: &ShadowRays,
    stream: &mut Stream,
    shadows: &mut Shadows,
) -> f32 {
    let most = method.drawn_faces as usize;
    match between(stage, receiver, shape, most, &mut shadows.between) {
        Between::Nothing => return 1.,
        Between::FewFaces => return cover::fraction(stage, receiver, shape, stream, shadows),
        Between::Anything => {}
    }
    let before = shadows.rays;
    let mut probe = Probe {
        stage,
        receiver,
        shape,
        shadows,
    };
    let mut asked = [0; FINEST];
    let size = (method.strata as usize).clamp(1, FINEST);
    asked[..size].fill(full(size));
    let mut level = Level {
        size,
        asked,
        seen: [0; FINEST],
        known: [0; FINEST],
    };
    let mut answers = Vec::with_capacity(64);
    probe.ask(&mut level, stream, &mut answers);
    let adaptive = 4 + (probe.shadows.rays - before) as u32 <= method.max_rays;
    let corners = if adaptive {
        probe.corners()
    } else {
        Vec::new()
    };
    let beyond = if shape.fills_square() {
        Beyond::new(&corners)
    } else {
        Beyond::default()
    };
    if adaptive && !level.sees_anything() && !corners.contains(&Some(true)) {
        // A sliver of the light may be seen between the rays: before it counts as hidden it is asked once more.
        probe.ask(&mut level, stream, &mut answers);
    }
    let mut divide = level.changes(&beyond);
    if !shape.fills_square() && level.disagrees_with(&corners) {
        // Nothing tells which strata are near those corners.
        divide[..size].fill(full(size));
    }

    let (mut lit, mut all) = (0., 0.);
    loop {
        let mut again: Bits = std::array::from_fn(|row| divide[row] & level.asked[row]);
        let spent = (probe.shadows.rays - before) as u32;
        if 2 * level.size > FINEST || spent + 4 * count(&again) > method.max_rays {
            again = [0; FINEST];
        }
        let area = 1. / (level.size * level.size) as f32;
        for answer in answers
            .iter()
            .filter(|answer| again[answer.row] & answer.bit == 0)
        {
            all += area * answer.weight;
            lit += if answer.seen {
                area * answer.weight
            } else {
                0.
            };
        }
        if count(&again) == 0 {
            break;
        }
        level = level.divide(&again);
        probe.ask(&mut level, stream, &mut answers);
        divide = level.changes(&beyond);
    }
    if all > 0. {
        lit / all
    } else {
        f32::from(u8::from(probe.vertex_seen()))
    }
}
