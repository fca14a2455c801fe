use std::collections::HashMap;

use protocol::messages::{Camera, Triple};
use protocol::scene::{Material, Mesh, Model, Object, Scene, Shading};

use super::*;
use crate::edges::finder::EdgeFinder;
use crate::shadows::worker::Lines;

/// A post that stands on a floor, under a square light.
fn scene() -> Scene {
    let corner = |k: u32| [0, 1, 2].map(|axis| (k >> axis & 1) as f32);
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let faces = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
    let post = |[x, y, z]: [f32; 3]| [0.2 * x, 2.0 * y, 0.2 * z];
    let object = |mesh: u32| Object {
        name: String::new(),
        mesh,
        material: 0,
        transform: [[1., 0., 0., 0.], [0., 1., 0., 0.], [0., 0., 1., 0.]],
        crease_angle: 85.0,
    };
    let square = |half: f32, y: f32| {
        [[-half, -half], [half, -half], [half, half], [-half, half]].map(|[x, z]| [x, y, z])
    };
    Scene {
        shading: Shading {
            model: Model::Direct,
            ambient: [0.0; 3],
            background: [0.0; 3],
        },
        lights: vec![Light::Area {
            vertices: square(0.3, 5.0).map(|[x, y, z]| [x - 3.0, y, z]).to_vec(),
            radiance: [200.0; 3],
        }],
        materials: vec![Material {
            name: String::new(),
            diffuse: [0.5; 3],
            diffuse_map: None,
            specular: [0.0; 3],
            roughness: 1.0,
        }],
        textures: Vec::new(),
        meshes: vec![
            Mesh {
                positions: square(9.0, 0.0).to_vec(),
                faces: vec![[0, 2, 1], [0, 3, 2]],
                ..Mesh::default()
            },
            Mesh {
                positions: (0..8).map(corner).map(post).collect(),
                faces: quads.into_iter().flat_map(faces).collect(),
                ..Mesh::default()
            },
        ],
        objects: vec![object(0), object(1)],
    }
}

/// The shadow's long edges are narrow at the contact and wide at their far ends: drawn as far as the light's penumbra is narrow,
/// which a ray through the light and the post says.
#[test]
fn edges_are_cut_where_their_penumbra_becomes_wide() {
    let scene = scene();
    let view = View::new(&Camera {
        eye: [1.0, 8.0, 0.01],
        target: [1.0, 0.0, 0.0],
        up: [0.0, 1.0, 0.0],
        fov_y: 40.0,
        width: 400,
        height: 400,
    });
    let mut shadows = Shadows::new(&scene, &EdgeFinder::new(&scene), Some(Lines::Middle));
    shadows.learn(&[Triple {
        light: 0,
        blocker: 1,
        receiver: 0,
    }]);
    shadows.update(true);
    let (mut list, mut tallies) = (EdgeList::default(), Vec::new());
    let mut drawn = |width_px: f32| {
        let worth = Worth {
            width_px,
            steps: 1.0,
        };
        list.clear();
        append(
            &shadows,
            &scene.lights,
            &view,
            worth,
            100,
            &mut tallies,
            &mut list,
        );
        (list.clone(), tallies[0])
    };

    let (whole, tally) = drawn(1e3);
    assert_eq!((tally.cut, tally.wide), (0, 0));
    assert!(tally.drawn >= 4, "{tally:?}");
    let (list, tally) = drawn(8.0);
    assert!(tally.cut >= 2 && tally.wide >= 1, "{tally:?}");
    assert_eq!(
        tally.drawn,
        list.count(EdgeKind::Shadow(super::super::wedge::EventKind::Hard))
    );
    let length = |list: &EdgeList, i: usize| {
        glam::Vec3::from(list.from[i]).distance(glam::Vec3::from(list.to[i]))
    };
    let total = |list: &EdgeList| (0..list.len()).map(|i| length(list, i)).sum::<f32>();
    assert!(total(&list) > 0.0 && total(&list) < 0.5 * total(&whole));

    // Ends that have one number are in one place, and a cut end is nobody else's.
    let ends = 2 * tally.all() as u32;
    let mut places: HashMap<u32, [u32; 3]> = HashMap::new();
    let mut own = 0;
    for i in 0..list.len() {
        for (end, number) in [list.from[i], list.to[i]].into_iter().zip(list.vertices[i]) {
            let bits = end.map(f32::to_bits);
            if number >= 100 + ends {
                own += 1;
                assert_eq!(places.insert(number, bits), None);
            }
            assert!((100..100 + 2 * ends).contains(&number));
            assert_eq!(*places.entry(number).or_insert(bits), bits);
        }
    }
    assert!(own >= tally.cut, "{own} {tally:?}");

    // Where a long edge ends, the ramp that the light's extent across it makes is as wide as is allowed.
    let far = (0..list.len()).flat_map(|i| [list.from[i], list.to[i]]);
    let reach =
        |p: [f32; 3]| (view.eye + view.right * p[0] + view.up * p[1] + view.forward * p[2]).x;
    let most = far.map(reach).fold(f32::NEG_INFINITY, f32::max);
    // Of similar triangles: the light is 0.6 m wide in z, the blocker at height d where the shadow has this reach.
    let d = 5.0 * most / (most + 3.0);
    let width_px = 0.6 * d / (5.0 - d) * view.focal_px / 8.0;
    assert!((7.0..8.6).contains(&width_px), "{width_px} px at {most}");
}
