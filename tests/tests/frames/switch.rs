//! A light that is switched off and on again under a still camera.

use protocol::messages::LightMove;
use protocol::scene::Light;
use renderer::config::Choices;
use renderer::frame::{Display, Edit};
use system_tests::metrics::temporal::{recovery_frames, shimmer};
use system_tests::picture::Picture;

use crate::drive::{Run, Theatre, view};

const SIZE_PX: [u32; 2] = [96, 72];
const OFF: usize = 100;
const ON: usize = 200;
const FRAMES: usize = 300;

const SCENE: &str = r#"
[shading]
ambient = [0.05, 0.05, 0.05]
[[light]]
kind = "area"
vertices = [[-0.5, 4, -0.5], [0.5, 4, -0.5], [0.5, 4, 0.5], [-0.5, 4, 0.5]]
radiance = [20, 20, 20]
[material.grey]
diffuse = [0.5, 0.5, 0.5]
[[object]]
name = "floor"
generate = { kind = "plane", size = [8, 8] }
material = "grey"
[[object]]
name = "ring"
generate = { kind = "torus", major = 1, minor = 0.3 }
material = "grey"
translate = [0, 1, 0]
"#;

fn picture(display: &Display) -> Picture {
    let grid = display.grid();
    let pixels = (0..grid.height).flat_map(|y| (0..grid.width).map(move |x| grid.at(x, y)));
    let rgb = pixels.map(|at| display.image().each_ref().map(|plane| plane[at]));
    Picture::from_linear(SIZE_PX, rgb.collect()).expect("a picture")
}

/// Mean distance of two pictures as shown.
fn error(a: &Picture, b: &Picture) -> f64 {
    let (a, b) = (a.to_srgb(), b.to_srgb());
    let each = a.iter().flatten().zip(b.iter().flatten());
    each.map(|(a, b)| f64::from((a - b).abs())).sum::<f64>() / (3 * a.len()) as f64
}

/// Share of the pixels that look more like the old picture, of those that the two differ in by more than noise.
fn ghost_share(test: &Picture, old: &Picture, new: &Picture) -> f64 {
    const NOISE: f32 = 8.0 / 255.0;
    let [test, old, new] = [test, old, new].map(Picture::to_srgb);
    let distance = |a: &[f32; 3], b: &[f32; 3]| (0..3).map(|k| (a[k] - b[k]).abs()).sum::<f32>();
    let is_ghost = |i: &usize| {
        let apart = distance(&old[*i], &new[*i]) > 3.0 * NOISE;
        apart && distance(&test[*i], &old[*i]) < distance(&test[*i], &new[*i])
    };
    (0..test.len()).filter(is_ghost).count() as f64 / test.len() as f64
}

#[test]
fn a_light_that_goes_off_and_on_leaves_no_ghost() {
    let theatre = Theatre::new(SCENE);
    let lit = theatre.loaded.scene.lights[0].clone();
    let Light::Area { vertices, .. } = &lit else {
        panic!("{lit:?}");
    };
    let dark = Light::Area {
        vertices: vertices.clone(),
        radiance: [0.0; 3],
    };
    let switch = |value: &Light| Edit {
        objects: Vec::new(),
        lights: vec![LightMove {
            light: 0,
            value: value.clone(),
        }],
    };
    let from = view(SIZE_PX, [1.0, 4.0, 6.0], [0.0, 0.5, 0.0], 45.0);
    let samples = (SIZE_PX[0] * SIZE_PX[1]) as usize / 50;
    let display = Display::new(
        &theatre.loaded.scene,
        Choices::default(),
        SIZE_PX[0],
        SIZE_PX[1],
        1,
    );
    let mut run = Run::new(theatre.stage.clone(), display, samples, &from);
    let mut frames = Vec::new();
    for frame in 0..FRAMES {
        run.draw(&from);
        frames.push(picture(&run.display));
        match frame + 1 {
            OFF => run.edit(&switch(&dark)),
            ON => run.edit(&switch(&lit)),
            _ => {}
        }
        run.plan(None);
    }
    let (bright, black) = (&frames[OFF - 1], &frames[ON - 1]);
    let [early, late] = [10..40, 60..90].map(|range| shimmer(&frames[range]).unwrap());
    let to_black: Vec<f64> = frames[OFF..ON].iter().map(|f| error(f, black)).collect();
    let to_bright: Vec<f64> = frames[ON..].iter().map(|f| error(f, bright)).collect();
    // Frames until little more is missing than what one still picture and the next always differ by.
    let recovery = |errors: &[f64]| {
        let floor = errors[errors.len() - 20..].iter().sum::<f64>() / 20.0 + 0.002;
        errors.iter().position(|e| *e <= floor)
    };
    let settled = recovery_frames(&to_bright, 0, 20);
    let recovered = [recovery(&to_black), recovery(&to_bright)];
    let ghosts = |frame: usize, old, new| ghost_share(&frames[frame], old, new);
    let dark_ghosts = [0, 10, 20, 40, 60].map(|k| ghosts(OFF + k, bright, black));
    let light_ghosts = [0, 10, 20, 40, 60].map(|k| ghosts(ON + k, black, bright));
    println!(
        "shimmer {early:.5} then {late:.5}; recovered after {recovered:?} frames ({settled:?} to 1.1 times); ghosts 0, 10, \
         20, 40, 60 frames after: {dark_ghosts:.4?} off, {light_ghosts:.4?} on"
    );
    assert!(late < early && late < 0.002, "{early} {late}");
    assert!(
        recovered.iter().all(|r| r.is_some_and(|r| r <= 40)),
        "{recovered:?}"
    );
    // Single pixels on outlines may still be seen by an older sample.
    let few = 3.0 / (SIZE_PX[0] * SIZE_PX[1]) as f64;
    let late_ghosts = [dark_ghosts[4], light_ghosts[4]];
    assert!(late_ghosts.iter().all(|g| *g <= few), "{late_ghosts:?}");
    let finite = |f: &Picture| f.rgb().iter().flatten().all(|c| c.is_finite());
    assert!(frames.iter().all(finite));
}
