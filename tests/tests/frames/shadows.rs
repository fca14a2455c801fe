//! Shadow edges of scenes whose shadows are known.

use protocol::scene::Light;
use renderer::camera::View;
use renderer::config::{Choices, ShadowEdges};
use renderer::edges::clip::SUBPIXELS;
use renderer::edges::tree::EdgeKind;
use renderer::frame::Display;
use renderer::shadows::wedge::EventKind;
use renderer::shadows::worth::Tally;

use crate::drive::{Run, Theatre, view};

const GREY: &str = "[material.grey]\ndiffuse = [0.5, 0.5, 0.5]\n";

fn choices(shadow_edges: ShadowEdges) -> Choices {
    Choices {
        shadow_edges,
        ..Choices::default()
    }
}

/// All colours of a frame's pixels, row by row.
fn colours(display: &Display) -> Vec<[f32; 3]> {
    let grid = display.grid();
    let pixels = (0..grid.height).flat_map(|y| (0..grid.width).map(move |x| grid.at(x, y)));
    pixels
        .map(|at| display.image().each_ref().map(|plane| plane[at]))
        .collect()
}

fn encode(linear: f32) -> f32 {
    let x = linear.clamp(0.0, 1.0);
    if x <= 0.003_130_8 {
        12.92 * x
    } else {
        1.055 * x.powf(1.0 / 2.4) - 0.055
    }
}

/// A box on a floor, 1 m high, its side at x = 1 lit by a square light 4 m above the floor whose side is 1 m.
const BOX_ON_FLOOR: &str = r#"
[[light]]
kind = "area"
vertices = [[-2.5, 4, -0.5], [-1.5, 4, -0.5], [-1.5, 4, 0.5], [-2.5, 4, 0.5]]
radiance = [20, 20, 20]
[[object]]
name = "floor"
generate = { kind = "plane", size = [12, 12] }
material = "grey"
[[object]]
name = "box"
generate = { kind = "box", size = [2, 1, 2.4] }
material = "grey"
translate = [0, 0.5, 0]
"#;

/// Where visible edges of a kind cross a row of the picture, px.
fn crossings(display: &Display, kind: EventKind, row_px: f64) -> Vec<f64> {
    let (list, seen) = (display.edge_stage().list(), display.edge_stage().visible());
    let mut all = Vec::new();
    for ((edge, segment), range) in seen.edge.iter().zip(&seen.segment).zip(&seen.range) {
        if list.kind[*edge as usize] != EdgeKind::Shadow(kind) {
            continue;
        }
        let [a, b] = segment
            .part(*range)
            .map(|p| p.map(|c| c as f64 / SUBPIXELS as f64));
        if (a[1] < row_px) != (b[1] < row_px) {
            all.push(a[0] + (b[0] - a[0]) * (row_px - a[1]) / (b[1] - a[1]));
        }
    }
    all
}

#[test]
fn a_contact_shadow_is_as_wide_as_similar_triangles_say() {
    let theatre = Theatre::new(&format!("{GREY}{BOX_ON_FLOOR}"));
    let from_above = view([128, 96], [2.2, 10.0, 0.01], [2.2, 0.0, 0.0], 14.0);
    let px_per_m = f64::from(from_above.focal_px) / 10.0;
    let wanted_px = px_per_m * (1.0 / (4.0 - 1.0));
    for which in [ShadowEdges::All, ShadowEdges::Chosen] {
        let display = Display::new(&theatre.loaded.scene, choices(which), 128, 96, 1);
        let mut run = Run::new(theatre.stage.clone(), display, 600, &from_above);
        for _ in 0..40 {
            run.draw(&from_above);
            run.plan(None);
        }
        let middle = 48.0;
        if which == ShadowEdges::All {
            let [umbral, penumbral] = [EventKind::Umbral, EventKind::Penumbral]
                .map(|kind| crossings(&run.display, kind, middle));
            let gap = |u: f64| {
                let gaps = penumbral.iter().map(|p| p - u).filter(|gap| *gap > 0.0);
                gaps.fold(f64::INFINITY, f64::min)
            };
            let gaps: Vec<f64> = umbral.iter().map(|u| gap(*u)).collect();
            println!("edges {gaps:?} px apart, {wanted_px:.2} wanted");
            assert!(gaps.iter().any(|gap| (gap - wanted_px).abs() < 1.0));
            both_edges_begin_at_the_contact(&run.display, &from_above);
        }
        let width = width_px(&run.display, 48);
        println!("{which:?}: the penumbra is {width:.2} px wide, {wanted_px:.2} wanted");
        assert!((width - wanted_px).abs() < 1.0, "{width} {wanted_px}");
    }
}

