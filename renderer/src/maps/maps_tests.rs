use glam::{DVec3, Vec2};
use protocol::messages::{Camera, Sample, SampleRequest};
use protocol::scene::{Model, Object, Shading, Texture};

use super::projected::Projected;
use super::*;
use crate::camera::View;
use crate::config::{Choices, PointCulling};
use crate::frame::{Display, Received, Wanted};

const SIDE: u32 = 96;

/// A wavy map, as fine as a few pixels.
fn texture() -> Texture {
    let code = |x: u32, y: u32| {
        let wave = |v: u32| (0.5 + 0.5 * (v as f32 * 0.9).sin()) * 200.0;
        [40 + wave(x) as u8, 30 + (wave(x + y) * 0.5) as u8, 128]
    };
    Texture {
        width: 64,
        height: 64,
        rgb: (0..64 * 64).map(|i| code(i % 64, i / 64)).collect(),
    }
}

fn material(diffuse_map: Option<u32>) -> Material {
    Material {
        name: String::new(),
        diffuse: [0.8, 0.9, 1.0],
        diffuse_map,
        specular: [0.0; 3],
        roughness: 1.0,
    }
}

/// A floor at y = 0, -4 to 4 both ways, the map lying on it twice each way; the half with x > 0 belongs to another object
/// whose material has no map.
fn scene() -> Scene {
    let quad = |low: f32, high: f32| Mesh {
        positions: vec![
            [low, 0.0, -4.0],
            [low, 0.0, 4.0],
            [high, 0.0, 4.0],
            [high, 0.0, -4.0],
        ],
        faces: vec![[0, 1, 2], [0, 2, 3]],
        uvs: vec![[0.0, 0.0], [0.0, 2.0], [1.0, 2.0], [1.0, 0.0]],
        face_uvs: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let object = |mesh: u32| Object {
        name: format!("{mesh}"),
        mesh,
        material: mesh,
        transform: [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
        ],
        crease_angle: 85.0,
    };
    Scene {
        shading: Shading {
            model: Model::Direct,
            ambient: [0.0; 3],
            background: [0.0; 3],
        },
        lights: Vec::new(),
        materials: vec![material(Some(0)), material(None)],
        textures: vec![texture()],
        meshes: vec![quad(-4.0, 0.0), quad(0.0, 4.0)],
        objects: vec![object(0), object(1)],
    }
}

fn view() -> View {
    View::new(&Camera {
        eye: [-0.5, 3.0, 2.5],
        target: [-0.5, 0.0, 0.0],
        up: [0.0, 1.0, 0.0],
        fov_y: 40.0,
        width: SIDE,
        height: SIDE,
    })
}

/// Where a ray meets the floor, and texture coordinates there.
fn floor(view: &View, x: f32, y: f32) -> (Vec3, Vec2) {
    let d = view.direction(x, y);
    let p = view.eye + d * (-view.eye.y / d.y);
    (p, Vec2::new((p.x + 4.0) / 4.0, (p.z + 4.0) / 4.0))
}

/// What a white surface reflects: smooth.
fn reflected(p: Vec3) -> [f32; 3] {
    [1.0 + 0.1 * p.x, 0.8 + 0.05 * p.z, 0.5]
}

/// What a server would say of a request; `known` is whether it says what the map did.
fn shade(map: &Map, view: &View, request: &SampleRequest, known: bool) -> Received {
    let (x, y) = (
        f32::from(request.x) + request.offset[0],
        f32::from(request.y) + request.offset[1],
    );
    let (p, uv) = floor(view, x, y);
    let light = reflected(p);
    let base = Vec3::new(0.8, 0.9, 1.0);
    let mapped = p.x < 0.0;
    let reflectance = if mapped {
        base * map.bilinear(uv)
    } else {
        base
    };
    let texel = Texel {
        face: u32::from(p.x + 4.0 > 0.5 * (p.z + 4.0)),
        reflectance: reflectance.into(),
        reflected: light,
    };
    Received {
        view: 1,
        epoch: 0,
        sample: Sample {
            id: request.id,
            position: p.into(),
            object: u32::from(!mapped),
            radiance: (reflectance * Vec3::from(light)).into(),
            flags: 0,
        },
        texel: (mapped && known).then_some(texel),
    }
}

/// Root of the mean squared error over the mapped floor, green, of a frame from a twentieth of the pixels.
fn error(known: bool) -> f64 {
    let (scene, view) = (scene(), view());
    let choices = Choices {
        point_culling: PointCulling::None,
        ..Choices::default()
    };
    let mut display = Display::new(&scene, choices, SIDE, SIDE, 1);
    let mut wanted = Wanted::default();
    display.begin(&view, 1);
    display.plan_first((SIDE * SIDE / 20) as usize, &mut wanted);
    let map = Map::new(&texture());
    let answers: Vec<Received> = wanted
        .here
        .iter()
        .map(|r| shade(&map, &view, r, known))
        .collect();
    display.receive(&answers, 1);
    display.draw(&view, 1);
    let (mut sum, mut count) = (0.0, 0);
    for (x, y) in (4..SIDE - 4).flat_map(|y| (4..SIDE - 4).map(move |x| (x, y))) {
        let mut truth = 0.0;
        for k in 0..64 {
            let at = |k: u32| (k as f32 + 0.5) / 8.0;
            let (p, uv) = floor(&view, x as f32 + at(k % 8), y as f32 + at(k / 8));
            truth += 0.9 * map.bilinear(uv).y * reflected(p)[1] / 64.0;
        }
        let (p, _) = floor(&view, x as f32, y as f32);
        if p.x < -0.1 {
            let got = display.image()[1][display.grid().at(x as usize, y as usize)];
            sum += f64::from(got - truth).powi(2);
            count += 1;
        }
    }
    assert!(count > 2000);
    (sum / f64::from(count)).sqrt()
}

#[test]
fn a_map_is_put_on_at_every_pixel_and_not_blurred_between_samples() {
    let (sharp, blurred) = (error(true), error(false));
    assert!(sharp < 0.015 && sharp < 0.12 * blurred, "{sharp} {blurred}");
}

#[test]
fn a_map_stays_on_its_side_of_an_edge() {
    let (scene, view) = (scene(), view());
    let choices = Choices {
        point_culling: PointCulling::None,
        ..Choices::default()
    };
    let mut display = Display::new(&scene, choices, SIDE, SIDE, 1);
    let mut wanted = Wanted::default();
    display.begin(&view, 1);
    display.plan_first(400, &mut wanted);
    let map = Map::new(&texture());
    let answers = wanted.here.iter().map(|r| shade(&map, &view, r, true));
    display.receive(&answers.collect::<Vec<_>>(), 1);
    display.draw(&view, 1);
    // The floor without a map is as bright as a white one of its base colour.
    for (x, y) in (4..SIDE - 4).flat_map(|y| (4..SIDE - 4).map(move |x| (x, y))) {
        let (p, _) = floor(&view, x as f32 + 0.5, y as f32 + 0.5);
        let (left, _) = floor(&view, x as f32 - 1.0, y as f32 + 0.5);
        if left.x > 0.0 {
            let got = display.image()[2][display.grid().at(x as usize, y as usize)];
            assert!((got - 0.5).abs() < 1e-3, "{x} {y} {p} {got}");
        }
    }
}

#[test]
fn scenes_without_maps_need_nothing() {
    let mut scene = scene();
    scene.materials[0].diffuse_map = None;
    assert!(Maps::new(&scene).is_none());
    let mut scene = self::scene();
    scene.meshes[0].face_uvs.clear();
    assert!(Maps::new(&scene).is_none());
}

#[test]
fn what_a_surface_shines_besides_its_map_stays() {
    let maps = Maps::new(&scene()).unwrap();
    let texel = Texel {
        face: 1,
        reflectance: [0.4, 0.0, 0.2],
        reflected: [2.0, 1.0, 0.0],
    };
    let mean = maps.means[0];
    let (flat, point) = maps.flatten(0, [1.0, 0.25, 0.0], &texel).unwrap();
    let mapped = [2.0 * 0.8 * mean.x, 0.9 * mean.y];
    assert!((flat[0] - 0.2 - mapped[0]).abs() < 1e-6);
    assert!((flat[1] - 0.25 - mapped[1]).abs() < 1e-6);
    assert!((point.share[0] - mapped[0] / flat[0]).abs() < 1e-6);
    assert_eq!((flat[2], point.share[2]), (0.0, 1.0));
    assert!(maps.flatten(1, [1.0; 3], &texel).is_none());
    assert!(maps.flatten(9, [1.0; 3], &texel).is_none());
    let past = Texel { face: 2, ..texel };
    assert!(maps.flatten(0, [1.0; 3], &past).is_none());
}

#[test]
fn projecting_a_map_agrees_with_rays_that_meet_it() {
    let view = view();
    let corners = [
        DVec3::new(-4.0, 0.0, -4.0),
        DVec3::new(-4.0, 0.0, 4.0),
        DVec3::new(0.0, 0.0, 4.0),
    ];
    let uvs = [[0.0, 0.0], [0.0, 2.0], [1.0, 2.0]];
    let projected = Projected::new(&view, corners, &uvs);
    for (x, y) in [(10.5, 20.5), (50.0, 90.0), (95.0, 3.0)] {
        let (_, uv) = floor(&view, x, y);
        let (_, right) = floor(&view, x + 0.01, y);
        let (_, down) = floor(&view, x, y + 0.01);
        let (got, footprint) = projected.at(x, y).unwrap();
        assert!((got - uv).length() < 1e-4);
        assert!((footprint.across * 0.01 - (right - uv)).length() < 2e-5);
        assert!((footprint.along * 0.01 - (down - uv)).length() < 2e-5);
    }
    // A face without area, and one whose plane holds the eye.
    let flat = Projected::new(&view, [corners[0]; 3], &uvs);
    assert!(flat.at(5.0, 5.0).is_none());
    let eye = view.eye.as_dvec3();
    let edge_on = Projected::new(
        &view,
        [eye + DVec3::X, eye + DVec3::Y, eye - DVec3::X],
        &uvs,
    );
    let _ = edge_on.at(48.0, 48.0);
}
