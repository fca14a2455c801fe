//! Equal surfaces in one place: which of them is seen never changes, since equal distances go to the smaller instance.
//!
//! Surfaces in one plane that are cut into other triangles, or brought there by another transform, differ by rounding, and
//! which of them is seen changes from ray to ray.

use glam::Vec3;
use rays::{Ray, World};
use renderer::camera::View;
use renderer::config::Choices;
use renderer::edges::world::world_of;
use renderer::epi::code::EdgeCode;

use crate::drive::{Theatre, view};

const SIZE_PX: [u32; 2] = [96, 72];
const FRAMES: usize = 100;

const HEAD: &str = r#"
[shading]
ambient = [1, 1, 1]
background = [0, 0, 0]
[material.red]
diffuse = [1, 0, 0]
[material.blue]
diffuse = [0, 0, 1]
"#;

/// Two squares of 2 m, the second made or placed as its text says.
fn squares(second: &str) -> String {
    let turn = "rotate = [63, 21, 7]";
    format!(
        "{HEAD}[[object]]\nname = \"first\"\ngenerate = {{ kind = \"plane\", size = [2, 2] }}\nmaterial = \"red\"\n{turn}\n\
         [[object]]\nname = \"second\"\nmaterial = \"blue\"\n{turn}\n{second}\n"
    )
}

/// The camera shakes by a tenth of a millimetre.
fn shaking() -> Vec<View> {
    let shake = |i: usize, k: f32| 1e-4 * (i as f32 * k).sin();
    (0..FRAMES)
        .map(|i| {
            let eye = [
                0.3 + shake(i, 1.0),
                0.4 + shake(i, 1.7),
                3.1 + shake(i, 2.3),
            ];
            view(SIZE_PX, eye, [shake(i, 0.6), shake(i, 1.1), 0.0], 30.0)
        })
        .collect()
}

/// Which square the ray through the middle of each pixel meets, as many bits as there are squares.
fn winners(world: &World, view: &View) -> u32 {
    (0..SIZE_PX[1])
        .flat_map(|y| (0..SIZE_PX[0]).map(move |x| (x, y)))
        .fold(0, |bits, (x, y)| {
            let direction = view.direction(x as f32 + 0.5, y as f32 + 0.5);
            let hit = world.closest(
                &Ray {
                    origin: view.eye,
                    direction,
                },
                f32::INFINITY,
            );
            bits | hit.map_or(0, |hit| 1 << hit.instance)
        })
}

#[track_caller]
fn check(second: &str) {
    let theatre = Theatre::new(&squares(second));
    let own = world_of(&theatre.loaded.scene);
    for (frame, view) in shaking().iter().enumerate() {
        for (whose, world) in [("shader", theatre.stage.world()), ("display", &own)] {
            assert_eq!(
                winners(world, view),
                1,
                "frame {frame}, rays of the {whose}"
            );
        }
    }
    theatre.play(Choices::default(), 346, &shaking(), |frame, _, display| {
        let (grid, image) = (display.grid(), display.image());
        for (x, y) in (0..grid.height).flat_map(|y| (0..grid.width).map(move |x| (x, y))) {
            let colour = Vec3::from([0, 1, 2].map(|k| image[k][grid.at(x, y)]));
            assert_eq!(colour.z, 0.0, "frame {frame}, pixel {x} {y}: {colour}");
            let inside = display.epi().code_at(x, y) == EdgeCode::EMPTY;
            assert!(
                !inside || colour.abs_diff_eq(Vec3::X, 1e-6) || frame == 0 || colour == Vec3::ZERO,
                "frame {frame}, pixel {x} {y}: {colour}"
            );
        }
    });
}

#[test]
fn of_two_equal_squares_the_first_is_always_seen() {
    check("generate = { kind = \"plane\", size = [2, 2] }");
}
