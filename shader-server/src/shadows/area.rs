//! Visible share of a polygon, by strata that are divided where light meets shadow.

use glam::{DVec3, Vec2};

use crate::{
    lights::{PolygonShape, Receiver},
    random::Stream,
    stage::Stage,
};

use super::{Shadows, rays::sees};

/// Strata a side at first, and at most.
const COARSE: usize = 4;
const FINEST: usize = 32;

/// Corners that are asked, at most about so many.
const CORNERS: usize = 4;

/// How far from a corner towards the middle its ray goes, since things may touch the light there.
const INSET: f64 = 0.03;

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
    /// Strata that differ from a neighbour.
    fn changes(&self) -> Bits {
        let mut changes = [0; FINEST];
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

fn count(bits: &Bits) -> u32 {
    bits.iter().map(|row| row.count_ones()).sum()
}

/// What rays to a light found so far.
struct Probe<'a> {
    stage: &'a Stage,
    receiver: &'a Receiver,
    shape: &'a PolygonShape,
    shadows: &'a mut Shadows,
}

impl Probe<'_> {
    /// Weight of the light at `place` of the unit square, and whether it is seen; nothing if it gives no light.
    fn at(&mut self, place: Vec2) -> Option<(f32, bool)> {
        let point = self.shape.at(place)?;
        let weight = self.shape.weight(self.receiver, point) as f32;
        (weight > 0.).then(|| {
            let light = Some(self.shape.instance);
            (
                weight,
                sees(self.stage, self.receiver, point, light, self.shadows),
            )
        })
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
                let place =
                    (Vec2::new(column as f32, row as f32) + stream.square()) / level.size as f32;
                level.known[row] &= !bit;
                level.seen[row] &= !bit;
                if let Some((weight, seen)) = self.at(place) {
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

    /// Whether rays to the light's corners say other than the strata: shadows come in over the border, and one ray a
    /// stratum notices the first tenth of one too seldom.
    fn corners_disagree(&mut self, level: &Level) -> bool {
        let any_seen = level.seen.iter().any(|row| *row != 0);
        let any_blocked = (0..COARSE).any(|row| level.known[row] & !level.seen[row] != 0);
        let vertices = &self.shape.vertices;
        let middle = vertices.iter().sum::<DVec3>() / vertices.len().max(1) as f64;
        let step = vertices.len().div_ceil(CORNERS).max(1);
        let mut disagree = false;
        for vertex in vertices.iter().step_by(step) {
            let corner = vertex.lerp(middle, INSET);
            if self.shape.weight(self.receiver, corner) > 0. {
                disagree |= if self.sees(corner) {
                    any_blocked
                } else {
                    any_seen
                };
            }
        }
        disagree
    }

    /// Strata of the first level's `row` that may be on the light's border.
    fn border(&self, row: usize) -> u32 {
        let outer = row == 0 || row == COARSE - 1;
        if outer || !self.shape.fills_square() {
            (1 << COARSE) - 1
        } else {
            1 | (1 << (COARSE - 1))
        }
    }
}

/// What the ray to a stratum that gives light came to.
struct Answer {
    row: usize,
    bit: u32,
    weight: f32,
    seen: bool,
}

/// Share of the polygon's unoccluded irradiance that reaches `receiver`.
///
/// Sixteen strata and the corners are asked first. If all agree that is the answer; else strata that differ from a neighbour
/// are divided in four and asked afresh, as long as `max_rays` lasts. Fresh rays keep each divided stratum
/// unbiased; the error is that of strata of the finest size along the shadow's outline, at the cost of that outline alone.
pub(super) fn fraction(
    stage: &Stage,
    receiver: &Receiver,
    shape: &PolygonShape,
    max_rays: u32,
    stream: &mut Stream,
    shadows: &mut Shadows,
) -> f32 {
    let before = shadows.rays;
    let mut probe = Probe {
        stage,
        receiver,
        shape,
        shadows,
    };
    let mut asked = [0; FINEST];
    asked[..COARSE].fill((1 << COARSE) - 1);
    let mut level = Level {
        size: COARSE,
        asked,
        seen: [0; FINEST],
        known: [0; FINEST],
    };
    let mut answers = Vec::with_capacity(64);
    probe.ask(&mut level, stream, &mut answers);
    let mut divide = level.changes();
    if probe.corners_disagree(&level) {
        for (row, bits) in divide[..COARSE].iter_mut().enumerate() {
            *bits |= probe.border(row);
        }
    }

    let (mut lit, mut all) = (0., 0.);
    loop {
        let mut again: Bits = std::array::from_fn(|row| divide[row] & level.asked[row]);
        let spent = (probe.shadows.rays - before) as u32;
        if level.size == FINEST || spent + 4 * count(&again) > max_rays {
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
        divide = level.changes();
    }
    if all > 0. {
        lit / all
    } else {
        f32::from(u8::from(probe.vertex_seen()))
    }
}
