//! One blocker's edge between a linear light and a plane, of which everything is known.

mod common;

use common::{sheet, weight};
use glam::{Vec3, vec3};
use rays::World;
use soft_maps::{Light, Options, Receiver, SoftMaps, Transition};

const HEIGHT: f32 = 4.;
const HALF_LENGTH: f32 = 0.5;
/// Height of the blocker, whose edge is at x = 0.
const EDGE: f32 = 1.5;

/// The plane y = −`slope`·x, half covered by a blocker at x < 0.
fn world(slope: f32) -> World {
    let plane = sheet(
        vec3(-8., 8. * slope, -8.),
        vec3(16., -16. * slope, 0.),
        Vec3::Z * 16.,
    );
    let blocker = sheet(vec3(-6., EDGE, -6.), Vec3::X * 6., Vec3::Z * 12.);
    World::new(vec![plane, blocker])
}

fn light() -> [Vec3; 2] {
    [-HALF_LENGTH, HALF_LENGTH].map(|x| vec3(x, HEIGHT, 0.))
}

fn receiver(slope: f32, x: f32, z: f32) -> Receiver {
    let normal = vec3(slope, 1., 0.).normalize();
    Receiver {
        position: vec3(x, -slope * x, z),
        normal,
        face_normal: normal,
    }
}

/// Share of the irradiance past the edge: from where the line over the edge meets the light to its second end.
fn exact(receiver: &Receiver) -> f32 {
    let p = receiver.position;
    let meets = p.x - p.x * (HEIGHT - p.y) / (EDGE - p.y);
    let (mut seen, mut all) = (0., 0.);
    for i in 0..4000 {
        let place = light()[0].lerp(light()[1], (i as f32 + 0.5) / 4000.);
        let weight = weight(receiver, place, None);
        all += weight;
        seen += if place.x > meets { weight } else { 0. };
    }
    (seen / all) as f32
}

/// Receivers in five lines across the penumbra, with what is true there.
fn truth(slope: f32) -> Vec<(Receiver, f32)> {
    let lines = [-1.3, -0.4, 0., 0.77, 2.].into_iter();
    let receivers =
        lines.flat_map(|z| (0..=600).map(move |i| receiver(slope, -1.2 + 0.0045 * i as f32, z)));
    receivers.map(|r| (r, exact(&r))).collect()
}

/// Largest and mean error.
fn errors(slope: f32, truth: &[(Receiver, f32)], options: &Options) -> (f32, f32) {
    let maps =
        SoftMaps::build(&world(slope), &Light::Segment(light()), options).expect("a sound light");
    let stats = maps.stats();
    // Where a strip of the plane one texel wide shows between blocker and background, its outline is missed.
    assert!(10 * stats.undersampled < stats.penumbral, "{stats:?}");
    let (mut worst, mut sum) = (0f32, 0.);
    for (receiver, expected) in truth {
        let seen = maps.fraction(receiver);
        assert!(!seen.flagged, "{receiver:?}");
        let error = (seen.share - expected).abs();
        worst = worst.max(error);
        sum += error;
    }
    (worst, sum / truth.len() as f32)
}

#[test]
fn the_error_is_that_of_the_slope_and_two_texels() {
    for slope in [0., 0.1, 0.25, 0.5, 0.75, 1.] {
        let truth = truth(slope);
        for transition in [Transition::Linear, Transition::Rational] {
            for texel_angle in [0.02, 0.005] {
                for (refinements, samples) in [(0, 2), (5, 2), (5, 3)] {
                    let options = Options {
                        transition,
                        texel_angle,
                        refinements,
                        samples,
                        max_samples: samples,
                        ..Options::default()
                    };
                    let (worst, mean) = errors(slope, &truth, &options);
                    // The penumbra's width is the light's length scaled by the distances from the edge, of which a texel
                    // is a part; with more samples the light between two of them is shorter.
                    let pieces = (samples - 1) as f32;
                    let width = 2. * HALF_LENGTH * EDGE / (HEIGHT - EDGE);
                    let texels = 2. * texel_angle * HEIGHT / width;
                    let of_slope = match transition {
                        Transition::Linear => slope / (4. * pieces * pieces),
                        Transition::Rational => 0.,
                    };
                    println!(
                        "slope {slope} {transition:?} texel {texel_angle} refined {refinements} samples {samples}: worst {worst:.4} mean {mean:.5}"
                    );
                    assert!(
                        worst <= of_slope + texels,
                        "{worst} > {of_slope} + {texels}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_hard_shadow_is_where_it_belongs() {
    // A blocker's edge along the light, at z = 0.3: its shadow's is at z = 0.3·HEIGHT/(HEIGHT − EDGE).
    let blocker = sheet(vec3(-1., EDGE, -3.), Vec3::X * 2., Vec3::Z * 3.3);
    let plane = sheet(vec3(-8., 0., -8.), Vec3::X * 16., Vec3::Z * 16.);
    let world = World::new(vec![plane, blocker]);
    let border = 0.3 * HEIGHT / (HEIGHT - EDGE);
    for texel_angle in [0.02, 0.013, 0.01, 0.007] {
        let options = Options {
            texel_angle,
            ..Options::default()
        };
        let maps = SoftMaps::build(&world, &Light::Segment(light()), &options).unwrap();
        // A texel is texel_angle·HEIGHT wide there; five halvings leave a thirty-second of it.
        let off = texel_angle * HEIGHT / 16.;
        for x in [-0.4, 0., 0.1, 0.5] {
            let inside = maps.fraction(&receiver(0., x, border - off)).share;
            let outside = maps.fraction(&receiver(0., x, border + off)).share;
            assert_eq!((inside, outside), (0., 1.), "texel {texel_angle}, x {x}");
        }
    }
}
