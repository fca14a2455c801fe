use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use protocol::scene::{Mesh, Model, Object, Shading};

use super::*;

const FLOOR: u32 = 0;
const OBJECTS: u32 = 4;
const LIGHTS: u32 = 2;

fn at([x, y, z]: [f32; 3]) -> Affine {
    [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, y], [0.0, 0.0, 1.0, z]]
}

fn area([x, y, z]: [f32; 3]) -> Light {
    Light::Area {
        vertices: vec![
            [x - 0.5, y, z - 0.5],
            [x + 0.5, y, z - 0.5],
            [x + 0.5, y, z + 0.5],
            [x - 0.5, y, z + 0.5],
        ],
        radiance: [5.0; 3],
    }
}

fn point(position: [f32; 3]) -> Light {
    Light::Point {
        position,
        intensity: [9.0; 3],
    }
}

/// Three boxes over a floor, two of which pass through one another, under a point light and an area light.
fn scene() -> Scene {
    let corner = |k: u32| [0, 1, 2].map(|axis| (k >> axis & 1) as f32 - 0.5);
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let faces = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
    let cube = Mesh {
        positions: (0..8).map(corner).collect(),
        faces: quads.into_iter().flat_map(faces).collect(),
        ..Mesh::default()
    };
    let floor = Mesh {
        positions: [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]]
            .map(|[x, z]| [x, 0.0, z])
            .to_vec(),
        faces: faces([3, 2, 1, 0]).to_vec(),
        ..Mesh::default()
    };
    let object = |mesh: u32, place: [f32; 3]| Object {
        name: String::new(),
        mesh,
        material: 0,
        transform: at(place),
        crease_angle: 85.0,
    };
    Scene {
        shading: Shading {
            model: Model::Direct,
            ambient: [0.0; 3],
            background: [0.0; 3],
        },
        lights: vec![point([0.3, 6.0, 0.2]), area([-1.0, 5.0, 0.5])],
        materials: Vec::new(),
        textures: Vec::new(),
        meshes: vec![floor, cube],
        objects: vec![
            object(0, [0.0; 3]),
            object(1, [0.0, 2.0, 0.0]),
            object(1, [0.4, 0.9, 0.3]),
            object(1, [0.1, 3.2, 0.1]),
        ],
    }
}

fn store_of(scene: &Scene) -> Shadows {
    Shadows::new(scene, &EdgeFinder::new(scene), Some(Lines::Boundaries))
}

fn every_triple() -> Vec<Triple> {
    let triple = |k: u32| Triple {
        light: k % LIGHTS,
        blocker: k / LIGHTS % OBJECTS,
        receiver: k / (LIGHTS * OBJECTS),
    };
    let all = (0..LIGHTS * OBJECTS * OBJECTS).map(triple);
    all.filter(|t| t.blocker != FLOOR).collect()
}

/// An edge to the bit: light, receiver, face, boundary and ends.
type Print = (u32, u32, u32, u8, [u64; 6]);

/// All edges in an order of their own.
fn edges(shadows: &Shadows) -> Vec<Print> {
    let mut all = Vec::new();
    for (light, cast) in shadows.edges() {
        assert_eq!(cast.edges.len(), cast.vertices.len());
        for e in &cast.edges {
            let ends = [e.from.to_array(), e.to.to_array()];
            let mut bits = ends.iter().flatten().map(|x| x.to_bits());
            let bits = std::array::from_fn(|_| bits.next().unwrap());
            all.push((light, e.receiver, e.face, e.kind as u8, bits));
        }
    }
    all.sort_unstable();
    all
}

fn creases(shadows: &Shadows) -> Vec<String> {
    let mut all: Vec<String> = shadows.meets().iter().map(|m| format!("{m:?}")).collect();
    all.sort_unstable();
    all
}

/// What a store that has known it all from the start has.
fn at_once(scene: &Scene, triples: &[Triple]) -> (Vec<Print>, Vec<String>) {
    let mut shadows = store_of(scene);
    shadows.learn(triples);
    shadows.update(true);
    (edges(&shadows), creases(&shadows))
}

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: RngSeed::Fixed(11),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// What may happen to a store.
#[derive(Clone, Debug)]
enum Step {
    Learn(Vec<usize>),
    Update(bool),
    MoveObject(u32, [f32; 3]),
    MoveLight(u32, [f32; 3]),
}

fn place() -> impl Strategy<Value = [f32; 3]> {
    [-1.0f32..1.0, 0.6f32..3.0, -1.0f32..1.0]
}

