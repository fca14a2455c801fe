//! Events against how much of the light is seen from a floor.

use glam::DVec2;

use super::*;
use crate::shadows::wedge::EventKind;

/// Where a wedge meets the floor `y = floor` if all of its lines go down.
fn on_floor(e: &Event, floor: f64) -> [DVec2; 2] {
    [0.0, 1.0].map(|s| {
        let (a, b) = (e.wedge.at(s, 0.0), e.wedge.at(s, 1.0));
        assert!(a.y > b.y && b.y >= floor - 1e-9);
        let p = a + (b - a) * ((floor - a.y) / (b.y - a.y));
        DVec2::new(p.x, p.z)
    })
}

fn curves(events: &[Event], kind: EventKind, floor: f64) -> Vec<[DVec2; 2]> {
    let kind = events.iter().filter(|e| e.kind == kind);
    kind.map(|e| on_floor(e, floor)).collect()
}

fn distance(p: DVec2, [a, b]: [DVec2; 2]) -> f64 {
    let d = b - a;
    let t = if d == DVec2::ZERO {
        0.0
    } else {
        ((p - a).dot(d) / d.length_squared()).clamp(0.0, 1.0)
    };
    p.distance(a + d * t)
}

fn cross([p, q]: [DVec2; 2], [a, b]: [DVec2; 2]) -> bool {
    let side = |a: DVec2, b: DVec2, p: DVec2| (b - a).perp_dot(p - a) > 0.0;
    side(p, q, a) != side(p, q, b) && side(a, b, p) != side(a, b, q)
}

/// A segment is cut by a triangle.
fn blocked(from: DVec3, to: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
    let volume = |a: DVec3, b: DVec3, c: DVec3| (a - from).cross(b - from).dot(c - from) > 0.0;
    let side = |p: DVec3| (b - a).cross(c - a).dot(p - a) > 0.0;
    if side(from) == side(to) {
        return false;
    }
    let lines = [(a, b), (b, c), (c, a)].map(|(a, b)| volume(to, a, b));
    lines[0] == lines[1] && lines[1] == lines[2]
}

/// Which share of a light of four vertices is seen from a point of the floor, by `n` by `n` lines that take in its rim.
fn seen(triangles: &[[DVec3; 3]], light: &ShadowLight, p: DVec3, n: u32) -> f64 {
    let v = light.vertices();
    let mut count = 0;
    for i in 0..n {
        for j in 0..n {
            // Just inside: on the rim itself a line may graze what does not hide anything.
            let [s, t] = [i, j].map(|k| 1e-4 + (1.0 - 2e-4) * f64::from(k) / f64::from(n - 1));
            let q = v[0].lerp(v[1], s).lerp(v[3].lerp(v[2], s), t);
            count += u32::from(!triangles.iter().any(|f| blocked(p, q, *f)));
        }
    }
    f64::from(count) / f64::from(n * n)
}

/// Whether a part of the light is hidden from a point that both light and triangles are above: whether a triangle overlaps it,
/// seen from there. Unlike trying lines, this finds the thinnest slivers.
fn is_partly_hidden(triangles: &[[DVec3; 3]], light: &ShadowLight, p: DVec3) -> bool {
    let light: Vec<DVec3> = light.vertices().iter().map(|v| *v - p).collect();
    triangles.iter().any(|t| overlap(&light, &t.map(|v| v - p)))
}

/// Whether two cones from the origin overlap: no plane along a side of one, or along a corner of each, separates them.
fn overlap(a: &[DVec3], b: &[DVec3]) -> bool {
    let sides = |of: &[DVec3]| {
        let next = of.iter().cycle().skip(1);
        of.iter()
            .zip(next)
            .map(|(p, q)| p.cross(*q))
            .collect::<Vec<_>>()
    };
    let corners = a.iter().flat_map(|p| b.iter().map(|q| p.cross(*q)));
    let range = |of: &[DVec3], n: DVec3| {
        let along = of.iter().map(|p| p.dot(n));
        along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
            (l.min(x), h.max(x))
        })
    };
    sides(a)
        .into_iter()
        .chain(sides(b))
        .chain(corners)
        .all(|n| {
            let slack = 1e-12 * n.length();
            let ((a_low, a_high), (b_low, b_high)) = (range(a, n), range(b, n));
            !(a_high <= slack && b_low >= -slack || b_high <= slack && a_low >= -slack)
        })
}

struct Stage {
    triangles: Vec<[DVec3; 3]>,
    light: ShadowLight,
    events: Vec<Event>,
    floor: f64,
}

