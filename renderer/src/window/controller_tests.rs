use super::*;

fn spec() -> CameraSpec {
    CameraSpec {
        eye: [0.0, 2.0, 10.0],
        target: [0.0, 1.0, 0.0],
        up: [0.0, 1.0, 0.0],
        fov_y: 45.0,
    }
}

fn controller() -> Controller {
    Controller::new(&spec(), 20.0, None)
}

fn distance(c: &Controller) -> f32 {
    (c.pose().target - c.pose().eye).length()
}

#[test]
fn orbiting_keeps_the_target_and_the_distance_and_never_tips_over() {
    let mut c = controller();
    let far = distance(&c);
    c.grab(Drag::Orbit);
    for step in 0..200 {
        c.drag(7.0, if step < 100 { 40.0 } else { -40.0 }, 500.0);
        assert_eq!(c.pose().target, Vec3::from(spec().target));
        assert!((distance(&c) - far).abs() < 1e-3 * far);
        assert!(protocol::validate::validate_camera(&c.camera(64, 64)).is_ok());
    }
    c.let_go(Drag::Pan);
    let there = c.pose();
    c.let_go(Drag::Orbit);
    c.drag(50.0, 50.0, 500.0);
    assert_eq!(c.pose(), there);
}

#[test]
fn dragging_right_turns_the_scene_right() {
    let mut c = controller();
    c.grab(Drag::Orbit);
    c.drag(10.0, 0.0, 500.0);
    assert!(c.pose().eye.x < 0.0);
    let mut c = controller();
    c.grab(Drag::Orbit);
    c.drag(0.0, 10.0, 500.0);
    assert!(c.pose().eye.y > 2.0);
}

#[test]
fn panning_keeps_the_target_s_plane_under_the_pointer() {
    let mut c = controller();
    let held = Vec3::from(spec().target);
    c.grab(Drag::Pan);
    c.drag(30.0, -20.0, 512.0);
    let view = crate::camera::View::new(&c.camera(512, 512));
    let (x, y, _) = view.project(held).unwrap();
    assert!(
        (x - 286.0).abs() < 0.01 && (y - 236.0).abs() < 0.01,
        "{x} {y}"
    );
}

#[test]
fn the_wheel_nears_but_never_reaches() {
    let mut c = controller();
    for _ in 0..500 {
        c.wheel(3.0);
    }
    assert!(distance(&c) > 0.0);
    assert!(protocol::validate::validate_camera(&c.camera(64, 64)).is_ok());
    for _ in 0..500 {
        c.wheel(-3.0);
    }
    assert!(distance(&c) <= 2000.1);
    c.wheel(f32::NAN);
    assert!(c.pose().eye.is_finite());
}

#[test]
fn keys_move_while_held_and_shift_moves_faster() {
    let fly = |fast: bool, parts: usize| {
        let mut c = controller();
        c.press(Held::Forward);
        if fast {
            c.press(Held::Fast);
        }
        let before = c.pose().eye;
        for _ in 0..parts {
            assert!(c.advance(0.08 / parts as f32));
            c.drawn();
        }
        c.release(Held::Forward);
        assert!(!c.moving() && !c.advance(0.1));
        (c.pose().eye - before).length()
    };
    let slow = fly(false, 1);
    assert!(slow > 0.0);
    assert!((fly(true, 1) / slow - FAST).abs() < 1e-3);
    assert!((fly(false, 8) / slow - 1.0).abs() < 1e-3);
    let mut c = controller();
    c.press(Held::Left);
    c.press(Held::Right);
    assert!(c.moving() && !c.advance(0.05));
    c.release_all();
    assert!(!c.moving());
}

#[test]
fn looking_turns_in_place() {
    let mut c = controller();
    c.press(Held::LookUp);
    c.press(Held::LookLeft);
    for _ in 0..100 {
        c.advance(0.1);
        c.drawn();
    }
    assert_eq!(c.pose().eye, Vec3::from(spec().eye));
    assert!(protocol::validate::validate_camera(&c.camera(64, 64)).is_ok());
    c.go_home();
    assert_eq!(c.pose().target, Vec3::from(spec().target));
}

#[test]
fn the_path_plays_until_something_else_moves() {
    let key = |x: f32| scenes::PathKey {
        eye: [x, 1.0, 5.0],
        target: [0.0; 3],
    };
    let path = CameraPath {
        name: "p".into(),
        seconds: 1.0,
        open: true,
        step: false,
        keys: vec![key(0.0), key(4.0)],
    };
    assert!(!controller().toggle_path());
    let mut c = Controller::new(&spec(), 20.0, Some(path));
    assert!(c.toggle_path() && c.moving());
    for _ in 0..5 {
        c.advance(0.1);
    }
    assert!((c.pose().eye.x - 2.0).abs() < 0.01, "{:?}", c.pose());
    c.press(Held::Forward);
    assert!(!c.playing());
    c.release(Held::Forward);
    c.toggle_path();
    for _ in 0..20 {
        c.advance(0.1);
    }
    assert!(!c.moving() && (c.pose().eye.x - 4.0).abs() < 1e-4);
}

#[test]
fn motion_is_expected_to_go_on() {
    let mut c = controller();
    assert!(c.predicted(64, 64).is_none());
    c.press(Held::Right);
    c.advance(0.05);
    let once = c.pose().eye;
    let next = c.predicted(64, 64).unwrap();
    c.drawn();
    c.advance(0.05);
    assert!((Vec3::from(next.eye) - c.pose().eye).length() < 1e-4);
    assert!(once != c.pose().eye);
    c.release(Held::Right);
    assert!(c.predicted(64, 64).is_none());
}

#[test]
fn a_scene_s_extent_is_that_of_its_objects_where_they_stand() {
    let chains = scenes::builtin("chains").unwrap().scene;
    assert!(extent(&chains) > 1.0);
    let mut empty = chains;
    empty.objects.clear();
    assert_eq!(extent(&empty), 0.0);
    assert!(Controller::new(&spec(), 0.0, None).extent > 1.0);
}