fn step() -> impl Strategy<Value = Step> {
    let some = prop::collection::vec(0..every_triple().len(), 0..8);
    prop_oneof![
        3 => some.prop_map(Step::Learn),
        2 => any::<bool>().prop_map(Step::Update),
        2 => (1..OBJECTS, place()).prop_map(|(o, p)| Step::MoveObject(o, p)),
        1 => (0..LIGHTS, place()).prop_map(|(l, [x, y, z])| Step::MoveLight(l, [x, y + 4.0, z])),
    ]
}

proptest! {
    #![proptest_config(config(48))]

    /// Triples in any order, twice, and cut in any way, edits between them, answers that come when they do: in the end
    /// it is what a store has that never knew anything else.
    #[test]
    fn the_way_to_a_state_leaves_no_trace(steps in prop::collection::vec(step(), 1..14)) {
        let (all, mut now) = (every_triple(), scene());
        let mut shadows = store_of(&now);
        let mut learned = Vec::new();
        for step in steps {
            match step {
                Step::Learn(which) => {
                    let some: Vec<Triple> = which.iter().map(|k| all[*k]).collect();
                    shadows.learn(&some);
                    learned.extend(some);
                }
                Step::Update(wait) => shadows.update(wait),
                Step::MoveObject(object, place) => {
                    now.objects[object as usize].transform = at(place);
                    shadows.move_object(object, &at(place));
                    let is_there = |e: &Print| e.1 == object;
                    prop_assert!(!edges(&shadows).iter().any(is_there), "edges stay behind");
                }
                Step::MoveLight(light, place) => {
                    let value = if light == 0 { point(place) } else { area(place) };
                    now.lights[light as usize] = value.clone();
                    shadows.change_light(light, &value);
                }
            }
        }
        shadows.update(true);
        prop_assert_eq!(shadows.under_way(), 0);
        let (wanted, wanted_creases) = at_once(&now, &learned);
        prop_assert_eq!(edges(&shadows), wanted);
        prop_assert_eq!(creases(&shadows), wanted_creases);
    }
}

proptest! {
    #![proptest_config(config(24))]

    /// A store that is told which answers another one took has the same edges after every step, whatever its own thread has
    /// done by then.
    #[test]
    fn another_store_follows_to_the_bit(steps in prop::collection::vec(step(), 1..14)) {
        let all = every_triple();
        let mut stores = [store_of(&scene()), store_of(&scene())];
        for step in steps {
            for (k, shadows) in stores.iter_mut().enumerate() {
                match &step {
                    Step::Learn(which) => {
                        let some: Vec<Triple> = which.iter().map(|k| all[*k]).collect();
                        shadows.learn(&some);
                    }
                    Step::MoveObject(object, place) => shadows.move_object(*object, &at(*place)),
                    Step::MoveLight(light, place) => {
                        let value = if *light == 0 { point(*place) } else { area(*place) };
                        shadows.change_light(*light, &value);
                    }
                    Step::Update(wait) if k == 0 => shadows.update(*wait),
                    Step::Update(_) => {}
                }
            }
            if let Step::Update(wait) = step {
                let taken = stores[0].taken().to_vec();
                match wait {
                    true => stores[1].update(true),
                    false => stores[1].update_as(&taken),
                }
            }
            let [first, second] = &stores;
            prop_assert_eq!(first.under_way(), second.under_way());
            prop_assert_eq!(first.generation(), second.generation());
            prop_assert_eq!(edges(first), edges(second));
            prop_assert_eq!(creases(first), creases(second));
        }
        // Answers that there are none of are not waited for.
        stores[1].update_as(&[(0, true), (1, false), (u64::MAX, true)]);
    }
}

#[test]
fn a_dropped_triple_concerns_its_pair_alone_and_is_made_good_when_it_comes_again() {
    let (all, scene) = (every_triple(), scene());
    let (whole, _) = at_once(&scene, &all);
    assert!(whole.len() > 40, "{}", whole.len());
    for dropped in [0, 7, all.len() - 1] {
        let mut rest = all.clone();
        let lost = rest.remove(dropped);
        let mut shadows = store_of(&scene);
        shadows.learn(&rest);
        shadows.update(true);
        for ((light, blocker), pair) in &shadows.pairs {
            let other = (*light, *blocker) != (lost.light, lost.blocker);
            let mut edges = pair.parts.iter().flat_map(|part| &part.edges);
            assert!(other || edges.all(|e| e.receiver != lost.receiver));
        }
        shadows.learn(&[lost]);
        shadows.update(true);
        assert_eq!(edges(&shadows), whole);
    }
}

