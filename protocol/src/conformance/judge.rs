//! What a sample should hold, held against what it holds.

use std::f64::consts::{FRAC_1_PI, PI};

use crate::messages::{Camera, NO_OBJECT, SampleRequest, flags};
use crate::scene::{Light, Scene};

use super::Checked;
use super::check::{ensure, failed};
use super::peer::Answer;
use super::world::{Hit, Thing, V, add, between, dot, first, length, ray, scaled, sub, unit, wide};

/// Error of a position, as a share of 1 m and the distance from the eye: single precision leaves a hundredth of it.
const PLACE: f64 = 1e-4;
/// Error of a radiance that can be computed, relative.
const RADIANCE: f64 = 1e-3;
/// Error of a radiance that is one product.
pub(super) const EXACT: f64 = 1e-5;

/// The request's ray, and what it meets; nothing if it passes too close to a border to be sure.
pub(super) fn seen(
    scene: &Scene,
    camera: &Camera,
    request: &SampleRequest,
) -> Option<((V, V), Option<Hit>)> {
    let (origin, direction) = ray(camera, request);
    let hit = first(scene, origin, direction, (0.0, f64::INFINITY))?;
    Some(((origin, direction), hit))
}

/// An aspect of a sample: the scene, the answer, its ray and what that meets.
pub(super) type Aspect = fn(&Scene, &Answer, (V, V), Option<&Hit>) -> Checked;

/// Looks at one aspect of all answers that are clear, of which there must be some.
pub(super) fn judge(scene: &Scene, answers: &[Answer], aspect: Aspect) -> Checked {
    let mut clear = 0;
    for answer in answers {
        if let Some((ray, hit)) = seen(scene, &answer.camera, &answer.request) {
            aspect(scene, answer, ray, hit.as_ref())?;
            clear += 1;
        }
    }
    let enough = clear * 2 > answers.len();
    ensure(
        enough,
        || "requests that are clear: a defect of these checks".into(),
        || format!("{clear} of {}", answers.len()),
    )
}

fn request_of(answer: &Answer) -> String {
    let r = &answer.request;
    let [x, y] = [(r.x, r.offset[0]), (r.y, r.offset[1])].map(|(p, o)| f64::from(p) + f64::from(o));
    format!("for sample {} through ({x}, {y})", r.id)
}

/// The position is on the ray, in front of the eye; for a miss it is the ray's direction.
pub(super) fn on_the_ray(
    _: &Scene,
    answer: &Answer,
    (origin, direction): (V, V),
    _: Option<&Hit>,
) -> Checked {
    let position = wide(answer.sample.position);
    if answer.sample.flags & flags::MISS != 0 {
        let off = length(sub(unit(position), direction));
        return ensure(
            off < PLACE,
            || format!("direction {direction:?} {}", request_of(answer)),
            || format!("{position:?}"),
        );
    }
    let to = sub(position, origin);
    let along = dot(to, direction);
    let off = length(sub(to, scaled(direction, along)));
    ensure(
        along > 0.0 && off < PLACE * (1.0 + along),
        || {
            format!(
                "a position on the ray {origin:?} + t {direction:?} {}",
                request_of(answer)
            )
        },
        || format!("{position:?}, {off} m off"),
    )
}

/// The position is where the ray meets the first surface.
pub(super) fn on_the_surface(_: &Scene, answer: &Answer, _: (V, V), hit: Option<&Hit>) -> Checked {
    let Some(hit) = hit else { return Ok(()) };
    let position = wide(answer.sample.position);
    let off = length(sub(position, hit.at));
    ensure(
        off < PLACE * (1.0 + hit.distance),
        || format!("position {:?} {}", hit.at, request_of(answer)),
        || format!("{position:?}"),
    )
}

/// The index names what the ray meets.
pub(super) fn named(_: &Scene, answer: &Answer, _: (V, V), hit: Option<&Hit>) -> Checked {
    let index = match hit.map(|hit| hit.thing) {
        Some(Thing::Object(index) | Thing::Light(index)) => index,
        _ => NO_OBJECT,
    };
    ensure(
        answer.sample.object == index,
        || format!("object {index} {}", request_of(answer)),
        || answer.sample.object.to_string(),
    )
}

/// Misses and lights are flagged, and nothing else is.
pub(super) fn flagged(_: &Scene, answer: &Answer, _: (V, V), hit: Option<&Hit>) -> Checked {
    let expected = match hit.map(|hit| hit.thing) {
        Some(Thing::Light(_)) => flags::LIGHT,
        Some(Thing::Object(_)) => 0,
        _ => flags::MISS,
    };
    let came = answer.sample.flags;
    ensure(
        came & (flags::MISS | flags::LIGHT) == expected,
        || format!("flags {expected} {}", request_of(answer)),
        || came.to_string(),
    )
}

/// Compares a radiance, to a relative error.
pub(super) fn alike(answer: &Answer, expected: V, error: f64) -> Checked {
    let came = wide(answer.sample.radiance);
    let fine = (0..3).all(|c| (came[c] - expected[c]).abs() <= error * expected[c].abs() + 1e-7);
    ensure(
        fine,
        || format!("radiance {expected:?} {}", request_of(answer)),
        || format!("{came:?}"),
    )
}

/// What misses bring.
pub(super) fn background(scene: &Scene, answer: &Answer, _: (V, V), hit: Option<&Hit>) -> Checked {
    match hit {
        None => alike(answer, wide(scene.shading.background), EXACT),
        Some(_) => Ok(()),
    }
}