/// Width of the ramp from shadow to light along a row, px; what lies between box and ramp is dark.
fn width_px(display: &Display, row: usize) -> f64 {
    let grid = display.grid();
    let values: Vec<f64> = (0..grid.width)
        .map(|x| f64::from(display.image()[1][grid.at(x, row)]))
        .collect();
    // The floor beside the shadow is the brightest of what lies right of the darkest.
    let darkest = (0..grid.width).min_by(|a, b| values[*a].total_cmp(&values[*b]));
    let darkest = darkest.expect("a dark pixel");
    assert!(values[darkest] < 1e-6, "the umbra is lit");
    let start = (darkest..grid.width).rev().find(|x| values[*x] < 1e-6);
    let start = start.expect("a start");
    let lit = values[start..].iter().fold(0.0f64, |a, b| a.max(*b));
    let reach = |share: f64| {
        let x = (start..grid.width).find(|x| values[*x] >= share * lit);
        let x = x.expect("an edge");
        let (before, after) = (values[x - 1], values[x]);
        (x - 1) as f64 + (share * lit - before) / (after - before)
    };
    assert!(
        values[darkest..=start].iter().all(|v| *v < 0.02 * lit),
        "light leaks in beside the box"
    );
    2.0 * (reach(0.75) - reach(0.25))
}

fn both_edges_begin_at_the_contact(display: &Display, view: &View) {
    let corner = view.to_view(glam::Vec3::new(-1.0, 0.0, 1.2));
    let list = display.edge_stage().list();
    for kind in [EventKind::Umbral, EventKind::Penumbral] {
        let ends = (0..list.len())
            .filter(|i| list.kind[*i] == EdgeKind::Shadow(kind))
            .flat_map(|i| [list.from[i], list.to[i]]);
        let nearest = ends
            .map(|end| glam::Vec3::from(end).distance(corner))
            .fold(f32::INFINITY, f32::min);
        let px = nearest * view.focal_px / corner.z;
        assert!(px < 1.0, "{kind:?} edges begin {px} px from the contact");
    }
}