#[test]
fn nothing_is_computed_twice_and_an_old_answer_is_not_taken() {
    let (all, scene) = (every_triple(), scene());
    let mut shadows = store_of(&scene);
    shadows.learn(&all);
    shadows.update(true);
    let known = (shadows.last_version, shadows.generation(), edges(&shadows));
    shadows.learn(&all);
    shadows.change_light(0, &scene.lights[0]);
    shadows.update(true);
    assert_eq!(
        (shadows.last_version, shadows.generation(), edges(&shadows)),
        known
    );

    let pair = (0, 1);
    let old = shadows.pairs[&pair].version;
    let late = || Answer::Part {
        pair,
        version: old,
        last: true,
        cast: Cast {
            events: 1_000_000,
            ..Cast::default()
        },
    };
    let events = |shadows: &Shadows| {
        let parts = shadows.pairs[&pair].parts.iter();
        parts.map(|part| part.events).sum::<usize>()
    };
    shadows.move_object(1, &at([0.5, 2.0, 0.0]));
    shadows.take(late());
    assert_eq!(events(&shadows), 0, "asked for before the move");
    shadows.update(true);
    let (computed, now) = (events(&shadows), edges(&shadows));
    assert!(computed > 0 && now != known.2);
    shadows.take(late());
    assert_eq!(events(&shadows), computed, "answered after its successor");
    assert_eq!(edges(&shadows), now);
}

#[test]
fn what_an_edit_concerns_is_computed_before_what_it_may_hide() {
    let mut shadows = store_of(&scene());
    // Box 1 shades the floor, box 2 the floor, box 3 box 1: moving box 3 leaves the pair of box 2 for later.
    let triple = |blocker, receiver| Triple {
        light: 0,
        blocker,
        receiver,
    };
    shadows.learn(&[triple(1, FLOOR), triple(2, FLOOR), triple(3, 1)]);
    shadows.update(true);
    let versions = |s: &Shadows| [1, 2, 3].map(|b| s.pairs[&(0, b)].version);
    let before = versions(&shadows);
    shadows.move_object(3, &at([0.0, 4.0, 0.0]));
    shadows.update(true);
    let after = versions(&shadows);
    assert!(after[2] > before[2] && after[0] > after[2] && after[1] > after[2]);
    shadows.move_object(1, &at([0.2, 2.0, 0.0]));
    shadows.update(true);
    let last = versions(&shadows);
    assert!(last[0] > after[1] && last[1] > last[0] && last[1] > last[2]);
}

#[test]
fn lines_can_be_switched_while_answers_are_under_way() {
    let (all, scene) = (every_triple(), scene());
    let mut shadows = store_of(&scene);
    shadows.learn(&all);
    shadows.update(false);
    shadows.set_lines(None);
    shadows.update(true);
    assert_eq!(edges(&shadows), []);
    shadows.set_lines(Some(Lines::Middle));
    shadows.update(true);
    let middle = edges(&shadows);
    assert!(
        middle
            .iter()
            .all(|e| e.3 == crate::shadows::wedge::EventKind::Hard as u8)
    );
    shadows.set_lines(Some(Lines::Boundaries));
    shadows.update(true);
    assert_eq!(edges(&shadows), at_once(&scene, &all).0);
    assert!(edges(&shadows).len() > middle.len() && !middle.is_empty());
}

#[test]
fn an_area_light_without_area_casts_the_shadows_of_a_point() {
    let (all, mut scene) = (every_triple(), scene());
    let place = [0.3, 6.0, 0.2];
    scene.lights[1] = point(place);
    let (hard, _) = at_once(&scene, &all);
    scene.lights[1] = Light::Area {
        vertices: vec![place; 4],
        radiance: [1.0; 3],
    };
    assert_eq!(at_once(&scene, &all).0, hard);
    assert!(hard.iter().any(|e| e.0 == 1));
}

#[test]
fn what_is_known_of_a_light_is_counted() {
    let mut shadows = store_of(&scene());
    assert_eq!(shadows.known(0), Known::default());
    shadows.learn(&every_triple());
    shadows.update(true);
    let known = shadows.known(1);
    assert_eq!((known.blockers, known.receivers), (3, 4));
    let of_light = edges(&shadows).iter().filter(|e| e.0 == 1).count();
    assert_eq!(known.edges, of_light);
    assert!(known.events > shadows.known(0).events);
}
