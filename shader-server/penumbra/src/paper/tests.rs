//! Volumes leave nothing out.

use crate::{
    blocker::Placed,
    light::{Light, Sampling, Shape},
    mesh::BlockerMesh,
    paper::volume::Volume,
    predicate::Pair,
    strata::mixed,
};
use glam::{Affine3A, DVec3, Vec3, dvec3, vec3};

/// Polygons, receivers and samples tried.
const CASES: usize = 1_000_000;

struct Random(u64);

impl Random {
    fn between(&mut self, low: f32, high: f32) -> f32 {
        self.0 = mixed(self.0);
        low + (high - low) * ((self.0 >> 40) as f32 / (1 << 24) as f32)
    }

    fn point(&mut self, half: f32) -> Vec3 {
        vec3(
            self.between(-half, half),
            self.between(-half, half),
            self.between(-half, half),
        )
    }
}

/// Corners of every kind: plain, slivers, tiny, in a plane that cuts the light, on a grid.
fn corners(random: &mut Random, kind: usize) -> [Vec3; 3] {
    let middle = random.point(1.5) + vec3(0., 0., 1.5);
    match kind % 6 {
        0 | 1 => [0; 3].map(|_| middle + random.point(1.)),
        2 => {
            let (a, along) = (middle, random.point(2.));
            let thin = random.between(0., 1e-4);
            [a, a + along, a + along * 0.5 + random.point(thin)]
        }
        3 => [0; 3].map(|_| middle + random.point(0.01)),
        4 => {
            let [x, y] = [random.between(-0.4, 0.4), random.between(-0.4, 0.4)];
            [
                vec3(x, y, random.between(-1., 0.5)),
                vec3(y, x, random.between(0.2, 2.)),
                vec3(-x, y, random.between(0.2, 2.)),
            ]
        }
        _ => [0; 3].map(|_| (random.point(2.) * 2.).round() * 0.5 + vec3(0., 0., 1.)),
    }
}

#[test]
fn whatever_is_blocked_is_in_the_volumes_and_in_every_box_around_it() {
    let mut random = Random(3);
    let sampling = Sampling {
        samples: 64,
        sets: 2,
        seed: 5,
    };
    let square = [[-0.5, -0.4], [0.5, -0.4], [0.5, 0.4], [-0.5, 0.4]];
    let square = square.map(|[x, y]| dvec3(x, y, 0.)).to_vec();
    let ball = Shape::Ball {
        centre: DVec3::ZERO,
        radius: 0.4,
    };
    let lights = [Shape::Polygon(square), ball].map(|shape| Light::new(shape, sampling));
    let lights = lights.map(|light| light.expect("sound shapes"));
    let (mut blocked, mut cut) = (0, 0);
    for case in 0..CASES {
        let light = &lights[usize::from(case % 5 == 4)];
        let corners = corners(&mut random, case / 5);
        let mesh = BlockerMesh::new(&corners, &[[0, 1, 2]]);
        let Some(polygon) = mesh.polygons.first() else {
            continue;
        };
        let placed = Placed::new(&mesh, &Affine3A::IDENTITY);
        let Some(blocker) = placed.blocker_alone((0, polygon), light) else {
            continue;
        };
        // Behind a place of the polygon as a sample sees it, mostly.
        let (set, sample) = (case as u32 % 2, (case as u32 / 2) % 64);
        let place = Vec3::from(light.local_sample(set, sample));
        let weights = [0; 3].map(|_| random.between(0., 1.));
        let sum: f32 = weights.iter().sum();
        let through = (0..3).map(|i| Vec3::from(blocker.corners[i]) * (weights[i] / sum));
        let at = place + (through.sum::<Vec3>() - place) * random.between(1.001, 4.);
        let at = at.to_array();
        if light.is_planar() && at[2] <= 0. {
            continue;
        }
        let Some(pair) = Pair::new(light, at, &blocker) else {
            continue;
        };
        if !pair.blocks(place.to_array()) {
            continue;
        }
        blocked += 1;
        let size = at
            .iter()
            .fold(blocker.bounds.max_abs(), |most, x| most.max(x.abs()));
        let group = &light.group_bounds[sample as usize / 32];
        for bounds in [&light.bounds, group] {
            let volume = Volume::new(&blocker, bounds, light.is_planar(), size);
            assert!(
                volume.contains(at, volume.all()),
                "case {case}: {corners:?} {at:?}"
            );
            let mut around = crate::light::Box3::EMPTY;
            around.add(at);
            around.add((Vec3::from(at) + random.point(1.)).to_array());
            let active = volume.cut(&around, volume.all());
            assert!(active.is_some(), "case {case}");
            cut += usize::from(active.is_some_and(|planes| planes != volume.all()));
            assert!(active.is_some_and(|planes| volume.contains(at, planes)));
        }
    }
    assert!(blocked > CASES / 3 && cut > 1000, "{blocked} {cut}");
}
