//! A camera that is somewhere else at once: points that were visible from the old place must not shine through from the new.

use renderer::config::Choices;
use renderer::edges::world::world_of;
use renderer::frame::Display;

use crate::drive::{Theatre, view};

const SIZE_PX: [u32; 2] = [128, 128];
/// How much nearer something must be to hide a point for sure, a share of the distance.
const CLEAR: f32 = 0.93;

#[test]
fn after_a_jump_no_hidden_point_stays_in_sight() {
    let theatre = Theatre::new(scenes::builtin_text("chains").expect("chains"));
    let here = view(SIZE_PX, [0.6, 4.2, 7.4], [-0.1, 1.05, 0.2], 40.0);
    let there = view(SIZE_PX, [7.0, 3.0, -2.8], [-0.1, 1.05, 0.1], 40.0);
    let world = world_of(&theatre.loaded.scene);
    let hidden = |display: &Display| {
        let (grid, pixels) = (display.grid(), display.pixels());
        let (mut hidden, mut all) = (0, 0);
        for (x, y) in (0..SIZE_PX[1]).flat_map(|y| (0..SIZE_PX[0]).map(move |x| (x, y))) {
            let (x, y) = (x as usize, y as usize);
            if !pixels.has_sample(x, y) {
                continue;
            }
            let at = grid.at(x, y);
            let direction = there.direction(x as f32 + pixels.x[at], y as f32 + pixels.y[at]);
            let ray = rays::Ray {
                origin: there.eye,
                direction,
            };
            // Directions have depth 1: the ray's parameter is the depth.
            let nearer = CLEAR * pixels.depth[at];
            hidden += usize::from(world.closest(&ray, nearer).is_some());
            all += 1;
        }
        hidden as f32 / all as f32
    };
    let views: Vec<_> = [here; 10].into_iter().chain([there; 16]).collect();
    let mut shares = Vec::new();
    theatre.play(Choices::default(), 400, &views, |frame, _, display| {
        if frame >= 10 {
            shares.push(hidden(display));
        }
    });
    assert!(shares[0] < 0.02, "{shares:?}");
    assert!(shares[15] < 0.005, "{shares:?}");
}
