//! Shadow events in an order in which neighbours follow each other, so that what one needs of a tree is there for the next.

use glam::DVec3;

use super::wedge::Event;

/// Bits of a coordinate.
const BITS: u32 = 10;

/// Sorts events along a curve that fills the box (object space) of their blocker; those in one place stay as they are.
pub(super) fn sort(events: &mut [Event], [low, high]: [DVec3; 2]) {
    let cells = f64::from((1u32 << BITS) - 1);
    let size = (high - low).max(DVec3::splat(f64::MIN_POSITIVE));
    events.sort_by_cached_key(|event| {
        let share = (event.wedge.blocker[0] - low) / size;
        // What is not a number becomes 0.
        let cell = share.to_array().map(|x| (x.clamp(0.0, 1.0) * cells) as u32);
        spread(cell[0]) | spread(cell[1]) << 1 | spread(cell[2]) << 2
    });
}

/// Two zeros between each two bits.
fn spread(x: u32) -> u32 {
    (0..BITS).fold(0, |all, bit| all | (x >> bit & 1) << (3 * bit))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shadows::wedge::{EventKind, Wedge};

    fn event(x: f64, y: f64, z: f64) -> Event {
        Event {
            wedge: Wedge {
                light: [DVec3::ZERO; 2],
                blocker: [DVec3::new(x, y, z), DVec3::ONE],
            },
            kind: EventKind::Hard,
            vertices: [0; 2],
            corners: [0; 2],
        }
    }

    #[test]
    fn octants_follow_each_other_and_nothing_is_lost() {
        let corners = (0..64).map(|i: u32| {
            let [x, y, z] = [i * 7 % 4, i * 5 / 4 % 4, i / 16].map(|c| f64::from(c) * 0.3);
            event(x, y, z)
        });
        let mut events: Vec<Event> = corners.collect();
        let broken = event(f64::NAN, 0.0, 0.0);
        events.push(broken);
        let key = |e: &Event| e.wedge.blocker[0].to_array().map(f64::to_bits);
        let mut before: Vec<_> = events.iter().map(key).collect();
        sort(&mut events, [DVec3::ZERO, DVec3::splat(0.9)]);
        let octant = |e: &Event| e.wedge.blocker[0].cmpge(DVec3::splat(0.45)).bitmask();
        let octants: Vec<u32> = events.iter().map(octant).collect();
        assert!(octants.is_sorted() && octants.contains(&7), "{octants:?}");
        let mut after: Vec<_> = events.iter().map(key).collect();
        before.sort_unstable();
        after.sort_unstable();
        assert_eq!(before, after);
    }
}
