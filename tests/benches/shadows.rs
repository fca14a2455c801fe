//! Time to find the shadow edges of the dragon under the grid, and to draw 150,000 of them into a picture of
//! 512x512.

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use protocol::messages::{Camera, Triple};
use protocol::scene::Scene;
use renderer::camera::View;
use renderer::config::{Choices, ShadowEdges};
use renderer::edges::crossings::Crossings;
use renderer::edges::finder::EdgeFinder;
use renderer::edges::list::EdgeList;
use renderer::edges::tree::EdgeKind;
use renderer::edges::visibility::{EdgeDrawer, Hiding};
use renderer::epi::grid::Grid;
use renderer::frame::EdgeStage;
use renderer::points::PixelSamples;
use renderer::shadows::store::Shadows;
use renderer::shadows::worker::Lines;
use renderer::stats::StageMs;
use scenes::LoadedScene;

const SIZE_PX: u32 = 512;
/// The most that the paper draws is 92,884.
const MANY: usize = 150_000;

/// The scanned dragon, or its stand-in, and what moves over it.
fn dragon() -> LoadedScene {
    let scanned = system_tests::places::shared().map(|s| s.join("references/dragon/dragon.toml"));
    match scanned {
        Some(path) => scenes::load(&path).expect("the dragon loads"),
        None => {
            eprintln!("there is no ../shared: the dragon of tubes stands in for the scanned one");
            scenes::open("grid").expect("built-in scenes load")
        }
    }
}

fn named(scene: &Scene, name: &str) -> u32 {
    let index = scene.objects.iter().position(|o| o.name == name);
    index.expect("the scene has it") as u32
}

/// What these blockers keep light from: everything but the grid, which hangs above.
fn triples(scene: &Scene, blocks: impl Fn(&str) -> bool) -> Vec<Triple> {
    let objects = || scene.objects.iter().zip(0u32..);
    let blockers = objects().filter(|(o, _)| o.name != "ground" && blocks(&o.name));
    let pairs = blockers.flat_map(|(_, blocker)| {
        let receivers = objects().filter(|(o, _)| o.name != "grid");
        receivers.map(move |(_, receiver)| (blocker, receiver))
    });
    pairs
        .map(|(blocker, receiver)| Triple {
            light: 0,
            blocker,
            receiver,
        })
        .collect()
}

fn view(loaded: &LoadedScene) -> View {
    let camera = &loaded.camera;
    View::new(&Camera {
        eye: camera.eye,
        target: camera.target,
        up: camera.up,
        fov_y: camera.fov_y,
        width: SIZE_PX,
        height: SIZE_PX,
    })
}

fn shadows(criterion: &mut Criterion) {
    let loaded = dragon();
    let scene = &loaded.scene;
    let grid = named(scene, "grid");
    let mut group = criterion.benchmark_group("dragon under the grid");
    group.sample_size(10);
    let finder = EdgeFinder::new(scene);
    for (which, lines) in [("middle", Lines::Middle), ("all", Lines::Boundaries)] {
        let store = || {
            let mut shadows = Shadows::new(scene, &finder, Some(lines));
            shadows.update(true);
            shadows
        };
        for (what, of_grid) in [("the dragon", false), ("the grid", true)] {
            let some = triples(scene, |name| (name == "grid") == of_grid);
            group.bench_function(format!("{which} edges of {what}, new"), |bencher| {
                bencher.iter_batched_ref(
                    store,
                    |shadows| {
                        shadows.learn(&some);
                        shadows.update(true);
                    },
                    BatchSize::PerIteration,
                );
            });
        }
        let mut known = store();
        known.learn(&triples(scene, |_| true));
        known.update(true);
        let mut place = scene.objects[grid as usize].transform;
        group.bench_function(format!("{which} edges, the grid moved"), |bencher| {
            bencher.iter(|| {
                place[0][3] += 1e-3;
                known.move_object(grid, &place);
                known.update(true);
            });
        });
    }
    let choices = Choices {
        shadow_edges: ShadowEdges::All,
        ..Choices::default()
    };
    let view = view(&loaded);
    let pixels = PixelSamples::new(Grid::new(SIZE_PX as usize, SIZE_PX as usize));
    let mut stage = EdgeStage::new(scene, choices, pixels.grid);
    let find = |stage: &mut EdgeStage| {
        stage.find(&view, &scene.lights, &pixels, &mut StageMs::default());
    };
    find(&mut stage);
    stage.learn(&triples(scene, |_| true));
    stage.update_shadows(true);
    find(&mut stage);
    let many = many_shadow_edges(stage.list());
    let mut crossings = Crossings::new(SIZE_PX as usize, SIZE_PX as usize);
    group.bench_function(format!("draw {MANY} shadow edges"), |bencher| {
        bencher.iter(|| {
            let mut drawer = EdgeDrawer::default();
            drawer.draw(&view, &many, Hiding::None, true, &mut crossings)
        });
    });
    group.finish();
}

/// The shadow edges of a list, over and over.
fn many_shadow_edges(list: &EdgeList) -> EdgeList {
    let of_shadows = |i: &usize| matches!(list.kind[*i], EdgeKind::Shadow(_));
    let some: Vec<usize> = (0..list.len()).filter(of_shadows).collect();
    assert!(!some.is_empty(), "the dragon throws shadows");
    let mut many = EdgeList {
        generation: 1,
        ..EdgeList::default()
    };
    for i in some.into_iter().cycle().take(MANY) {
        many.from.push(list.from[i]);
        many.to.push(list.to[i]);
        many.kind.push(list.kind[i]);
        many.object.push(list.object[i]);
        many.second.push(list.second[i]);
        many.faces.push(list.faces[i]);
        many.vertices.push(list.vertices[i]);
    }
    many
}

criterion_group!(benches, shadows);
criterion_main!(benches);
