use super::*;
use crate::shadows::wedge::EventKind;
use protocol::messages::Camera;

/// 100 px a metre at the origin, for lines that are not turned away.
fn view() -> View {
    let half: f32 = 0.5 * 64.0 / 1000.0;
    View::new(&Camera {
        eye: [0.0, 0.0, 10.0],
        target: [0.0; 3],
        up: [0.0, 1.0, 0.0],
        fov_y: 2.0 * half.atan().to_degrees(),
        width: 64,
        height: 64,
    })
}

fn edge(from: [f64; 3], to: [f64; 3]) -> ShadowEdge {
    ShadowEdge {
        from: from.into(),
        to: to.into(),
        s: [0.0, 1.0],
        t: [1.0; 2],
        receiver: 0,
        face: 0,
        kind: EventKind::Hard,
    }
}

/// Along x; the penumbra lies along y.
fn level() -> ShadowEdge {
    edge([-0.1, 0.0, 0.0], [0.1, 0.0, 0.0])
}

fn grade(width: [f32; 2], form: f32) -> Grade {
    Grade {
        across: Vec3::Y,
        width,
        form,
    }
}

const WORTH: Worth = Worth {
    width_px: 8.0,
    steps: 1.0,
};

/// A light that gives a white surface with a form of 1 this many steps over black.
fn light(steps: f32) -> Light {
    let intensity = steps / (255.0 * 12.92) * std::f32::consts::PI;
    Light::Point {
        position: [0.0; 3],
        intensity: [intensity, 0.0, 0.0],
    }
}

fn judged(light: &Light, edge: &ShadowEdge, grade: &Grade) -> (Verdict, [f32; 2]) {
    Judge::new(light, WORTH).judge(&view(), edge, grade)
}

#[test]
fn wide_penumbrae_are_left_out() {
    let verdict = |width: f32| judged(&light(1e4), &level(), &grade([width; 2], 1.0));
    for width in [0.0, 0.01, 0.079] {
        assert_eq!(verdict(width), (Verdict::Drawn, [0.0, 1.0]), "{width}");
    }
    for width in [0.081, 1.0, 1e9] {
        assert_eq!(verdict(width).0, Verdict::Wide, "{width}");
    }
    let all = Judge::new(&light(1e-3), Worth::ALL);
    let wide = all.judge(&view(), &level(), &grade([1e9; 2], 1.0));
    assert_eq!(wide.0, Verdict::Drawn);
}

