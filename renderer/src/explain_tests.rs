use super::*;
use crate::camera::View;
use crate::config::Method;
use protocol::messages::{Camera, LightShadows, ShadowMethod, Triple};

/// A box above a plane, under a point light, a linear one, an area light and an area light without area.
const SCENE: &str = r#"
[[light]]
kind = "point"
position = [0, 4, 0]
intensity = [9, 9, 9]
[[light]]
kind = "linear"
from = [-1, 4, 0]
to = [1, 4, 0]
intensity = [9, 9, 9]
[[light]]
kind = "area"
vertices = [[-1, 4, -1], [1, 4, -1], [1, 4, 1], [-1, 4, 1]]
radiance = [9, 9, 9]
[[light]]
kind = "point"
position = [0, 4, 0]
intensity = [1e-7, 1e-7, 1e-7]
[material.grey]
diffuse = [0.5, 0.5, 0.5]
[[object]]
name = "floor"
generate = { kind = "plane", size = [8, 8] }
material = "grey"
[[object]]
name = "box"
generate = { kind = "box", size = [1, 1, 1] }
material = "grey"
translate = [0, 1, 0]
[[object]]
name = "pierced"
generate = { kind = "box", size = [1, 1, 1] }
material = "grey"
translate = [2, 0, 0]
"#;

fn explanation(choices: Choices, frames: usize) -> (Explanation, Display) {
    let folder = std::env::temp_dir().join(format!("explain-{}-{frames}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join(format!(
        "{:?}-{:?}.toml",
        choices.shadow_edges, choices.method
    ));
    std::fs::write(&file, SCENE).unwrap();
    let scene = scenes::load(&file).unwrap().scene;
    std::fs::remove_file(&file).unwrap();
    let mut display = Display::new(&scene, choices, 64, 48, 1);
    let view = View::new(&Camera {
        eye: [0.0, 6.0, 9.0],
        target: [0.0; 3],
        up: [0.0, 1.0, 0.0],
        fov_y: 45.0,
        width: 64,
        height: 48,
    });
    let triple = |light, receiver| Triple {
        light,
        blocker: 1,
        receiver,
    };
    let met: Vec<Triple> = (0..4).map(|light| triple(light, 0)).collect();
    display.learn(&met);
    display.learn(&[triple(0, 2)]);
    display.update_shadows(true);
    display.begin(&view, 1);
    for _ in 0..frames {
        display.draw(&view, 1);
    }
    let told = [LightShadows {
        light: 1,
        method: ShadowMethod::SoftMap,
        why: "it is a line".into(),
    }];
    (Explanation::of(&display, &scene, &told), display)
}

#[test]
fn every_light_has_the_model_that_it_needs_and_no_more() {
    let (chosen, display) = explanation(Choices::default(), 5);
    let kinds = chosen.lights.iter().map(|l| (l.kind, l.model));
    assert_eq!(
        kinds.collect::<Vec<_>>(),
        [
            (LightKind::Point, LightModel::Hard),
            (LightKind::Linear, LightModel::Middle),
            (LightKind::Area, LightModel::Middle),
            (LightKind::Point, LightModel::Hard),
        ]
    );
    let [point, linear, area, dim] = chosen.lights[..] else {
        panic!("{chosen:?}");
    };
    assert_eq!((point.known.blockers, point.known.receivers), (1, 2));
    assert_eq!((area.known.blockers, area.known.receivers), (1, 1));
    // The lines of a middle are no more than those of a point in that place.
    assert_eq!(linear.known.events, point.known.events);
    assert_eq!(area.known.events, point.known.events);
    assert!(point.tally.drawn > 0 && point.tally.wide + point.tally.dim == 0);
    assert!(area.tally.wide > 0 && area.tally.dim == 0);
    assert!(dim.tally.dim > 0 && dim.tally.drawn + dim.tally.wide == 0);
    for light in &chosen.lights {
        assert_eq!(light.tally.all(), light.known.edges);
    }
    let all: Tally = chosen.lights.iter().map(|l| l.tally).sum();
    assert_eq!(display.shadow_tally(), all);
    assert!(chosen.creases > 0);
    // The camera stands still.
    assert_eq!(
        chosen.effort,
        Effort {
            frames: 5,
            searches: 1,
            judgements: 1
        }
    );
}

#[test]
fn the_dearer_model_is_dearer_and_none_costs_nothing() {
    let with = |shadow_edges| {
        let choices = Choices {
            shadow_edges,
            ..Choices::default()
        };
        explanation(choices, 1).0
    };
    let (all, chosen, off) = (
        with(ShadowEdges::All),
        with(ShadowEdges::Chosen),
        with(ShadowEdges::Off),
    );
    assert_eq!(all.lights[0].known, chosen.lights[0].known);
    for light in [1, 2] {
        assert_eq!(all.lights[light].model, LightModel::Boundaries);
        assert!(all.lights[light].known.edges > chosen.lights[light].known.edges);
        assert_eq!(all.lights[light].tally.drawn, all.lights[light].known.edges);
    }
    for light in &off.lights {
        assert_eq!(light.model, LightModel::NoEdges);
        assert_eq!((light.known.events, light.known.edges), (0, 0));
        assert_eq!(light.tally, Tally::default());
    }
    let choices = Choices {
        method: Method::PointsOnly,
        ..Choices::default()
    };
    let points = explanation(choices, 1).0;
    assert!(points.lights.iter().all(|l| l.model == LightModel::NoEdges));
    assert_eq!((points.creases, points.effort.searches), (0, 0));
}

#[test]
fn the_text_holds_the_facts() {
    let (chosen, _) = explanation(Choices::default(), 3);
    let text = chosen.to_string();
    assert!(
        text.contains("4 lights") && text.contains("1 of 3 frames"),
        "{text}"
    );
    assert!(
        text.contains(&format!(" {} segments", chosen.creases)),
        "{text}"
    );
    let parts: Vec<&str> = text.split("\nlight ").collect();
    assert_eq!(parts.len(), 5, "{text}");
    let told = "visibility: soft shadow maps: it is a line";
    for (light, part) in parts[1..].iter().enumerate() {
        assert_eq!(part.contains(told), light == 1, "{text}");
    }
    for (part, light) in parts[1..].iter().zip(&chosen.lights) {
        let Tally {
            drawn,
            wide,
            dim,
            faint,
            cut,
        } = light.tally;
        for fact in [
            format!("{} blockers", light.known.blockers),
            format!("{} receivers", light.known.receivers),
            format!("{} events, {} edges", light.known.events, light.known.edges),
            format!("{drawn} are drawn ({cut} of them in part)"),
            format!("{wide} left out as too wide"),
            format!("{dim} as too dim"),
            format!("{faint} as too faint"),
        ] {
            assert!(part.contains(&fact), "{fact}: {part}");
        }
        assert!(
            ["model:", "saves:", "error:"]
                .iter()
                .all(|k| part.contains(k))
        );
    }
}
