//! Furniture from boxes that touch and never overlap, so that every visible crease is an edge of the mesh.

use super::builder::Builder;
use super::solids::cuboid;

/// Where two boxes would end flush, one stands back by this, metres: flush ones would share an edge of four faces.
const STEP: f32 = 0.003;

/// A top of `thickness` on four square legs, their outer sides flush with it but for a finger's width.
pub(super) fn table(b: &mut Builder, size: [f32; 3], thickness: f32, leg: f32) {
    let [hx, top, hz] = [size[0] / 2.0, size[1], size[2] / 2.0];
    let under = top - thickness;
    cuboid(b, [-hx, under, -hz], [hx, top, hz]);
    let inset = (0.25 * leg).min(0.5 * (hx.min(hz) - leg));
    for (sx, sz) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let (x, z) = (sx * (hx - inset - leg / 2.0), sz * (hz - inset - leg / 2.0));
        cuboid(
            b,
            [x - leg / 2.0, 0.0, z - leg / 2.0],
            [x + leg / 2.0, under, z + leg / 2.0],
        );
    }
}

/// Seat, four legs, two back posts, a rail along the top and upright slats below it; it faces +z.
pub(super) fn chair(b: &mut Builder, size: [f32; 3], seat: f32, slats: u32) {
    let (hx, top, hz) = (size[0] / 2.0, size[1], size[2] / 2.0);
    let (board, leg, rail) = (0.035, 0.04, 0.07);
    let under = seat - board;
    cuboid(b, [-hx, under, -hz], [hx, seat, hz]);
    for (sx, sz) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let (x, z) = (sx * (hx - leg), sz * (hz - leg));
        cuboid(
            b,
            [x - leg / 2.0, 0.0, z - leg / 2.0],
            [x + leg / 2.0, under, z + leg / 2.0],
        );
    }
    let rail_y = (top - rail).max(seat + 0.5 * (top - seat));
    let back = -hz + leg;
    for sx in [-1.0, 1.0] {
        let x = sx * (hx - leg / 2.0);
        let half = leg / 2.0 - STEP;
        let z = -hz + leg / 2.0;
        cuboid(b, [x - half, seat, z - half], [x + half, rail_y, z + half]);
    }
    cuboid(b, [-hx, rail_y, -hz], [hx, top, back]);
    let inner = 2.0 * (hx - leg);
    let width = 0.4 * inner / slats as f32;
    for i in 0..slats {
        let x = -hx + leg + (i as f32 + 0.5) * inner / slats as f32;
        let z = -hz + leg / 2.0;
        cuboid(
            b,
            [x - width / 2.0, seat, z - 0.008],
            [x + width / 2.0, rail_y, z + 0.008],
        );
    }
}

/// Two sides, a back and boards between them, open towards +z.
pub(super) fn shelf(b: &mut Builder, size: [f32; 3], boards: u32, thickness: f32) {
    let (hx, top, hz) = (size[0] / 2.0, size[1], size[2] / 2.0);
    let back = -hz + thickness / 2.0;
    cuboid(b, [-hx, 0.0, -hz], [-hx + thickness, top, hz]);
    cuboid(b, [hx - thickness, 0.0, -hz], [hx, top, hz]);
    let (left, right) = (-hx + thickness, hx - thickness);
    cuboid(b, [left, 0.0, -hz + STEP], [right, top - 0.5 * STEP, back]);
    for i in 0..boards {
        let y = STEP + i as f32 * (top - thickness - 2.0 * STEP) / (boards - 1) as f32;
        cuboid(b, [left, y, back], [right, y + thickness, hz - STEP]);
    }
}

/// A row of upright books; `size` is the row's length and its books' greatest height and depth.
pub(super) fn books(b: &mut Builder, size: [f32; 3], seed: u32, part: u32, of: u32) {
    let [length, height, depth] = size;
    let mut random = Random(u64::from(seed) ^ 0x5eed);
    let mut x = 0.0;
    let mut last = u32::MAX;
    loop {
        let width = height * (0.1 + 0.16 * random.next());
        let tall = height * (0.72 + 0.28 * random.next());
        let deep = depth * (0.7 + 0.3 * random.next());
        let gap = if random.next() < 0.08 {
            1.5 * width
        } else {
            0.004
        };
        let mut turn = (random.next() * of as f32) as u32 % of;
        if turn == last {
            turn = (turn + 1) % of;
        }
        last = turn;
        if x + width > length {
            return;
        }
        if turn == part {
            cuboid(b, [x, 0.0, 0.0], [x + width, tall, deep]);
        }
        x += width + gap;
    }
}

/// Numbers in [0, 1) that are the same everywhere (splitmix64).
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (((z ^ (z >> 31)) >> 40) as f32) / (1 << 24) as f32
    }
}
