//! Lights that are no points: the mean of many samples of one place.

use crate::messages::SampleRequest;

use super::check::{Check, failed};
use super::judge::{irradiance, mean_is, of_irradiance, seen};
use super::peer::Peer;
use super::requests::ask_in_turns;
use super::world::{World, camera};
use super::{Bench, Checked};

/// Samples of the place.
const COUNT: u64 = 1024;

const SCENE: &str = "5, Scene";

pub(super) fn checks() -> Vec<Check> {
    vec![
        Check::new("shading.area-light", SCENE, |bench| {
            mean(bench, &bench.worlds.lamp)
        }),
        Check::new("shading.linear-light", SCENE, |bench| {
            mean(bench, &bench.worlds.tube)
        }),
    ]
}

/// On the floor beside the light, with nothing in between.
fn mean(bench: &Bench, world: &World) -> Checked {
    let request = |id| SampleRequest {
        id,
        x: 38,
        y: 30,
        offset: [0.5; 2],
    };
    let Some((_, Some(hit))) = seen(&world.scene, &camera(), &request(0)) else {
        return failed("a place that is seen: a defect of these checks", "none");
    };
    let irradiance = irradiance(&world.scene.lights[0], hit.at, hit.normal);
    let Some(radiance) = of_irradiance(&world.scene, hit.thing, irradiance) else {
        return failed(
            "a floor: a defect of these checks",
            format!("{:?}", hit.thing),
        );
    };
    let mut peer = Peer::ready(bench, world)?;
    let requests: Vec<SampleRequest> = (0..COUNT).map(request).collect();
    mean_is(&ask_in_turns(&mut peer, 1, &requests)?, radiance)
}
