use proptest::prelude::*;

use super::*;

fn checker() -> Texture {
    Texture {
        width: 2,
        height: 2,
        rgb: vec![[255, 0, 0], [0, 255, 0], [0, 0, 255], [188; 3]],
    }
}

/// Grey texels from a hash of their place.
fn noise(width: u32, height: u32) -> Texture {
    let code = |i: u32| (i.wrapping_mul(2_654_435_761) >> 24) as u8;
    Texture {
        width,
        height,
        rgb: (0..width * height).map(|i| [code(i); 3]).collect(),
    }
}

#[test]
fn texel_centres_give_texels_and_v_points_up() {
    let map = Map::new(&checker());
    assert_eq!(map.bilinear(Vec2::new(0.25, 0.75)), Vec3::X);
    assert_eq!(map.bilinear(Vec2::new(0.75, 0.75)), Vec3::Y);
    assert_eq!(map.bilinear(Vec2::new(0.25, 0.25)), Vec3::Z);
    assert!((map.bilinear(Vec2::new(0.75, 0.25)) - 0.5029).length() < 1e-3);
}

#[test]
fn it_repeats_and_blends_in_linear_light() {
    let map = Map::new(&checker());
    for uv in [[0.25, 0.75], [0.1, 0.9], [0.5, 0.3]] {
        let uv = Vec2::from(uv);
        let moved = uv + Vec2::new(-3., 5.);
        assert!((map.bilinear(uv) - map.bilinear(moved)).length() < 1e-5);
    }
    let half = Vec3::new(0.5, 0.5, 0.);
    assert_eq!(map.bilinear(Vec2::new(0.5, 0.75)), half);
    assert_eq!(map.bilinear(Vec2::new(0., 0.75)), half);
    // Just below a whole number, where adding one rounds to it.
    assert!((map.bilinear(Vec2::new(-1e-9, 0.75)) - half).length() < 1e-5);
}

#[test]
fn broken_input_is_black() {
    let map = Map::new(&checker());
    let (nan, wide) = (Vec2::new(f32::NAN, 0.), Vec2::splat(f32::INFINITY));
    assert_eq!(map.bilinear(nan), Vec3::ZERO);
    assert_eq!(map.filtered(nan, &Footprint::default()), Vec3::ZERO);
    let endless = Footprint {
        across: wide,
        along: wide,
    };
    assert_eq!(map.filtered(Vec2::ZERO, &endless), Vec3::ZERO);
    let empty = Map::new(&Texture {
        width: 3,
        height: 3,
        rgb: vec![],
    });
    assert_eq!(empty.bilinear(Vec2::ZERO), Vec3::ZERO);
    assert_eq!(empty.mean(), Vec3::ZERO);
}

#[test]
fn every_copy_has_the_mean_of_the_first_whatever_its_size() {
    for (width, height) in [(64, 64), (7, 5), (1, 9), (100, 3)] {
        let map = Map::new(&noise(width, height));
        let texels = &map.levels[0].texels;
        let mean = texels.iter().map(|t| f64::from(t.x)).sum::<f64>() / texels.len() as f64;
        for level in &map.levels {
            let sum: f64 = level.texels.iter().map(|t| f64::from(t.x)).sum();
            assert!((sum / level.texels.len() as f64 - mean).abs() < 1e-4);
        }
        assert!((f64::from(map.mean().x) - mean).abs() < 1e-4);
    }
}

/// The mean over a footprint by its definition: bilinear look-ups on a fine grid.
fn averaged(map: &Map, uv: Vec2, footprint: &Footprint) -> f64 {
    const SIDE: usize = 48;
    let mut sum = 0.0;
    for i in 0..SIDE {
        for k in 0..SIDE {
            let [a, b] = [i, k].map(|s| (s as f32 + 0.5) / SIDE as f32 - 0.5);
            let at = uv + footprint.across * a + footprint.along * b;
            sum += f64::from(map.bilinear(at).x);
        }
    }
    sum / (SIDE * SIDE) as f64
}

#[test]
fn a_footprint_is_about_averaged_over() {
    let map = Map::new(&noise(128, 128));
    let spread = 0.35;
    for (across, along) in [
        (2.0, 2.0),
        (4.0, 8.0),
        (16.0, 3.0),
        (30.0, 30.0),
        (1.0, 4.0),
    ] {
        let footprint = Footprint {
            across: Vec2::new(across, 0.2 * across) / 128.,
            along: Vec2::new(-0.3 * along, along) / 128.,
        };
        let (mut error, mut plain) = (0.0, 0.0);
        for k in 0..50 {
            let uv = Vec2::new(0.137 * k as f32, 0.311 * k as f32);
            let wanted = averaged(&map, uv, &footprint);
            error += (f64::from(map.filtered(uv, &footprint).x) - wanted).powi(2);
            plain += (f64::from(map.bilinear(uv).x) - wanted).powi(2);
        }
        // A probe is not a box, and its texels may be up to 1.4 times too wide or too narrow: on noise, the worst map, that
        // leaves a part of the error of a single look-up.
        assert!(error < spread * plain, "{across} {along}: {error} {plain}");
    }
}

proptest! {
    #[test]
    fn what_is_found_lies_between_the_darkest_and_the_brightest_texel(
        u in -20.0f32..20.0, v in -20.0f32..20.0, sides in proptest::array::uniform4(-3.0f32..3.0),
    ) {
        let map = Map::new(&noise(17, 6));
        let footprint = Footprint {
            across: Vec2::new(sides[0], sides[1]),
            along: Vec2::new(sides[2], sides[3]),
        };
        let found = map.filtered(Vec2::new(u, v), &footprint).x;
        let texels = map.levels[0].texels.iter().map(|t| t.x);
        let (low, high) = texels.fold((1.0f32, 0.0f32), |(l, h), t| (l.min(t), h.max(t)));
        prop_assert!(found >= low - 1e-5 && found <= high + 1e-5);
    }

    #[test]
    fn a_flat_map_is_flat_over_any_footprint(u in -1e6f32..1e6, side in 0.0f32..1e6) {
        let map = Map::new(&Texture { width: 5, height: 4, rgb: vec![[128; 3]; 20] });
        let footprint = Footprint { across: Vec2::new(side, 1.0), along: Vec2::new(0.1, side) };
        let found = map.filtered(Vec2::new(u, -u), &footprint);
        prop_assert!((found - map.mean()).length() < 1e-4);
    }
}
