//! Radiance where it can be worked out.

use super::check::{Check, ensure, skipped};
use super::judge::{self, EXACT, alike, diffuse, linear, reflected, seen};
use super::peer::{Answer, Peer};
use super::requests::{LOOK, ask_in_turns, look, look_with};
use super::world::{
    FURNACE, Hit, LEANING, QUADRANTS, REPEATS, Thing, V, add, camera, dot, scaled, spread, unit,
    wide,
};
use super::{Bench, Checked};
use crate::scene::{Light, Scene};

const SHADING: &str = "5, Shading";
const SCENE: &str = "5, Scene";

pub(super) fn checks() -> Vec<Check> {
    let looks = |name, aspect: judge::Aspect| {
        Check::new(name, SHADING, move |bench| {
            look(bench, &bench.worlds.lit, aspect)
        })
    };
    vec![
        Check::new("shading.ambient-alone", SHADING, |bench| {
            look(bench, &bench.worlds.dim, judge::dark)
        }),
        looks("shading.background", judge::background),
        looks("shading.point-light", judge::lit),
        looks("shading.in-shadow-ambient", judge::dark),
        Check::new("shading.area-lights-block", SCENE, |bench| {
            look(bench, &bench.worlds.shade, judge::lit)?;
            look(bench, &bench.worlds.shade, judge::dark)
        }),
        Check::new("shading.area-light-seen", SCENE, |bench| {
            look(bench, &bench.worlds.lamp, lamp_seen)
        }),
        Check::new("shading.map", SCENE, map),
        Check::new("shading.textured", "4, Textured", textured),
        Check::new("shading.normals", SCENE, |bench| {
            look(bench, &bench.worlds.bent, leaning)
        }),
        Check::new("shading.direct-has-no-gloss", SHADING, |bench| {
            look(bench, &bench.worlds.shiny, judge::lit)
        }),
        Check::new("shading.furnace", SHADING, furnace),
    ]
}

/// An area light has its radiance in front, and is black from behind.
fn lamp_seen(scene: &Scene, answer: &Answer, (_, direction): (V, V), hit: Option<&Hit>) -> Checked {
    let (Some(hit), Some(Light::Area { radiance, .. })) = (hit, scene.lights.first()) else {
        return Ok(());
    };
    if hit.thing != Thing::Light(0) {
        return Ok(());
    }
    // It shines downwards.
    let in_front = direction[1] > 0.0;
    let expected = if in_front { wide(*radiance) } else { [0.0; 3] };
    alike(answer, expected, EXACT)
}

/// Radiance of the floor with its map, where one texel's colour is all around.
fn mapped_radiance(scene: &Scene, hit: &Hit) -> Option<V> {
    let [u, v] = hit.shares.map(|share| (share * f64::from(REPEATS)).fract());
    let inside = |share: f64| (share * 2.0).fract() > 0.3 && (share * 2.0).fract() < 0.7;
    if !inside(u) || !inside(v) {
        return None;
    }
    // Row 0 is on top, where v is 1.
    let quadrant = usize::from(v < 0.5) * 2 + usize::from(u >= 0.5);
    let colour = QUADRANTS[quadrant].map(linear);
    let (diffuse, ambient) = (diffuse(scene, hit.thing)?, wide(scene.shading.ambient));
    Some([0, 1, 2].map(|c| diffuse[c] * colour[c] * ambient[c]))
}

fn map(bench: &Bench) -> Checked {
    let world = &bench.worlds.mapped;
    let mut peer = Peer::ready(bench, world)?;
    for answer in ask_in_turns(&mut peer, 1, &spread(&camera(), 0..2 * LOOK))? {
        let seen = seen(&world.scene, &answer.camera, &answer.request);
        let hit = seen.and_then(|(_, hit)| hit);
        if let Some(radiance) = hit.and_then(|hit| mapped_radiance(&world.scene, &hit)) {
            alike(&answer, radiance, 1e-3)?;
        }
    }
    Ok(())
}

/// What comes with a textured sample is in keeping with its radiance and its face.
fn textured(bench: &Bench) -> Checked {
    let world = &bench.worlds.mapped;
    let mut peer = Peer::ready(bench, world)?;
    let mut found = false;
    for answer in ask_in_turns(&mut peer, 1, &spread(&camera(), 0..LOOK))? {
        let Some(texel) = answer.texel else { continue };
        found = true;
        let product =
            [0, 1, 2].map(|c| f64::from(texel.reflectance[c]) * f64::from(texel.reflected[c]));
        alike(&answer, product, 1e-4)?;
        let Some((_, Some(hit))) = seen(&world.scene, &answer.camera, &answer.request) else {
            continue;
        };
        let [u, v] = hit.shares;
        let face = u32::from(v > u);
        ensure(
            (u - v).abs() < 1e-3 || texel.face == face,
            || format!("face {face} at shares {u} and {v} of the floor's sides"),
            || texel.face.to_string(),
        )?;
    }
    if found {
        return Ok(());
    }
    skipped("the server sends no Textured")
}

/// Normals of a mesh bend its shading.
fn leaning(scene: &Scene, answer: &Answer, _: (V, V), hit: Option<&Hit>) -> Checked {
    let Some(hit) = hit else { return Ok(()) };
    if hit.thing != Thing::Object(0) {
        return Ok(());
    }
    // By the inverse transpose of the floor's transform, whose columns are at right angles.
    let m = &scene.objects[0].transform;
    let columns = [0, 1, 2].map(|c| wide([m[0][c], m[1][c], m[2][c]]));
    let mut normal = [0.0; 3];
    for (column, share) in columns.into_iter().zip(unit(LEANING)) {
        normal = add(normal, scaled(column, share / dot(column, column)));
    }
    match reflected(scene, hit, unit(normal)) {
        Some((radiance, _)) => alike(answer, radiance, 1e-3),
        None => Ok(()),
    }
}

/// Inside a closed grey cube nothing is darker than one reflection of the ambient light, nor brighter than endless ones; whatever
/// model the server has, and all alike but for what chance does.
fn furnace(bench: &Bench) -> Checked {
    let world = &bench.worlds.furnace;
    let mut peer = Peer::ready(bench, world)?;
    let [reflectance, ambient] = FURNACE.map(f64::from);
    let least = reflectance * ambient;
    let most = least / (1.0 - reflectance);
    for answer in look_with(&mut peer)? {
        let radiance = f64::from(answer.sample.radiance[0]);
        ensure(
            radiance >= least * 0.999 && radiance <= most * 1.001,
            || format!("radiance from {least} to {most}"),
            || radiance.to_string(),
        )?;
    }
    Ok(())
}