impl Stage {
    /// A mesh within a distance of about two of the origin, under a square light.
    fn new(mesh: &Mesh, next: &mut impl FnMut(f64, f64) -> f64) -> Self {
        let fixture = Fixture::new(mesh);
        let centre = DVec3::new(next(-1.5, 1.5), next(5.0, 8.0), next(-1.5, 1.5));
        let tilt = DQuat::from_euler(EulerRot::YXZ, next(-3.0, 3.0), next(1.3, 1.8), 0.0);
        let light = polygon(4, centre, next(0.3, 1.2), tilt);
        assert!(light.normal().y < 0.0);
        let events = fixture.find(&light, EventOptions { back_hidden: true });
        let at = |v: u32| DVec3::from(mesh.positions[v as usize].map(f64::from));
        Self {
            triangles: mesh.faces.iter().map(|f| f.map(at)).collect(),
            light,
            events,
            floor: -next(2.2, 4.0),
        }
    }

    fn seen(&self, p: DVec2, n: u32) -> f64 {
        seen(
            &self.triangles,
            &self.light,
            DVec3::new(p.x, self.floor, p.y),
            n,
        )
    }

    fn is_whole(&self, p: DVec2) -> bool {
        !is_partly_hidden(
            &self.triangles,
            &self.light,
            DVec3::new(p.x, self.floor, p.y),
        )
    }

    /// Between points with no curve of a kind between them, the light does not go out (umbral) or cease to be hidden
    /// (penumbral). Returns how many pairs of points there were where it was so on both sides.
    fn check(
        &self,
        kind: EventKind,
        name: &str,
        next: &mut impl FnMut(f64, f64) -> f64,
    ) -> [usize; 2] {
        let curves = curves(&self.events, kind, self.floor);
        let away = |p: DVec2| curves.iter().all(|c| distance(p, *c) > 0.05);
        let mut pairs = [0; 2];
        for _ in 0..250 {
            let p = DVec2::new(next(-4.0, 4.0), next(-4.0, 4.0));
            let q = p + DVec2::new(next(-1.0, 1.0), next(-1.0, 1.0));
            if !away(p) || !away(q) || curves.iter().any(|c| cross([p, q], *c)) {
                continue;
            }
            let [a, b] = [p, q].map(|p| match kind {
                EventKind::Umbral => self.seen(p, 16) == 0.0,
                _ => self.is_whole(p),
            });
            assert_eq!(a, b, "{name}, {kind:?}: {p} and {q} under {:?}", self.light);
            pairs[usize::from(a)] += 1;
        }
        pairs
    }
}

fn turned_blocker(mesh: &Mesh, next: &mut impl FnMut(f64, f64) -> f64) -> Mesh {
    meshes::turned(mesh, turn(next))
}

