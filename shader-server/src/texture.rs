//! Texture look-up.

use std::sync::LazyLock;

use glam::Vec3;
use protocol::scene::Texture;

/// Linear value of each sRGB code.
static DECODED: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|code| {
        let encoded = code as f64 / 255.;
        let linear = if encoded <= 0.040_45 {
            encoded / 12.92
        } else {
            ((encoded + 0.055) / 1.055).powf(2.4)
        };
        linear as f32
    })
});

/// Linear colour of `texture` at `uv` (v up, repeating), bilinear between texel centres. Black if the texture has no texels
/// or `uv` is not finite.
#[must_use]
pub fn bilinear(texture: &Texture, uv: [f32; 2]) -> Vec3 {
    let (width, height) = (texture.width as usize, texture.height as usize);
    if texture.rgb.len() < width * height || width * height == 0 {
        return Vec3::ZERO;
    }
    if !uv[0].is_finite() || !uv[1].is_finite() {
        return Vec3::ZERO;
    }
    let (x0, x1, fx) = taps(uv[0], width);
    let (y0, y1, fy) = taps(1. - uv[1].rem_euclid(1.), height);
    let texel = |x: usize, y: usize| {
        let code = texture.rgb[y * width + x];
        Vec3::from(code.map(|c| DECODED[usize::from(c)]))
    };
    let upper = texel(x0, y0).lerp(texel(x1, y0), fx);
    let lower = texel(x0, y1).lerp(texel(x1, y1), fx);
    upper.lerp(lower, fy)
}

/// The two texels around a coordinate in units of the texture's size, and the weight of the second.
fn taps(coordinate: f32, size: usize) -> (usize, usize, f32) {
    let place = coordinate.rem_euclid(1.) * size as f32 - 0.5;
    let floor = place.floor();
    let first = (floor as i64).rem_euclid(size as i64) as usize;
    (first, (first + 1) % size, place - floor)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checker() -> Texture {
        Texture {
            width: 2,
            height: 2,
            rgb: vec![[255, 0, 0], [0, 255, 0], [0, 0, 255], [188; 3]],
        }
    }

    #[test]
    fn texel_centres_give_texels_and_v_points_up() {
        let t = checker();
        assert_eq!(bilinear(&t, [0.25, 0.75]), Vec3::X);
        assert_eq!(bilinear(&t, [0.75, 0.75]), Vec3::Y);
        assert_eq!(bilinear(&t, [0.25, 0.25]), Vec3::Z);
        assert!((bilinear(&t, [0.75, 0.25]) - 0.5029).length() < 1e-3);
    }

    #[test]
    fn it_repeats_and_blends_in_linear_light() {
        let t = checker();
        for uv in [[0.25, 0.75], [0.1, 0.9], [0.5, 0.3]] {
            let moved = [uv[0] - 3., uv[1] + 5.];
            assert!((bilinear(&t, uv) - bilinear(&t, moved)).length() < 1e-5);
        }
        assert_eq!(bilinear(&t, [0.5, 0.75]), Vec3::new(0.5, 0.5, 0.));
        assert_eq!(bilinear(&t, [0., 0.75]), Vec3::new(0.5, 0.5, 0.));
    }

    #[test]
    fn broken_input_is_black() {
        assert_eq!(bilinear(&checker(), [f32::NAN, 0.]), Vec3::ZERO);
        let empty = Texture {
            width: 3,
            height: 3,
            rgb: vec![],
        };
        assert_eq!(bilinear(&empty, [0., 0.]), Vec3::ZERO);
    }
}