/// Diffuse reflectance of the material of an object that has no map.
pub(super) fn diffuse(scene: &Scene, thing: Thing) -> Option<V> {
    let Thing::Object(index) = thing else {
        return None;
    };
    let object = scene.objects.get(index as usize)?;
    Some(wide(scene.materials.get(object.material as usize)?.diffuse))
}

/// Ambient and diffusely reflected light of the scene's point lights, with the surface's normal as given; whether all of it is
/// ambient. Nothing if a shadow's border is too close to be sure.
pub(super) fn reflected(scene: &Scene, hit: &Hit, normal: V) -> Option<(V, bool)> {
    let diffuse = diffuse(scene, hit.thing)?;
    let mut total = wide(scene.shading.ambient);
    let mut dark = true;
    for light in &scene.lights {
        let Light::Point {
            position,
            intensity,
        } = light
        else {
            continue;
        };
        let to = sub(wide(*position), hit.at);
        if dot(to, hit.normal) <= 0.0 {
            continue;
        }
        if between(scene, hit.at, wide(*position))? == Thing::Nothing {
            let share = dot(unit(to), normal) / dot(to, to) * FRAC_1_PI;
            total = add(total, scaled(wide(*intensity), share.max(0.0)));
            dark = false;
        }
    }
    Some(([0, 1, 2].map(|c| diffuse[c] * total[c]), dark))
}

/// Diffuse reflection of point lights where they are seen.
pub(super) fn lit(scene: &Scene, answer: &Answer, _: (V, V), hit: Option<&Hit>) -> Checked {
    let found = hit.and_then(|hit| reflected(scene, hit, hit.normal));
    match found {
        Some((radiance, false)) => alike(answer, radiance, RADIANCE),
        _ => Ok(()),
    }
}

/// Ambient light, and nothing else, where no light is seen.
pub(super) fn dark(scene: &Scene, answer: &Answer, _: (V, V), hit: Option<&Hit>) -> Checked {
    let found = hit.and_then(|hit| reflected(scene, hit, hit.normal));
    match found {
        Some((radiance, true)) => alike(answer, radiance, EXACT),
        _ => Ok(()),
    }
}

/// Everything at once.
pub(super) fn right(scene: &Scene, answer: &Answer, ray: (V, V), hit: Option<&Hit>) -> Checked {
    for aspect in [
        on_the_ray,
        on_the_surface,
        named,
        flagged,
        background,
        lit,
        dark,
    ] as [Aspect; 7]
    {
        aspect(scene, answer, ray, hit)?;
    }
    Ok(())
}

/// Irradiance of an area or a linear light that nothing hides, by the middles of many small pieces.
pub(super) fn irradiance(light: &Light, at: V, normal: V) -> V {
    const PIECES: u32 = 400;
    let middles = |n: u32| (0..n).map(move |i| (f64::from(i) + 0.5) / f64::from(n));
    match light {
        Light::Point { .. } => [0.0; 3],
        Light::Linear {
            from,
            to,
            intensity,
        } => {
            let (from, to) = (wide(*from), wide(*to));
            let along = sub(to, from);
            let share: f64 = middles(PIECES)
                .map(|s| {
                    let d = sub(add(from, scaled(along, s)), at);
                    dot(unit(d), normal).max(0.0) / dot(d, d)
                })
                .sum();
            scaled(wide(*intensity), share * length(along) / f64::from(PIECES))
        }
        Light::Area { vertices, radiance } => {
            let [a, b, _, d] = vertices[..] else {
                return [0.0; 3];
            };
            let (corner, across, along) = (wide(a), sub(wide(b), wide(a)), sub(wide(d), wide(a)));
            let facing = super::world::cross(across, along);
            let (area, facing) = (length(facing), unit(facing));
            let side = PIECES / 4;
            let mut share = 0.0;
            for s in middles(side) {
                for t in middles(side) {
                    let place = add(corner, add(scaled(across, s), scaled(along, t)));
                    let d = sub(place, at);
                    let cosines = dot(unit(d), normal).max(0.0) * (-dot(unit(d), facing)).max(0.0);
                    share += cosines / dot(d, d);
                }
            }
            scaled(wide(*radiance), share * area / f64::from(side * side))
        }
    }
}

/// The mean radiance of many samples of one place agrees within what chance leaves, and a hundredth.
pub(super) fn mean_is(answers: &[Answer], expected: V) -> Checked {
    let count = answers.len() as f64;
    for (c, expected) in expected.into_iter().enumerate() {
        let values = answers.iter().map(|a| f64::from(a.sample.radiance[c]));
        let mean = values.clone().sum::<f64>() / count;
        let variance = values.map(|v| (v - mean) * (v - mean)).sum::<f64>() / count;
        let allowed = 0.01 * expected + 4.0 * (variance / count).sqrt();
        if (mean - expected).abs() > allowed {
            return failed(
                format!("a mean of {} ± {allowed} in channel {c}", expected),
                format!("{mean}"),
            );
        }
    }
    Ok(())
}

/// sRGB to linear (IEC 61966-2-1).
pub(super) fn linear(encoded: u8) -> f64 {
    let c = f64::from(encoded) / 255.0;
    if c <= 0.040_45 {
        c / 12.92
    } else {
        ((c + 0.055) / 1.055).powf(2.4)
    }
}

/// Radiance of a diffuse surface with this irradiance.
pub(super) fn of_irradiance(scene: &Scene, thing: Thing, irradiance: V) -> Option<V> {
    let (diffuse, ambient) = (diffuse(scene, thing)?, wide(scene.shading.ambient));
    Some([0, 1, 2].map(|c| diffuse[c] * (ambient[c] + irradiance[c] / PI)))
}