proptest! {
    #![proptest_config(config(6))]

    /// What hides a part of the light is a union of what faces hide, whose rims are VE and EV events: also for concave, open and
    /// non-manifold blockers nothing but penumbral events bounds it.
    #[test]
    fn outside_of_penumbral_events_the_light_is_whole(seed in any::<u64>()) {
        let mut next = rng(seed);
        let mut pairs = [0; 2];
        for name in ["cube", "l", "star", "frame", "flat l", "flat star", "flat frame", "bow tie", "fin", "book"] {
            let mesh = meshes::all().into_iter().find(|m| m.0 == name).unwrap().1;
            let stage = Stage::new(&turned_blocker(&mesh, &mut next), &mut next);
            let found = stage.check(EventKind::Penumbral, name, &mut next);
            pairs = [pairs[0] + found[0], pairs[1] + found[1]];
        }
        prop_assert!(pairs[0] > 50 && pairs[1] > 50, "{:?}", pairs);
    }

    /// The same for umbrae of convex blockers, and of flat ones whose openings are convex or nearly whole.
    #[test]
    fn the_light_goes_out_at_umbral_events(seed in any::<u64>()) {
        let mut next = rng(seed);
        let mut pairs = [0; 2];
        for name in ["cube", "sphere", "flat l", "flat star", "flat frame"] {
            let mesh = meshes::all().into_iter().find(|m| m.0 == name).unwrap().1;
            let mesh = if name.starts_with("flat") {
                // Nearly across the light, so that it casts an umbra.
                let tilt = DQuat::from_euler(EulerRot::YXZ, next(-3.0, 3.0), next(-0.3, 0.3), 0.0);
                meshes::turned(&mesh, tilt)
            } else {
                turned_blocker(&mesh, &mut next)
            };
            let mut stage = Stage::new(&mesh, &mut next);
            // Near enough for umbrae in corners and around holes.
            stage.floor = -1.7;
            let found = stage.check(EventKind::Umbral, name, &mut next);
            pairs = [pairs[0] + found[0], pairs[1] + found[1]];
        }
        prop_assert!(pairs[0] > 50 && pairs[1] > 20, "{:?}", pairs);
    }

    /// Penumbral events of a convex blocker close: each line from light vertex to blocker vertex ends an even number
    /// of events, and each curve has the whole light on one side only.
    #[test]
    fn penumbral_events_of_convex_blockers_close(seed in any::<u64>()) {
        let mut next = rng(seed);
        for name in ["cube", "sphere"] {
            let mesh = meshes::all().into_iter().find(|m| m.0 == name).unwrap().1;
            for aligned in [false, true] {
                let mesh = if aligned { mesh.clone() } else { turned_blocker(&mesh, &mut next) };
                let mut stage = Stage::new(&mesh, &mut next);
                if aligned {
                    let y = next(3.0, 6.0) as f32;
                    let square = [[-0.5, y, -0.5], [0.5, y, -0.5], [0.5, y, 0.5], [-0.5, y, 0.5]];
                    stage.light = ShadowLight::polygon(&square);
                    prop_assert!(stage.light.normal().y < 0.0);
                    let options = EventOptions { back_hidden: true };
                    stage.events = Fixture::new(&mesh).find(&stage.light, options);
                }
                let mut ends = std::collections::HashMap::new();
                for e in stage.events.iter().filter(|e| e.kind == EventKind::Penumbral) {
                    for k in 0..2 {
                        *ends.entry((e.corners[k], e.vertices[k])).or_insert(0) += 1;
                    }
                }
                prop_assert!(ends.len() >= 4);
                prop_assert!(ends.values().all(|n| *n == 2), "{} {:?}", name, ends);
                let curves = curves(&stage.events, EventKind::Penumbral, stage.floor);
                for _ in 0..100 {
                    let p = DVec2::new(next(-4.0, 4.0), next(-4.0, 4.0));
                    if curves.iter().any(|c| distance(p, *c) < 0.05) {
                        continue;
                    }
                    let far = DVec2::new(1e3, 17.3);
                    let inside = curves.iter().filter(|c| cross([p, far], **c)).count() % 2 == 1;
                    prop_assert_eq!(!stage.is_whole(p), inside);
                    // Lines may miss a sliver, but see nothing hidden outside.
                    prop_assert!(inside || stage.seen(p, 16) == 1.0);
                }
            }
        }
    }

    /// A light of width `l` at height `h` over the floor and an edge at height `d`: `l d / (h - d)`, nothing at contact.
    #[test]
    fn penumbrae_are_as_wide_as_similar_triangles_say(h in 2.5..9.0_f64, l in 0.1..1.5_f64) {
        let fixture = Fixture::new(&test_meshes::cube());
        for d in [0.0, 0.01, 0.5, 1.5] {
            let floor = 1.0 - d;
            let (y, r) = ((floor + h) as f32, (0.5 * l) as f32);
            let light = ShadowLight::polygon(&[[-r, y, -r], [r, y, -r], [r, y, r], [-r, y, r]]);
            let events = fixture.find(&light, EventOptions { back_hidden: true });
            // Where the curves cross the floor's middle line, farthest out.
            let place = |kind| {
                let curves: Vec<_> = events.iter().filter(|e| e.kind == kind).map(|e| on_floor(e, floor)).collect();
                let line = [DVec2::new(0.0, 0.013), DVec2::new(99.0, 0.013)];
                let crossed = curves.iter().filter(|c| cross(line, **c));
                let x = crossed.map(|[a, b]| a.x + (b.x - a.x) * (0.013 - a.y) / (b.y - a.y));
                let xs: Vec<f64> = x.collect();
                (xs.len(), xs.iter().copied().fold(f64::NEG_INFINITY, f64::max))
            };
            let (outer, inner) = (place(EventKind::Penumbral), place(EventKind::Umbral));
            prop_assert_eq!((outer.0, inner.0), (1, 1));
            let width = l * d / (h - d);
            prop_assert!((outer.1 - inner.1 - width).abs() < 1e-5 * (1.0 + width), "{} {:?} {:?}", width, outer, inner);
        }
    }
}