/// Lights and blockers in places where something has no direction or no inside.
#[test]
fn degenerate_places_give_pictures_of_numbers() {
    let square = |y: f32, h: f32| {
        format!("[[-{h}, {y}, -{h}], [{h}, {y}, -{h}], [{h}, {y}, {h}], [-{h}, {y}, {h}]]")
    };
    let area = |vertices: &str| {
        format!("[[light]]\nkind = \"area\"\nvertices = {vertices}\nradiance = [9, 9, 9]\n")
    };
    let point =
        |at: &str| format!("[[light]]\nkind = \"point\"\nposition = {at}\nintensity = [9, 9, 9]\n");
    let linear =
        |ends: &str| format!("[[light]]\nkind = \"linear\"\n{ends}\nintensity = [9, 9, 9]\n");
    let cases = [
        (
            "an area light in the receiver's plane",
            area(&square(0.0, 1.0)),
        ),
        (
            "a linear light in the receiver's plane",
            linear("from = [-3, 0, 1]\nto = [3, 0, 1]"),
        ),
        (
            "an area light that the blocker passes through",
            area(&square(1.0, 2.0)),
        ),
        (
            "a linear light that passes through the blocker",
            linear("from = [-3, 1, 0]\nto = [3, 1.1, 0]"),
        ),
        ("an area light below the receiver", area(&square(-1.0, 1.0))),
        (
            "an area light in the plane of the blocker's top",
            area(&square(1.5, 2.0)),
        ),
        ("an area light inside the blocker", area(&square(1.0, 0.2))),
        ("a point light inside the blocker", point("[0, 1, 0]")),
        (
            "a point light on a vertex of the blocker",
            point("[0.5, 1.5, 0.5]"),
        ),
        (
            "a point light on an edge of the blocker",
            point("[0.5, 1.5, 0]"),
        ),
        (
            "a point light on a line through an edge",
            point("[0.5, 4, 0.5]"),
        ),
        (
            "a linear light parallel to edges",
            linear("from = [-1, 4, 0.5]\nto = [1, 4, 0.5]"),
        ),
        ("a tiny area light", area(&square(4.0, 1e-4))),
    ];
    let from = view([64, 48], [1.0, 3.0, 6.0], [0.0, 0.5, 0.0], 45.0);
    for (name, light) in cases {
        let theatre = Theatre::new(&format!(
            "{GREY}{light}
[[object]]
name = \"floor\"
generate = {{ kind = \"plane\", size = [8, 8] }}
material = \"grey\"
[[object]]
name = \"box\"
generate = {{ kind = \"box\", size = [1, 1, 1] }}
material = \"grey\"
translate = [0, 1, 0]
"
        ));
        for which in [ShadowEdges::All, ShadowEdges::Chosen] {
            let mut brightest = 0.0f32;
            theatre.play(choices(which), 600, &[from; 8], |frame, _, display| {
                for rgb in colours(display) {
                    assert!(
                        rgb.iter().all(|c| c.is_finite() && *c >= 0.0),
                        "{name}, {which:?}, frame {frame}: {rgb:?}"
                    );
                    brightest = rgb.into_iter().fold(brightest, f32::max);
                }
            });
            println!("{name}, {which:?}: at most {brightest}");
        }
    }
}

/// A light without area is given the samples of a point light: all else that a picture is made of must be the same too.
#[test]
fn an_area_light_without_area_gives_the_picture_of_a_point_light() {
    let place = [0.5, 4.0, 0.3];
    let theatre = Theatre::new(&format!(
        "{GREY}[[light]]\nkind = \"point\"\nposition = {place:?}\nintensity = [30, 30, 30]\n\
         [[object]]\nname = \"floor\"\ngenerate = {{ kind = \"plane\", size = [8, 8] }}\nmaterial = \"grey\"\n\
         [[object]]\nname = \"ring\"\ngenerate = {{ kind = \"torus\", major = 1, minor = 0.3 }}\nmaterial = \"grey\"\n\
         translate = [0, 1, 0]\n"
    ));
    let from = view([128, 96], [1.0, 5.0, 6.0], [0.0, 0.5, 0.0], 45.0);
    let mut flat = theatre.loaded.scene.clone();
    flat.lights = vec![Light::Area {
        vertices: vec![place; 4],
        radiance: [1.0; 3],
    }];
    let all = choices(ShadowEdges::All);
    let mut run = Run::new(
        theatre.stage.clone(),
        Display::new(&theatre.loaded.scene, all, 128, 96, 1),
        400,
        &from,
    );
    let mut other = Display::new(&flat, all, 128, 96, 1);
    other.begin(&from, 0);
    for frame in 0..12 {
        run.draw(&from);
        other.learn(&run.triples);
        other.update_shadows(true);
        other.receive(&run.received, 0);
        other.draw(&from, 0);
        assert_eq!(run.display.shadow_tally(), other.shadow_tally());
        assert!(
            run.display.edge_stage().crossings() == other.edge_stage().crossings(),
            "frame {frame}"
        );
        assert!(colours(&run.display) == colours(&other), "frame {frame}");
        run.plan(None);
    }
    assert!(run.display.shadow_tally().drawn > 50);
}

/// A ring over a floor that a far light brightens, whose own shadow is out of sight, as a camera below the ring sees it. The
/// same samples make two pictures by different choices: the most steps between them once gradients are known to a step,
/// and what became of the edges of the second.
fn differ(light: &str, choices: [Choices; 2]) -> (f32, Tally) {
    let far = "[[light]]\nkind = \"point\"\nposition = [40, 20, 0]\nintensity = [900, 900, 900]\n";
    let objects = "[[object]]\nname = \"floor\"\ngenerate = { kind = \"plane\", size = [8, 8] }\nmaterial = \"grey\"\n\
         [[object]]\nname = \"ring\"\ngenerate = { kind = \"torus\", major = 0.2, minor = 0.05 }\nmaterial = \"grey\"\n\
         translate = [0, 3, 0]\n";
    let from = view([128, 96], [0.0, 2.0, 0.01], [0.0, 0.0, 0.0], 60.0);
    let theatre = Theatre::new(&format!("{GREY}{far}{light}{objects}"));
    let scene = &theatre.loaded.scene;
    let display = Display::new(scene, choices[0], 128, 96, 1);
    let mut run = Run::new(theatre.stage.clone(), display, 400, &from);
    let mut other = Display::new(scene, choices[1], 128, 96, 1);
    other.begin(&from, 0);
    let mut most = 0.0f32;
    for frame in 0..20 {
        run.draw(&from);
        other.learn(&run.triples);
        other.update_shadows(true);
        other.receive(&run.received, 0);
        other.draw(&from, 0);
        let gathered = frame >= 10;
        for (a, b) in colours(&run.display)
            .iter()
            .zip(&colours(&other))
            .filter(|_| gathered)
        {
            let steps = (0..3).map(|k| (encode(a[k]) - encode(b[k])).abs() * 255.0);
            most = steps.fold(most, f32::max);
        }
        run.plan(None);
    }
    println!("{most} steps, {:?}", other.shadow_tally());
    (most, other.shadow_tally())
}

/// The lights are points, so that edges are left out for their dimness alone.
#[test]
fn leaving_out_dim_edges_changes_less_than_a_step() {
    let change = |dim: f32| {
        let light = format!(
            "[[light]]\nkind = \"point\"\nposition = [0.2, 4, 0.1]\nintensity = [{dim}, {dim}, {dim}]\n"
        );
        differ(&light, [ShadowEdges::All, ShadowEdges::Chosen].map(choices))
    };
    let (most, tally) = change(5e-3);
    assert!(
        tally.dim > 50 && tally.drawn == 0 && tally.wide == 0,
        "{tally:?}"
    );
    assert!(most < 1.0, "{most} steps");
    // All but what is on the ring where it turns away from the light.
    let (most, tally) = change(5.0);
    assert!(tally.drawn > 50 && tally.wide == 0, "{tally:?}");
    assert!(most < 1.0, "{most} steps");
}

/// All widths are allowed, so that edges are left out for the little that changes across them in a few pixels.
#[test]
fn leaving_out_faint_edges_changes_less_than_a_step() {
    let light = "[[light]]\nkind = \"area\"\nradiance = [0.3, 0.3, 0.3]\n\
         vertices = [[-0.05, 4, -0.15], [0.45, 4, -0.15], [0.45, 4, 0.35], [-0.05, 4, 0.35]]\n";
    let with = |shadow_steps: f32| Choices {
        shadow_width: 100.0,
        shadow_steps,
        ..choices(ShadowEdges::Chosen)
    };
    let (most, tally) = differ(light, [with(0.0), with(1.0)]);
    assert!(tally.faint > 20, "{tally:?}");
    assert!(most < 1.0, "{most} steps");
    let (_, every) = differ(light, [with(1.0), with(0.0)]);
    assert_eq!(every.faint, 0);
    assert!(
        every.drawn >= tally.drawn + tally.faint,
        "{every:?} {tally:?}"
    );
}