#[test]
fn the_width_is_that_on_screen() {
    // Seen aslant, a penumbra is as much narrower as its edge's direction and the line of sight say.
    let aslant = Grade {
        across: Vec3::new(0.0, 0.1, 0.994_987_4),
        ..grade([0.7; 2], 1.0)
    };
    assert_eq!(judged(&light(1e4), &level(), &aslant).0, Verdict::Drawn);
    let wider = Grade {
        width: [0.9; 2],
        ..aslant
    };
    assert_eq!(judged(&light(1e4), &level(), &wider).0, Verdict::Wide);
    // Along the edge there is no width.
    let along = Grade {
        across: Vec3::X,
        ..grade([9.0; 2], 1.0)
    };
    assert_eq!(judged(&light(1e4), &level(), &along).0, Verdict::Drawn);
    // An edge seen end on has that of its end.
    let end_on = edge([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    let verdict = |width: f32| judged(&light(1e4), &end_on, &grade([width; 2], 1.0)).0;
    assert_eq!(verdict(0.06), Verdict::Drawn);
    assert_eq!(verdict(0.2), Verdict::Wide);
}

#[test]
fn an_edge_is_drawn_as_far_as_it_is_narrow() {
    let (verdict, part) = judged(&light(1e4), &level(), &grade([0.0, 0.32], 1.0));
    assert_eq!(verdict, Verdict::Drawn);
    assert!(part[0] == 0.0 && (part[1] - 0.25).abs() < 1e-4, "{part:?}");
    let (verdict, part) = judged(&light(1e4), &level(), &grade([0.12, 0.04], 1.0));
    assert_eq!(verdict, Verdict::Drawn);
    assert!(part[1] == 1.0 && (part[0] - 0.5).abs() < 1e-4, "{part:?}");
}

/// Half of this edge is behind the eye; a metre before it a pixel is a thousandth of a metre.
#[test]
fn what_is_behind_the_eye_does_not_matter() {
    let edge = edge([0.5, 0.0, 0.0], [0.5, 0.0, 20.0]);
    let (verdict, part) = judged(&light(1e4), &edge, &grade([0.01, 9.0], 1.0));
    assert_eq!(verdict, Verdict::Drawn);
    assert!(part[0] == 0.0 && part[1] < 0.5, "{part:?}");
    let behind = self::edge([0.5, 0.0, 11.0], [0.5, 0.0, 20.0]);
    assert_eq!(
        judged(&light(1e4), &behind, &grade([0.0; 2], 1.0)).0,
        Verdict::Wide
    );
}

#[test]
fn a_light_that_changes_less_than_a_step_is_dim() {
    let verdict = |steps: f32, form: f32| judged(&light(steps), &level(), &grade([0.0; 2], form)).0;
    assert_eq!(verdict(0.99, 1.0), Verdict::Dim);
    assert_eq!(verdict(1.01, 1.0), Verdict::Drawn);
    assert_eq!(verdict(10.0, 0.099), Verdict::Dim);
    assert_eq!(verdict(10.0, 0.101), Verdict::Drawn);
    assert_eq!(verdict(0.0, f32::INFINITY), Verdict::Drawn);
    let none = Judge::new(
        &light(0.0),
        Worth {
            steps: 0.0,
            ..WORTH
        },
    );
    let verdict = none.judge(&view(), &level(), &grade([0.0; 2], 1.0)).0;
    assert_eq!(verdict, Verdict::Dim, "no light at all");
}

/// A penumbra of 6 px over which there are fewer steps than that changes by less than one in five.
#[test]
fn a_penumbra_that_changes_less_than_a_step_in_a_neighbourhood_is_faint() {
    let verdict =
        |steps: f32, width: f32| judged(&light(steps), &level(), &grade([width; 2], 1.0)).0;
    assert_eq!(verdict(1.1, 0.06), Verdict::Faint);
    assert_eq!(verdict(1.3, 0.06), Verdict::Drawn);
    assert_eq!(verdict(1.1, 0.05), Verdict::Drawn);
    assert_eq!(verdict(1.3, 0.07), Verdict::Faint);
    assert_eq!(verdict(9.0, 0.09), Verdict::Wide);
}

#[test]
fn lights_are_as_strong_as_all_of_them() {
    let linear = Light::Linear {
        from: [0.0; 3],
        to: [0.0, 3.0, 4.0],
        intensity: [1.0, 2.0, 0.0],
    };
    assert_eq!(strength(&linear), 10.0);
    let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
    let area = Light::Area {
        vertices: square.map(|[x, z]| [x, 7.0, z]).to_vec(),
        radiance: [0.0, 0.5, 0.25],
    };
    assert_eq!(strength(&area), 2.0);
}

#[test]
fn tallies_add_up() {
    let mut tally = Tally::default();
    let verdicts = [
        Verdict::Drawn,
        Verdict::Wide,
        Verdict::Dim,
        Verdict::Dim,
        Verdict::Faint,
    ];
    for verdict in verdicts {
        tally.count(verdict);
    }
    let counts = (tally.drawn, tally.wide, tally.dim, tally.faint);
    assert_eq!(counts, (1, 1, 2, 1));
    let sum: Tally = [tally, tally].into_iter().sum();
    assert_eq!((sum.all(), sum.dim, sum.faint), (10, 4, 2));
}
