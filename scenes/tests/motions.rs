//! Paths of objects and lights in scene files.

use protocol::scene::Light;
use scenes::{Moving, builtin, load};

const SCENE: &str = "
[[light]]
name = 'lamp'
kind = 'linear'
from = [0, 3, 0]
to = [1, 3, 0]
intensity = [2, 2, 2]
[[object]]
name = 'row'
generate = { kind = 'chain', keys = [[0, 1, 0], [2, 1, 0]], links = 4, major = 0.5, minor = 0.1 }
[[object]]
name = 'rower'
generate = { kind = 'sphere', radius = 1 }
[[path]]
name = 'all'
seconds = 1
open = true
keys = [{ eye = [0, 0, 9], target = [0, 0, 0] }, { eye = [0, 0, 5], target = [0, 0, 0] }]
[[path]]
name = 'all'
object = 'row'
seconds = 2
open = true
keys = [{}, { translate = [0, 2, 0] }]
[[path]]
name = 'all'
light = 'lamp'
seconds = 4
step = true
keys = [{ power = 0.5 }, { translate = [0, 1, 0] }]
";

#[test]
fn paths_of_one_name_move_parts_and_lights_beside_the_camera() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("s.toml");
    std::fs::write(&file, SCENE).unwrap();
    let loaded = load(&file).unwrap();
    assert_eq!((loaded.paths.len(), loaded.motions.len()), (1, 2));
    assert_eq!(loaded.motions[0].moving, Moving::Objects(vec![0, 1, 2, 3]));
    assert_eq!(loaded.motions[1].moving, Moving::Light(0));
    let (mut objects, mut lights) = (Vec::new(), Vec::new());
    for motion in &loaded.motions {
        motion.place(&loaded.scene, 1.0, &mut objects, &mut lights);
    }
    assert_eq!((objects.len(), lights.len()), (4, 1));
    for (moved, at_rest) in objects.iter().zip(&loaded.scene.objects) {
        let mut expected = at_rest.transform;
        expected[1][3] += 1.0;
        assert_eq!(moved.transform, expected);
    }
    let [half, higher] = [1.0, 3.0].map(|seconds| {
        let mut lights = Vec::new();
        loaded.motions[1].place(&loaded.scene, seconds, &mut Vec::new(), &mut lights);
        lights.remove(0).value
    });
    let at = |y: f32, power: f32| Light::Linear {
        from: [0.0, y, 0.0],
        to: [1.0, y, 0.0],
        intensity: [power; 3],
    };
    assert_eq!((half, higher), (at(3.0, 1.0), at(4.0, 2.0)));
}

#[test]
fn the_program_s_own_motions_begin_at_rest() {
    for name in scenes::builtin_names() {
        let loaded = builtin(name).unwrap();
        for wanted in ["drag", "lamp"] {
            let motion = loaded.motions.iter().find(|m| m.name == wanted).unwrap();
            let (mut objects, mut lights) = (Vec::new(), Vec::new());
            motion.place(&loaded.scene, 0.0, &mut objects, &mut lights);
            assert!(!objects.is_empty() || !lights.is_empty());
            for o in objects {
                let at_rest = &loaded.scene.objects[o.object as usize].transform;
                assert_eq!(o.transform, *at_rest);
            }
            for l in lights {
                assert_eq!(l.value, loaded.scene.lights[l.light as usize]);
            }
        }
    }
}
