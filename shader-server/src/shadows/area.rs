//! Visible share of a polygon, by strata that are divided where light meets shadow.

use glam::{DVec3, Vec2};

use crate::{
    lights::{PolygonShape, Receiver},
    random::Stream,
    stage::Stage,
};

use super::{
    Shadows,
    rays::{ShadowRays, sees},
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
        let differs = |row: usize, from: Option<bool>, columns: u32| match from {
            Some(true) => self.known[row] & !self.seen[row] & columns,
            Some(false) => self.known[row] & self.seen[row] & columns,
            None => 0,
        };
        changes[0] |= differs(0, beyond.bottom, u32::MAX);
        changes[last] |= differs(last, beyond.top, u32::MAX);
        for (row, changes) in changes[..self.size].iter_mut().enumerate() {
            *changes |= differs(row, beyond.left, 1) | differs(row, beyond.right, 1 << last);
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

    fn disagrees_with(&self, corners: &[Option<bool>]) -> bool {
        let any_seen = self.seen.iter().any(|row| *row != 0);
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
    u32::MAX >> (FINEST - size)
}

fn count(bits: &Bits) -> u32 {
    bits.iter().map(|row| row.count_ones()).sum()
}

/// What the light's corners say of each side of the square: whether both its ends are seen, if they agree.
///
/// Shadows come in over the border, and one ray a stratum notices the first tenth of one too seldom.
#[derive(Default)]
struct Beyond {
    bottom: Option<bool>,
    right: Option<bool>,
    top: Option<bool>,
    left: Option<bool>,
}

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
        let both = |i: usize, j: usize| {
            let (a, b) = (
                corners.get(i).copied().flatten(),
                corners.get(j).copied().flatten(),
            );
            if a == b { a } else { None }
        };
        Self {
            bottom: both(0, 1),
            right: both(1, 2),
            top: both(2, 3),
            left: both(3, 0),
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
/// The first strata and the corners are asked first. If all agree that is the answer; else strata that differ from a neighbour
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
    let corners = probe.corners();
    let beyond = if shape.fills_square() {
        Beyond::new(&corners)
    } else {
        Beyond::default()
    };
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
