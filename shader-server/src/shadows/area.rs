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

/// Where rays at the corners of the unit square go: a little inside, since things may touch the light there.
const CORNERS: [Vec2; 4] = [
    Vec2::new(0.02, 0.02),
    Vec2::new(0.98, 0.02),
    Vec2::new(0.02, 0.98),
    Vec2::new(0.98, 0.98),
];

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

    /// Asks one ray of each stratum in `level.asked`; puts weights, in row order, into `weights`.
    fn ask(&mut self, level: &mut Level, stream: &mut Stream, weights: &mut Vec<f32>) {
        weights.clear();
        for row in 0..level.size {
            let mut asked = level.asked[row];
            while asked != 0 {
                let column = asked.trailing_zeros();
                asked &= asked - 1;
                let place =
                    (Vec2::new(column as f32, row as f32) + stream.square()) / level.size as f32;
                let answer = self.at(place);
                let bit = 1 << column;
                level.known[row] &= !bit;
                level.seen[row] &= !bit;
                if let Some((_, seen)) = answer {
                    level.known[row] |= bit;
                    level.seen[row] |= if seen { bit } else { 0 };
                }
                weights.push(answer.map_or(0., |(weight, _)| weight));
            }
        }
    }
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
    let full = (1 << COARSE) - 1;
    let mut asked = [0; FINEST];
    asked[..COARSE].fill(full);
    let mut level = Level {
        size: COARSE,
        asked,
        seen: [0; FINEST],
        known: [0; FINEST],
    };
    let mut weights = Vec::with_capacity(64);
    probe.ask(&mut level, stream, &mut weights);
    let mut divide = level.changes();
    for row in border_to_divide(&mut probe, &level) {
        divide[row.0] |= row.1;
    }

    let (mut lit, mut all) = (0., 0.);
    loop {
        let spent = (probe.shadows.rays - before) as u32;
        let affordable = spent + 4 * count_both(&divide, &level.asked) <= max_rays;
        let last = level.size == FINEST || !affordable;
        let area = 1. / (level.size * level.size) as f32;
        let mut index = 0;
        for row in 0..level.size {
            let divided = if last { 0 } else { divide[row] };
            let mut asked = level.asked[row];
            while asked != 0 {
                let bit = asked & asked.wrapping_neg();
                asked ^= bit;
                if divided & bit == 0 {
                    all += area * weights[index];
                    lit += if level.seen[row] & bit != 0 {
                        area * weights[index]
                    } else {
                        0.
                    };
                }
                index += 1;
            }
        }
        let again: Bits = std::array::from_fn(|row| divide[row] & level.asked[row]);
        if last || count(&again) == 0 {
            break;
        }
        level = level.divide(&again);
        probe.ask(&mut level, stream, &mut weights);
        divide = level.changes();
    }
    if all > 0. {
        lit / all
    } else {
        f32::from(u8::from(vertex_seen(&mut probe)))
    }
}

/// Whether the receiver sees the first vertex that gives it light: of a light almost below the horizon no stratum may.
fn vertex_seen(probe: &mut Probe<'_>) -> bool {
    let gives = |v: &&DVec3| probe.shape.weight(probe.receiver, **v) > 0.;
    let light = Some(probe.shape.instance);
    probe
        .shape
        .vertices
        .iter()
        .find(gives)
        .is_some_and(|vertex| sees(probe.stage, probe.receiver, *vertex, light, probe.shadows))
}

fn count_both(a: &Bits, b: &Bits) -> u32 {
    a.iter().zip(b).map(|(a, b)| (a & b).count_ones()).sum()
}

/// Strata on the light's border, as rows of bits, if a ray to a corner disagrees with what the strata say: shadows come in
/// over the border, and one ray a stratum sees the first tenth of them too seldom.
fn border_to_divide(probe: &mut Probe<'_>, level: &Level) -> impl Iterator<Item = (usize, u32)> {
    let any_seen = level.seen.iter().any(|row| *row != 0);
    let any_blocked = level
        .seen
        .iter()
        .zip(&level.known)
        .any(|(seen, known)| known & !seen != 0);
    let mut disagrees = false;
    let corners: &[Vec2] = if probe.shape.fills_square() {
        &CORNERS
    } else {
        &[]
    };
    let vertices = if corners.is_empty() {
        probe.shape.vertices.len()
    } else {
        0
    };
    for corner in corners {
        let seen = probe.at(*corner).map(|(_, seen)| seen);
        disagrees |= seen == Some(true) && any_blocked || seen == Some(false) && any_seen;
    }
    let step = vertices.div_ceil(8).max(1);
    for vertex in (0..vertices).step_by(step) {
        let middle: DVec3 = probe.shape.vertices.iter().sum::<DVec3>() / vertices as f64;
        let point = probe.shape.vertices[vertex].lerp(middle, 0.03);
        if probe.shape.weight(probe.receiver, point) > 0. {
            let light = Some(probe.shape.instance);
            let seen = sees(probe.stage, probe.receiver, point, light, probe.shadows);
            disagrees |= if seen { any_blocked } else { any_seen };
        }
    }
    let full = (1u32 << COARSE) - 1;
    let ends = 1 | (1 << (COARSE - 1));
    let whole = !probe.shape.fills_square();
    (0..COARSE).filter(move |_| disagrees).map(move |row| {
        (
            row,
            if whole || row == 0 || row == COARSE - 1 {
                full
            } else {
                ends
            },
        )
    })
}
